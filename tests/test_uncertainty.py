"""Errors of a fit: inverse information, blind directions, the sandwich by participant, condition numbers."""

import factories as make
import numpy as np
import pytest

from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import likelihood
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.uncertainty import clustered, condition_number, correlation, observed

ALL = np.ones(3, dtype=bool)
NONE = np.zeros((3, 3))
ROOT = np.array([[2.0, 0, 0], [0.5, 1.0, 0], [-0.3, 0.4, 0.7]])
INFORMATION = ROOT @ ROOT.T


def test_with_all_parameters_identified_the_covariance_is_the_inverse():
    covariance, blind = observed(INFORMATION, NONE, ALL)
    assert covariance == pytest.approx(np.linalg.inv(INFORMATION))
    assert not blind.any()


def test_inactive_parameters_have_no_covariance():
    told = np.array([True, False, True])
    covariance, blind = observed(INFORMATION, NONE, told)
    block = np.ix_(told, told)
    assert covariance[block] == pytest.approx(np.linalg.inv(INFORMATION[block]))
    assert np.isnan(covariance[1]).all()
    assert np.isnan(covariance[:, 1]).all()
    assert not blind.any()
    nothing, blind = observed(INFORMATION, NONE, ~ALL)
    assert np.isnan(nothing).all()
    assert not blind.any()


def test_a_direction_without_information_makes_its_parameters_blind():
    # Only the sum of the last two is told: their difference is a blind direction.
    information = np.array([[4.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0]])
    covariance, blind = observed(information, NONE, ALL)
    assert blind.tolist() == [False, True, True]
    assert covariance[0, 0] == pytest.approx(0.25)
    assert np.isnan(covariance[1:]).all()
    assert np.isnan(covariance[:, 1:]).all()


def test_the_regulariser_identifies_no_parameter_but_lowers_the_variance():
    information = np.array([[4.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 1.0]])
    covariance, blind = observed(information + 0.5 * np.eye(3), 0.5 * np.eye(3), ALL)
    assert blind.tolist() == [False, True, True]
    assert covariance[0, 0] == pytest.approx(1 / 4.5)


def test_a_saddle_is_no_information():
    covariance, blind = observed(np.diag([2.0, -1.0, 3.0]), NONE, ALL)
    assert blind.tolist() == [False, True, False]
    assert np.diag(covariance)[[0, 2]] == pytest.approx([1 / 2, 1 / 3])


def sandwich(covariance, scores, participants):
    """c/(c - 1) sum over participants of A s s' A, s a participant's sum of scores about the participants' mean."""
    names = sorted(set(participants))
    sums = {name: np.zeros(len(covariance)) for name in names}
    for name, score in zip(participants, scores, strict=True):
        sums[name] = sums[name] + score
    mean = sum(sums.values()) / len(names)
    total = np.zeros_like(covariance)
    for name in names:
        pulled = covariance @ (sums[name] - mean)
        total += np.outer(pulled, pulled)
    return total * len(names) / (len(names) - 1)


@pytest.mark.parametrize("participants", [["a", "b", "a", "c", "b", "a"], list("abcdef"), list("bbbaaa")])
def test_the_sandwich_against_a_loop(participants):
    scores = np.random.default_rng(3).normal(size=(6, 3))
    covariance = np.linalg.inv(INFORMATION)
    assert clustered(covariance, scores, participants) == pytest.approx(sandwich(covariance, scores, participants))


def test_the_sandwich_leaves_out_parameters_without_covariance():
    scores = np.random.default_rng(4).normal(size=(5, 3))
    holes = np.full((3, 3), np.nan)
    holes[:2, :2] = np.linalg.inv(INFORMATION[:2, :2])
    robust = clustered(holes, scores, list("abcab"))
    assert robust[:2, :2] == pytest.approx(sandwich(holes[:2, :2], scores[:, :2], list("abcab")))
    assert np.isnan(robust[2]).all()
    assert np.isnan(robust[:, 2]).all()


def test_one_participant_has_no_scatter():
    assert clustered(np.eye(3), np.ones((4, 3)), ["a"] * 4) is None


def test_equal_participants_have_no_scatter_although_their_demonstrations_have():
    scores = np.array([[1.0, 0, 0], [-1.0, 0, 0], [2.0, 1, 0], [-2.0, -1, 0]])
    assert clustered(np.eye(3), scores, list("aabb")) == pytest.approx(np.zeros((3, 3)))
    assert clustered(np.eye(3), scores, list("abab"))[0, 0] == pytest.approx(2 * (3**2 + 3**2))


