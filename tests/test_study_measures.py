"""What the paths of a study are like, against lines whose answers are known."""

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.demonstration import Condition
from navirl_cli.evaluation.compare import DRIVEN, ON_GRID
from navirl_cli.study.measures import groups_of, rows_of

GRID = make.open_grid(40, 21)
AT = np.array([[2.05, 1.05]])
STRAIGHT = [[c, 10] for c in range(1, 39)]
#: Leaves its row at cell 10, by 5 cells, and comes back.
AROUND = [[c, 10] for c in range(1, 11)] + [[10 + k, 10 + k] for k in range(1, 6)]
AROUND += [[c, 15] for c in range(16, 25)] + [[24 + k, 15 - k] for k in range(1, 6)] + [[c, 10] for c in range(30, 39)]


def trial(cells, number, people=AT, **fields):
    return make.demonstration(GRID, cells, people, number=number, **{"cycle": 2, **fields})


def test_a_path_is_measured_as_driven_and_on_the_grid():
    xy = np.array([[0.12, 1.02], [1.0, 1.05], [2.0, 1.62], [3.88, 1.07]])
    one = make.demonstration(GRID, STRAIGHT, AT)
    one = make.replace(one, xy_m=xy, t_s=np.arange(4.0), yaw_rad=np.zeros(4))
    (row,) = rows_of([one])
    assert row.values[DRIVEN]["length_m"] == pytest.approx(oracles.length_by_steps(xy))
    assert row.values[ON_GRID]["length_m"] == pytest.approx(3.7)
    assert row.values[DRIVEN]["min_center_distance_m"] == pytest.approx(
        oracles.distance_by_sampling(xy, AT, 4000), abs=1e-6
    )
    assert row.values[DRIVEN]["min_distance_m"] == pytest.approx(row.values[DRIVEN]["min_center_distance_m"] - 0.25)
    assert row.values[ON_GRID]["area_m2"] == 0.0


def test_the_declared_nominal_line_counts():
    raised = np.array([[0.15, 1.25], [3.85, 1.25]])
    plain, declared = rows_of([trial(STRAIGHT, 1), trial(STRAIGHT, 2, nominal_m=raised)])
    assert plain.values[DRIVEN]["area_m2"] == pytest.approx(0.0)
    assert declared.values[DRIVEN]["area_m2"] == pytest.approx(3.7 * 0.2)


def test_groups_leave_trials_without_people_out():
    course = trial(AROUND, 3, np.zeros((0, 2)), cycle=None, set="obstacle course")
    trials = [
        trial(STRAIGHT, 1),
        trial(AROUND, 2),
        course,
        trial(AROUND, 4, condition=Condition.AUTONOMOUS, cycle=None, set="obstacle avoidance"),
        trial(AROUND, 5, condition=Condition.JOYSTICK, cycle=None, participant="p2"),
    ]
    rows = rows_of(trials)
    assert [row.group for row in rows][2] == "force, obstacle course"
    groups = groups_of(trials, rows)
    assert [(one.group, one.path_type) for one in groups] == [
        (group, kind) for group in ("force, cycle 2", "joystick", "obstacle avoidance") for kind in (DRIVEN, ON_GRID)
    ]
    force = groups[0]
    assert (force.count, force.participants) == (2, 1)
    lengths = [rows[0].values[DRIVEN]["length_m"], rows[1].values[DRIVEN]["length_m"]]
    assert force.mean["length_m"] == pytest.approx(np.mean(lengths))
    assert force.std["length_m"] == pytest.approx(np.std(lengths, ddof=1))
    # The straight path never leaves the nominal one: only the other has an onset.
    assert force.mean["onset_m"] == pytest.approx(rows[1].values[DRIVEN]["onset_m"])
    assert np.isnan(force.std["onset_m"])
