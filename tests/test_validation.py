"""Leaving participants out: against an explicit loop, and what must come out on simulated people."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest
from executors import Here
from toy_term import Egg

from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import feature_sums, likelihood, log_likelihood
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.status import Status
from navirl_cli.irl.terms import TERMS
from navirl_cli.irl.validation import cross_validate

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -0.8, -4.0, 3.0))
START = Reward.named({})
MODELS = {"learnt": (0, 1, 2), "length + personal space": (0, 2), "no person": (0, 1), "length only": (0,)}


def mixed(reward, participants, each, seed):
    """Demonstrations whose participants come mixed up."""
    demonstrations = make.by_participants(SCENE, reward, participants, each, seed)
    return [demonstrations[i] for i in np.random.default_rng(seed).permutation(len(demonstrations))]


@pytest.fixture(scope="module")
def eight():
    return mixed(TRUTH, 8, 6, seed=4)


@pytest.fixture(scope="module")
def validated(eight):
    return cross_validate(evidence_of(eight), START, 1e-3, executor=Here())


def test_leaving_one_out_against_a_loop(eight, validated):
    names = sorted({one.participant for one in eight})
    assert validated.participants == tuple(names)
    for k, name in list(enumerate(names))[::3]:
        others = evidence_of([one for one in eight if one.participant != name])
        own = evidence_of([one for one in eight if one.participant == name])
        assert validated.steps[k] == own.steps
        for model, numbers in MODELS.items():
            learnt = fit(others, Reward.named({}, tuple(START.terms[number] for number in numbers)), 1e-3)
            assert validated.sizes[model] == len(learnt.reward.theta)
            gain = (validated.log_likelihoods["learnt"][k] - validated.log_likelihoods[model][k]) / own.steps
            assert validated.gain(model)[k] == pytest.approx(gain)
            expected = log_likelihood(own, learnt.reward)
            assert validated.log_likelihoods[model][k] == pytest.approx(expected, rel=1e-9), model
        assert validated.log_likelihoods["uniform"][k] == pytest.approx(own.uniform_log_likelihood())
        learnt = fit(others, START, 1e-3)
        found = likelihood(own, learnt.reward)
        assert validated.demonstrated[k] == pytest.approx(feature_sums(own, learnt.reward), rel=1e-6)
        assert validated.expected[k] == pytest.approx(validated.demonstrated[k] - found.gradient, rel=1e-6)
        # The gradient's own chance, and how it moves with what was learnt from the others.
        learnt_covariance = np.where(np.isfinite(learnt.covariance), learnt.covariance, 0.0)
        variance = found.information + found.information @ learnt_covariance @ found.information
        assert validated.deviation[k] == pytest.approx(np.sqrt(np.diag(variance)), rel=1e-6)


def test_the_model_without_people_lacks_every_term_about_them():
    evidence = evidence_of(mixed(TRUTH, 2, 2, seed=5))
    start = Reward.named({}, (TERMS["length"], Egg()))
    found = cross_validate(evidence, start, 1e-3, executor=Here()).log_likelihoods
    # Without the egg there is length alone, which is named once.
    assert list(found) == ["learnt", "paper", "length + personal space", "no person", "uniform"]
    assert (found["learnt"] != found["no person"]).all()


def test_per_step_is_over_all_steps(validated):
    total = validated.log_likelihoods["learnt"].sum() / validated.steps.sum()
    assert validated.per_step("learnt") == pytest.approx(total)


def test_expected_features_are_those_of_the_learnt_policy(eight, validated):
    # The first feature is the length of way: what the policy drives on average, once for each path.
    name = validated.participants[2]
    learnt = fit(evidence_of([one for one in eight if one.participant != name]), START, 1e-3).reward
    paths = make.drawn(SCENE, learnt, 2000, seed=0)
    lengths = [np.hypot(*np.diff(one.cells, axis=0).T).sum() * 0.1 for one in paths]
    error = np.std(lengths) / np.sqrt(len(lengths))
    assert validated.expected[2, 0] / 6 == pytest.approx(np.mean(lengths), abs=4 * error)


def test_the_true_model_predicts_better_than_simpler_ones(validated):
    order = ["learnt", "no person", "uniform"]
    values = [validated.per_step(model) for model in order]
    assert values[0] > values[1] + 0.1 > values[2] + 0.2
    assert (validated.log_likelihoods["learnt"] > validated.log_likelihoods["uniform"]).all()
    assert list(validated.log_likelihoods) == [*MODELS, "uniform"]


def test_equal_participants_mispredict_by_about_one_standard_error(validated):
    root = np.sqrt((validated.mismatch**2).mean(axis=0))
    assert (root > 0.5).all()
    assert (root < 2.0).all()
    assert validated.mismatch == pytest.approx(
        np.abs(validated.demonstrated - validated.expected) / validated.deviation
    )


def test_different_participants_mispredict_by_more():
    unlike = []
    for number, a_p in enumerate((-1.0, -9.0, -2.0, -8.0, -1.0, -9.0)):
        paths = make.drawn(SCENE, Reward((-32.0, -0.8, a_p, 3.0)), 15, seed=number)
        unlike += [make.demonstration(d.grid, d.cells, d.people_m, participant=f"p{number}") for d in paths]
    found = cross_validate(evidence_of(unlike), START, 0.0, executor=Here())
    assert np.sqrt((found.mismatch[:, 2] ** 2).mean()) > 2.0


def test_without_effect_of_people_the_simpler_model_predicts_as_well():
    evidence = evidence_of(mixed(Reward((-32.0, -0.8, 0.0, 3.0)), 5, 12, seed=6))
    found = cross_validate(evidence, START, 1e-3, executor=Here())
    assert found.per_step("learnt") == pytest.approx(found.per_step("no person"), abs=0.01)
    assert found.per_step("learnt") <= found.per_step("no person") + 0.003, "two parameters for nothing"


def test_the_executor_changes_nothing_and_progress_names_who_was_left_out():
    told = []
    evidence = evidence_of(mixed(TRUTH, 3, 3, seed=1))
    here = cross_validate(evidence, START, 1e-3, executor=Here())
    again = cross_validate(evidence, START, 1e-3, progress=lambda done, name: told.append((done, name)))
    assert told == [(1, "p01"), (2, "p02"), (3, "p03")]
    for model, values in here.log_likelihoods.items():
        assert (again.log_likelihoods[model] == values).all()
    assert (again.mismatch == here.mismatch).all()


def test_one_participant_cannot_be_left_out():
    evidence = evidence_of(make.by_participants(SCENE, TRUTH, 1, 3, seed=0))
    with pytest.raises(
        DemonstrationError,
        match="`cross_validate`: expected several participants, found only p01; add logs of others",
    ):
        cross_validate(evidence, START, 0.0)


def test_a_participant_without_selected_steps_is_not_left_out(eight):
    evidence = evidence_of(eight)
    some = evidence.only([np.full(len(one.cells) - 1, one.participant < "p04") for one in eight])
    found = cross_validate(some, START, 1e-3, executor=Here())
    assert found.participants == ("p01", "p02", "p03")


def test_a_parameter_that_the_others_do_not_identify_is_reported_and_gives_no_prediction():
    alone = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4])
    met = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
    truth = Reward((-32.0, -4.0, -4.0, 3.0))
    demonstrations = [
        *(replace(one, participant="p01") for one in make.drawn(met, truth, 20, 1)),
        *make.by_participants(alone, truth, 3, 8, seed=2)[8:],
    ]
    found = cross_validate(evidence_of(demonstrations), START, 1e-3, executor=Here())
    assert found.identified.tolist() == [[True, True, False, False], [True] * 4, [True] * 4]
    assert found.statuses == (Status.NOT_IDENTIFIED, Status.CONVERGED, Status.CONVERGED)
    assert np.isnan(found.mismatch[0, 2:]).all()
    assert np.isfinite(found.mismatch[:, :2]).all()
