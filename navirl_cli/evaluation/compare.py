"""Demonstrated paths against learnt ones and against paths that know nothing of people's wishes."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import SceneError
from navirl_cli.evaluation.drawn import Drawn, Precision, draw
from navirl_cli.evaluation.groups import GroupMetrics, Measured, by_group, group_of, summary_of
from navirl_cli.evaluation.metrics import METRICS, line_values
from navirl_cli.evaluation.motion import contact_values, motion_values
from navirl_cli.evaluation.policy_paths import nearness
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, avoidance_line_m, scenes_of

#: Radius of a standing person as an obstacle, m.
PERSON_RADIUS_M = 0.25

DRIVEN, ON_GRID, LEARNT, NOMINAL, AVOIDANCE = "driven", "driven, on grid", "learnt", "nominal", "avoidance"
#: What each kind of path is, in the order of the tables; several rewards have "learnt, NAME" each.
KINDS: dict[str, str] = {
    DRIVEN: "the demonstrated poses",
    ON_GRID: "the demonstrated path through the centres of its cells, comparable with learnt paths",
    LEARNT: "paths drawn from the learnt policy, through the centres of cells",
    NOMINAL: "the line that the log says the navigation followed, else the shortest way on the map without people",
    AVOIDANCE: "the shortest way on the grid around people as obstacles of radius 0.25 m",
}


@dataclass(frozen=True)
class Comparison:
    """All metrics of a set of demonstrations."""

    groups: tuple[GroupMetrics, ...]
    rows: tuple[Measured, ...]
    #: What could not be measured, and why.
    notes: tuple[str, ...]


def compare(
    demonstrations: Sequence[Demonstration],
    rewards: Mapping[str, Reward],
    precision: Precision,
    rng: np.random.Generator,
    *,
    fields: Collection[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> Comparison:
    """Measure demonstrations and, in the same scenes, learnt and baseline paths.

    Args:
        demonstrations: What was driven.
        rewards: Learnt rewards by name; none to measure no learnt paths.
        precision: How many paths to draw from a policy in each scene.
        rng: Source of randomness.
        fields: Names of FIELDS to group by; none for condition, cycle and set.
        progress: Called with demonstrations done and in all.

    Returns:
        The metrics.

    Raises:
        SceneError: A demonstration's scene has no way.
        InfinitePartitionError: A reward has no policy in a scene.
    """
    learnt: dict[tuple[str, str], list[tuple[Drawn, dict[str, FloatArray]]]] = {}
    known: dict[tuple[str, int, float], Drawn] = {}
    rows: list[Measured] = []
    notes: list[str] = []
    for number, (one, scene) in enumerate(zip(demonstrations, scenes_of(demonstrations), strict=True)):
        group = group_of(one, fields)
        paths = _lines(one, scene, notes)
        nominal = paths[NOMINAL]
        found = {
            kind: dict(line_values(line, nominal, one.people_m, one.robot_radius_m)) for kind, line in paths.items()
        }
        found[DRIVEN] |= {**motion_values(one), **contact_values(one)}
        rows.append(Measured(one.id, one.participant, group, found))
        for name, reward in rewards.items():
            key = (name, id(scene), one.robot_radius_m)
            if key not in known:
                known[key] = draw(reward, scene, nominal, one.robot_radius_m, precision, rng)
            near = nearness(paths[ON_GRID], known[key].paths, scene.lattice)
            kind = LEARNT if len(rewards) == 1 else f"{LEARNT}, {name}"
            learnt.setdefault((group, kind), []).append((known[key], near))
        if progress is not None:
            progress(number + 1, len(demonstrations))
    groups = [
        summary_of(group, kind, [row for row in rows if row.group == group])
        for group in dict.fromkeys(row.group for row in rows)
        for kind in dict.fromkeys(kind for row in rows if row.group == group for kind in row.values)
    ]
    groups += [_learnt(group, kind, members) for (group, kind), members in learnt.items()]
    order = list(by_group(demonstrations, fields))
    groups.sort(key=lambda row: (order.index(row.group), _place(row.kind), row.kind))
    return Comparison(tuple(groups), tuple(rows), tuple(notes))


def _place(kind: str) -> int:
    """A kind's place in the tables."""
    return list(KINDS).index(kind if kind in KINDS else LEARNT)


def nominal_of(demonstration: Demonstration, scene: Scene) -> FloatArray:
    """(k, 2) m: the line that the navigation followed, where the log says, else the scene's nominal path."""
    return scene.nominal_line_m() if demonstration.nominal_m is None else demonstration.nominal_m


def _lines(demonstration: Demonstration, scene: Scene, notes: list[str]) -> dict[str, FloatArray]:
    """The line of every kind but the learnt."""
    lines = {
        DRIVEN: demonstration.xy_m,
        ON_GRID: demonstration.grid.centres_of(demonstration.cells),
        NOMINAL: nominal_of(demonstration, scene),
    }
    try:
        clearance = demonstration.robot_radius_m + PERSON_RADIUS_M
        lines[AVOIDANCE] = avoidance_line_m(scene, clearance)
    except SceneError as error:
        notes.append(f"{demonstration.id}: no path around the people as obstacles: {error}")
    return lines


def _learnt(group: str, kind: str, members: Sequence[tuple[Drawn, dict[str, FloatArray]]]) -> GroupMetrics:
    """Expected values over the scenes of a group, each as often as it was demonstrated in."""
    scenes: dict[int, list[tuple[Drawn, dict[str, FloatArray]]]] = {}
    for member in members:
        scenes.setdefault(id(member[0]), []).append(member)
    mean, spread, error, exact = {}, {}, {}, {}
    share = np.array([len(own) / len(members) for own in scenes.values()])
    for metric in METRICS:
        name = metric.name
        if name not in (members[0][0].values | members[0][1]):
            continue
        # Demonstrations of one scene share its paths, so that they share the error too.
        every = [[(drawn.values | near)[name] for drawn, near in own] for own in scenes.values()]
        known = np.isfinite([np.mean(own) for own in every])  # distances need people
        if not known.any():
            mean[name] = spread[name] = error[name] = float("nan")
            continue
        every = [own for own, one in zip(every, known, strict=True) if one]
        weight = share[known] / share[known].sum()
        mean[name] = float(weight @ [np.mean(own) for own in every])
        second = float(weight @ [np.mean(np.square(own)) for own in every])
        spread[name] = float(np.sqrt(max(second - mean[name] ** 2, 0.0)))
        errors = np.array([np.mean(own, axis=0).std(ddof=1) / np.sqrt(len(own[0])) for own in every])
        error[name] = float(np.sqrt(weight**2 @ errors**2))
        values = [drawn.exact[name] for drawn, _ in members if np.isfinite(drawn.exact.get(name, np.nan))]
        if values:
            exact[name] = float(np.mean(values))
    return GroupMetrics(group, kind, len(members), mean, spread, error, exact)
