"""Paths drawn from a policy: frequencies, ends, steps, seeds."""

import factories as make
import numpy as np
import pytest

from navirl_cli.errors import RewardError
from navirl_cli.irl import paths
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths, sampled_lines_m
from navirl_cli.irl.reward import Reward

SCENE = make.random_scene(np.random.default_rng(4), 13, 9, density=0.15)
POLICY = policy_of(Reward((-26.0, -0.5, -3.0, 2.0)), SCENE)


def draw(count, seed):
    return sample_paths(POLICY, SCENE.start, count, np.random.default_rng(seed))


def test_visit_frequencies_are_those_of_the_policy():
    count = 20_000
    drawn = draw(count, 0)
    on_the_way = np.arange(drawn.states.shape[1]) < drawn.lengths[:, None]
    assert (drawn.states[~on_the_way] == SCENE.goal).all()
    size = SCENE.lattice.size
    owner = np.nonzero(on_the_way)[0]
    table = np.zeros((count, size))
    np.add.at(table, (owner, drawn.states[on_the_way]), 1.0)
    expected = POLICY.visits(np.eye(size)[SCENE.start])
    # A cell of which nobody was seen has an empirical spread of zero: no less than that of a Poisson count.
    error = np.maximum(table.std(axis=0, ddof=1), np.sqrt(expected)) / np.sqrt(count) + 1e-12
    assert (np.abs(table.mean(axis=0) - expected) < 5 * error).all()
    assert drawn.lengths.mean() == pytest.approx(expected.sum(), rel=0.01)


def test_move_frequencies_are_those_of_the_policy():
    # At the start of every path the choice is a plain draw of one of eight.
    count = 20_000
    second = draw(count, 1).states[:, 1]
    for move in range(8):
        share = POLICY.probability[SCENE.start, move]
        target = SCENE.lattice.neighbours[SCENE.start, move]
        seen = (second == target).mean() if target >= 0 else 0.0
        assert abs(seen - share) <= 5 * np.sqrt(share * (1 - share) / count) + 1e-12


def test_the_same_seed_draws_the_same_paths_and_another_one_others():
    one, two, other = draw(50, 7), draw(50, 7), draw(50, 8)
    assert (one.states == two.states).all()
    assert (one.lengths == two.lengths).all()
    assert [p.tolist() for p in map(one.path, range(50))] != [p.tolist() for p in map(other.path, range(50))]


def test_every_path_starts_at_the_start_moves_to_neighbours_and_ends_in_the_goal_once():
    drawn = draw(300, 2)
    assert len(drawn) == 300
    for number in range(len(drawn)):
        path = drawn.path(number)
        assert (path[0], path[-1]) == (SCENE.start, SCENE.goal)
        assert (path[:-1] != SCENE.goal).all()
        assert (np.abs(np.diff(SCENE.lattice.cells[path], axis=0)).max(axis=1) == 1).all()


def test_lines_run_through_the_centres_of_the_cells():
    drawn = draw(5, 3)
    for number, line in enumerate(sampled_lines_m(POLICY, drawn)):
        cells = SCENE.lattice.cells[drawn.path(number)]
        assert (line == SCENE.lattice.grid.centres_of(cells)).all()


def test_a_hard_policy_drives_the_only_shortest_path():
    scene = make.scene_on(make.open_grid(9, 5), [0, 2], [8, 2])
    hard = policy_of(Reward((-2000.0, 0.0, 0.0, 1.0)), scene)
    drawn = sample_paths(hard, scene.start, 20, np.random.default_rng(0))
    assert (drawn.lengths == 9).all()
    assert (scene.lattice.cells[drawn.states][:, :, 1] == 2).all()


def test_a_path_that_does_not_reach_the_goal_is_an_error(monkeypatch):
    monkeypatch.setattr(paths, "PATIENCE", 0)
    corridor = make.scene_on(make.open_grid(150, 1), [0, 0], [149, 0])
    with pytest.raises(RewardError, match="a sampled path did not reach the goal within 100 steps"):
        sample_paths(policy_of(Reward((-30.0, 0.0, 0.0, 1.0)), corridor), corridor.start, 2, np.random.default_rng(0))
