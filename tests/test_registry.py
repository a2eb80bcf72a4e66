"""Terms of one's own: from files and installed packages, in every process, and their refusals."""

import pickle
import re
import subprocess
import sys
from pathlib import Path

import factories as make
import pytest
from toy_term import Egg

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.rewards import read_reward
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.errors import ArgumentError, ArtefactError, RewardError
from navirl_cli.irl.reward import PAPER_TERMS, Reward
from navirl_cli.irl.terms import TERMS, registry
from navirl_cli.irl.terms.registry import names_of, terms_named

SOURCE = Path(__file__).with_name("toy_term.py").read_text()
SCENE = make.scene_on(make.open_grid(12, 8), [0, 3], [11, 4], [[0.6, 0.6]])


@pytest.fixture(autouse=True)
def nothing_taken(monkeypatch):
    monkeypatch.setattr(registry, "_taken", {})
    monkeypatch.delenv("NAVIRL_TERMS", raising=False)


@pytest.fixture
def egg(tmp_path):
    path = tmp_path / "my_term.py"
    path.write_text(SOURCE)
    return path


def test_terms_of_the_package_by_name():
    assert terms_named(["length", "deviation", "personal-space"]) == PAPER_TERMS
    assert names_of(PAPER_TERMS) == ["length", "deviation", "personal-space"]


def test_a_term_of_a_file(egg):
    length, own = terms_named(["length", f"{egg}:Egg"])
    assert (length, own.name) == (TERMS["length"], "egg")
    assert terms_named(["egg"]) == (own,), "known by its name from now on"
    assert terms_named([f"{egg}:Egg"]) == (own,), "and the same when it is loaded again"


def test_a_term_itself():
    assert terms_named(["length", Egg()]) == (TERMS["length"], Egg())
    assert terms_named(["egg"]) == (Egg(),)


def test_a_changed_file_is_loaded_again(egg):
    (before,) = terms_named([f"{egg}:Egg"])
    egg.write_text(SOURCE.replace("initial=-4.0", "initial=-3.0"))
    (after,) = terms_named([f"{egg}:Egg"])
    assert (before.parameters[0].initial, after.parameters[0].initial) == (-4.0, -3.0)


def test_a_term_of_a_file_crosses_processes(egg):
    (own,) = terms_named([f"{egg}:Egg"])
    reward = Reward.named({}, (TERMS["length"], own))
    assert pickle.loads(pickle.dumps(reward)) == reward
    code = "import pickle, sys; print(pickle.load(sys.stdin.buffer).terms[1].name)"
    done = subprocess.run([sys.executable, "-c", code], input=pickle.dumps(reward), capture_output=True, check=True)
    assert done.stdout.split() == [b"egg"]


def test_a_term_of_an_installed_package(tmp_path, monkeypatch):
    (tmp_path / "eggs.py").write_text(SOURCE)
    info = tmp_path / "eggs-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: eggs\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[navirl.terms]\negg = eggs:Egg\nbad = eggs:Nothing\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert terms_named(["egg"])[0].name == "egg"
    with pytest.raises(RewardError, match=r"term bad: eggs:Nothing does not load: AttributeError"):
        terms_named(["bad"])
    with pytest.raises(ArgumentError, match=r"expected one of 'length'.*'egg', 'bad', found 'egk'; did you mean 'egg'"):
        terms_named(["egk"])


def test_the_environment_names_files(egg, monkeypatch):
    monkeypatch.setenv("NAVIRL_TERMS", f"{egg}:Egg")
    assert terms_named(["egg"])[0].name == "egg"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("class Egg", "class Eg", r"my_term\.py: term: expected 'Eg', found 'Egg'; did you mean 'Eg'\?"),
        ("import numpy", "import numpi", r"my_term\.py: does not run: ModuleNotFoundError: No module named 'numpi'"),
        ("    about_turns = False\n", "", r"term .*my_term\.py:Egg: expected name, .*, on, found no about_turns$"),
        ('name = "egg"', 'name = "Egg"', r"expected a name of its own of lower-case letters, .* found 'Egg'$"),
        ('name = "egg"', 'name = "turn"', r"expected a name of its own of lower-case letters, .* found 'turn'$"),
        ("initial=-4.0", "initial=1e6", r"a_e: expected initial values within -10000 to 10000 and a positive scale, f"),
        ("    name =", "    size: int\n    name =", r"cannot be made without arguments: TypeError: .*'size'"),
        ('"a_e"', '"a-e"', r"expected parameters named as a_p or sigma, found 'a-e'$"),
        ('"a_e"', '"c0"', r"`terms`: expected each parameter once, found c0 again in egg$"),
    ],
)
def test_what_is_no_term_is_refused(egg, old, new, message):
    egg.write_text(SOURCE.replace(old, new, 1))
    with pytest.raises((RewardError, ArgumentError), match=message) as raised:
        terms_named(["length", f"{egg}:Egg"])
    assert "\n" not in str(raised.value)


