"""A short version of benchmarks/recovery.py: known parameters come back from demonstrations in cells."""

import sys
from pathlib import Path

import numpy as np
import pytest

# At the end of the path: benchmarks and tests have modules of the same names.
sys.path.append(str(Path(__file__).parent.parent / "benchmarks"))
import factories as make
import recovery
from path_moments import PathMoments, path_moments
from scenes import PUBLISHED

from navirl_cli.errors import RewardError
from navirl_cli.irl.bias import corrected
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward

DATA_SETS = 6


@pytest.fixture(scope="module")
def fits():
    return [recovery.recovered(number) for number in range(DATA_SETS)]


@pytest.fixture(scope="module")
def moments():
    return path_moments(PUBLISHED, recovery.passing_scene(), 20_000, 1)


def test_most_intervals_cover_the_truth(fits):
    # 24 intervals of 95 %: of ten thousand correct programs less than ten miss five.
    assert recovery.coverage(fits).sum() * DATA_SETS >= 20


def test_the_mean_lies_at_the_truth_but_for_the_bias_that_theory_expects(fits, moments):
    errors = moments.standard_errors(recovery.DEMONSTRATIONS)
    mean, _ = recovery.bias([one.corrected for one in fits], errors)
    # Chance moves the mean of six by 1/sqrt(6) = 0.41 standard errors.
    assert np.abs(mean).max() < 4 / np.sqrt(DATA_SETS)


def test_reported_standard_errors_are_those_of_the_expected_information(fits, moments):
    reported = np.median([one.errors for one in fits], axis=0)
    assert reported == pytest.approx(moments.standard_errors(recovery.DEMONSTRATIONS), rel=0.3)


def test_the_default_regulariser_has_no_relevant_effect(fits, moments):
    errors = moments.standard_errors(recovery.DEMONSTRATIONS)
    assert max(np.abs((one.regularised - one.theta) / errors).max() for one in fits) < 0.05


def test_standard_errors_and_bias_by_theory_are_those_of_sampled_paths(moments):
    errors, bias = recovery.theory()
    assert errors == pytest.approx(moments.standard_errors(recovery.DEMONSTRATIONS), rel=0.03)
    sampled = moments.bias(recovery.DEMONSTRATIONS)
    assert bias / errors == pytest.approx(sampled / errors, abs=0.05)


def test_only_a_maximum_of_the_likelihood_can_be_corrected():
    evidence = evidence_of(make.drawn(make.scene_on(make.open_grid(8, 5), [0, 2], [7, 2]), PUBLISHED, 3, seed=0))
    found = fit(evidence, Reward((-50.0,), PUBLISHED.terms[:1]), l2=1.0)
    with pytest.raises(RewardError, match="`correct_bias`: the bias is known only at a maximum of the likelihood"):
        corrected(evidence, found)


def test_theory_on_a_binomial_share():
    """The log-odds of a coin, whose bias is known: (p - 1/2) / (n p (1 - p))."""
    p, n = 0.8, 50
    variance = p * (1 - p)
    # One path is one throw: first derivative (heads - p), no second derivative of the reward.
    skewness = np.full((1, 1, 1), variance * (1 - 2 * p))
    moments = PathMoments(np.full((1, 1), variance), skewness, np.zeros((1, 1, 1)))
    assert moments.bias(n) == pytest.approx([(p - 0.5) / (n * variance)])
    assert moments.standard_errors(n) == pytest.approx([1 / np.sqrt(n * variance)])
