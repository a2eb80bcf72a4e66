"""The demonstrated steps: which ones, how often, and in which scene."""

from itertools import pairwise

import factories as make
import numpy as np
import pytest

from navirl_cli.errors import DemonstrationError, SceneError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.reward import Reward

TRUTH = Reward((-35.0, -0.6, -3.0, 2.0))
GRID = make.open_grid(6, 4)
EAST = [[c, 1] for c in range(6)]
BENT = [[0, 1], [1, 2], [2, 3], [3, 3], [4, 2], [5, 1]]
NORTH = [[0, 0], [0, 1], [0, 2], [0, 3]]


def path(cells, number, participant="p1", people=make.NOBODY):
    return make.demonstration(GRID, cells, people, number=number, participant=participant)


@pytest.fixture
def four():
    """East, north, east by another way, north again: two scenes by turns."""
    return evidence_of([path(EAST, 1), path(NORTH, 2, "p2"), path(BENT, 3, "p2"), path(NORTH, 4, "p3")])


def steps_of(evidence):
    """(demonstration, number, from, to) of every step, sorted."""
    return sorted(
        (owner, number, *part.scene.lattice.cells[state].tolist(), *part.scene.lattice.cells[target].tolist())
        for part in evidence.scenes
        for owner, number, state, target in zip(
            part.owner.tolist(), part.number.tolist(), part.state, part.target, strict=True
        )
    )


def test_every_step_of_every_path_is_there_once(four):
    expected = sorted(
        (owner, number, *here, *there)
        for owner, cells in enumerate((EAST, NORTH, BENT, NORTH))
        for number, (here, there) in enumerate(pairwise(cells))
    )
    assert steps_of(four) == expected
    assert (four.count, four.owners.tolist(), four.steps) == (4, [0, 1, 2, 3], 16)


def test_equal_scenes_are_one_object_and_others_are_not(four):
    assert [sorted(set(part.owner.tolist())) for part in four.scenes] == [[0, 2], [1, 3]]
    with_person = evidence_of(
        [path(EAST, 1), path(EAST, 2, people=[[0.3, 0.3]]), path(BENT, 3), path(BENT, 4, people=[[0.3, 0.3]])]
    )
    assert [sorted(set(part.owner.tolist())) for part in with_person.scenes] == [[0, 2], [1, 3]]


def test_only_some_steps_are_taken(four):
    masks = [np.zeros(5, bool), np.array([True, False, True]), np.array([False, True, False, False, True]), [False] * 3]
    some = four.only([np.asarray(mask) for mask in masks])
    assert steps_of(some) == [step for step in steps_of(four) if masks[step[0]][step[1]]]
    assert (some.count, some.owners.tolist(), some.steps) == (4, [1, 2], 4)
    assert some.participants == four.participants
    # From a corner 3 moves are possible, from a side 5, from (1, 2) and (4, 2) all 8.
    assert some.uniform_log_likelihood() == pytest.approx(-np.log(3 * 5 * 8 * 8))


def test_a_scene_without_selected_steps_is_left_out(four):
    east = four.only([np.ones(5, bool), np.zeros(3, bool), np.ones(5, bool), np.zeros(3, bool)])
    assert len(east.scenes) == 1
    assert log_likelihood(east, TRUTH) == pytest.approx(
        log_likelihood(evidence_of([path(EAST, 1), path(BENT, 2)]), TRUTH)
    )


def test_demonstrations_are_repeated_as_often_as_counted(four):
    counts = [2, 0, 1, 1]
    again = four.repeated(np.array(counts))
    assert steps_of(again) == sorted(step for step in steps_of(four) for _ in range(counts[step[0]]))
    assert (again.count, again.owners.tolist(), again.steps) == (4, [0, 2, 3], 2 * 5 + 5 + 3)
    single = [log_likelihood(evidence_of([path(cells, 1)]), TRUTH) for cells in (EAST, NORTH, BENT, NORTH)]
    assert log_likelihood(again, TRUTH) == pytest.approx(np.dot(counts, single), rel=1e-12)
    assert four.repeated(np.ones(4, int)).steps == four.steps


def test_some_steps_repeated(four):
    some = four.only([np.arange(5) == 2, np.zeros(3, bool), np.ones(5, bool), np.zeros(3, bool)])
    assert steps_of(some.repeated(np.array([3, 1, 0, 1]))) == [(0, 2, 2, 1, 3, 1)] * 3


def test_no_selected_step_is_an_error(four):
    for empty in (
        lambda: four.only([np.zeros(n, bool) for n in (5, 3, 5, 3)]),
        lambda: four.repeated(np.zeros(4, int)),
        lambda: four.only([np.ones(5, bool), *(np.zeros(n, bool) for n in (3, 5, 3))]).repeated(np.array([0, 1, 1, 1])),
    ):
        with pytest.raises(DemonstrationError, match=r"^no step is left to learn from$"):
            empty()


def test_steps_that_a_path_takes_twice_are_two():
    back_and_forth = evidence_of([path([[0, 1], [1, 1], [0, 1], [1, 1], [2, 1]], 1)])
    assert [step[2:] for step in steps_of(back_and_forth)] == [(0, 1, 1, 1), (1, 1, 0, 1), (0, 1, 1, 1), (1, 1, 2, 1)]


def test_a_path_that_ends_at_its_start_is_refused_by_name():
    with pytest.raises(
        SceneError, match=r"^demonstration p9/5: start and goal lie in the same cell at x 0\.05 m, y 0\.15"
    ):
        evidence_of([path(EAST, 1), path([[0, 1], [1, 1], [0, 1]], 5, "p9")])
