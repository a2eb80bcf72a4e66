"""Demonstrated paths beside learnt ones and beside paths that do not depend on people's wishes."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import SceneError
from navirl_cli.evaluation.drawn import Drawn, Precision, Shown, draw, expected_here, expected_of
from navirl_cli.evaluation.groups import GroupMetrics, Measured, by_group, group_of, summary_of
from navirl_cli.evaluation.lines import Lines
from navirl_cli.evaluation.metric import NO_REWARD, Metric, Values, measure, missing_of
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.evaluation.motion import PERSON_RADIUS_M, Drive
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, avoidance_line_m, scenes_of
from navirl_cli.parallel import map_in_order

DRIVEN, ON_GRID, LEARNT, NOMINAL, AVOIDANCE = "driven", "driven, on grid", "learnt", "nominal", "avoidance"
#: The types of paths, in the order of the tables; several rewards have "learnt, NAME" each.
PATH_TYPES: dict[str, str] = {
    DRIVEN: "the demonstrated poses",
    ON_GRID: "the demonstrated path through the centres of its cells, comparable with learnt paths",
    LEARNT: "paths drawn from the learnt policy, through the centres of cells",
    NOMINAL: "the line that the navigation followed, from the log; without it the shortest path on the map without "
    "people",
    AVOIDANCE: f"the shortest path on the grid around people as obstacles of radius {PERSON_RADIUS_M:g} m",
}


@dataclass(frozen=True, eq=False)
class Comparison(ByContent):
    """All metrics of a set of demonstrations."""

    groups: tuple[GroupMetrics, ...]
    rows: tuple[Measured, ...]
    #: What could not be measured, and why.
    notes: tuple[str, ...]
    #: Of metrics that no path has: the reason.
    missing: Mapping[str, str]


def compare(
    demonstrations: Sequence[Demonstration],
    rewards: Mapping[str, Reward],
    precision: Precision,
    rng: np.random.Generator,
    *,
    metrics: Sequence[Metric] = PAPER_METRICS,
    fields: Collection[str] = (),
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> Comparison:
    """Measure demonstrations and, in the same scenes, learnt and baseline paths.

    Args:
        demonstrations: What was driven.
        rewards: Learnt rewards by name; none to measure no learnt paths.
        precision: How many paths to draw from a policy in each scene.
        rng: Source of randomness. Each policy in each scene has a stream of its own.
        metrics: To compute; others cost nothing.
        fields: Names of FIELDS to group by; none for condition, cycle and set.
        progress: Called with demonstrations done and in all.
        executor: Where paths of policies are drawn and measured; by default here. The results are the same.

    Returns:
        The metrics.

    Raises:
        SceneError: A demonstration's scene has no path from start to goal.
        InfinitePartitionError: A reward has no policy in a scene.
    """
    notes: list[str] = []
    lines = list(_lines_of(demonstrations, scenes := scenes_of(demonstrations), notes))
    where = _shown(demonstrations, scenes, lines)
    rows: list[Measured] = []
    for one, line, shown in zip(demonstrations, lines, where, strict=True):
        rows.append(measured(one, line, shown.nominal_m, metrics, group_of(one, fields)))
        if progress is not None and not rewards:
            progress(len(rows), len(demonstrations))
    drawn: dict[tuple[str, Shown], Drawn] = {}
    for key, paths in _drawn(list(dict.fromkeys(where)), rewards, metrics, precision, rng, executor):
        drawn[key] = paths
        if progress is not None:
            count = len(rewards) * len(set(where))
            progress(len(demonstrations) * len(drawn) // count, len(demonstrations))
    groups: list[GroupMetrics] = []
    learnt: list[dict[str, Values]] = [{} for _ in rows]
    for group in by_group(demonstrations, fields):
        own = [number for number, row in enumerate(rows) if row.group == group]
        path_types = dict.fromkeys(path_type for number in own for path_type in rows[number].values)
        found = {path_type: summary_of(group, path_type, [rows[number] for number in own]) for path_type in path_types}
        for name in rewards:
            members = [(drawn[name, where[number]], where[number].numbers.index(number)) for number in own]
            path_type = learnt_type(name, rewards)
            found[path_type] = expected_of(group, path_type, members, metrics)
            for number, (paths, place) in zip(own, members, strict=True):
                learnt[number][path_type] = expected_here(paths, place, metrics)
        ordered = sorted(found.values(), key=lambda row: (_place(row.path_type), row.path_type))
        groups += [row for row in ordered if row.mean]
    missing = {metric.name: NO_REWARD for metric in metrics if metric.near is not None and not rewards}
    rows = [replace(row, values={**row.values, **own}) for row, own in zip(rows, learnt, strict=True)]
    return Comparison(tuple(groups), tuple(rows), tuple(notes), missing)


def _drawn(
    places: Sequence[Shown],
    rewards: Mapping[str, Reward],
    metrics: Sequence[Metric],
    precision: Precision,
    rng: np.random.Generator,
    executor: Executor | None,
) -> Iterator[tuple[tuple[str, Shown], Drawn]]:
    """Paths of every reward in every scene, measured, each with its own stream of random numbers."""
    if not rewards:
        return
    keys = [(name, shown) for shown in places for name in rewards]
    streams = rng.spawn(len(keys))
    work = [(rewards[name], shown, metrics, precision, own) for (name, shown), own in zip(keys, streams, strict=True)]
    results = map(_draw, work) if executor is None else map_in_order(_draw, work, executor)
    yield from zip(keys, results, strict=True)


def _draw(work: tuple[Reward, Shown, Sequence[Metric], Precision, np.random.Generator]) -> Drawn:
    """The same of one reward in one scene, with what travels to a process."""
    return draw(*work)


def learnt_type(name: str, rewards: Collection[str]) -> str:
    """The type of the paths of one of several rewards."""
    return LEARNT if len(rewards) == 1 else f"{LEARNT}, {name}"


def compare_files(
    files: Mapping[str, Sequence[Demonstration]],
    rewards: Mapping[str, Reward],
    precision: Precision,
    rng: np.random.Generator,
    *,
    metrics: Sequence[Metric] = PAPER_METRICS,
    fields: Collection[str] = (),
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> Comparison:
    """Measure the demonstrations of several files, as :func:`compare` does those of one.

    Args:
        files: Demonstrations by the name of their file. Of several files, names of groups and ids begin with it, as
            :func:`name_in` says.
        rewards: As of :func:`compare`; so are the other arguments.
        precision: How many paths to draw.
        rng: Source of randomness.
        metrics: To compute.
        fields: To group by.
        progress: Called with demonstrations done and in all.
        executor: As of :func:`compare`.
    """
    found = []
    done, count = 0, sum(map(len, files.values()))
    for name, own in files.items():
        update = None if progress is None else (lambda n, _all, done=done: progress(done + n, count))
        one = compare(own, rewards, precision, rng, metrics=metrics, fields=fields, progress=update, executor=executor)
        done += len(own)
        groups = tuple(replace(row, group=name_in(files, name, row.group)) for row in one.groups)
        rows = tuple(
            replace(row, group=name_in(files, name, row.group), id=name_in(files, name, row.id)) for row in one.rows
        )
        found.append(Comparison(groups, rows, tuple(name_in(files, name, note) for note in one.notes), one.missing))
    return Comparison(
        tuple(row for one in found for row in one.groups),
        tuple(row for one in found for row in one.rows),
        tuple(note for one in found for note in one.notes),
        found[0].missing,
    )


def name_in(files: Collection[str], file: str, name: str) -> str:
    """The name of a group or a trial of one of several files; of one file alone the name itself."""
    return f"{file}: {name}" if len(files) > 1 else name


def _place(path_type: str) -> int:
    """A type's place in the tables."""
    return list(PATH_TYPES).index(path_type if path_type in PATH_TYPES else LEARNT)


