"""Priors: their densities against explicit formulas, and what they do to a fit."""

import factories as make
import numpy as np
import oracles
import pytest
from scipy.stats import multivariate_normal

from navirl_cli.errors import RewardError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.status import Status

START = Reward.named({})
TRUTH = Reward((-32.0, -0.8, -4.0, 3.0))
SCENE = make.scene_on(make.open_grid(26, 14), [1, 6], [24, 7], [[1.3, 0.7]])
MEAN = np.array([-40.0, -0.7, -3.0, 2.5])
ROOT = np.array([[3.0, 0, 0, 0], [0.1, 0.2, 0, 0], [0.3, 0.1, 0.5, 0], [-0.2, 0.0, 0.3, 0.4]])
COVARIANCE = ROOT @ ROOT.T


def check_gradient(prior, theta):
    slow = oracles.derivative(prior.log_density, np.asarray(theta))
    assert prior.gradient(np.asarray(theta)) == pytest.approx(slow, rel=1e-7, abs=1e-7)


def test_the_regulariser_is_the_sum_of_squares_in_scales():
    prior = Prior.l2(START.parameters, 0.3)
    theta = np.array([-50.0, -0.5, 4.0, 2.0])
    assert prior.log_density(theta) == pytest.approx(-0.15 * (5.0**2 + 0.5**2 + 4.0**2 + 2.0**2))
    assert prior.log_density(np.zeros(4)) == 0.0
    assert prior.gradient(theta) == pytest.approx([0.3 * 50 / 100, 0.15, -1.2, -0.6])
    check_gradient(prior, theta)
    assert (Prior.l2(START.parameters, 0.0).precision == 0).all()


@pytest.mark.parametrize("weight", [-0.1, np.nan, -np.inf])
def test_a_weight_below_zero_is_refused(weight):
    with pytest.raises(RewardError, match=f"`l2`: expected 0 or more, found {weight:g}"):
        Prior.l2(START.parameters, weight)


def test_a_gaussian_against_scipy():
    prior, other = Prior.gaussian(MEAN, COVARIANCE), multivariate_normal(MEAN, COVARIANCE)
    rng = np.random.default_rng(0)
    for theta in MEAN + 3 * rng.normal(size=(5, 4)):
        expected = other.logpdf(theta) - other.logpdf(MEAN)
        assert prior.log_density(theta) == pytest.approx(expected, rel=1e-9)
        check_gradient(prior, theta)
    assert prior.log_density(MEAN) == pytest.approx(0.0, abs=1e-10)
    assert prior.gradient(MEAN) == pytest.approx(np.zeros(4), abs=1e-10)


def test_parameters_without_covariance_have_no_prior():
    holes = COVARIANCE.copy()
    holes[1] = holes[:, 1] = np.nan
    prior = Prior.gaussian(MEAN, holes)
    known = [0, 2, 3]
    other = multivariate_normal(MEAN[known], COVARIANCE[np.ix_(known, known)])
    theta = np.array([-30.0, -400.0, 1.0, 3.0])
    assert prior.log_density(theta) == pytest.approx(other.logpdf(theta[known]) - other.logpdf(MEAN[known]))
    assert prior.gradient(theta)[1] == 0.0
    nothing = Prior.gaussian(MEAN, np.full((4, 4), np.nan))
    assert nothing.log_density(theta) == 0.0
    assert (nothing.precision == 0).all()


def test_two_priors_add_up():
    one, other = Prior.gaussian(MEAN, COVARIANCE), Prior.l2(START.parameters, 0.2)
    both, theta = one + other, np.array([-35.0, -0.2, -6.0, 1.0])
    assert both.log_density(theta) == pytest.approx(one.log_density(theta) + other.log_density(theta))
    assert both.gradient(theta) == pytest.approx(one.gradient(theta) + other.gradient(theta))


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c.__setitem__((0, 0), -1.0),
        lambda c: c.__setitem__((slice(None), 0), 0.0),
        lambda c: c.__setitem__((0, 1), 0.5),
        lambda c: c.__setitem__(([0, 1], [1, 0]), np.nan),
        lambda c: c.__setitem__(([2, 3], [3, 2]), 5.0),
    ],
    ids=["negative", "singular", "lopsided", "holes", "correlation above one"],
)
def test_an_invalid_covariance_is_refused(change):
    broken = COVARIANCE.copy()
    change(broken)
    with pytest.raises(RewardError, match="the covariance of the prior is not positive definite"):
        Prior.gaussian(MEAN, broken)


