"""The help of every command: options in sections, examples that run."""

import json
import re
import shlex
import sys
from pathlib import Path

import published_factory as forge
import pytest
from click.testing import CliRunner
from command_line import commands, options
from rerun_fake import fake_rerun

from navirl_cli.cli import cli
from navirl_cli.commands.usage import Command

SAMPLES = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))
BEGINNINGS = {
    ".json": b'{"format":"navirl/',
    ".html": b"<!DOCTYPE html>",
    ".tex": rb"\begin{tabular}",
    ".png": b"\x89PNG",
    ".pdf": b"%PDF",
}
SLOW = {
    "fit demos.json --pool persons -o population.json",
    "plan reward.json --scene demos.json:p01/3 --recommend",
    "report demos.json reward.json --samples 50 -o report.html --force",
    "simulate -o simulated",
    "simulate --participants 1 --seed 7 -o other",
    "fit demos.json --cycle 2 --terms length,deviation,length-space -o reward.json",
    "models demos.json --condition force --cycle 2",
    "report demos.json reward.json -o report.html",
    "study demos.json --samples 100 -o study",
    "watch logs --reward reward.json --participant p04 --condition force -o visit",
    "watch logs --condition force -o visit --once",
    "study p01.mcap p02.mcap p03.mcap -o study",
}
EVERY = [pytest.param(words, command, id=" ".join(words)) for words, command in commands()]


def help_of(*words):
    return CliRunner().invoke(cli, [*words, "--help"], prog_name="navirl").output


def examples_in(text):
    """The commands at the end of a help."""
    return [line.strip() for line in text.partition("\nExamples:\n")[2].splitlines() if line.startswith("    navirl ")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the examples name: logs, demonstrations, rewards with profiles, and the archive of the published study."""
    folder = tmp_path_factory.mktemp("examples")
    (folder / "logs").mkdir()
    for log in SAMPLES:
        (folder / log.name).symlink_to(log)
        (folder / "logs" / log.name).symlink_to(log)
    files = forge.participant()
    (folder / "runs.tar.gz").write_bytes(forge.archive({f"runs/p1/{name}": data for name, data in files.items()}))
    (folder / "trials.csv").write_text(CliRunner().invoke(cli, ["inspect", str(SAMPLES[0]), "--trials"]).stdout)
    fit = ["fit", "demos.json", "--condition", "force", "--cycle", "2", "--intervals", "wald"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for words in (
            ["extract", *(log.name for log in SAMPLES), "-o", "demos.json"],
            [*fit, "--profile", "sigma_p", "-o", "reward.json"],
            [*fit, "--only-corrected", "-o", "second.json"],
            ["select", "demos.json", "--participant", "p01", "-o", "monday.json"],
            ["select", "demos.json", "--participant", "p02", "-o", "tuesday.json"],
        ):
            result = CliRunner().invoke(cli, words)
            assert result.exit_code == 0, result.output
    (folder / "first.json").write_bytes((folder / "reward.json").read_bytes())
    return folder


def test_groups_show_examples_of_their_commands():
    for words in ((), ("plot",)):
        lines = examples_in(help_of(*words))
        assert len(lines) >= 2
        known = {line for own, _ in commands() if own[: len(words)] == words for line in examples_in(help_of(*own))}
        known |= {"navirl extract p01.mcap p02.mcap p03.mcap -o demos.json", "navirl fit demos.json -o reward.json"}
        assert set(lines) <= known


@pytest.mark.parametrize(("words", "command"), EVERY)
def test_every_option_stands_in_a_section(words, command):
    assert isinstance(command, Command)
    text = help_of(*words)
    sections = re.findall(r"^(\w[\w ]*):$", text, re.MULTILINE)
    assert sections[-3:] == ["Output", "Help", "Examples"]
    assert len(set(sections)) == len(sections)
    assert re.search(r"\nHelp:\n +-h, --help .*\n\nExamples:", text)
    for option in options(command):
        assert len(re.findall(rf"^  (-\w, )?{option.opts[-1]}(?![\w-])", text, re.MULTILINE)) == 1


@pytest.mark.parametrize(("words", "command"), EVERY)
def test_every_option_is_described(words, command):
    for option in options(command):
        assert option.help, (words, option)
        assert option.help[0].isupper() or option.help.startswith(("paper:",)), option.help
        assert re.search(r"[.;\])]$", option.help), option.help


@pytest.mark.parametrize(("words", "command"), EVERY)
def test_every_help_ends_with_examples_of_its_command(words, command):
    assert 2 <= len(command.examples) <= 3
    lines = examples_in(help_of(*words))
    assert lines == [example.line for example in command.examples]
    for line in lines:
        assert line.startswith(" ".join(("navirl", *words, "")))
        assert len(line) <= 96


def marked(line):
    """An example as a parameter; those that take long are slow."""
    words = line.removeprefix("navirl ")
    return pytest.param(line, id=words, marks=[pytest.mark.slow] if words in SLOW else [])


#: Words after which each command prints its table, but for those that print only the name of a file.
TABLES = {
    "inspect": ["p01.mcap"],
    "annotate": ["p01.mcap", "trials.csv", "-o", "new.mcap"],
    "extract": ["p01.mcap", "-o", "new.json"],
    "fit": ["demos.json", "--cycle", "2", "--intervals", "wald", "-o", "new.json"],
    "models": ["demos.json", "--terms", "length", "--condition", "force"],
    "evaluate": ["demos.json"],
    "info": ["demos.json"],
    "config": [],
    "plan": ["reward.json", "--scene", "demos.json"],
    "export": ["reward.json", "--to", "table"],
    "import-study": ["runs.tar.gz", "-o", "new"],
    "simulate": ["--participants", "1", "-o", "new"],
    "study": ["demos.json", "--samples", "20", "-o", "new"],
}


def test_every_command_that_prints_a_table_has_json():
    for words, command in commands():
        assert ("--json" in {name for option in options(command) for name in option.opts}) == (words[0] in TABLES)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "study" else []) for name in TABLES]
)
def test_json_is_one_object_with_units_in_its_keys(folder, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    for path in folder.iterdir():
        (tmp_path / path.name).symlink_to(path)
    result = CliRunner().invoke(cli, [name, *TABLES[name], "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    assert isinstance(document, dict)
    assert not [key for key in keys_in(document) if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", key)]


#: Objects whose keys are names of the data: participants, groups, modalities, metrics, reasons.
BY_DATA = {
    "groups",
    "parameters",
    "reward_by_term",
    "participants",
    "metrics",
    "completion_s",
    "missing",
    "missing_on_grid",
    "by_participant",
}


def keys_in(document, by_data=False):
    """All keys that the format defines."""
    if isinstance(document, list):
        for one in document:
            yield from keys_in(one)
    elif isinstance(document, dict):
        for key, value in document.items():
            yield from keys_in(value, not by_data and key in BY_DATA)
            if not by_data:
                yield key


@pytest.mark.parametrize("line", [marked(line) for words, _ in commands() for line in examples_in(help_of(*words))])
def test_examples_run(folder, tmp_path, monkeypatch, line):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "rerun", fake_rerun())
    words = shlex.split(line)[1:]
    if words[0] == "watch" and "--once" not in words:
        words.append("--once")  # it would wait for more
    output = words[words.index("-o") + 1] if "-o" in words else None
    for path in folder.iterdir():
        if path.name != output:
            (tmp_path / path.name).symlink_to(path)
    result = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert result.stdout
    if output is not None and (beginning := BEGINNINGS.get(Path(output).suffix)):
        assert Path(output).read_bytes().startswith(beginning)
