"""Models side by side: against explicit loops, on the published study, and as a command."""

import json
import re
from dataclasses import replace
from math import sqrt
from pathlib import Path

import factories as make
import numpy as np
import pytest
import study_data
from executors import Here

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import PAPER_L2, fit
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.models import MODELS, compare_models
from navirl_cli.irl.reward import PAPER_TERMS, Reward
from navirl_cli.irl.selection import select
from navirl_cli.irl.terms import TERMS
from navirl_cli.logs.load import Forces, LoadOptions, load_recording

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -0.8, -4.0, 3.0))
LENGTH, SPACE = (tuple(TERMS[name] for name in names) for names in (("length",), ("length", "personal-space")))


@pytest.fixture(scope="module")
def demonstrations():
    shown = make.by_participants(SCENE, TRUTH, 4, 3, seed=4)
    return [shown[number] for number in (7, 0, 3, 4, 11, 9, 1, 8, 2, 5, 10)]  # mixed up, and not equally many


@pytest.fixture(scope="module")
def compared(demonstrations):
    return compare_models(evidence_of(demonstrations), [LENGTH, SPACE], PAPER_L2, executor=Here())


def test_every_model_against_a_loop(demonstrations, compared):
    assert [model.terms for model in compared.models] == [LENGTH, SPACE, PAPER_TERMS], "the paper's is always there"
    assert compared.participants == ("p01", "p02", "p03", "p04")
    for model in compared.models:
        assert (
            model.fit.log_likelihood == fit(evidence_of(demonstrations), Reward.named({}, model.terms)).log_likelihood
        )
        for number, name in enumerate(compared.participants):
            own = evidence_of([one for one in demonstrations if one.participant == name])
            others = evidence_of([one for one in demonstrations if one.participant != name])
            learnt = fit(others, Reward.named({}, model.terms))
            assert model.held_out[number] == pytest.approx(log_likelihood(own, learnt.reward), rel=1e-9)
            assert model.problems.get(name, "converged") == learnt.status
            assert compared.steps[number] == own.steps
        assert compared.per_step(model) == pytest.approx(model.held_out.sum() / compared.steps.sum())


def test_the_difference_is_a_ratio_with_its_paired_error(compared):
    model, paper = compared.models[1], compared.paper
    found = compared.difference(model, paper)
    gains = [one - other for one, other in zip(model.held_out, paper.held_out, strict=True)]
    steps = compared.steps.tolist()
    ratio = sum(gains) / sum(steps)
    variance = sum((gain - ratio * n) ** 2 for gain, n in zip(gains, steps, strict=True)) / 3
    assert found.mean == pytest.approx(compared.per_step(model) - compared.per_step(paper))
    assert found.standard_error == pytest.approx(sqrt(variance / 4) / (sum(steps) / 4))
    assert found.in_favour == sum(gain > 0 for gain in gains)


def test_the_error_is_the_usual_one_where_all_have_equally_many_steps(compared):
    equal = replace(compared, steps=np.full(4, 20))
    gains = (compared.models[0].held_out - compared.paper.held_out) / 20
    found = equal.difference(compared.models[0], compared.paper)
    assert found.mean == pytest.approx(gains.mean())
    assert found.standard_error == pytest.approx(gains.std(ddof=1) / 2)


def test_a_model_without_a_policy_is_a_problem_of_its_own(demonstrations):
    free = (TERMS["deviation"],)
    found = compare_models(evidence_of(demonstrations), [free, PAPER_TERMS], PAPER_L2, executor=Here())
    lost, paper = found.models
    assert lost.fit is None
    assert np.isnan(lost.held_out).all()
    assert "partition function" in lost.problems[""]
    assert np.isfinite(paper.held_out).all()


def test_one_participant_is_refused(demonstrations):
    alone = evidence_of([one for one in demonstrations if one.participant == "p01"])
    with pytest.raises(DemonstrationError, match="`models`: expected several participants, found only p01"):
        compare_models(alone, MODELS, PAPER_L2, executor=Here())