def _shown(
    demonstrations: Sequence[Demonstration], scenes: Sequence[Scene], lines: Sequence[Mapping[str, FloatArray]]
) -> list[Shown]:
    """For each demonstration the demonstrations that share its learnt paths.

    Learnt paths run through centres of cells. Nominal paths between the same cells are the same for them, and the first
    one stands for all: declared ones start where the robot stood within the cell.
    """
    keys = [
        (scene, one.robot_radius_m, one.grid.cells_of(own[NOMINAL]).tobytes())
        for one, scene, own in zip(demonstrations, scenes, lines, strict=True)
    ]
    members: dict[tuple[Scene, float, bytes], list[int]] = {}
    for number, key in enumerate(keys):
        members.setdefault(key, []).append(number)
    known = {
        key: Shown(key[0], lines[own[0]][NOMINAL], key[1], tuple(own), tuple(lines[n][ON_GRID] for n in own))
        for key, own in members.items()
    }
    return [known[key] for key in keys]


def nominal_of(demonstration: Demonstration, scene: Scene) -> FloatArray:
    """(k, 2) m: the line that the navigation followed, where the log holds it, else the scene's nominal path."""
    return scene.nominal_line_m() if demonstration.nominal_m is None else demonstration.nominal_m


def measured(
    demonstration: Demonstration,
    lines: Mapping[str, FloatArray],
    nominal_m: FloatArray,
    metrics: Sequence[Metric],
    group: str,
) -> Measured:
    """Measure the paths of one demonstration.

    Args:
        demonstration: The demonstration.
        lines: (n, 2) m each, by type of path.
        nominal_m: (k, 2) m.
        metrics: To compute.
        group: Its group.
    """
    lacking, one = missing_of(demonstration), demonstration
    found = {
        path_type: measure(
            metrics,
            Lines(line[None], nominal_m, one.people_m, one.robot_radius_m),
            lacking,
            Drive(one) if path_type == DRIVEN else None,
        )
        for path_type, line in lines.items()
    }
    values = {path_type: values for path_type, (values, _) in found.items()}
    return Measured(
        one.id, one.participant, group, values, {path_type: reasons for path_type, (_, reasons) in found.items()}
    )


def _lines_of(
    demonstrations: Sequence[Demonstration], scenes: Sequence[Scene], notes: list[str]
) -> Iterator[dict[str, FloatArray]]:
    """The lines of every demonstration by type, learnt ones aside; those of a scene are found once."""
    nominal: dict[Scene, FloatArray] = {}
    avoidance: dict[tuple[Scene, float], FloatArray | SceneError] = {}
    for one, scene in zip(demonstrations, scenes, strict=True):
        if one.nominal_m is None and scene not in nominal:
            nominal[scene] = nominal_of(one, scene)
        clearance = one.robot_radius_m + PERSON_RADIUS_M
        if (scene, clearance) not in avoidance:
            avoidance[scene, clearance] = _avoidance(scene, clearance)
        lines = {
            DRIVEN: one.xy_m,
            ON_GRID: one.grid.centres_of(one.cells),
            NOMINAL: nominal[scene] if one.nominal_m is None else one.nominal_m,
        }
        around = avoidance[scene, clearance]
        if isinstance(around, SceneError):
            notes.append(f"{one.id}: no path around the people as obstacles: {around}")
        else:
            lines[AVOIDANCE] = around
        yield lines


def _avoidance(scene: Scene, clearance_m: float) -> FloatArray | SceneError:
    """The path around people, or why it does not exist."""
    try:
        return avoidance_line_m(scene, clearance_m)
    except SceneError as error:
        return error