@pytest.fixture(scope="module")
def halves():
    paths = make.drawn(SCENE, TRUTH, 700, seed=4)
    return evidence_of(paths[:600]), evidence_of(paths[600:]), evidence_of(paths)


def as_prior(found):
    return Prior.gaussian(np.array(found.reward.theta), found.covariance)


def test_learning_in_two_steps_is_learning_from_all(halves):
    first, second, both = halves
    earlier, pooled = fit(first, START, 0.0), fit(both, START, 0.0)
    alone, later = fit(second, START, 0.0), fit(second, earlier.reward, 0.0, prior=as_prior(earlier))
    assert later.status is Status.CONVERGED
    away = np.abs(np.subtract(later.reward.theta, pooled.reward.theta)) / pooled.standard_errors
    assert away.max() < 0.1, "600 paths are Gaussian enough"
    assert (np.abs(np.subtract(alone.reward.theta, pooled.reward.theta)) / pooled.standard_errors).max() > 0.5
    assert later.standard_errors == pytest.approx(pooled.standard_errors, rel=0.05)
    assert later.objective == pytest.approx(later.log_likelihood + as_prior(earlier).log_density(later.reward.theta))
    assert later.log_likelihood < alone.log_likelihood


def test_the_same_data_twice_halve_the_covariance(halves):
    first = halves[0]
    once = fit(first, START, 0.0)
    twice = fit(first, START, 0.0, prior=as_prior(once))
    assert twice.reward.theta == pytest.approx(once.reward.theta, rel=1e-4)
    assert twice.covariance == pytest.approx(once.covariance / 2, rel=1e-3)


def test_a_more_certain_prior_pulls_more(halves):
    second = halves[1]
    alone = np.array(fit(second, START, 0.0).reward.theta)
    aim = alone + np.array([4.0, -0.3, 1.0, 1.0])
    scale = np.array([10.0, 1.0, 1.0, 1.0])
    distances = [
        np.linalg.norm(
            (np.array(fit(second, START, 0.0, prior=Prior.gaussian(aim, c * np.diag(scale**2))).reward.theta) - aim)
            / scale
        )
        for c in (1e4, 1e-1, 1e-2, 1e-6)
    ]
    assert distances[0] == pytest.approx(np.linalg.norm((alone - aim) / scale), rel=0.01)
    assert (np.diff(distances) < 0).all()
    assert distances[-1] < 1e-2


def test_parameters_identified_by_the_prior_alone_are_identified():
    nobody = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4])
    evidence = evidence_of(make.drawn(nobody, Reward((-35.0, -0.6, 0.0, 1.0)), 30, seed=3))
    prior = Prior.gaussian(np.array([0.0, 0.0, -3.0, 2.5]), np.diag([np.nan, np.nan, 0.25, 0.04]))
    assert fit(evidence, START, 0.0).identified.tolist() == [True, True, False, False]
    found = fit(evidence, START, 0.0, prior=prior)
    assert found.status is Status.CONVERGED
    assert found.identified.all()
    assert found.reward.theta[2:] == pytest.approx((-3.0, 2.5), rel=1e-6)
    assert found.standard_errors[2:] == pytest.approx([0.5, 0.2], rel=1e-6)
    # What tells nothing of them is the regulariser: it only says where they stay small.
    held = fit(evidence, START, 1.0)
    assert held.identified.tolist() == [True, True, False, False]


def test_a_prior_of_other_parameters_is_refused():
    evidence = evidence_of(make.drawn(SCENE, TRUTH, 2, seed=0))
    with pytest.raises(RewardError, match="`prior`: expected one of c0, a_g, found one of 4 parameters"):
        fit(evidence, Reward((-50.0, -0.5), START.terms[:2]), prior=Prior.gaussian(MEAN, COVARIANCE))
