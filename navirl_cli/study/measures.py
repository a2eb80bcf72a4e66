"""What the paths of a study are like, trial by trial and group by group."""

from collections.abc import Iterable, Sequence

import numpy as np

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.compare import DRIVEN, ON_GRID, measured, nominal_of
from navirl_cli.evaluation.groups import GroupMetrics, Measured, by_group, group_of, summary_of
from navirl_cli.evaluation.metrics import BY_NAME, PAPER_METRICS
from navirl_cli.irl.scene import scenes_of

#: What the paper and its claims need.
STUDY_METRICS = (*PAPER_METRICS, BY_NAME["min_center_distance_m"], BY_NAME["onset_m"])


def rows_of(demonstrations: Sequence[Demonstration]) -> list[Measured]:
    """Measure every path as driven and through the centres of its cells, comparable with learnt paths.

    Raises:
        SceneError: A demonstration's scene has no path from start to goal.
    """
    found = []
    for one, scene in zip(demonstrations, scenes_of(demonstrations), strict=True):
        lines = {DRIVEN: one.xy_m, ON_GRID: one.grid.centres_of(one.cells)}
        found.append(measured(one, lines, nominal_of(one, scene), STUDY_METRICS, group_of(one)))
    return found


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
    return [summary_of(group, path_type, members[group]) for group in known for path_type in (DRIVEN, ON_GRID)]
