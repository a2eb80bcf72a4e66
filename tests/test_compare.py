"""Demonstrated, learnt and baseline paths side by side."""

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.demonstration import Condition
from navirl_cli.evaluation.compare import (
    AVOIDANCE,
    DRIVEN,
    KINDS,
    LEARNT,
    NOMINAL,
    ON_GRID,
    PERSON_RADIUS_M,
    compare,
    group_of,
)
from navirl_cli.irl.reward import Reward

GRID = make.open_grid(40, 21)
PERSON = np.array([[2.03, 0.98]])
ROW = 10
STRAIGHT = [[c, ROW] for c in range(1, 39)]
# Round the person at a distance of 7 cells.
ROUND = [
    [1, 10], *[[c, 10 - (c - 1)] for c in range(2, 9)], *[[c, 3] for c in range(9, 32)],
    *[[c, 3 + (c - 31)] for c in range(32, 39)],
]  # fmt: skip


def trial(cells, number, condition=Condition.FORCE, cycle=2, people=PERSON, **fields):
    return make.demonstration(GRID, cells, people, number=number, condition=condition, cycle=cycle, **fields)


TRIALS = [trial(STRAIGHT, 1), trial(ROUND, 2), trial(ROUND, 3, Condition.JOYSTICK, None)]


def run(trials=TRIALS, reward=None, samples=0, seed=0):
    return compare(trials, reward, samples, np.random.default_rng(seed))


def of(comparison, group, kind):
    (found,) = [one for one in comparison.groups if (one.group, one.kind) == (group, kind)]
    return found


def test_groups_are_conditions_and_cycles():
    assert [group_of(one) for one in TRIALS] == ["force, cycle 2", "force, cycle 2", "joystick"]


def test_mean_and_spread_of_what_was_driven():
    group = of(run(), "force, cycle 2", DRIVEN)
    lengths = [oracles.length_by_steps(one.xy_m) for one in TRIALS[:2]]
    assert lengths[0] == pytest.approx(3.7)
    assert group.count == 2
    assert group.mean.length_m == pytest.approx(np.mean(lengths))
    assert group.std.length_m == pytest.approx(abs(lengths[1] - lengths[0]) / np.sqrt(2))  # n - 1
    near = [oracles.distance_by_sampling(one.xy_m, PERSON, 2000) - 0.25 for one in TRIALS[:2]]
    assert group.mean.min_distance_m == pytest.approx(np.mean(near), abs=1e-4)
    # The detour is a trapezoid of sides 3.7 and 2.3 and height 0.7; the straight one has no area.
    assert group.mean.area_m2 == pytest.approx((3.7 + 2.3) / 2 * 0.7 / 2)


def test_one_path_has_no_spread():
    group = of(run(), "joystick", DRIVEN)
    assert group.count == 1
    assert np.isnan(group.std.length_m)


def test_what_was_driven_is_listed_by_demonstration():
    comparison = run()
    assert [(name, group) for name, group, _ in comparison.driven] == [
        ("p1/1", "force, cycle 2"), ("p1/2", "force, cycle 2"), ("p1/3", "joystick")
    ]  # fmt: skip
    assert comparison.driven[1][2].length_m == pytest.approx(oracles.length_by_steps(TRIALS[1].xy_m))


def test_poses_beside_the_centres_change_what_was_driven_but_not_what_is_on_the_grid():
    moved = trial(STRAIGHT, 1, xy_m=GRID.centres_of(STRAIGHT) + np.array([0.0, 0.03]))
    comparison = run([moved])
    assert of(comparison, "force, cycle 2", DRIVEN).mean.area_m2 == pytest.approx(3.7 * 0.03)
    assert of(comparison, "force, cycle 2", ON_GRID).mean.area_m2 == pytest.approx(0.0, abs=1e-12)


def test_the_baselines_are_the_straight_way_and_the_one_that_keeps_clear():
    comparison = run()
    nominal, avoidance = (of(comparison, "joystick", kind).mean for kind in (NOMINAL, AVOIDANCE))
    assert nominal.length_m == pytest.approx(3.7)
    assert nominal.area_m2 == pytest.approx(0.0, abs=1e-12)
    assert nominal.min_distance_m == pytest.approx(1.05 - 0.98 - 0.25)
    assert PERSON_RADIUS_M <= avoidance.min_distance_m < PERSON_RADIUS_M + 0.1
    assert 3.7 < avoidance.length_m < 4.2
    assert avoidance.area_m2 > 0


def test_learnt_paths_are_drawn_for_every_demonstration_from_the_seed():
    reward = Reward((-60.0, -0.5, -6.0, 2.0))
    one, two, other = (
        run(reward=reward, samples=4),
        run(reward=reward, samples=4),
        run(reward=reward, samples=4, seed=1),
    )
    learnt = of(one, "force, cycle 2", LEARNT)
    assert learnt.count == 8
    assert learnt == of(two, "force, cycle 2", LEARNT)
    assert learnt != of(other, "force, cycle 2", LEARNT)
    assert learnt.mean.min_distance_m > of(one, "force, cycle 2", NOMINAL).mean.min_distance_m
    assert not [group for group in run(reward=reward, samples=0).groups if group.kind == LEARNT]


def test_groups_come_in_the_order_of_the_table():
    comparison = run(reward=Reward((-60.0, -0.5, -6.0, 2.0)), samples=1)
    kinds = list(KINDS)
    assert [(one.group, one.kind) for one in comparison.groups] == [
        (group, kind) for group in ("force, cycle 2", "joystick") for kind in kinds
    ]


def test_where_no_way_is_left_around_a_person_the_rest_is_measured_and_it_is_said():
    # The person stands beside the start.
    crowded = trial(STRAIGHT, 4, people=np.array([[0.2, 1.2]]))
    comparison = run([*TRIALS, crowded])
    assert len(comparison.notes) == 1
    assert comparison.notes[0].startswith("p1/4: no path around the people as obstacles: the cell at x 0.15 m")
    assert of(comparison, "force, cycle 2", AVOIDANCE).count == 2
    assert of(comparison, "force, cycle 2", DRIVEN).count == 3


def test_without_people_there_are_no_distances():
    comparison = run([trial(STRAIGHT, 1, people=make.NOBODY)])
    for group in comparison.groups:
        assert np.isnan(group.mean.min_distance_m)
        assert group.mean.length_m == pytest.approx(3.7)


def test_progress_counts_demonstrations():
    seen = []
    compare(TRIALS, None, 0, np.random.default_rng(0), lambda done, of_all: seen.append((done, of_all)))
    assert seen == [(1, 3), (2, 3), (3, 3)]
