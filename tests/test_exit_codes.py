"""One rule of exit codes for all commands: 2 usage, 1 data and files, 3 losses, 130 interrupted."""

import re
from pathlib import Path

import click
import pytest
from command_line import commands, options
from robot_log import Run, write_run

from navirl_cli.commands.types import Choice, Count, Number, OutputPath, Point, RoleTopic

EVERY = [pytest.param(words, command, id=" ".join(words)) for words, command in commands()]
#: Words that no option of a type takes.
WRONG = {Choice: "nonsense", Count: "-1000000", Number: "nan", OutputPath: "x.doc", Point: "here", RoleTopic: "ft"}


#: What commands need besides, which depends on their other options.
NEEDED = {
    ("select",): ("--cycle", "2"),
    ("merge",): ("other.json",),
    ("plot", "compare"): ("--group", "a", "--group", "b"),
    ("export",): ("-o", "none"),
    ("view",): ("--scene", "none.json", "-o", "none.rrd"),
}


def least(words, command):
    """The words that a command needs at least, with files that do not exist."""
    given = [*words]
    for param in command.params:
        if isinstance(param, click.Argument):
            given.append("none.json")
        elif param.required:
            ending = param.type.endings[0] if isinstance(param.type, OutputPath) else ""
            given += [
                param.opts[0],
                param.type.choices[0] if isinstance(param.type, Choice) else f"{param.name}{ending}",
            ]
    return [*given, *NEEDED.get(words, ())]


def wrong_values():
    for words, command in commands():
        for option in options(command):
            for kind, value in WRONG.items():
                if type(option.type) is kind:
                    yield pytest.param(
                        [*least(words, command), option.opts[-1], value], id=f"{' '.join(words)} {option.opts[-1]}"
                    )


@pytest.mark.parametrize("words", list(wrong_values()))
def test_a_value_that_cannot_be_right_is_wrong_usage(navirl, tmp_path, words):
    assert "Error: Invalid value for '" in navirl(*words, code=2).stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("words", "command"), EVERY)
def test_missing_and_unknown_words_are_wrong_usage(navirl, tmp_path, words, command):
    if words != ("config",):  # which shows the present folder
        assert "Error: Missing " in navirl(*words, code=2).stderr
    assert "No such option" in navirl(*least(words, command), "--nonsense", code=2).stderr
    assert list(tmp_path.iterdir()) == []


FIT, EVALUATE = ("fit", "demos.json", "-o", "x.json"), ("evaluate", "demos.json")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("extract", "a.mcap", "-o", "x.json", "--no-wrench", "--gain"), "leave out --gain, or --no-wrench"),
        (("extract", "a.mcap", "-o", "x.json", "--no-wrench", "--topic", "wrench=/a"), "leave out --topic wrench, or"),
        (("extract", "a.mcap", "-o", "./a.mcap", "--force"), "expected another file than the input a.mcap"),
        (("extract", "a.mcap", "--map", "m.yaml", "-o", "m.yaml"), "expected another file than the input m.yaml"),
        (("fit", "demos.json", "-o", "demos.json", "--force"), "expected another file than the input demos.json"),
        ((*FIT, "--prior", "x.json"), "expected another file than the input x.json"),
        ((*FIT, "--init", "c0=a"), "expected name=number once each, found 'c0=a'"),
        ((*FIT, "--init", "c7=1"), "expected one of 'c0', 'a_g', 'a_p', 'sigma_p', found 'c7'"),
        ((*FIT, "--init", "c0=-50,c0=-60"), "expected name=number once each, found 'c0=-60'"),
        ((*FIT, "--init", "c0=5"), "c0 = 5 1/m is outside its bounds"),
        ((*FIT, "--prior", "r.json", "--cross-validate", "participant"), "leave out --prior, or --cross-validate"),
        ((*FIT, "--correct-bias", "--bootstrap", "5"), "leave out --bootstrap, or ask for them in another fit"),
        ((*FIT, "--correct-bias", "--steps", "contact"), "leave out --steps, or --correct-bias"),
        ((*FIT, "--correct-bias", "--l2", "1"), "expected --l2 <= 0.001, found 1"),
        ((*EVALUATE, "--ranks"), "--ranks needs one --reward"),
        ((*EVALUATE, "--reward", "a/r.json", "--reward", "b/r.json"), "--reward: expected files of different names"),
        ((*EVALUATE, "--pair", "joystick", "joystick"), "--pair: expected two groups, found 'joystick' twice"),
        ((*EVALUATE, "--metrics", "length_m,"), "expected one of 'length_m', "),
        ((*EVALUATE, "--format", "json"), "expected one of 'text', 'csv', 'markdown', 'latex', found 'json'"),
        ((*EVALUATE, "-o", "m.txt"), "expected a name that ends in .json, .csv, .md or .tex, found 'm.txt'"),
        ((*EVALUATE, "-o", "demos.json", "--force"), "expected another file than the input demos.json"),
        (("report", "demos.json", "r.json", "-o", "page.pdf"), "expected a name that ends in .html, found"),
        (("plot", "compare", "demos.json", "-o", "x.png"), "compare needs two or more --reward"),
        (("study", "a.mcap", "-o", "x", "--topic", "lidar=/scan"), "role: expected one of 'wrench', "),
    ],
)  # fmt: skip
def test_words_that_cannot_be_right_together_are_wrong_usage(navirl, tmp_path, words, message):
    assert message in " ".join(navirl(*words, code=2).stderr.split())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("words", "command"), [one for one in EVERY if one.id != "simulate"])
