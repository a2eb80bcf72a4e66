"""What the paths of a study are like, trial by trial and group by group."""

from collections.abc import Iterable, Sequence

import numpy as np

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.compare import DRIVEN, ON_GRID, nominal_of
from navirl_cli.evaluation.groups import GroupMetrics, Measured, by_group, group_of, summary_of
from navirl_cli.evaluation.metrics import onset_m, paper_values
from navirl_cli.irl.scene import Scene, scenes_of


def measured(demonstrations: Sequence[Demonstration]) -> list[Measured]:
    """Measure every path as driven and through the centres of its cells, comparable with learnt paths.

    Raises:
        SceneError: A demonstration's scene has no path from start to goal.
    """
    return [_measured(one, scene) for one, scene in zip(demonstrations, scenes_of(demonstrations), strict=True)]


def _measured(one: Demonstration, scene: Scene) -> Measured:
    nominal = nominal_of(one, scene)
    driven, on_grid = (
        dict(paper_values(line, nominal, one.people_m, one.robot_radius_m))
        for line in (one.xy_m, one.grid.centres_of(one.cells))
    )
    driven["min_center_distance_m"] = driven["min_distance_m"] + one.robot_radius_m
    driven["onset_m"] = onset_m(one.xy_m, nominal, one.people_m)
    return Measured(one.id, one.participant, group_of(one), {DRIVEN: driven, ON_GRID: on_grid})


def with_people(rows: Iterable[Measured]) -> list[Measured]:
    """The trials in whose scene there are people."""
    return [row for row in rows if np.isfinite(row.values[DRIVEN]["min_center_distance_m"])]


def groups_of(demonstrations: Iterable[Demonstration], rows: Iterable[Measured]) -> list[GroupMetrics]:
    """Properties of the trials with people, by group in the order of the tables, then as driven and on the grid.

    Args:
        demonstrations: Of the study.
        rows: What was measured of them.
    """
    members: dict[str, list[Measured]] = {}
    for row in with_people(rows):
        members.setdefault(row.group, []).append(row)
    known = [group for group in by_group(demonstrations) if group in members]
    return [summary_of(group, kind, members[group]) for group in known for kind in (DRIVEN, ON_GRID)]