def test_a_missing_file_no_term_and_a_term_twice_are_refused(tmp_path):
    with pytest.raises(
        RewardError, match=r"no\.py:Egg: expected a Python file and a class as my_term\.py:MyTerm: No su"
    ):
        terms_named([f"{tmp_path}/no.py:Egg"])
    with pytest.raises(ArgumentError, match="expected at least one term"):
        terms_named([])
    with pytest.raises(ArgumentError, match="expected each parameter once, found a_turn again in turn"):
        terms_named(["turn", "length", "turn"])


class TestCommands:
    @pytest.fixture
    def demos(self, tmp_path):
        shown = make.by_participants(SCENE, Reward((-40.0, -1.0, -4.0, 3.0)), 2, 2, seed=3)
        write_json(tmp_path / "demos.json", "demonstrations", demonstrations_document(shown, [], {}), force=False)

    @pytest.mark.usefixtures("demos", "egg")
    def test_a_fit_with_a_term_of_a_file_in_several_processes_and_its_reward_read_back(self, navirl, monkeypatch):
        words = ["fit", "demos.json", "--terms", "length,my_term.py:Egg", "-o", "reward.json", "--bootstrap", 6]
        shown = navirl(*words).stdout
        assert "s_x: decay along x" in shown
        assert read_json(Path("reward.json"), "reward")["terms"] == ["length", "egg"]
        monkeypatch.setattr(registry, "_taken", {})
        with pytest.raises(ArtefactError, match=r"reward\.json: term: .*found 'egg'.*NAVIRL_TERMS=my_term\.py:MyTerm"):
            read_reward(Path("reward.json"))
        assert "reward.json: term: expected one of" in navirl("info", "reward.json", code=1).stderr
        assert float(navirl("info", "reward.json", "--field", "parameters.c0").stdout) < 0
        monkeypatch.setenv("NAVIRL_TERMS", "my_term.py:Egg")
        navirl("evaluate", "demos.json", "--reward", "reward.json", "--samples", 10)

    @pytest.mark.usefixtures("demos")
    def test_unknown_terms_are_wrong_words(self, navirl):
        stderr = navirl("fit", "demos.json", "--terms", "lenght", "-o", "r.json", code=2).stderr
        assert "found 'lenght'; did you mean 'length'?" in stderr
        assert (
            "each parameter once" in navirl("fit", "demos.json", "--terms", "turn,turn", "-o", "r.json", code=2).stderr
        )
        stderr = navirl("fit", "demos.json", "--terms", "length,no.py:No", "-o", "r.json", code=1).stderr
        assert "no.py:No: expected a Python file" in stderr

    @pytest.mark.usefixtures("demos")
    def test_initial_values_and_priors_of_other_terms(self, navirl):
        navirl("fit", "demos.json", "-o", "paper.json")
        other = ["--terms", "length,deviation,length-space", "-o", "other.json", "--force"]
        navirl("fit", "demos.json", *other, "--init", "paper.json")
        initial, paper = (read_json(Path(f"{name}.json"), "reward") for name in ("other", "paper"))
        values = {one["name"]: one["value"] for one in paper["parameters"]}
        assert initial["initial"] == {"c0": values["c0"], "a_g": values["a_g"], "a_l": -50.0, "sigma_l": 2.0}
        navirl("fit", "demos.json", *other, "--init", "a_l=-30")
        assert read_json(Path("other.json"), "reward")["initial"]["a_l"] == -30.0
        found = navirl("fit", "demos.json", *other, "--init", "a_p=-3", code=2).stderr
        assert re.search(r"expected one of 'c0', 'a_g', 'a_l', 'sigma_l', found 'a_p'", found)
        found = navirl("fit", "demos.json", *other, "--prior", "paper.json", code=1).stderr
        assert (
            "--prior: expected a reward of the terms length, deviation, length-space, found one of length, d" in found
        )
        navirl("fit", "demos.json", "--init", "other.json", "-o", "again.json")
        assert read_json(Path("again.json"), "reward")["terms"] == ["length", "deviation", "length-space"]

    @pytest.mark.usefixtures("demos")
    def test_files_from_before_terms_had_names_and_files_whose_terms_do_not_fit(self, navirl):
        navirl("fit", "demos.json", "-o", "reward.json")
        document = read_json(Path("reward.json"), "reward")
        content = {key: value for key, value in document.items() if key not in {"format", "version", "navirl", "terms"}}
        write_json(Path("old.json"), "reward", content, force=False)
        assert read_reward(Path("old.json")).reward.terms == PAPER_TERMS
        write_json(Path("bad.json"), "reward", content | {"terms": ["length", "deviation"]}, force=False)
        with pytest.raises(
            ArtefactError, match=r"bad\.json: parameters: expected c0, a_g, as of the terms length, deviat"
        ):
            read_reward(Path("bad.json"))