class TestCommand:
    @pytest.fixture(autouse=True)
    def files(self, tmp_path, demonstrations):
        write_json(
            tmp_path / "demos.json", "demonstrations", demonstrations_document(demonstrations, [], {}), force=False
        )

    def test_the_table(self, navirl, compared):
        result = navirl("models", "demos.json", "--terms", "length", "--terms", "length,personal-space")
        rows = [line.split() for line in result.stdout.splitlines() if line.startswith("length")]
        assert [row[0] for row in rows] == ["length", "length,personal-space", "length,deviation,personal-space"]
        assert [row[1] for row in rows] == ["1", "3", "4"]
        for row, model in zip(rows, compared.models, strict=True):
            assert row[2:4] == [f"{model.fit.log_likelihood:.2f}", f"{compared.per_step(model):.4f}"]
        first, *lines = result.stderr.splitlines()
        assert first == "navirl: 3 models, each fitted 5 times: to all participants, and to all but each"
        assert [line.partition(";")[0] for line in lines[:3]] == [
            "navirl: fit 5 of 15: length",
            "navirl: fit 10 of 15: length, personal-space",
            "navirl: fit 15 of 15: length, deviation, personal-space",
        ], "one line a model without a terminal, also for the paper's, which is added"
        gain = compared.difference(compared.models[0], compared.paper)
        assert rows[0][4:10] == [f"{gain.mean:.4f}", "±", f"{gain.standard_error:.4f}", str(gain.in_favour), "of", "4"]
        assert rows[2][4:] == ["-", "-", "converged"]
        assert "The best of several models looks better than it is" in result.stdout
        assert "standard errors of differences rest on 4 participants" in result.stderr

    def test_json(self, navirl, compared):
        found = json.loads(
            navirl("models", "demos.json", "--terms", "length", "--terms", "deviation", "--json", code=3).stdout
        )
        length, lost, paper = found["models"]
        assert found["participants"] == list(compared.participants)
        assert found["steps"] == compared.steps.tolist()
        assert (length["terms"], length["parameter_count"], length["status"]) == (["length"], 1, "converged")
        assert length["log_likelihood_held_out"] == pytest.approx(compared.models[0].held_out.tolist())
        assert length["difference_per_step"] == pytest.approx(
            vars(compared.difference(compared.models[0], compared.paper))
        )
        assert paper["parameters"].keys() == {"c0", "a_g", "a_p", "sigma_p"}
        assert [lost[key] for key in ("parameters", "log_likelihood", "difference_per_step", "status")] == [None] * 4
        assert lost["log_likelihood_held_out"] == [None] * 4
        assert lost["problems"][0]["left_out"] is None

    def test_a_model_that_fails_is_shown_and_ends_with_3(self, navirl):
        result = navirl("models", "demos.json", "--terms", "deviation", code=3)
        assert re.search(r"^deviation +1 +- +- +- +- +failed$", result.stdout, re.M)
        assert "- deviation, without p02: infinite partition function: " in result.stdout
        assert "navirl: deviation: infinite partition function" in result.stderr

    def test_a_reach_without_reachable_steps_is_refused(self, navirl):
        assert "--reach needs --steps reachable." in navirl("models", "demos.json", "--reach", 2, code=2).stderr

    def test_one_participant_is_refused(self, navirl, demonstrations):
        alone = [one for one in demonstrations if one.participant == "p01"]
        write_json(Path("one.json"), "demonstrations", demonstrations_document(alone, [], {}), force=False)
        assert "expected several participants, found only p01" in navirl("models", "one.json", code=1).stderr


# --- the published study: log-likelihoods and held-out values that an independent solver found -----------------------

PRESENT = (study_data.ROOT / "expected.json").is_file()
needs_study = pytest.mark.skipif(not PRESENT, reason=study_data.REASON)
PAPER, SATURATING = "length,deviation,personal-space", "length,saturating-deviation,personal-space"
#: Log-likelihood, and the optimum as c0, a_s, b_s, a_p, sigma_p and a_turn in cells for c0, else in the terms' units.
OPTIMA = {
    ("force", SATURATING): (-333.46, (-5.589, -0.863, 3.63, -4.95, 1.839)),
    ("force", f"{SATURATING},turn"): (-329.47, (-4.750, -0.737, 3.743, -4.242, 1.978, -1.239)),
    ("joystick", SATURATING): (-354.34, (-5.182, -0.587, 53.4, -4.316, 1.877)),
    ("joystick", f"{SATURATING},turn"): (-349.53, (-4.289, -0.544, 57.6, -3.688, 1.969, -1.163)),
}
HELD_OUT = {
    "length": (-0.8315, -0.9212),
    "length,personal-space": (-0.7263, -0.7671),
    PAPER: (-0.7180, -0.7728),
    "length,deviation,anisotropic-space": (-0.6909, -0.8174),
    f"{PAPER},turn": (-0.7092, -0.7525),
    SATURATING: (-0.6847, -0.7187),
    f"{SATURATING},turn": (-0.6818, -0.7111),
    "length,saturating-deviation,anisotropic-space,turn": (-0.6755, None),
}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Steps of the second force cycle and of the joystick."""
    from click.testing import CliRunner

    from navirl_cli.cli import cli

    logs = tmp_path_factory.mktemp("study")
    result = CliRunner().invoke(cli, ["import-study", str(study_data.ROOT), "-o", str(logs / "logs")])
    assert result.exit_code == 0, result.output
    found = [
        one
        for path in sorted((logs / "logs").glob("*.mcap"))
        for one in extract(load_recording(path, LoadOptions(forces=Forces.IGNORED)), ExtractSettings()).demonstrations
        if one.set is None
    ]
    force, joystick = select(found, Subset(("force",), (2,))), select(found, Subset(("joystick",)))
    return {"force": force.evidence, "joystick": joystick.evidence}


@needs_study
@pytest.mark.parametrize(
    ("condition", "names"),
    [
        pytest.param(*which, marks=pytest.mark.slow if which == ("joystick", f"{SATURATING},turn") else [])
        for which in OPTIMA
    ],
)
def test_optima_on_the_published_study(study, condition, names):
    value, theta = OPTIMA[condition, names]
    found = fit(study[condition], Reward.named({}, tuple(TERMS[name] for name in names.split(","))))
    assert found.log_likelihood == pytest.approx(value, abs=1e-2)
    assert np.array(found.reward.theta) / [10, *[1] * (len(theta) - 1)] == pytest.approx(theta, rel=2e-3)


@needs_study
@pytest.mark.slow
@pytest.mark.parametrize("condition", ["force", "joystick"])
def test_held_out_values_on_the_published_study(study, condition):
    models = {names: tuple(TERMS[name] for name in names.split(",")) for names in HELD_OUT}
    found = compare_models(study[condition], list(models.values()), PAPER_L2)
    for (names, (force, joystick)), model in zip(HELD_OUT.items(), found.models, strict=True):
        expected = force if condition == "force" else joystick
        if expected is not None:
            assert found.per_step(model) == pytest.approx(expected, abs=1e-3), names
