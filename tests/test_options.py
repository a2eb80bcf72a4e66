"""How an artefact was made: no option that changes a result is missing from the command lines of a report."""

import inspect
import json
from pathlib import Path
from types import SimpleNamespace

import click
import factories as make
import pytest
from command_line import options

import navirl_cli as navirl_python
from navirl_cli.artefacts.demonstrations import demonstrations_document, settings_document
from navirl_cli.artefacts.options import NOT_KEPT, option_words
from navirl_cli.artefacts.steps import extract_words, steps_of
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.cli import cli
from navirl_cli.commands.extract import extract
from navirl_cli.commands.usage import given_words
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.logs.load import LoadOptions
from navirl_cli.reports.made import Made, made_blocks

#: A value of every option of extract and fit that is not its default, as words, and as the command line gives it back.
EXTRACT = {
    "--topic": "wrench=/ft",
    "--namespace": "/robot1",
    "--map": "map.yaml",
    "--frame": "odom",
    "--no-wrench": None,
    "--wrench-frame": "ft",
    "--force-scale": "1000",
    "--time": "log",
    "--join": None,
    "--strict": None,
    "--split": "stop",
    "--goal": "1,2.5",
    "--person": "3,-1",
    "--keep-truncated": None,
    "--trials": "trials.csv",
    "--participant": "p07",
    "--condition": "force",
    "--cycle": "2",
    "--set": "obstacle course",
    "--contact-force": "4.5",
    "--wrench-filter": "2",
    "--gain": None,
    "--resolution": "0.05",
    "--rasterizer": "chain",
    "--robot-radius": "0.35",
}
FIT = {
    "--condition": "force",
    "--cycle": "2",
    "--set": "main task",
    "--participant": "p01",
    "--trial": "p01/1",
    "--truncated": None,
    "--only-corrected": None,
    "--steps": "reachable",
    "--reach": "1.25",
    "--terms": "length,my_term.py:MyTerm",
    "--init": "c0=-40,a_g=-0.5",
    "--prior": "earlier.json",
    "--person": "p01",
    "--pool": "persons",
    "--l2": "0",
    "--method": "adam",
    "--correct-bias": None,
    "--intervals": "wald",
    "--bootstrap": "10",
    "--profile": "c0",
    "--cross-validate": "participant",
    "--seed": "7",
}
#: Of the Python interface, with the words above.
PYTHON = {
    "condition": "force",
    "cycle": [2],
    "set": ["main task"],
    "participant": "p01",
    "trial": "p01/1",
    "truncated": True,
    "only_corrected": True,
    "steps": "reachable",
    "reach": 1.25,
    "init": {"c0": -40, "a_g": -0.5},
    "terms": "length, ./my_term.py:MyTerm",
    "prior": "folder/earlier.json",
    "person": "p01",
    "pool": "persons",
    "l2": 0.0,
    "method": "adam",
    "correct_bias": True,
    "intervals": "wald",
    "bootstrap": 10,
    "profile": ["c0"],
    "cross_validate": "participant",
    "seed": 7,
}


@pytest.fixture(autouse=True)
def own_term(monkeypatch, tmp_path):
    """A term in a file, and the other files that the words above name."""
    monkeypatch.chdir(tmp_path)
    source = (Path(__file__).parent / "toy_term.py").read_text()
    name = next(line.split()[1].split("(")[0].rstrip(":") for line in source.splitlines() if line.startswith("class "))
    Path("my_term.py").write_text(f"{source}\n\nclass MyTerm({name}):\n    pass\n")


def words_of(values):
    return [word for option, value in values.items() for word in ([option] if value is None else [option, value])]


def by_option(words):
    """Words of a command line by option."""
    found, option = {}, ""
    for word in words:
        if word.startswith("--"):
            option = word
            found[option] = None
        else:
            found[option] = word
    return found


def called(name, values):
    """What a command keeps of a call with some options, whether or not they go together."""
    command = cli.get_command(click.Context(cli), name)
    with command.make_context(name, [*words_of(values), "-o", "x.json", "demos.json"]):
        return given_words()


