"""What a fit is asked besides: refused early, and never at the cost of the fit."""

import factories as make
import pytest

from navirl_cli.errors import ArgumentError, DemonstrationError, RewardError
from navirl_cli.irl.analyses import Questions, answers
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import PAPER_L2, fit
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import Steps

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -4.0, -4.0, 3.0))


@pytest.fixture(scope="module")
def evidence():
    return evidence_of(make.by_participants(SCENE, TRUTH, 2, 4, seed=2))


@pytest.mark.parametrize(
    ("questions", "changes", "message"),
    [
        (Questions(cross_validate=True), {"prior": True}, "`cross_validate` and `prior` exclude each other"),
        (Questions(correct_bias=True), {"prior": True}, "`correct_bias` needs all steps and no prior"),
        (Questions(correct_bias=True), {"steps": Steps.CONTACT}, "`correct_bias` needs all steps and no prior"),
        (Questions(correct_bias=True, bootstrap=2), {}, "leave out `prior`, `steps`, `bootstrap`"),
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
    assert found is before
    assert lost == ["a better fit was found"]
    assert analyses.profiles == ()
    assert analyses.validation is not None
