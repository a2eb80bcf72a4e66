"""Demonstrated paths against learnt ones and against paths that know nothing of people's wishes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.grid import FloatArray
from navirl_cli.errors import SceneError
from navirl_cli.evaluation.metrics import PathMetrics, path_metrics
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths, sampled_lines_m
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, avoidance_line_m, scenes_of

#: Radius of a standing person as an obstacle, m.
PERSON_RADIUS_M = 0.25

DRIVEN, ON_GRID, LEARNT, NOMINAL, AVOIDANCE = "driven", "driven, on grid", "learnt", "nominal", "avoidance"
#: What each kind of path is, in the order of the tables.
KINDS: dict[str, str] = {
    DRIVEN: "the demonstrated poses",
    ON_GRID: "the demonstrated path through the centres of its cells, comparable with learnt paths",
    LEARNT: "paths drawn from the learnt policy, through the centres of cells",
    NOMINAL: "the shortest way on the map, as if nobody were there",
    AVOIDANCE: "the shortest way on the grid around people as obstacles of radius 0.25 m",
}


@dataclass(frozen=True)
class GroupMetrics:
    """Mean and spread of the paths of one kind in one group of demonstrations."""

    group: str
    kind: str
    count: int
    mean: PathMetrics
    #: Sample standard deviation (n - 1); NaN for one path.
    std: PathMetrics


@dataclass(frozen=True)
class Comparison:
    """All metrics of a set of demonstrations."""

    groups: tuple[GroupMetrics, ...]
    #: By demonstration: id, group, and the metrics of the driven path.
    driven: tuple[tuple[str, str, PathMetrics], ...]
    #: What could not be measured, and why.
    notes: tuple[str, ...]


def _rank(demonstration: Demonstration) -> tuple[int, int]:
    """Order of the groups: force first, by cycle, then joystick, then autonomous."""
    return list(Condition).index(demonstration.condition), demonstration.cycle or 0


def group_of(demonstration: Demonstration) -> str:
    """The group of a demonstration: its condition, and its cycle where known."""
    cycle = "" if demonstration.cycle is None else f", cycle {demonstration.cycle}"
    return demonstration.condition.value + cycle


def compare(
    demonstrations: Sequence[Demonstration],
    reward: Reward | None,
    samples: int,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Measure demonstrations and, in the same scenes, learnt and baseline paths.

    Args:
        demonstrations: What was driven.
        reward: A learnt reward, or None.
        samples: Paths to draw from its policy for every demonstration.
        rng: Source of randomness.
        progress: Called with demonstrations done and in all.

    Returns:
        The metrics.

    Raises:
        SceneError: A demonstration's scene has no way.
        InfinitePartitionError: The reward has no policy in a scene.
    """
    collected: dict[tuple[str, str], list[PathMetrics]] = {}
    driven: list[tuple[str, str, PathMetrics]] = []
    notes: list[str] = []
    for number, (demonstration, scene) in enumerate(zip(demonstrations, scenes_of(demonstrations), strict=True)):
        group = group_of(demonstration)
        lines = _lines(demonstration, scene, notes)
        if reward is not None and samples:
            policy = policy_of(reward, scene)
            lines[LEARNT] = sampled_lines_m(policy, sample_paths(policy, scene.start, samples, rng))
        nominal = lines[NOMINAL][0]
        for kind, paths in lines.items():
            measured = [
                path_metrics(line, nominal, demonstration.people_m, demonstration.robot_radius_m) for line in paths
            ]
            collected.setdefault((group, kind), []).extend(measured)
            if kind == DRIVEN:
                driven.append((demonstration.id, group, measured[0]))
        if progress is not None:
            progress(number + 1, len(demonstrations))
    order = list(dict.fromkeys(group_of(one) for one in sorted(demonstrations, key=_rank)))
    ordered = sorted(collected, key=lambda key: (order.index(key[0]), list(KINDS).index(key[1])))
    groups = tuple(_summary(group, kind, collected[group, kind]) for group, kind in ordered)
    return Comparison(groups, tuple(driven), tuple(notes))


def _lines(demonstration: Demonstration, scene: Scene, notes: list[str]) -> dict[str, list[FloatArray]]:
    """The lines of every kind but the learnt."""
    lines = {
        DRIVEN: [demonstration.xy_m],
        ON_GRID: [demonstration.grid.centres_of(demonstration.cells)],
        NOMINAL: [scene.nominal_line_m()],
    }
    try:
        clearance = demonstration.robot_radius_m + PERSON_RADIUS_M
        lines[AVOIDANCE] = [avoidance_line_m(scene, clearance)]
    except SceneError as error:
        notes.append(f"{demonstration.id}: no path around the people as obstacles: {error}")
    return lines


def _summary(group: str, kind: str, measured: Iterable[PathMetrics]) -> GroupMetrics:
    """Mean and standard deviation over the paths that have a value (distance to people needs people)."""
    mean, spread = {}, {}
    paths = list(measured)
    for name in (field.name for field in fields(PathMetrics)):
        values = np.array([getattr(one, name) for one in paths])
        values = values[np.isfinite(values)]
        mean[name] = float(values.mean()) if len(values) else np.nan
        spread[name] = float(values.std(ddof=1)) if len(values) > 1 else np.nan
    return GroupMetrics(group, kind, len(paths), PathMetrics(**mean), PathMetrics(**spread))
