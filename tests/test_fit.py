"""Fits: known truth found again, what the data do not tell, bounds, and what is refused."""

import factories as make
import numpy as np
import pytest

from navirl_cli.errors import RewardError
from navirl_cli.irl import fit as fit_module
from navirl_cli.irl import objective as objective_module
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import Method, fit
from navirl_cli.irl.likelihood import likelihood, log_likelihood, policy_of
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError, ValueStatus
from navirl_cli.irl.status import Status

TRUTH = Reward((-32.0, -0.8, -4.0, 3.0))
START = Reward.named({})
SCENE = make.scene_on(make.open_grid(26, 14), [1, 6], [24, 7], [[1.3, 0.7]])
ALONE = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4])


@pytest.fixture(scope="module")
def many():
    return evidence_of(make.drawn(SCENE, TRUTH, 400, seed=1))


def test_a_known_reward_is_found_again_within_its_standard_errors(many):
    found = fit(many, START, l2=0.0)
    assert found.status is Status.CONVERGED
    error = found.standard_errors
    assert (error < [1.0, 0.3, 0.5, 0.5]).all(), "so many paths say it well"
    assert (np.abs(np.array(found.reward.theta) - TRUTH.theta) < 3 * error).all()
    assert found.identified.all()
    assert not found.on_bound.any()
    assert np.abs(likelihood(many, found.reward).gradient * error).max() < 1e-3
    assert log_likelihood(many, TRUTH) < found.log_likelihood < log_likelihood(many, TRUTH) + 15
    assert found.log_likelihood == pytest.approx(log_likelihood(many, found.reward), rel=1e-12)
    assert found.log_likelihood_initial == pytest.approx(log_likelihood(many, START), rel=1e-12)
    assert found.log_likelihood_uniform == pytest.approx(many.uniform_log_likelihood())
    assert (found.demonstrations, found.steps) == (400, many.steps)
    information = np.linalg.inv(-likelihood(many, found.reward).hessian)
    assert found.covariance == pytest.approx(information, rel=1e-6)


def test_the_answer_does_not_depend_on_the_start(many):
    thetas = [
        fit(many, Reward(theta), l2=0.0).reward.theta
        for theta in ((-50.0, -0.01, -5.0, 2.0), (-90.0, -5.0, 2.0, 0.2), (-40.0, 0.0, -20.0, 9.0))
    ]
    assert thetas[1] == pytest.approx(thetas[0], rel=1e-3)
    assert thetas[2] == pytest.approx(thetas[0], rel=1e-3)


def test_from_an_indifferent_start_the_personal_space_is_learnt(many):
    # At a_p = 0 neither slope nor own curvature tells sigma_p, only the mixed one.
    found = fit(many, Reward((-50.0, -0.01, 0.0, 2.0)), l2=0.0)
    assert found.identified.all()
    assert found.reward.theta == pytest.approx(fit(many, START, l2=0.0).reward.theta, rel=1e-3)


def test_the_accepted_steps_are_recorded(many):
    told = []
    found = fit(many, START, l2=0.01, progress=lambda step, value: told.append((step, value)))
    assert [step for step, _ in told] == list(range(1, len(told) + 1))
    assert len(found.path_theta) == len(found.path_log_likelihood) == found.iterations + 1
    assert tuple(found.path_theta[-1]) == pytest.approx(found.reward.theta)
    assert found.path_log_likelihood[-1] == pytest.approx(found.log_likelihood)
    assert found.evaluations >= len(told)


def test_the_regulariser_pulls_toward_zero_in_its_scales(many):
    free, held = fit(many, START, l2=0.0), fit(many, START, l2=2.0)
    scale = np.array([10.0, 1.0, 1.0, 1.0])
    assert np.linalg.norm(np.array(held.reward.theta) / scale) < np.linalg.norm(np.array(free.reward.theta) / scale)
    # At its maximum the likelihood's gradient balances the pull.
    gradient = likelihood(many, held.reward).gradient * scale
    assert gradient == pytest.approx(2.0 * np.array(held.reward.theta) / scale, rel=1e-3, abs=1e-3)
    assert held.log_likelihood < free.log_likelihood