@pytest.mark.parametrize(("name", "values"), [("extract", EXTRACT), ("fit", FIT)])
def test_every_option_is_kept_or_stands_in_a_list_with_its_reason(name, values):
    command = cli.get_command(click.Context(cli), name)
    names = {max(one.opts, key=len) for one in options(command)} - {"--quiet", "--verbose"}
    assert names == {*values, *(f"--{one}" for one in NOT_KEPT if one != "executor")}


def test_a_fit_keeps_each_of_its_options():
    for option, value in FIT.items():
        assert called("fit", {option: value}) == ([option] if value is None else [option, value])
    assert by_option(called("fit", FIT)) == FIT
    assert called("fit", {"--workers": "2", "--l2": "0.001"}) == [], "neither where it was computed nor a default"


def test_the_python_door_keeps_the_same():
    known = set(inspect.signature(navirl_python.fit).parameters) - {"demos"}
    assert known == {*PYTHON, *(one for one in NOT_KEPT if one in known)}
    assert option_words(PYTHON, navirl_python.fit.__kwdefaults__) == called("fit", FIT)
    assert option_words(navirl_python.fit.__kwdefaults__, navirl_python.fit.__kwdefaults__) == []
    assert option_words({"prior": object()}, {}) == ["--prior", "prior.json"]


def test_an_extraction_gives_each_of_its_options_back(monkeypatch):
    taken = []

    class StopHereError(Exception):
        """Ends the command once its settings are known."""

    def kept(*given, **named):
        taken.append(settings_document(*given, **named))
        raise StopHereError

    monkeypatch.setattr("navirl_cli.commands.extract.settings_document", kept)
    monkeypatch.setattr("navirl_cli.commands.extract.read_map", lambda _path: None)
    monkeypatch.setattr("navirl_cli.commands.extract.read_labels", lambda _path: None)
    usual = json.loads(json.dumps(settings_document(ExtractSettings(), LoadOptions(), None, None)))
    Path("a.mcap").touch()
    for option, value in [("", ""), *EXTRACT.items()]:
        words = words_of({option: value}) if option else []
        with pytest.raises(StopHereError):
            extract.main([*words, "a.mcap", "-o", "x.json"], standalone_mode=False)
        settings = json.loads(json.dumps(taken.pop()))
        assert extract_words(settings, usual) == words
        older = {name: one for name, one in settings.items() if name not in {"strict", "join"}}
        assert option in {"--strict", "--join"} or extract_words(older, usual) == words


def test_both_doors_write_the_options_and_a_report_shows_them(navirl):
    ones = [make.demonstration(make.open_grid(8, 4), [[x, 1] for x in range(7)], number=n, cycle=2) for n in (1, 2)]
    write_json(Path("demos.json"), "demonstrations", demonstrations_document(ones, [], {}), force=False)
    navirl("fit", "demos.json", "-o", "a.json", "--cycle", 2, "--terms", "length", "--intervals", "wald")
    kept = read_json(Path("a.json"), "reward")["options"]
    assert kept == ["--cycle", "2", "--intervals", "wald", "--terms", "length"]
    found = navirl_python.fit("demos.json", cycle=2, terms="length", intervals="wald")
    found.write("b.json")
    assert read_json(Path("b.json"), "reward")["options"] == kept
    usual = settings_document(ExtractSettings(), LoadOptions(), None, None)
    settings = {**usual, "map": "map.yaml", "trials": "t.csv", "wrench": False}
    inputs = [{"file": name} for name in ("p 1.mcap", "map.yaml", "t.csv")]
    made = Made(
        demos=(SimpleNamespace(file="many/manifest.json"),),
        reward=SimpleNamespace(file="a.json"),
        inputs=[SimpleNamespace(file=name) for name in ("p 1.mcap", "map.yaml", "t.csv")],
        settings=settings,
        usual=usual,
        options=("--samples", "5"),
        seed=0,
        everyone=ones,
        names=["many/"],
        steps=steps_of(["many/"], [{"inputs": inputs, "settings": settings}]),
    )
    content = {**read_json(Path("a.json"), "reward"), "prior": True}
    lines = [item.strip("`") for item in made_blocks(content, made)[-1].items]
    assert lines == [
        "navirl extract 'p 1.mcap' --map map.yaml --no-wrench --trials t.csv -o many/",
        "navirl fit many/ --cycle 2 --intervals wald --terms length -o a.json",
        "navirl report many/ a.json --samples 5 -o report.html",
    ]