def test_correlations():
    covariance = np.array([[4.0, 1.0], [1.0, 9.0]])
    assert correlation(covariance) == pytest.approx(np.array([[1, 1 / 6], [1 / 6, 1]]))
    covariance = np.array([[4.0, np.nan], [np.nan, np.nan]])
    assert correlation(covariance)[0, 0] == 1.0
    assert np.isnan(correlation(covariance)[1]).all()


@pytest.mark.parametrize("r", [0.0, 0.5, -0.9])
def test_the_condition_number_of_two_parameters_is_independent_of_units(r):
    # The eigenvalues of [[1, r], [r, 1]] are 1 + |r| and 1 - |r|.
    for units in ([1.0, 1.0], [1e3, 1e-4]):
        covariance = np.array([[1.0, r], [r, 1.0]]) * np.outer(units, units)
        assert condition_number(covariance) == pytest.approx((1 + abs(r)) / (1 - abs(r)))


def test_condition_numbers_at_the_ends():
    assert condition_number(np.diag([4.0, np.nan, 1e-3])) == pytest.approx(1.0)
    assert np.isnan(condition_number(np.full((2, 2), np.nan)))
    assert condition_number(np.array([[1.0, 2.0], [2.0, 1.0]])) == np.inf


def test_a_fit_reports_the_sandwich_of_its_own_scores():
    scene = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4], [[0.8, 0.4]])
    truth = Reward((-32.0, -0.8, -4.0, 3.0))
    evidence = evidence_of(make.by_participants(scene, truth, 6, 8, seed=2))
    found = fit(evidence, Reward.named({}), 0.0)
    assert found.participants == 6
    scores = likelihood(evidence, found.reward).scores
    assert found.clustered == pytest.approx(sandwich(found.covariance, scores, evidence.participants), rel=1e-6)
    assert found.clustered_errors == pytest.approx(np.sqrt(np.diag(found.clustered)))
    assert found.correlation == pytest.approx(correlation(found.covariance))
    assert found.condition_number == pytest.approx(np.linalg.cond(found.correlation))
    # These participants differ by chance only, so that both errors are of one size.
    assert (found.clustered_errors < 3 * found.standard_errors).all()
    assert (found.clustered_errors > found.standard_errors / 4).all()


def test_participants_who_do_differ_make_the_clustered_errors_larger():
    scene = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4], [[0.8, 0.4]])
    unlike = []
    for number, a_p in enumerate((-1.0, -9.0, -2.0, -8.0, -1.0, -9.0)):
        paths = make.by_participants(scene, Reward((-32.0, -0.8, a_p, 3.0)), 1, 30, seed=number)
        unlike += [make.demonstration(d.grid, d.cells, d.people_m, participant=f"p{number}") for d in paths]
    found = fit(evidence_of(unlike), Reward.named({}), 0.0)
    assert found.clustered_errors[2] > 2 * found.standard_errors[2]


def test_a_participant_without_selected_steps_does_not_count():
    scene = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4], [[0.8, 0.4]])
    demonstrations = make.by_participants(scene, Reward((-32.0, -2.0, -4.0, 3.0)), 3, 8, seed=2)
    evidence = evidence_of(demonstrations)
    for names in (["p01"], ["p01", "p03"]):
        some = evidence.only([np.full(len(d.cells) - 1, d.participant in names) for d in demonstrations])
        alone = evidence_of([d for d in demonstrations if d.participant in names])
        found, expected = (fit(one, Reward.named({})) for one in (some, alone))
        assert found.reward.theta == pytest.approx(expected.reward.theta, rel=1e-6)
        assert (found.participants, found.demonstrations) == (len(names), 8 * len(names))
        if len(names) == 1:
            assert found.clustered is None
        else:
            assert found.clustered == pytest.approx(expected.clustered, rel=1e-6)


def test_parameters_identified_by_a_prior_alone_have_its_error_by_participant():
    nobody = make.scene_on(make.open_grid(16, 9), [0, 4], [15, 4])
    evidence = evidence_of(make.by_participants(nobody, Reward((-35.0, -2.0, 0.0, 1.0)), 5, 6, seed=3))
    prior = Prior.gaussian(np.array([0.0, 0.0, -3.0, 2.5]), np.diag([np.nan, np.nan, 0.25, 0.04]))
    found = fit(evidence, Reward.named({}), 0.0, prior=prior)
    assert found.standard_errors[2:] == pytest.approx([0.5, 0.2], rel=1e-6)
    assert found.clustered_errors[2:] == pytest.approx([0.5, 0.2], rel=1e-6)
