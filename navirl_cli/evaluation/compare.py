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
    NOMINAL: "the line that the log says the navigation followed, else the shortest way on the map without people",
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


def by_group(demonstrations: Iterable[Demonstration]) -> dict[str, list[Demonstration]]:
    """Demonstrations by group: force first, by cycle, then joystick, then autonomous; special sets after the rest."""
    order = list(Condition)
    groups: dict[str, list[Demonstration]] = {}
    for one in sorted(demonstrations, key=lambda one: (order.index(one.condition), one.set or "", one.cycle or 0)):
        groups.setdefault(group_of(one), []).append(one)
    return groups


def group_of(demonstration: Demonstration) -> str:
    """The group of a demonstration: its condition, its cycle and its set where known.

    A robot that drives by itself is what its set says: "obstacle avoidance".
    """
    alone = demonstration.condition is Condition.AUTONOMOUS and demonstration.set is not None
    condition = [] if alone else [demonstration.condition.value]
    cycle = [] if demonstration.cycle is None else [f"cycle {demonstration.cycle}"]
    return ", ".join([*condition, *cycle, *([] if demonstration.set is None else [demonstration.set])])


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
    order = list(by_group(demonstrations))
    ordered = sorted(collected, key=lambda key: (order.index(key[0]), list(KINDS).index(key[1])))
    groups = tuple(summary_of(group, kind, collected[group, kind]) for group, kind in ordered)
    return Comparison(groups, tuple(driven), tuple(notes))


def _lines(demonstration: Demonstration, scene: Scene, notes: list[str]) -> dict[str, list[FloatArray]]:
    """The lines of every kind but the learnt."""
    lines = {
        DRIVEN: [demonstration.xy_m],
        ON_GRID: [demonstration.grid.centres_of(demonstration.cells)],
        NOMINAL: [scene.nominal_line_m() if demonstration.nominal_m is None else demonstration.nominal_m],
    }
    try:
        clearance = demonstration.robot_radius_m + PERSON_RADIUS_M
        lines[AVOIDANCE] = [avoidance_line_m(scene, clearance)]
    except SceneError as error:
        notes.append(f"{demonstration.id}: no path around the people as obstacles: {error}")
    return lines


def summary_of(group: str, kind: str, measured: Iterable[PathMetrics]) -> GroupMetrics:
    """Mean and standard deviation over the paths that have a value (distance to people needs people)."""
    mean, spread = {}, {}
    paths = list(measured)
    for name in (field.name for field in fields(PathMetrics)):
        values = np.array([getattr(one, name) for one in paths])
        values = values[np.isfinite(values)]
        mean[name] = float(values.mean()) if len(values) else np.nan
        spread[name] = float(values.std(ddof=1)) if len(values) > 1 else np.nan
    return GroupMetrics(group, kind, len(paths), PathMetrics(**mean), PathMetrics(**spread))
