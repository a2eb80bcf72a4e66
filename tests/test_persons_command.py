"""``navirl fit --pool persons`` and ``--person`` as a user gives them: what is printed, what is stored, refusals."""

import json
from dataclasses import replace

import factories as make
import numpy as np
import pytest
from click.testing import CliRunner

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.cli import cli
from navirl_cli.irl.reward import Reward

SCENE = make.scene_on(make.open_grid(16, 12), [0, 5], [15, 6], [[0.8, 0.9]])
TRUTH = np.array([-32.0, -4.0, -4.0, 3.0])


def said(*words, code=0):
    result = CliRunner().invoke(cli, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three people, one of them alone, a new one, and what the fit said."""
    found, rng, every = tmp_path_factory.mktemp("persons"), np.random.default_rng(4), []
    for name in ("ann", "ben", "cid", "new"):
        own = Reward(tuple(TRUTH * np.exp(0.2 * rng.standard_normal(4))))
        every += [
            replace(one, participant=name, id=f"{name}/{number}")
            for number, one in enumerate(make.drawn(SCENE, own, 3, int(rng.integers(1000))))
        ]
    for name, some in (("demos", every[:9]), ("one", every[:3]), ("new", every[9:])):
        write_json(found / f"{name}.json", "demonstrations", demonstrations_document(some, [], {}), force=False)
    text = said("fit", found / "demos.json", "--pool", "persons", "--workers", 1, "-o", found / "people.json")
    (found / "said.txt").write_text(text)
    return found


def test_the_text_says_whose_rewards_these_are_and_that_intervals_are_approximate(folder):
    text = (folder / "said.txt").read_text()
    for sentence in (
        "of the typical person",
        "random effects over 3 participants",
        "Status: converged: another draw moves the typical reward and the scatters by less than",
        "The demonstrations do not show that people differ: ",
        "Approximate: ",
        "3 participants say little about how people differ.",
        "people differ by %",
        "Each person's reward, drawn towards the typical one",
        "By importance sampling, ",
    ):
        assert sentence in " ".join(text.split()), sentence
    assert all(name in text for name in ("ann", "ben", "cid"))


def test_the_file_holds_everybody(folder):
    content = json.loads((folder / "people.json").read_text())
    people = content["population"]["persons"]
    assert [one["name"] for one in people] == ["ann", "ben", "cid"]
    for one in people:
        assert [parameter["name"] for parameter in one["parameters"]] == ["c0", "a_g", "a_p", "sigma_p"]
        assert all(parameter["lower"] <= parameter["value"] <= parameter["upper"] for parameter in one["parameters"])
        assert len(one["demonstrations"]) == 3
    assert all(0 < one["scatter_lower"] < one["scatter_upper"] for one in content["population"]["parameters"])


@pytest.mark.parametrize(
    ("command", "option", "output"),
    [
        (["evaluate", "demos.json", "--reward", "people.json"], "--person", "a.json"),
        (["plot", "policy", "demos.json", "--reward", "people.json"], "--person", "a.png"),
        pytest.param(["report", "demos.json", "people.json"], "--person", "a.html", marks=pytest.mark.slow),
        (["plan", "people.json", "--scene", "demos.json"], "--person-name", "a.json"),
    ],
    ids=lambda one: one[0] if isinstance(one, list) else "",
)
def test_one_person_is_taken_by_name(folder, tmp_path, monkeypatch, command, option, output):
    monkeypatch.chdir(folder)
    said(*command, option, "ben", "-o", tmp_path / output)
    assert (tmp_path / output).exists()
    text = said(*command, option, "bem", "-o", tmp_path / output, "--force", code=1)
    assert "people.json: person: expected one of 'ann', 'ben', 'cid', found 'bem'; did you mean 'ben'?" in text


def test_a_new_person_is_learnt_from_how_the_others_differ(folder, tmp_path):
    output = tmp_path / "new.json"
    words = ["fit", folder / "new.json", "--prior", folder / "people.json"]
    text = said(*words, "--person", "new", "-o", output)
    assert "The reward of new: own demonstrations, and how 3 other people are scattered." in " ".join(text.split())
    content = json.loads(output.read_text())
    assert (content["person"], content["shrunk_towards"]) == ("new", ["ann", "ben", "cid"])
    assert "say whose reward to learn with --person" in said(*words, "-o", output, "--force", code=1)


def test_one_participant_is_no_population(folder, tmp_path):
    text = said("fit", folder / "one.json", "--pool", "persons", "-o", tmp_path / "a.json", code=1)
    assert "--pool: expected several participants, found only ann" in " ".join(text.split())
    assert not (tmp_path / "a.json").exists()


def test_one_reward_for_all_has_no_persons(folder, tmp_path):
    said("fit", folder / "one.json", "-o", tmp_path / "one.json")
    text = said("evaluate", folder / "one.json", "--reward", tmp_path / "one.json", "--person", "ann", code=1)
    assert "expected a reward with one for each person, found one reward for all" in " ".join(text.split())