@pytest.mark.parametrize("l2", [0.0, 1e-3, 1.0])
@pytest.mark.parametrize("person", [make.NOBODY, [[600.0, 600.0]]], ids=["nobody", "far away"])
def test_without_a_person_nearby_the_personal_space_keeps_its_initial_values(l2, person):
    scene = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4], person)
    evidence = evidence_of(make.drawn(scene, Reward((-35.0, -0.6, 0.0, 1.0)), 30, seed=3))
    found = fit(evidence, START, l2=l2)
    assert found.status is Status.NOT_IDENTIFIED
    assert found.identified.tolist() == [True, True, False, False]
    assert found.reward.theta[2:] == (START.theta[2], START.theta[3])
    assert np.isfinite(found.covariance[:2, :2]).all()
    assert np.isnan(found.covariance[2:]).all()
    assert np.isnan(found.standard_errors[2:]).all()


def test_a_parameter_on_its_bound_is_reported_and_has_no_standard_error():
    # Paths along both borders of a field: leaving the nominal path pays, but a_g cannot be positive.
    grid = make.open_grid(16, 9)
    rim = [[0, 4], [1, 5], [2, 6], [3, 7], *[[c, 8] for c in range(4, 12)], [12, 7], [13, 6], [14, 5], [15, 4]]
    mirror = [[c, 8 - r] for c, r in rim]
    evidence = evidence_of([make.demonstration(grid, rim), make.demonstration(grid, mirror, number=2)] * 5)
    found = fit(evidence, Reward((-50.0, -0.5, 0.0, 2.0)), l2=0.0)
    assert found.reward.theta[1] == 0.0
    assert found.on_bound.tolist() == [False, True, False, False]
    assert likelihood(evidence, found.reward).gradient[1] > 0
    assert np.isnan(found.standard_errors[1])
    assert np.isfinite(found.standard_errors[0])
    # Nobody is there either, which is said first; with a reward of way and deviation alone it is the bound.
    assert found.status is Status.NOT_IDENTIFIED
    alone = fit(evidence, Reward((-50.0, -0.5), START.terms[:2]), l2=0.0)
    assert alone.status is Status.ON_BOUND
    assert alone.reward.theta == pytest.approx(found.reward.theta[:2], rel=1e-6)


def test_a_path_that_is_always_shortest_has_no_best_cost_of_path_length():
    # On a corridor of one cell the straight way is the likelier the more way costs, without end, and nothing lies
    # beside the nominal path.
    grid = make.open_grid(12, 1)
    evidence = evidence_of([make.demonstration(grid, [[c, 0] for c in range(12)])])
    found = fit(evidence, Reward((-50.0, -0.5), START.terms[:2]), l2=0.0)
    assert found.status is Status.NOT_IDENTIFIED
    assert not found.identified.any()
    assert found.reward.theta[0] < -50.0
    assert found.reward.theta[1] == -0.5
    assert np.isnan(found.standard_errors).all()
    held = fit(evidence, Reward((-50.0, -0.5), START.terms[:2]), l2=1e-3)
    assert -50.0 < held.reward.theta[0] < -10.0, "with a regulariser it is the regulariser's"
    assert held.reward.theta[1] == -0.5


@pytest.mark.parametrize("l2", [-1.0, -1e-12, np.nan])
def test_a_regulariser_below_zero_is_refused(many, l2):
    with pytest.raises(RewardError, match="`l2`: expected 0 or more, found"):
        fit(many, START, l2=l2)


def test_a_start_without_a_partition_function_is_refused(many):
    with pytest.raises(InfinitePartitionError, match="choose a more negative c0"):
        fit(many, Reward((-10.0, 0.0, 0.0, 1.0)))


def test_every_status_gives_advice():
    assert [status.value for status in Status] == [
        "converged",
        "open interval",
        "stopped early",
        "on bound",
        "not identified",
        "infinite partition function",
    ]
    assert len({status.advice for status in Status}) == 6


def test_the_same_evidence_gives_the_same_fit(many):
    one, two = fit(many, START), fit(many, START)
    assert one.reward == two.reward
    assert (one.covariance == two.covariance).all()