def test_files_that_do_not_exist_are_one_line(navirl, tmp_path, words, command):
    result = navirl(*least(words, command), code=1)
    assert result.stderr.startswith("navirl: none.json: ")
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "command"), [one for one in EVERY if one.id not in {"inspect", "models", "info", "config"}]
)
def test_existing_files_are_not_replaced(navirl, tmp_path, words, command):
    given = [str(word) for word in least(words, command)]
    if "-o" not in given:
        given += ["-o", "none.csv"]
    output = Path(given[given.index("-o") + 1])
    output.write_text("mine")
    result = navirl(*given, code=1)
    assert result.stderr.startswith(("navirl: none", f"navirl: {output}"))
    assert output.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [tmp_path / output]


@pytest.mark.parametrize("words", [("inspect",), ("extract", "-o", "x.json")], ids=" ".join)
def test_losses_are_listed_and_exit_with_3(navirl, tmp_path, words):
    log = write_run(tmp_path / "run.mcap", Run())
    log.write_bytes(log.read_bytes()[:-30])
    result = navirl(words[0], log.name, *words[1:], code=3)
    assert "run" in result.stdout
    assert re.search(r"^navirl: run\.mcap: bytes ", result.stderr, re.MULTILINE)


@pytest.mark.parametrize(("words", "command"), EVERY)
def test_an_interrupt_is_one_line_and_130(navirl, monkeypatch, words, command):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "callback", interrupted)
    result = navirl(*least(words, command), code=130)
    assert (result.stdout, result.stderr) == ("", "navirl: interrupted\n")


@pytest.mark.parametrize(
    ("words", "victim"),
    [
        (("extract", "logs", "-o", "logs/a.mcap"), "logs/a.mcap"),
        (("extract", "logs/*.mcap", "-o", "logs/a.mcap"), "logs/a.mcap"),
        (("extract", "logs", "-o", "hard.mcap"), "logs/a.mcap"),
        (("extract", "soft.mcap", "-o", "hard.mcap"), "logs/a.mcap"),
        (("evaluate", "study/demos.json", "-o", "hard.json"), "study/demos.json"),
        (("report", "study/demos.json", "figure.png", "-o", "page.html"), "study/demos.json"),
        (("plot", "paths", "study/demos.json", "-o", "figure.png"), "study/demos.json"),
        (("study", "study/demos.json", "-o", "study"), "study/demos.json"),
        (("import-study", "study/demos.json", "-o", "study"), None),
    ],
)
def test_an_input_is_never_replaced_whatever_its_name(navirl, tmp_path, words, victim):
    for name in ("logs/a.mcap", "study/demos.json"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text("mine")
    (tmp_path / "hard.mcap").hardlink_to(tmp_path / "logs/a.mcap")
    (tmp_path / "soft.mcap").symlink_to("logs/a.mcap")
    for name in ("hard.json", "figure.png", "page.html"):
        (tmp_path / name).hardlink_to(tmp_path / "study/demos.json")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    said = navirl(*words, "--force", code=1 if victim is None else 2).stderr
    assert victim is None or "expected another file than the input " in " ".join(said.split())
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
