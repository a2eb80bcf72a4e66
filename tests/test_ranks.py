"""Ranks of demonstrations among the policy's own paths: uniform where the policy is the truth."""

import factories as make
import numpy as np
import pytest
from scipy import stats

from navirl_cli.demos.grid import moves_along
from navirl_cli.evaluation.ranks import path_log_likelihood, ranks_of, sampled_log_likelihoods
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import log_likelihood, policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward

TRUTH = Reward((-45.0, -0.8, -4.0, 2.0))
SCENE = make.scene_on(make.open_grid(40, 21), [2, 10], [37, 10], [[2.05, 1.05]])


@pytest.fixture(scope="module")
def demonstrations():
    return make.drawn(SCENE, TRUTH, 500, seed=0)


def ranks(demonstrations, reward, seed=1):
    return np.array([one.rank for one in ranks_of(demonstrations, reward, 2000, np.random.default_rng(seed))])


def test_under_the_truth_ranks_are_uniform(demonstrations):
    found = ranks(demonstrations, TRUTH)
    assert ((found >= 0) & (found <= 1)).all()
    assert stats.kstest(found, "uniform").pvalue > 0.01


@pytest.mark.parametrize(
    "wrong", [(-60.0, -0.8, -4.0, 2.0), (-35.0, -0.8, -4.0, 2.0), (-45.0, -0.8, 0.0, 2.0), (-45.0, -8.0, -4.0, 2.0)]
)
def test_under_another_reward_they_are_not(demonstrations, wrong):
    assert stats.kstest(ranks(demonstrations, Reward(wrong)), "uniform").pvalue < 1e-4


def test_log_likelihoods_are_those_of_the_fit(demonstrations):
    few = demonstrations[:5]
    found = ranks_of(few, TRUTH, 10, np.random.default_rng(0))
    assert sum(one.log_likelihood for one in found) == pytest.approx(log_likelihood(evidence_of(few), TRUTH))
    assert [one.id for one in found] == [one.id for one in few]


def test_sampled_paths_have_the_likelihood_of_their_moves():
    policy = policy_of(TRUTH, SCENE)
    paths = sample_paths(policy, SCENE.start, 50, np.random.default_rng(3))
    for number, value in enumerate(sampled_log_likelihoods(policy, paths)):
        states = paths.path(number)
        assert value == pytest.approx(path_log_likelihood(policy, states, moves_along(SCENE.lattice.cells[states])))


def test_a_path_that_the_policy_never_takes_ranks_last():
    # Under a steep reward a long detour has a probability of zero.
    far = [[2, 10], [2, 9], *[[c, 8] for c in range(3, 37)], [37, 9], [37, 10]]
    one = make.demonstration(SCENE.lattice.grid, far, SCENE.people_m)
    (found,) = ranks_of([one], Reward((-2000.0, -0.8, -4.0, 2.0)), 100, np.random.default_rng(0))
    assert found.rank < 0.02


def test_ties_are_shared_out_and_the_same_seed_ranks_the_same():
    # A corridor one cell wide with hardly any choice: nearly all paths are one.
    scene = make.scene_on(make.open_grid(12, 1), [0, 0], [11, 0])
    only = [make.demonstration(scene.lattice.grid, [[c, 0] for c in range(12)], number=i) for i in range(200)]
    reward = Reward((-200.0, -0.5, 0.0, 1.0))
    found = ranks(only, reward)
    assert stats.kstest(found, "uniform").pvalue > 0.01
    assert (found == ranks(only, reward)).all()
    assert (found != ranks(only, reward, seed=2)).any()


def test_progress_counts():
    seen = []
    few = make.drawn(SCENE, TRUTH, 3, seed=5)
    ranks_of(few, TRUTH, 10, np.random.default_rng(0), lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]
