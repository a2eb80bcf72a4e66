"""What the paths of a study are like, against lines whose answers are known."""

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.demonstration import Condition
from navirl_cli.evaluation.groups import mean_and_spread
from navirl_cli.evaluation.metrics import LEAVES_M, onset_m
from navirl_cli.study.measures import by_participant, groups_of, measured

NOMINAL = np.array([[0.0, 0.0], [10.0, 0.0]])
PERSON = np.array([[6.0, 0.3]])
GRID = make.open_grid(40, 21)
AT = np.array([[2.05, 1.05]])
STRAIGHT = [[c, 10] for c in range(1, 39)]
#: Leaves its row at cell 10, by 5 cells, and comes back.
AROUND = [[c, 10] for c in range(1, 11)] + [[10 + k, 10 + k] for k in range(1, 6)]
AROUND += [[c, 15] for c in range(16, 25)] + [[24 + k, 15 - k] for k in range(1, 6)] + [[c, 10] for c in range(30, 39)]


def trial(cells, number, people=AT, **fields):
    return make.demonstration(GRID, cells, people, number=number, **{"cycle": 2, **fields})


def test_the_onset_is_where_the_path_is_15_cm_off():
    # A line that rises by 0.1 m a metre from x = 2 m on is 15 cm off at 3.5 m.
    line = np.array([[0.0, 0.0], [2.0, 0.0], [7.0, 0.5], [10.0, 0.0]])
    assert onset_m(line, NOMINAL, PERSON) == pytest.approx(6.0 - 3.5)


@pytest.mark.parametrize("turn", [0.0, 1.1, 2.5])
def test_the_onset_knows_no_direction(turn):
    line = np.array([[0.0, 0.0], [2.0, 0.0], [7.0, -0.5], [10.0, 0.0]])
    cos, sin = np.cos(turn), np.sin(turn)
    turned = [part @ np.array([[cos, sin], [-sin, cos]]) + (3.0, -7.0) for part in (line, NOMINAL, PERSON)]
    assert onset_m(*turned) == pytest.approx(2.5)


def test_the_first_person_counts_and_the_onset_may_lie_behind():
    line = np.array([[0.0, 0.0], [2.0, 0.0], [7.0, 0.5], [10.0, 0.0]])
    assert onset_m(line, NOMINAL, np.array([[9.0, 1.0], [1.5, 0.0]])) == pytest.approx(1.5 - 3.5)


@pytest.mark.parametrize(
    ("line", "people"),
    [
        ([[0.0, 0.0], [5.0, LEAVES_M], [10.0, 0.0]], PERSON),  # never leaves
        ([[0.0, 0.4], [5.0, 0.4], [10.0, 0.0]], PERSON),  # starts away
        ([[0.0, 0.0], [5.0, 1.0], [10.0, 0.0]], np.zeros((0, 2))),  # nobody is there
    ],
)
def test_some_paths_have_no_onset(line, people):
    assert np.isnan(onset_m(np.array(line), NOMINAL, people))


def test_a_path_is_measured_as_driven_and_on_the_grid():
    xy = np.array([[0.12, 1.02], [1.0, 1.05], [2.0, 1.62], [3.88, 1.07]])
    one = make.demonstration(GRID, STRAIGHT, AT)
    one = make.replace(one, xy_m=xy, t_s=np.arange(4.0), yaw_rad=np.zeros(4))
    (row,) = measured([one])
    assert row.driven["length_m"] == pytest.approx(oracles.length_by_steps(xy))
    assert row.on_grid["length_m"] == pytest.approx(3.7)
    assert row.center_distance_m == pytest.approx(oracles.distance_by_sampling(xy, AT, 4000), abs=1e-6)
    assert row.driven["min_distance_m"] == pytest.approx(row.center_distance_m - 0.25)
    assert row.on_grid["area_m2"] == 0.0


def test_the_declared_nominal_line_counts():
    raised = np.array([[0.15, 1.25], [3.85, 1.25]])
    plain, declared = measured([trial(STRAIGHT, 1), trial(STRAIGHT, 2, nominal_m=raised)])
    assert plain.driven["area_m2"] == pytest.approx(0.0)
    assert declared.driven["area_m2"] == pytest.approx(3.7 * 0.2)


def test_groups_leave_trials_without_people_out():
    course = trial(AROUND, 3, np.zeros((0, 2)), cycle=None, set="obstacle course")
    trials = [
        trial(STRAIGHT, 1),
        trial(AROUND, 2),
        course,
        trial(AROUND, 4, condition=Condition.AUTONOMOUS, cycle=None, set="obstacle avoidance"),
        trial(AROUND, 5, condition=Condition.JOYSTICK, cycle=None, participant="p2"),
    ]
    rows = measured(trials)
    assert [row.group for row in rows][2] == "force, obstacle course"
    groups = groups_of(trials, rows)
    assert [one.group for one in groups] == ["force, cycle 2", "joystick", "obstacle avoidance"]
    force = groups[0]
    assert (force.driven.count, force.participants) == (2, 1)
    lengths = [rows[0].driven["length_m"], rows[1].driven["length_m"]]
    assert force.driven.mean["length_m"] == pytest.approx(np.mean(lengths))
    assert force.driven.std["length_m"] == pytest.approx(np.std(lengths, ddof=1))
    # The straight path never leaves the nominal one: only the other has an onset.
    assert force.onset_m[0] == pytest.approx(rows[1].onset_m)
    assert np.isnan(force.onset_m[1])


def test_participants_count_with_their_means():
    trials = [
        trial(STRAIGHT, 1),
        trial(AROUND, 2),
        trial(AROUND, 1, participant="p2"),
        trial(AROUND, 2, participant="p3"),
    ]
    rows = measured(trials)
    found = by_participant(rows, "force, cycle 2", lambda row: row.driven["length_m"])
    straight, around = rows[0].driven["length_m"], rows[1].driven["length_m"]
    assert found == pytest.approx({"p1": (straight + around) / 2, "p2": around, "p3": around})
    assert by_participant(rows, "joystick", lambda row: row.driven["length_m"]) == {}
    assert set(by_participant(rows, "force, cycle 2", lambda row: row.onset_m)) == {"p1", "p2", "p3"}


def test_mean_and_spread_of_few():
    assert mean_and_spread([1.0, 3.0, float("nan")]) == (2.0, pytest.approx(np.sqrt(2)))
    mean, spread = mean_and_spread([5.0])
    assert (mean, np.isnan(spread)) == (5.0, True)
    assert np.isnan(mean_and_spread([])).all()