@pytest.mark.parametrize("fixed", [("sigma_p",), ("c0", "a_g"), ("c0", "a_g", "a_p", "sigma_p")])
def test_fixed_parameters_are_constant_and_the_others_are_optimal(many, fixed):
    start = Reward((-34.0, -0.4, -3.0, 3.5))
    found = fit(many, start, l2=0.0, fixed=fixed)
    held = np.array([parameter.name in fixed for parameter in start.parameters])
    assert found.status is Status.CONVERGED
    assert (np.array(found.reward.theta)[held] == np.array(start.theta)[held]).all()
    assert np.isnan(found.standard_errors[held]).all()
    assert np.isfinite(found.standard_errors[~held]).all()
    found_likelihood = likelihood(many, found.reward)
    assert np.abs(found_likelihood.gradient[~held] * found.standard_errors[~held]).max(initial=0.0) < 1e-3
    assert found.covariance[np.ix_(~held, ~held)] == pytest.approx(
        np.linalg.inv(-found_likelihood.hessian[np.ix_(~held, ~held)]), rel=1e-6
    )
    assert found.log_likelihood < fit(many, start, l2=0.0).log_likelihood
    if held.all():
        assert found.reward == start
        assert found.iterations == 0


def test_a_parameter_fixed_on_its_bound_is_not_reported_as_on_bound(many):
    found = fit(many, Reward((-40.0, 0.0, -2.0, 1.0)), l2=0.0, fixed=("a_g",))
    assert found.reward.theta[1] == 0.0
    assert not found.on_bound.any()
    assert found.status is Status.CONVERGED


def test_without_a_scan_one_search_is_made_and_adam_makes_one_only(many):
    alone, scanned = fit(many, START, l2=0.0, scan=False), fit(many, START, l2=0.0)
    assert alone.evaluations < scanned.evaluations
    assert alone.evaluations <= 2 * (alone.iterations + 2)
    assert alone.reward.theta == pytest.approx(scanned.reward.theta, rel=1e-3)
    adam = fit(many, START, method=Method.ADAM)
    assert adam.evaluations >= adam.iterations + 1
    assert adam.method is Method.ADAM


def test_an_ascent_to_an_infinite_partition_function_is_reported(monkeypatch):
    # The partition function never ends abruptly; here it is made to.
    real = objective_module.likelihood

    def cliff(evidence, reward):
        if reward.theta[0] > -30.0:
            raise InfinitePartitionError(ValueStatus.INFINITE)
        return real(evidence, reward)

    monkeypatch.setattr(objective_module, "likelihood", cliff)
    evidence = evidence_of(make.drawn(ALONE, Reward((-24.0, -0.6, 0.0, 1.0)), 30, seed=3))
    found = fit(evidence, Reward((-50.0, -0.5), START.terms[:2]), l2=0.0)
    assert found.status is Status.INFINITE
    assert found.reward.theta[0] == pytest.approx(-30.0, abs=1e-3)
    assert "endless detours outweigh the direct path" in found.status.advice


def test_wandering_demonstrations_are_learnt_close_to_an_infinite_partition_function():
    # To and fro, again and again: the policy that drives as far on average is close to none at all.
    grid = make.open_grid(12, 7)
    there = [[c, 3] for c in range(10)]
    wander = [*there, *([*there[::-1][1:], *there[1:]] * 6), [10, 3], [11, 3]]
    evidence = evidence_of([make.demonstration(grid, wander)])
    found = fit(evidence, Reward((-50.0,), START.terms[:1]), l2=0.0)
    assert found.status is Status.CONVERGED
    scene = evidence.scenes[0].scene
    policy = policy_of(found.reward, scene)
    way = policy.expected_to_goal((policy.probability * scene.lattice.step_m).sum(axis=1))[scene.start]
    assert way == pytest.approx(0.1 * (len(wander) - 1), rel=1e-4)
    with pytest.raises(InfinitePartitionError):
        policy_of(Reward((found.reward.theta[0] + 0.5,), START.terms[:1]), scene)


def test_a_search_that_is_cut_short_is_reported(many, monkeypatch):
    from navirl_cli.irl import newton

    monkeypatch.setattr(newton, "MAX_ITERATIONS", 2)
    assert fit(many, START, l2=0.0, scan=False).status is Status.STOPPED_EARLY


def test_the_worst_status_is_reported():
    best = fit_module.Maximum(None, True, False, None, None)
    yes, no = np.array([True, True]), np.array([True, False])
    for maximum, identified, on_bound, status in (
        (best, yes, ~yes, Status.CONVERGED),
        (best, yes, no, Status.ON_BOUND),
        (best, no, no, Status.NOT_IDENTIFIED),
        (fit_module.Maximum(None, False, False, None, None), no, no, Status.STOPPED_EARLY),
        (fit_module.Maximum(None, False, True, None, None), yes, ~yes, Status.INFINITE),
    ):
        assert fit_module._status(maximum, identified, on_bound) is status
