"""What a fit is asked besides: refused early, and never at the cost of the fit."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest

from navirl_cli.errors import ArgumentError, DemonstrationError, RewardError
from navirl_cli.irl.analyses import Questions, answers
from navirl_cli.irl.bias import expected_bias, first_order_bias
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import PAPER_L2, fit
from navirl_cli.irl.intervals import Errors, Kind
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps
from navirl_cli.irl.status import Status

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -4.0, -4.0, 3.0))


@pytest.fixture(scope="module")
def evidence():
    return evidence_of(make.by_participants(SCENE, TRUTH, 2, 4, seed=2))


@pytest.mark.parametrize(
    ("questions", "changes", "message"),
    [
        (Questions(cross_validate=True), {"prior": True}, "may know: leave out `prior`, or `cross_validate`"),
        (Questions(correct_bias=True), {"prior": True}, "without a prior: leave out `prior`, or `c"),
        (Questions(correct_bias=True), {"steps": Steps.CONTACT}, "without a prior: leave out `steps`, or `c"),
        (
            Questions(correct_bias=True, bootstrap=2, profiles=("c0",)),
            {},
            "leave out `bootstrap` and `profile`, or ask for them",
        ),
        (
            Questions(correct_bias=True),
            {"l2": 0.5},
            "maximum likelihood: expected `l2` <= 0.001, found 0.5",
        ),
    ],
)
def test_analyses_that_exclude_each_other_are_refused_before_reading(questions, changes, message):
    arguments = {"steps": Steps.ALL, "prior": False, "l2": PAPER_L2}
    Questions(correct_bias=True).check_arguments(**arguments)
    with pytest.raises(ArgumentError, match=message):
        questions.check_arguments(**arguments | changes)


def test_analyses_that_the_data_do_not_allow_are_refused_before_the_fit(evidence):
    Questions(bootstrap=2, profiles=("c0",), cross_validate=True).check(evidence, TRUTH)
    with pytest.raises(RewardError, match="expected one of 'c0', 'a_g', 'a_p', 'sigma_p', found 'c1'"):
        Questions(profiles=("c1",)).check(evidence, TRUTH)
    alone = evidence_of(make.drawn(SCENE, TRUTH, 4, seed=1))
    for questions in (Questions(bootstrap=2), Questions(cross_validate=True)):
        with pytest.raises(DemonstrationError, match="expected several participants"):
            questions.check(alone, TRUTH)


def test_a_failed_analysis_keeps_the_fit_and_the_other_analyses(evidence, monkeypatch):
    def no_answer(*_args, **_options):
        raise RewardError("a better fit was found")

    monkeypatch.setattr("navirl_cli.irl.analyses.profile", no_answer)
    before = fit(evidence, TRUTH)
    found, analyses, lost = answers(evidence, before, Questions(profiles=("c0",), cross_validate=True))
    assert found.reward is before.reward
    assert found.status in {before.status, Status.OPEN_INTERVAL}
    assert lost == ["a better fit was found"]
    assert analyses.profiles == ()
    assert analyses.validation is not None


def test_intervals_belong_to_every_fit_and_open_ones_to_its_status(evidence):
    plain = fit(evidence, TRUTH)
    found, analyses, _ = answers(evidence, plain, Questions())
    assert [one.errors for one in analyses.intervals] == [Errors.PARTICIPANT, Errors.MODEL], "two participants"
    assert analyses.intervals[0].kind is Kind.PROFILE, "eight demonstrations"
    assert (found.status is Status.OPEN_INTERVAL) == analyses.intervals[0].is_open
    for kind in (Kind.WALD, Kind.NONE):
        _, analyses, _ = answers(evidence, plain, Questions(intervals=kind))
        assert [one.kind for one in analyses.intervals] == ([kind] * 2 if kind is Kind.WALD else [])


def test_the_expected_bias_is_known_for_whole_paths_that_were_not_corrected(evidence):
    plain = fit(evidence, TRUTH)
    for questions, whole, known in ((Questions(), True, True), (Questions(), False, False)):
        _, analyses, _ = answers(evidence, plain, replace(questions, intervals=Kind.NONE), whole_paths=whole)
        assert (analyses.bias is not None) == known
    with_prior = replace(plain, l2=0.5)
    assert expected_bias(evidence, with_prior) is None
    assert expected_bias(evidence, plain) == pytest.approx(
        first_order_bias(evidence, plain.reward, np.isfinite(plain.standard_errors))
    )
