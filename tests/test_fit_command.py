"""``navirl fit`` with all that can be asked of it, and the figure of profiles: text, files, refusals."""

import json
from dataclasses import replace
from pathlib import Path

import factories as make
import numpy as np
import pytest
from click.testing import CliRunner

from navirl_cli.artefacts.demonstrations import demonstrations_document, read_demonstrations
from navirl_cli.artefacts.rewards import read_reward, reward_document
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.cli import cli
from navirl_cli.demos.demonstration import Contact
from navirl_cli.demos.timing import steps_in_contact
from navirl_cli.errors import RewardError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.profile import fall_at
from navirl_cli.irl.reward import Reward
from navirl_cli.reports.fit_remarks import warnings

SCENE = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
TRUTH = Reward((-32.0, -4.0, -4.0, 3.0))
NAMES = ["c0", "a_g", "a_p", "sigma_p"]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Demonstrations of four participants, every other one pushed at; of one; and of nobody pushing; and rewards."""
    folder = tmp_path_factory.mktemp("fit")
    pushed = [Contact(0.9, 1.9, 8.0, (1.0, 2.0)), Contact(2.4, 2.45, 5.0, (0.0, 1.0))]
    every = [
        replace(one, contacts=tuple(pushed), force_n=np.zeros((len(one.t_s), 2))) if number % 2 else one
        for number, one in enumerate(make.by_participants(SCENE, TRUTH, 4, 8, seed=2))
    ]
    for name, some in (("demos", every), ("one", every[:8]), ("quiet", every[::2])):
        write_json(folder / f"{name}.json", "demonstrations", demonstrations_document(some, [], {}), force=False)
    coarse = replace(make.open_grid(14, 8), resolution_m=0.2)
    other = [make.demonstration(coarse, [[0, 3], [1, 3], [2, 4]])]
    write_json(folder / "coarse.json", "demonstrations", demonstrations_document(other, [], {}), force=False)
    everything = ["--bootstrap", 6, "--seed", 3, "--profile", "sigma_p", "--profile", "a_g"]
    for name, options in (("reward", []), ("full", [*everything, "--cross-validate", "participant"])):
        words = ["fit", folder / "demos.json", "-o", folder / f"{name}.json", *options]
        result = CliRunner().invoke(cli, [str(word) for word in words], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        (folder / f"{name}.txt").write_text(result.stdout)
    return folder


def values_of(document, key="value"):
    return [parameter[key] for parameter in document["parameters"]]


@pytest.fixture(scope="module")
def evidence(files):
    return evidence_of(read_demonstrations(files / "demos.json"))


@pytest.fixture(scope="module")
def full(files):
    return read_json(files / "full.json", "reward")


def test_analyses_that_were_not_requested_are_absent(files, full):
    document = read_json(files / "reward.json", "reward")
    assert (document["bootstrap"], document["profiles"], document["cross_validation"]) == (None, [], None)
    assert (document["method"], document["prior"], document["l2"]) == ("newton", False, 1e-3)
    for key in ("parameters", "covariance", "log_likelihood"):
        assert full[key] == document[key], "the fit does not depend on what else is asked for"


def test_errors_by_participant_and_correlations_are_written_and_printed(files, evidence):
    document, text = read_json(files / "reward.json", "reward"), (files / "reward.txt").read_text()
    found = fit(evidence, Reward.named({}))
    assert values_of(document) == pytest.approx(found.reward.theta)
    assert values_of(document, "standard_error") == pytest.approx(found.standard_errors)
    assert values_of(document, "standard_error_clustered") == pytest.approx(found.clustered_errors)
    assert np.array(document["covariance_clustered"]) == pytest.approx(found.clustered)
    assert document["condition_number"] == pytest.approx(found.condition_number)
    assert text.startswith(f"Status: {document['status']}: ")
    heading, *_ = rows = text.splitlines()[2:]
    assert heading.split("  ")[0] == "parameter"
    assert heading.index("95 % interval") < heading.index("as if one person") < heading.index("error by participant")
    assert rows[3].split()[:2] == ["a_p", f"{found.reward.theta[2]:.4f}"]
    figures = found.clustered_errors[2], found.standard_errors[2]
    assert " ".join(f"{figure:.4f}" for figure in figures) in " ".join(rows[3].split())
    front, behind = document["intervals"]
    assert (front["errors"], behind["errors"]) == ("participant", "model")
    for wide, narrow in zip(front["parameters"], behind["parameters"], strict=True):
        assert wide["lower"] is None or wide["lower"] <= narrow["lower"]
        assert wide["upper"] is None or wide["upper"] >= narrow["upper"]
    lines = [line.split() for line in text.splitlines()]
    assert [row for row in lines if row[:1] == ["sigma_p"]][-1][1:] == [f"{r:.2f}" for r in found.correlation[3]]
    assert f"Condition number of the correlations: {found.condition_number:.3g}." in text
    assert f"32 demonstrations of 4 participants, {found.steps} steps; " in text


def test_a_single_participant_has_no_errors_by_participant(navirl, files):
    text = navirl("fit", files / "one.json", "-o", "r.json").stdout
    assert "by participant" not in text
    assert "8 demonstrations of 1 participant, " in text
    document = read_json(Path("r.json"), "reward")
    assert document["covariance_clustered"] is None
    assert values_of(document, "standard_error_clustered") == [None] * 4


def test_bootstrap(files, full):
    drawn, text = full["bootstrap"], (files / "full.txt").read_text()
    theta = np.array(drawn["theta"])
    assert theta.shape == (6, 4)
    assert (drawn["seed"], drawn["failed"]) == (3, 0)
    assert drawn["standard_errors"] == pytest.approx(theta.std(axis=0, ddof=1))
    assert drawn["interval"] == "bca"
    assert (theta.min(axis=0) <= drawn["lower"]).all()
    assert (drawn["upper"] <= theta.max(axis=0)).all()
    assert "Bootstrap: 6 draws of 4 participants (seed 3). Its intervals are approximate, too narrow" in text
    assert f"{drawn['lower'][0]:.4f} to {drawn['upper'][0]:.4f}" in text.splitlines()[3]
    assert "bootstrap 95 %" in text.splitlines()[2]


def test_profiles(files, full):
    sigma_p, a_g = full["profiles"]
    assert (sigma_p["parameter"], a_g["parameter"], sigma_p["level"]) == ("sigma_p", "a_g", 0.95)
    best = values_of(full)[3]
    assert sigma_p["lower"] < best < sigma_p["upper"]
    assert best in sigma_p["values"]
    assert max(sigma_p["relative_log_likelihood"]) == 0.0
    at = {
        round(value, 9): fallen
        for value, fallen in zip(sigma_p["values"], sigma_p["relative_log_likelihood"], strict=True)
    }
    assert at[round(sigma_p["lower"], 9)] == pytest.approx(-fall_at(0.95), rel=2e-3)
    text = (files / "full.txt").read_text()
    row = next(line for line in text.splitlines()[6:] if line.startswith("sigma_p") and " 95 " in line)
    assert row.split()[1:4] == ["95", f"{sigma_p['lower']:.4f}", f"{sigma_p['upper']:.4f}"]
    back = read_reward(files / "full.json").profiles
    assert [one.name for one in back] == ["sigma_p", "a_g"]
    assert back[0].values == pytest.approx(sigma_p["values"])
    assert (back[0].lower, back[0].upper, back[0].level) == (sigma_p["lower"], sigma_p["upper"], 0.95)


def test_cross_validation(files, full, evidence):
    found, text = full["cross_validation"], (files / "full.txt").read_text()
    assert found["left_out"] == ["p01", "p02", "p03", "p04"]
    assert sum(found["steps"]) == full["steps"]
    assert list(found["models"]) == ["learnt", "length + personal space", "no person", "length only", "uniform"]
    for model in found["models"].values():
        assert model["log_likelihood_per_step"] == pytest.approx(sum(model["log_likelihood"]) / full["steps"])
    assert sum(found["models"]["uniform"]["log_likelihood"]) == pytest.approx(evidence.uniform_log_likelihood())
    assert list(found["features"]) == NAMES
    row = next(line for line in text.splitlines() if line.startswith("learnt "))
    assert row.split()[1:3] == ["4", f"{found['models']['learnt']['log_likelihood_per_step']:.4f}"]
    lengths, learnt = (np.array(found["models"][model]["log_likelihood"]) for model in ("length only", "learnt"))
    paired = (learnt - lengths) / found["steps"]
    row = next(line for line in text.splitlines() if line.startswith("length only "))
    error = paired.std(ddof=1) / np.sqrt(4)
    assert row.split()[-5:] == [f"{paired.mean():+.4f}", f"{error:.4f}", f"{(paired > 0).sum()}", "of", "4"]
    root = np.sqrt(np.mean(np.square(found["features"]["a_p"]["mismatch_standard_errors"])))
    table = text[text.index("|f - E f|") :].splitlines()
    assert table[4].split()[:2] == ["a_p", f"{root:.2f}"]


def test_json_on_stdout_is_what_is_in_the_file(navirl, files):
    shown = json.loads(navirl("fit", files / "one.json", "-o", "r.json", "--json", "--profile", "a_p").stdout)
    written = read_json(Path("r.json"), "reward")
    assert all(written[key] == value for key, value in shown.items())
    assert [one["parameter"] for one in shown["profiles"]] == ["a_p"]


def test_adam(navirl, files):
    text = navirl("fit", files / "demos.json", "-o", "r.json", "--method", "adam").stdout
    document, newton = read_json(Path("r.json"), "reward"), read_json(files / "reward.json", "reward")
    assert document["method"] == "adam"
    assert document["status"] in {"converged", "open interval"}
    assert f"; {document['iterations']} iterations, " in text
    assert document["iterations"] > 3 * newton["iterations"]
    assert newton["log_likelihood"] - 1.0 < document["log_likelihood"] <= newton["log_likelihood"]


def test_steps_in_contact_alone(navirl, files, evidence):
    text = navirl("fit", files / "demos.json", "-o", "r.json", "--steps", "contact", "--l2", "0.1").stdout
    masks = [steps_in_contact(one) for one in read_demonstrations(files / "demos.json")]
    document = read_json(Path("r.json"), "reward")
    assert document["steps"] == sum(int(mask.sum()) for mask in masks) == 16 * 6
    assert values_of(document) == pytest.approx(fit(evidence.only(masks), Reward.named({}), 0.1).reward.theta, rel=1e-6)
    assert "16 demonstrations of 4 participants, 96 steps; " in text
    message = navirl("fit", files / "quiet.json", "-o", "q.json", "--steps", "contact", code=1).stderr
    assert message == "navirl: --steps contact: none of the demonstrations holds a contact; learn from all steps\n"


def test_a_prior_is_an_earlier_reward_with_its_covariance(navirl, files):
    navirl("fit", files / "one.json", "-o", "r.json", "--prior", files / "reward.json")
    document, earlier = read_json(Path("r.json"), "reward"), read_json(files / "reward.json", "reward")
    assert (document["prior"], document["l2"]) == (True, 1e-3)
    assert [one["file"] for one in document["inputs"]] == ["one.json", "reward.json"]
    assert list(document["initial"].values()) == pytest.approx(values_of(earlier))
    prior = Prior.gaussian(np.array(values_of(earlier)), np.array(earlier["covariance"]))
    one = evidence_of(read_demonstrations(files / "one.json"))
    assert values_of(document) == pytest.approx(fit(one, Reward.named({}), 0.0, prior=prior).reward.theta, rel=1e-4)
    assert all(
        new < old
        for new, old in zip(values_of(document, "standard_error"), values_of(earlier, "standard_error"), strict=True)
    )
    with_start = ("--init", "c0=-44", "--l2", "0.5", "--json")
    other = json.loads(
        navirl("fit", files / "one.json", "-o", "s.json", "--prior", files / "reward.json", *with_start).stdout
    )
    assert (other["initial"]["c0"], other["l2"]) == (-44.0, 0.5)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--prior", "{}/reward.json", "--cross-validate", "participant"), 2, "leave out --prior, or --cross-validate"),
        (("--profile", "nonsense"), 1, "navirl: --profile: expected one of 'c0', 'a_g', 'a_p', 'sigma_p', found 'n"),
        (("--bootstrap", "1"), 2, "Invalid value for '--bootstrap': 1 is not in the range"),
        (("--cross-validate", "trial"), 2, "for '--cross-validate': expected 'participant', found 'trial'"),
        (("--method", "simplex"), 2, "Invalid value for '--method'"),
        (("--steps", "some"), 2, "Invalid value for '--steps'"),
        (("--prior", "none.json"), 1, "navirl: none.json: cannot be read"),
        (("--prior", "{}/demos.json"), 1, "expected navirl reward (format 'navirl/reward')"),
    ],
)  # fmt: skip
def test_invalid_requests_are_refused_and_no_file_is_written(navirl, files, tmp_path, words, code, message):
    words = [word.format(files) for word in words]
    result = navirl("fit", files / "demos.json", "-o", "r.json", *words, code=code)
    assert message in result.stderr
    assert result.stdout == ""
    if code == 1:
        assert result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_prior_on_other_cells_is_refused(navirl, files):
    message = navirl("fit", files / "coarse.json", "-o", "r.json", "--prior", files / "reward.json", code=1).stderr
    assert "reward.json: learnt on cells of 0.1 m, but the demonstrations lie on cells of 0.2 m" in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--bootstrap", "5"), "navirl: --bootstrap: expected several participants, found only p01"),
        (("--cross-validate", "participant"), "navirl: --cross-validate: expected several participants, found"),
    ],
)  # fmt: skip
def test_analyses_of_several_participants_are_refused_for_one(navirl, files, words, message):
    stderr = navirl("fit", files / "one.json", "-o", "r.json", *words, code=1).stderr
    assert stderr.startswith(message)
    assert stderr.count("\n") == 1


def test_a_prior_with_an_invalid_covariance_is_refused(navirl, files):
    document = json.loads((files / "reward.json").read_text())
    document["covariance"][0][0] = -1.0
    Path("broken.json").write_text(json.dumps(document))
    stderr = navirl("fit", files / "demos.json", "-o", "r.json", "--prior", "broken.json", code=1).stderr
    assert "the covariance of the prior is not positive definite" in stderr


def test_the_same_seed_writes_the_same_bytes(navirl, files):
    words = ("fit", files / "demos.json", "--bootstrap", "2", "--profile", "c0")
    for number, options in enumerate(((), ("--seed", "0"), ("--seed", "1"))):
        navirl(*words, *options, "-o", f"{number}.json")
    contents = [Path(f"{number}.json").read_bytes() for number in range(3)]
    assert contents[0] == contents[1]
    assert contents[1] != contents[2]


def content_of(evidence):
    """Of a reward file, as if all participants were p01 to p04 and all parameters certain."""
    document = reward_document(fit(evidence, Reward.named({})), [], [], 0.1)
    for one in document["parameters"]:
        one["standard_error"] = 0.49 * abs(one["value"])
    return {**document, "participants": ["p01", "p02", "p03", "p04"]}


def test_strongly_correlated_parameters_are_named(evidence):
    content = {**content_of(evidence), "participants": [f"p{n:02d}" for n in range(10)]}
    assert warnings(content) == []
    covariance = np.array(content["covariance"])
    covariance[1, 2] = covariance[2, 1] = -0.99 * np.sqrt(covariance[1, 1] * covariance[2, 2])
    (line,) = warnings({**content, "covariance": covariance})
    assert line.startswith("a_g and a_p are strongly correlated (-0.990): the data barely separate them; read them")
    covariance[1] = covariance[:, 1] = np.nan
    assert warnings({**content, "covariance": covariance}) == []


def test_an_uncertain_parameter_is_named(evidence):
    content = {**content_of(evidence), "participants": ["p01"]}
    content["parameters"][2]["standard_error"] = 0.51 * abs(content["parameters"][2]["value"])
    assert warnings(content) == ["a_p is uncertain: its standard error exceeds half of its value"]


def test_few_participants_are_too_few_for_errors_by_participant(evidence):
    content = content_of(evidence)
    (line,) = warnings(content)
    assert line.startswith(
        "errors and intervals by participant rest on 4 participants: they are rough with fewer than 10"
    )
    assert warnings({**content, "participants": ["p01"]}) == []


def test_a_value_outside_its_own_interval_is_named(evidence):
    content = {**content_of(evidence), "participants": ["p01"], "l2": 1e-3}
    values = {one["name"]: one["value"] for one in content["parameters"]}
    ends = [{"name": name, "lower": value - 1, "upper": value + 1} for name, value in values.items()]
    assert warnings({**content, "intervals": [{"parameters": ends}]}) == []
    ends[2] |= {"upper": values["a_p"] - 0.5}
    (line,) = warnings({**content, "intervals": [{"parameters": ends}] * 2})
    assert line.startswith("the value of a_p lies outside the interval: the regulariser decides it")
    ends[0] |= {"lower": values["c0"] + 0.5, "upper": None}
    (line,) = warnings({**content, "intervals": [{"parameters": ends}]})
    assert line.startswith("the values of c0 and a_p lie outside the interval: the regulariser decides them")


def test_demonstrations_without_intervention_are_reported(navirl, files):
    demonstrations = read_demonstrations(files / "one.json")
    some = [replace(one, corrected=number > 1) for number, one in enumerate(demonstrations)]
    write_json(Path("some.json"), "demonstrations", demonstrations_document(some, [], {}), force=False)
    told = navirl("fit", "some.json", "-o", "a.json").stderr
    assert "navirl: 2 of 8 demonstrations show no intervention: the reward also learns what the robot does" in told
    for options in (("--only-corrected",), ("--condition", "force")):
        assert "no intervention" not in navirl("fit", "some.json", "-o", "b.json", "--force", *options).stderr


def test_input_files_are_not_replaced(navirl, files):
    before = (files / "one.json").read_bytes()
    told = navirl("fit", files / "one.json", "-o", files / "one.json", "--force", code=2).stderr
    assert "expected another file than the input" in told
    navirl("fit", files / "one.json", "--prior", files / "reward.json", "-o", files / "reward.json", "--force", code=2)
    assert (files / "one.json").read_bytes() == before


def test_a_failed_analysis_keeps_the_fit(navirl, files, monkeypatch):
    def nothing(*_args, **_options):
        raise RewardError("`profile` a_p: the profile found a better fit")

    monkeypatch.setattr("navirl_cli.irl.analyses.profile", nothing)
    told = navirl("fit", files / "one.json", "-o", "r.json", "--profile", "a_p", code=3)
    assert told.stderr.endswith("navirl: --profile a_p: the profile found a better fit\n")
    assert read_reward(Path("r.json")).profiles == ()


def test_a_prior_must_be_a_maximum_and_should_be_of_others(navirl, files):
    told = navirl("fit", files / "one.json", "-o", "r.json", "--prior", files / "reward.json").stderr
    assert "navirl: the prior was learnt from p01/1, p01/2" in told
    assert "these demonstrations count twice" in told
    document = json.loads((files / "reward.json").read_text())
    Path("early.json").write_text(json.dumps({**document, "status": "stopped early"}))
    told = navirl("fit", files / "one.json", "-o", "s.json", "--prior", "early.json", code=1).stderr
    assert "navirl: --prior: expected a fit at its maximum, found one that ended with stopped early" in told


def test_the_bias_is_subtracted_and_reported(navirl, files):
    plain = read_json(files / "reward.json", "reward")
    text = navirl("fit", files / "demos.json", "-o", "r.json", "--correct-bias").stdout
    found = read_json(Path("r.json"), "reward")
    bias = np.array(values_of(found, "bias_subtracted"))
    assert np.array(values_of(found)) + bias == pytest.approx(values_of(plain))
    assert np.abs(bias / values_of(found, "standard_error")).max() < 1
    assert found["log_likelihood"] < plain["log_likelihood"]
    assert "bias subtracted" in text
    assert values_of(plain, "bias_subtracted") == [None] * 4
    for options in (("--prior", files / "reward.json"), ("--steps", "contact"), ("--profile", "c0")):
        told = navirl("fit", files / "demos.json", "-o", "s.json", "--correct-bias", *options, code=2).stderr
        assert "--correct-bias" in told


def test_a_bias_too_large_for_correction_leaves_the_fit_unchanged(navirl, files):
    one = read_demonstrations(files / "demos.json")[:1]
    write_json(Path("single.json"), "demonstrations", demonstrations_document(one, [], {}), force=False)
    told = navirl("fit", "single.json", "-o", "r.json", "--correct-bias", code=3).stderr
    assert "navirl: --correct-bias: too few demonstrations: a first-order correction is not valid" in told
    assert values_of(read_json(Path("r.json"), "reward"), "bias_subtracted") == [None] * 4


def test_plot_profile_draws_what_the_file_holds(navirl, files):
    for suffix, magic in ((".png", b"\x89PNG"), (".svg", b"<?xml")):
        name = f"profile{suffix}"
        assert navirl("plot", "profile", files / "full.json", "-o", name).stdout == f"{name}\n"
        assert Path(name).read_bytes().startswith(magic)
    navirl("plot", "profile", files / "full.json", "-o", "wide.png", "--wide")
    widths = [int.from_bytes(Path(name).read_bytes()[16:20], "big") for name in ("profile.png", "wide.png")]
    assert widths[1] > 2 * widths[0]


def test_plot_profile_without_a_profile_is_refused(navirl, files, tmp_path):
    message = navirl("plot", "profile", files / "reward.json", "-o", "a.png", code=1).stderr
    assert message.endswith("reward.json: expected profile likelihoods, found none; fit again with --profile sigma_p\n")
    assert "ends in .png, .pdf or .svg" in navirl("plot", "profile", files / "full.json", "-o", "a.gif", code=2).stderr
    assert list(tmp_path.iterdir()) == []


def test_an_interval_that_reaches_a_bound_does_not_go_beyond(files):
    # The deviation's weight cannot be positive.
    rows = [line.split() for line in (files / "full.txt").read_text().splitlines()]
    (shown,) = (row for row in rows if row[:2] == ["a_g", "95"])
    assert float(shown[2]) < 0.0
    assert shown[3:] == "- above, up to the parameter's bound 0".split()  # noqa: SIM905


def test_a_fit_without_people_says_so_before_it_starts(files, tmp_path, navirl, monkeypatch):
    someone = read_demonstrations(files / "demos.json")[:4]
    nobody = [replace(one, people_m=np.zeros((0, 2))) for one in someone]
    for name, some in (("nobody", nobody), ("one", [*nobody[:3], someone[3]])):
        write_json(tmp_path / f"{name}.json", "demonstrations", demonstrations_document(some, [], {}), force=False)

    def started(*_, **__):
        raise RewardError("started")

    monkeypatch.setattr("navirl_cli.commands.fit.fit_reward", started)
    warned, ended = navirl("fit", "nobody.json", "-o", "reward.json", code=1).stderr.splitlines()
    assert warned == (
        "navirl: none of 4 demonstrations has people, so that the personal space (a_p, sigma_p) cannot be learnt "
        "from them; extract them again with a people topic, or give places with --person x,y"
    )
    assert ended == "navirl: started"
    assert navirl("fit", "one.json", "-o", "reward.json", code=1).stderr == "navirl: started\n"
