"""The order of the states: ways that climb in it, the two parts of a matrix, and maps that need another order."""

import factories as make
import numpy as np
import pytest

from navirl_cli.demos.grid import Grid
from navirl_cli.irl import values
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward


def slow_climbs(ordering, parent):
    """Walk from every state to the goal and count the steps to a higher rank."""
    most = 0
    for state in range(len(parent)):
        here, count = state, 0
        while parent[here] >= 0:
            count += bool(ordering.rank[parent[here]] > ordering.rank[here])
            here = parent[here]
        assert here == ordering.goal
        most = max(most, count)
    return most


@pytest.mark.parametrize("seed", range(8))
def test_climbs_against_a_walk_from_every_state(seed):
    rng = np.random.default_rng(seed)
    scene = make.random_scene(rng, 14, 11, density=(0.0, 0.25)[seed % 2])
    lattice = scene.lattice
    cost = rng.gamma(0.3, size=(lattice.size, 1)) + 0.01 * lattice.step_m
    _, parent = lattice.cheapest_tree(scene.goal, cost)
    slow = slow_climbs(scene.ordering, parent)
    assert slow > 1, "costs so uneven send ways up and down"
    assert scene.ordering.climbs(parent) == slow


def test_paths_that_only_descend_have_no_climbs():
    scene = make.random_scene(np.random.default_rng(3), 14, 11, density=0.2)
    _, parent = scene.lattice.cheapest_tree(scene.goal, scene.lattice.step_m)
    assert scene.ordering.climbs(parent) == 0


def test_rank_and_order_undo_each_other_and_follow_the_distance():
    ordering = make.random_scene(np.random.default_rng(4), 13, 9, density=0.2).ordering
    assert ordering.order[0] == ordering.goal
    assert (ordering.rank[ordering.order] == np.arange(ordering.graph.size)).all()
    assert (np.diff(ordering.distance[ordering.order]) >= 0).all()
    for rank, state in enumerate(ordering.order.tolist()):
        for move, target in enumerate(ordering.graph.neighbours[state].tolist()):
            assert ordering.neighbours[rank, move] == (-1 if target < 0 else ordering.rank[target])


@pytest.mark.parametrize("seed", range(6))
def test_a_matrix_is_split_into_steps_down_and_all_others(seed):
    rng = np.random.default_rng(seed)
    ordering = make.random_scene(rng, 12, 9, density=(0.0, 0.2, 0.35)[seed % 3]).ordering
    size = ordering.graph.size
    weight = rng.random((size, 8))  # also where no move is possible: that must not matter
    whole = np.zeros((size, size))
    for rank in range(size):
        for move, target in enumerate(ordering.neighbours[rank].tolist()):
            if target >= 0:
                whole[rank, target] = weight[rank, move]
    triangular, rest = ordering.split(weight)
    lower = np.eye(size) - triangular.toarray()
    assert (lower + rest.toarray() == whole).all()
    assert (np.triu(lower) == 0).all(), "strictly lower"
    assert (np.tril(rest.toarray()) == 0).all()
    again, other = ordering.split(2 * weight)  # the pattern is kept, the numbers are not
    assert (np.eye(size) - again.toarray() + other.toarray() == 2 * whole).all()


def behind_a_row_of_people():
    """Open ground; from the start a row of people bars the straight way, and the cheap way leads around its far end."""
    people = np.stack([np.full(12, 1.5), np.arange(12) * 0.12 + 0.05], axis=1)
    return make.scene_on(make.open_grid(30, 22), [2, 2], [27, 2], people), Reward((-40.0, -0.01, -60.0, 30.0))


def two_gates():
    """A wall with two gates: in the near one stands a person, so that the way to it must be walked back."""
    occupied = np.zeros((24, 25), dtype=bool)
    occupied[1:20, 12] = True
    return make.scene_on(Grid(occupied, 0.1, (0.0, 0.0)), [2, 2], [22, 2], [[1.25, 0.05]]), Reward(
        (-40.0, 0.0, -500.0, 20.0)
    )


@pytest.mark.parametrize("banded", [False, True], ids=["plain", "banded"])
@pytest.mark.parametrize("world", [behind_a_row_of_people, two_gates])
def test_a_new_order_is_made_for_best_paths_that_first_lead_away_and_values_are_right(world, banded, monkeypatch):
    made = []
    real = values.Ordering
    monkeypatch.setattr(values, "Ordering", lambda *args: made.append(real(*args)) or made[-1])
    if banded:
        monkeypatch.setattr(values, "PLAIN_STEPS", 1)
        monkeypatch.setattr(values, "STEPS_PER_BAND", 5.0)
    scene, reward = world()
    hard, parent = scene.lattice.cheapest_tree(
        scene.goal, np.where(scene.lattice.possible, -reward.on(scene).value, 1.0)
    )
    assert scene.ordering.climbs(parent) > values.MAX_CLIMBS
    policy = policy_of(reward, scene)
    assert made == [policy.ordering]
    assert made[0].distance == pytest.approx(hard, rel=1e-12)
    assert made[0].climbs(parent) == 0
    slow = make.slow_values(scene, reward)
    assert np.abs(policy.value - slow).max() < 1e-9
    start = np.eye(scene.lattice.size)[scene.start]
    assert policy.visits(start)[scene.goal] == pytest.approx(1.0, abs=1e-10)
    # The order is a means, not an end: without a new one the answer is the same, only later.
    monkeypatch.setattr(values, "MAX_CLIMBS", 10_000)
    stubborn = policy_of(reward, scene)
    assert len(made) == 1
    assert stubborn.value == pytest.approx(policy.value, abs=1e-9)
    assert stubborn.sweeps >= policy.sweeps
