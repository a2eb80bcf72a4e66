"""Every command with every term of the registry, and with one of a researcher's own."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import factories as make
import numpy as np
import pytest
from click.testing import CliRunner

import navirl_cli
from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.cli import cli
from navirl_cli.errors import NavirlWarning
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.terms import TERMS, registry
from navirl_cli.reports import recommendation

SCENE = make.scene_on(make.open_grid(16, 12), [0, 5], [15, 5], [[0.8, 0.3]])
OWN = Path(__file__).with_name("toy_term.py")
EVERY = (*TERMS, "egg")
#: Drawing takes long: the term whose states are not cells is drawn always, the others by hand.
drawn_terms = pytest.mark.parametrize(
    "term", [pytest.param(name, marks=() if name == "turn" else pytest.mark.slow) for name in EVERY]
)


def words_of(term):
    """The terms of a reward with this one, for --terms."""
    own = f"{OWN}:Egg" if term == "egg" else term
    return ",".join(dict.fromkeys(["length", *(["personal-space"] if term in {"turn", "length"} else []), own]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Demonstrations of two people, and a reward with each term."""
    folder = tmp_path_factory.mktemp("terms")
    shown = [
        replace(one, cycle=1 + number % 2)
        for number, one in enumerate(make.by_participants(SCENE, Reward((-40.0, -1.0, -4.0, 3.0)), 2, 4, seed=3))
    ]
    write_json(folder / "demos.json", "demonstrations", demonstrations_document(shown, [], {}), force=False)
    for term in EVERY:
        last = TERMS[term].parameters[-1].name if term in TERMS else "s_y"
        asked = ["--terms", words_of(term), "--intervals", "wald", "--profile", last, "--cross-validate", "participant"]
        words = ["fit", str(folder / "demos.json"), *asked, "-o", str(folder / f"{term}.json")]
        result = CliRunner().invoke(cli, words, catch_exceptions=False)
        assert result.exit_code in {0, 3}, result.output
    return folder


@pytest.fixture(name="run")
def _run(folder, navirl, monkeypatch):
    """Run a command beside the files; the term of one's own is known by the environment alone."""
    monkeypatch.setattr(registry, "_taken", {})
    monkeypatch.setenv("NAVIRL_TERMS", f"{OWN}:Egg")
    for path in folder.glob("*.json"):
        Path(path.name).symlink_to(path)
    return navirl


@pytest.mark.parametrize("term", EVERY)
def test_fit_evaluate_and_python(run, term):
    reward = read_json(Path(f"{term}.json"), "reward")
    assert reward["terms"][-1] == term or reward["terms"] == ["length", "personal-space"]
    assert reward["profiles"][0]["parameter"] == reward["parameters"][-1]["name"] or term == "length"
    assert reward["cross_validation"]["models"].keys() >= {"learnt", "uniform"}
    found = json.loads(
        run(
            "evaluate",
            "demos.json",
            "--reward",
            f"{term}.json",
            "--metrics",
            "length_m,heading_rad",
            "--ranks",
            "--samples",
            20,
            "--json",
        ).stdout
    )
    assert len(found["ranks"]["demonstrations"]) == 8
    assert {"driven", "learnt"} <= {row["path_type"] for row in found["groups"]}
    demos, learnt = navirl_cli.read_demonstrations("demos.json"), navirl_cli.read_reward(f"{term}.json")
    view = navirl_cli.policy(learnt, demos[0])
    assert np.nansum(view.visits[tuple(SCENE.lattice.cells[SCENE.goal][::-1])]) == pytest.approx(1.0)
    driving = np.isfinite(view.value) & (view.value != 0)
    assert view.probability[driving].sum(axis=1) == pytest.approx(1.0)
    assert view.value[tuple(SCENE.lattice.cells[SCENE.start][::-1])] == view.policy.value_by_cell()[SCENE.start]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NavirlWarning)  # some end on a bound
        again = navirl_cli.fit(demos, terms=reward["terms"], intervals="wald")
    assert again.reward.theta == pytest.approx(learnt.reward.theta, rel=1e-6)
    assert again.reward.terms == learnt.reward.terms
    path = json.loads(run("plan", f"{term}.json", "--scene", "demos.json", "--json").stdout)["paths"][0]
    names = [name.replace("-", "_") for name in reward["terms"]]
    assert list(path["reward_by_term"]) == names
    total = sum(path["reward_by_term"].values()) - view.policy.value_by_cell()[SCENE.start]
    assert total == pytest.approx(path["log_probability"])


@drawn_terms
def test_every_figure_and_page(run, term, monkeypatch):
    monkeypatch.setattr(recommendation, "DRAWS", 2)
    reward = f"{term}.json"
    for kind in ("policy", "reward", "value", "actions"):
        run("plot", kind, "demos.json", "--reward", reward, "--overlay", "samples", "-o", f"{kind}.png")
    run("plot", "ranks", "demos.json", "--reward", reward, "--samples", 10, "-o", "ranks.png")
    run("plot", "properties", "demos.json", "--reward", reward, "--samples", 10, "-o", "properties.png")
    run("plot", "compare", "demos.json", "--reward", reward, "--reward", "length.json", "-o", "compare.png")
    run("plot", "profile", reward, "-o", "profile.png")
    run("plot", "convergence", reward, "-o", "convergence.png")
    run("plan", reward, "--scene", "demos.json", "--mode", "expected", "--recommend", "--plot", "plan.png")
    run("report", "demos.json", reward, "-o", "report.html")
    page = Path("report.html").read_text()
    for one in navirl_cli.read_reward(reward).reward.terms:
        assert one.formula.replace("'", "&#x27;").replace(">", "&gt;") in page


@pytest.mark.slow
@pytest.mark.parametrize("term", EVERY)
def test_study_and_models(run, term):
    run("study", "demos.json", "--terms", words_of(term), "--samples", 5, "-o", "study")
    summary = read_json(Path("study/summary.json"), "study")
    names = [one["name"] for one in read_json(Path(f"{term}.json"), "reward")["parameters"]]
    assert list(summary["pooled"]["theta"]) == names
    assert summary["settings"]["terms"] == read_json(Path(f"{term}.json"), "reward")["terms"]
    text = Path("study/report.md").read_text()
    assert all(name in text for name in names)
    shown = run("models", "demos.json", "--terms", words_of(term)).stdout
    assert f"\n{','.join(summary['settings']['terms'])} " in shown
