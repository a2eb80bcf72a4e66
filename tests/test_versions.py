"""Files of navirl 0.1.0 (version 1) are read as those of today; tests/version1 holds small ones that it wrote."""

import json
from collections import Counter
from pathlib import Path

import pytest

from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.artefacts.rewards import read_reward
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.errors import ArtefactError

OLD = Path(__file__).parent / "version1"
KINDS = ("demonstrations", "reward", "metrics", "study")
#: What has another name since.
RENAMED = {
    "demonstrations": ("peak_n", "impulse_ns", "m_s_per_n", "standard_error"),
    "reward": ("told", "per_step"),
    "metrics": ("less", "lower", "p_value"),
    "study": ("trouble", "asked", "lower", "upper", "against"),
}


def keys(value):
    if isinstance(value, dict):
        yield from value
        value = list(value.values())
    if isinstance(value, list):
        for one in value:
            yield from keys(one)


def values(value):
    if isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from values(one)
    else:
        yield value


@pytest.mark.parametrize("kind", KINDS)
def test_files_of_version_1_are_read(kind):
    written = json.loads((OLD / f"{kind}.json").read_text())
    assert (written["version"], written["navirl"]) == (1, "0.1.0")
    found = read_json(OLD / f"{kind}.json", kind)
    assert found.pop("version") == 2
    written.pop("version")
    assert not Counter(map(str, values(written))) - Counter(map(str, values(found))), "nothing is lost"
    assert set(RENAMED[kind]) <= set(keys(written))
    assert not set(RENAMED[kind]) & set(keys(found)) - {"standard_error", "p_value"}


def test_what_was_renamed_means_the_same():
    first = read_demonstrations(OLD / "demonstrations.json")[0]
    assert first.contacts[0].peak_force_n == pytest.approx(14.545041)
    assert first.contacts[0].impulse_n_s == pytest.approx((-0.032298, 28.027959))
    gain = read_json(OLD / "demonstrations.json", "demonstrations")["gain"]
    assert (gain["gain_m_s_n"], gain["logs"][1]["standard_error_m_s_n"]) == pytest.approx(
        (0.0150357, 5.20506e-5), rel=1e-5
    )
    reward = read_json(OLD / "reward.json", "reward")
    assert reward["bootstrap"]["identified_draws"] == [3, 2, 3, 3]
    models = reward["cross_validation"]["models"]
    assert models["uniform"]["log_likelihood_per_step"] == pytest.approx(-2.0794, abs=1e-4)
    metrics = read_json(OLD / "metrics.json", "metrics")
    assert metrics["metrics"] == ["length_m", "min_distance_m", "area_m2"]
    assert [one["participant"] for one in metrics["demonstrations"]] == ["a", "a", "b", "b"]
    assert {one["path_type"] for one in metrics["groups"]} >= {"driven", "learnt"}
    (pair,) = metrics["pairs"]
    assert (pair["minus"], pair["metrics"]["length_m"]["student_lower"]) == ("force, cycle 2", None)
    assert [one.name for one in read_reward(OLD / "reward.json").profiles] == ["sigma_p"]


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_written_is_of_version_2_and_comes_back(kind, tmp_path):
    content = read_json(OLD / f"{kind}.json", kind)
    own = {key: value for key, value in content.items() if key not in {"format", "version", "navirl"}}
    write_json(tmp_path / "new.json", kind, own, force=False)
    assert json.loads((tmp_path / "new.json").read_text())["version"] == 2
    again = read_json(tmp_path / "new.json", kind)
    assert {**again, "navirl": content["navirl"]} == content


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("demonstrations", lambda d: d.update(demonstrations=3), "at demonstrations: expected a list, found 3"),
        (
            "demonstrations",
            lambda d: d["demonstrations"][0].update(contacts=[[1], 2, "a", None]),
            "at demonstrations/0/contacts/0: expected an object, found a list of 1 items",
        ),
        (
            "demonstrations",
            lambda d: d["demonstrations"][1]["contacts"][0].update(peak_force_n=1.0),
            "at demonstrations/1/contacts/0: expected no field 'peak_n'",
        ),
        ("demonstrations", lambda d: d["gain"].pop("m_s_per_n"), "at gain: expected the field 'gain_m_s_n', which is"),
        ("reward", lambda d: d.update(bootstrap="told"), "at bootstrap: expected an object or null, found 'told'"),
        ("reward", lambda d: d["bootstrap"].update(told=True), "at bootstrap/identified_draws: expected a list, found"),
        ("reward", lambda d: d["cross_validation"].update(models=[{"per_step": 1}]), "at cross_validation/models: exp"),
        ("metrics", lambda d: d.update(groups=[[1]]), "at groups/0: expected an object, found a list"),
        ("metrics", lambda d: d["groups"][0].update(mean=5), "at groups/0/mean: expected an object, found 5"),
        ("metrics", lambda d: d.update(demonstrations={"a": {"id": [1]}}), "at demonstrations: expected a list, found"),
        ("metrics", lambda d: d.update(version=True), "version: expected 1 to 2, found True"),
        ("metrics", lambda d: d.update(version=0), "version: expected 1 to 2, found 0"),
        ("metrics", lambda d: d.update(version="1"), "version: expected 1 to 2, found '1'"),
        ("metrics", lambda d: d.update(version=[[1]]), "version: expected 1 to 2, found a list of 1 items"),
        ("metrics", lambda d: d.pop("version"), "version: expected 1 to 2, found None; later ones need a later navirl"),
        ("metrics", lambda d: d.update(version=3), "version: expected 1 to 2, found 3; later ones need a later navirl"),
    ],
)
def test_broken_files_of_version_1_are_refused_with_the_place(tmp_path, kind, change, message):
    document = json.loads((OLD / f"{kind}.json").read_text())
    change(document)
    path = tmp_path / "x.json"
    path.write_text(json.dumps(document))
    with pytest.raises(ArtefactError) as caught:
        read_json(path, kind)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "words",
    [
        ("fit", "demonstrations.json", "-o", "r.json"),
        ("fit", "demonstrations.json", "--init", "reward.json", "-o", "r.json"),
        ("fit", "demonstrations.json", "--prior", "reward.json", "-o", "r.json"),
        ("evaluate", "demonstrations.json", "--reward", "reward.json", "--samples", "20"),
        ("report", "demonstrations.json", "reward.json", "--samples", "20", "-o", "page.html"),
        pytest.param(("study", "demonstrations.json", "--samples", "20", "-o", "study"), marks=pytest.mark.slow),
        ("plot", "paths", "demonstrations.json", "-o", "paths.png"),
        ("plot", "forces", "demonstrations.json", "-o", "forces.png"),
        ("plot", "policy", "demonstrations.json", "--reward", "reward.json", "-o", "policy.png"),
        ("plot", "convergence", "reward.json", "-o", "convergence.png"),
        ("plot", "profile", "reward.json", "-o", "profile.png"),
    ],
    ids=" ".join,
)
def test_every_command_takes_files_of_version_1(navirl, words):
    named = [OLD / word if (OLD / word).exists() else word for word in words]
    navirl(*named)
