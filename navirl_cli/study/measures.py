"""What the paths of a study are like, trial by trial and group by group."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import ByContent
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.compare import DRIVEN, ON_GRID, nominal_of
from navirl_cli.evaluation.groups import GroupMetrics, by_group, group_of, mean_and_spread, summary_of
from navirl_cli.evaluation.metrics import Values, onset_m, paper_values
from navirl_cli.irl.scene import Scene, scenes_of


@dataclass(frozen=True, eq=False)
class Measured(ByContent):
    """One trial's path."""

    id: str
    participant: str
    group: str
    driven: Values
    #: Through the centres of its cells, comparable with learnt paths.
    on_grid: Values
    #: Least distance between the robot's centre and a person's, m; NaN where there is nobody.
    center_distance_m: float
    #: How far before the first person, along the nominal path, the robot left it, m; NaN where it never did, or did not
    #: start on it.
    onset_m: float


def measured(demonstrations: Sequence[Demonstration]) -> list[Measured]:
    """Measure every path.

    Raises:
        SceneError: A demonstration's scene has no way from start to goal.
    """
    return [_measured(one, scene) for one, scene in zip(demonstrations, scenes_of(demonstrations), strict=True)]


def _measured(one: Demonstration, scene: Scene) -> Measured:
    nominal = nominal_of(one, scene)
    driven, on_grid = (
        paper_values(line, nominal, one.people_m, one.robot_radius_m)
        for line in (one.xy_m, one.grid.centres_of(one.cells))
    )
    return Measured(
        id=one.id,
        participant=one.participant,
        group=group_of(one),
        driven=driven,
        on_grid=on_grid,
        center_distance_m=driven["min_distance_m"] + one.robot_radius_m,
        onset_m=onset_m(one.xy_m, nominal, one.people_m),
    )


@dataclass(frozen=True, eq=False)
class GroupProperties(ByContent):
    """Properties of the paths of one group, over its trials with people."""

    group: str
    driven: GroupMetrics
    on_grid: GroupMetrics
    #: Distance between centres and onset, m: mean and sample standard deviation.
    center_distance_m: tuple[float, float]
    onset_m: tuple[float, float]
    #: Number of paths that have an onset.
    onsets: int
    participants: int


def groups_of(demonstrations: Iterable[Demonstration], rows: Iterable[Measured]) -> list[GroupProperties]:
    """Properties by group, in the order of the tables; groups without people are left out.

    Args:
        demonstrations: Of the study.
        rows: Their measures.
    """
    members: dict[str, list[Measured]] = {}
    for row in rows:
        if np.isfinite(row.center_distance_m):
            members.setdefault(row.group, []).append(row)
    return [_properties(group, members[group]) for group in by_group(demonstrations) if group in members]


def _properties(group: str, rows: Sequence[Measured]) -> GroupProperties:
    return GroupProperties(
        group,
        summary_of(group, DRIVEN, [row.driven for row in rows]),
        summary_of(group, ON_GRID, [row.on_grid for row in rows]),
        mean_and_spread([row.center_distance_m for row in rows]),
        mean_and_spread([row.onset_m for row in rows]),
        int(np.isfinite([row.onset_m for row in rows]).sum()),
        len({row.participant for row in rows}),
    )


def by_participant(rows: Iterable[Measured], group: str, value: Callable[[Measured], float]) -> Mapping[str, float]:
    """Mean of a value over each participant's trials of a group; who has none finite is not in it."""
    values: dict[str, list[float]] = {}
    for row in rows:
        if row.group == group and np.isfinite(value(row)):
            values.setdefault(row.participant, []).append(value(row))
    return {participant: float(np.mean(known)) for participant, known in values.items()}
