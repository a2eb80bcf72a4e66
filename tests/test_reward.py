"""The sum of terms: against loops, in the goal, with a new term, and what is no reward."""

from math import exp, hypot

import factories as make
import numpy as np
import oracles
import pytest
from toy_term import Egg

from navirl_cli.errors import RewardError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import likelihood, log_likelihood
from navirl_cli.irl.reward import PAPER_TERMS, Reward


@pytest.fixture(scope="module")
def scene():
    return make.random_scene(np.random.default_rng(11), 9, 7, density=0.15, people=2)


@pytest.mark.parametrize("seed", range(4))
def test_the_reward_of_the_paper_against_loops(seed):
    rng = np.random.default_rng(seed)
    scene = make.random_scene(rng, 10, 8, density=0.2, people=seed)
    theta = (-rng.uniform(25, 90), -rng.uniform(0, 3), rng.uniform(-8, 3), rng.uniform(0.2, 5))
    grid = scene.lattice.grid
    start, goal = (tuple(scene.lattice.cells[state].tolist()) for state in (scene.start, scene.goal))
    slow = oracles.paper_reward(theta, ~grid.occupied, start, goal, scene.people_m, 0.1, grid.origin_m)
    fast = make.by_cell(scene, Reward(theta).on(scene).value, -np.inf)
    assert fast == pytest.approx(
        np.where(make.by_cell(scene, np.ones(scene.lattice.size), 0)[..., None], slow, -np.inf)
    )


def test_the_absorbing_goal_has_no_reward(scene):
    jet = Reward.named({"a_p": -3.0}).on(scene)
    assert (jet.value[scene.goal] == -np.inf).all()
    for array in (*jet.first, *jet.second.values()):
        assert len(array) == 1 or (array[scene.goal] == 0).all()


def test_reward_by_cell_leaves_out_the_part_of_the_move(scene):
    people = scene.people_m
    expected = [
        -0.5 * scene.deviation_m[state] ** 2 + sum(-4.0 * exp(-1.5 * hypot(*(xy - person)) ** 2) for person in people)
        for state, xy in enumerate(scene.lattice.xy_m)
    ]
    assert Reward((-50.0, -0.5, -4.0, 1.5)).by_cell(scene) == pytest.approx(expected)


def test_a_new_term_joins_the_likelihood_without_touching_anything():
    scene = make.scene_on(make.open_grid(12, 8), [0, 3], [11, 4], [[0.6, 0.6], [0.7, 0.1]])
    theta = np.array([-40.0, -0.6, -2.5, 1.3, 3.1])
    terms = (PAPER_TERMS[0], PAPER_TERMS[1], Egg())
    evidence = evidence_of(make.drawn(scene, Reward(tuple(theta), terms), 5, seed=2))
    at = theta * [1.1, 0.7, 1.3, 0.8, 1.2]

    def value(x):
        return log_likelihood(evidence, Reward(tuple(x), terms))

    def gradient(x):
        return likelihood(evidence, Reward(tuple(x), terms)).gradient

    found = likelihood(evidence, Reward(tuple(at), terms))
    assert found.gradient == pytest.approx(oracles.derivative(value, at), rel=1e-6, abs=1e-7)
    assert found.hessian == pytest.approx(oracles.derivative(gradient, at), rel=1e-6, abs=1e-7)
    # With s_x = s_y it is the round one.
    round_one = likelihood(evidence, Reward((-40.0, -0.6, -2.5, 1.3)))
    egg = likelihood(evidence, Reward((-40.0, -0.6, -2.5, 1.3, 1.3), terms))
    assert egg.value == pytest.approx(round_one.value, rel=1e-13)
    assert egg.gradient[3] + egg.gradient[4] == pytest.approx(round_one.gradient[3], rel=1e-9)


def test_parameters_that_are_not_named_keep_their_initial_values():
    assert Reward.named({"a_p": 2}).theta == (-50.0, -0.01, 2.0, 2.0)
    assert [parameter.name for parameter in Reward.named({}).parameters] == ["c0", "a_g", "a_p", "sigma_p"]


@pytest.mark.parametrize(
    ("make_it", "message"),
    [
        (lambda: Reward((-50.0, 0.0)), r"needs 4 parameters \(c0, a_g, a_p, sigma_p\), found 2"),
        (lambda: Reward((0.0, 0.0, 0.0, 1.0)), r"c0 = 0 1/m is outside its bounds -10000 to -0.01"),
        (lambda: Reward((-50.0, 0.1, 0.0, 1.0)), r"a_g = 0.1 1/m\^2 is outside its bounds -10000 to 0"),
        (lambda: Reward((-50.0, 0.0, np.nan, 1.0)), r"a_p = nan is outside"),
        (lambda: Reward((-50.0, 0.0, 0.0, 0.0)), r"sigma_p = 0 1/m\^2 is outside its bounds 0.001 to 1000"),
        (
            lambda: Reward.named({"a_q": 1.0, "c0": -1.0}),
            r"^parameter: expected one of 'c0', 'a_g', 'a_p', 'sigma_p', found 'a_q'",
        ),
    ],
)
def test_invalid_rewards_are_refused(make_it, message):
    with pytest.raises(RewardError, match=message):
        make_it()
