"""The help of every command: options in sections, examples that run."""

import re
import shlex
from pathlib import Path

import published_factory as forge
import pytest
from click.testing import CliRunner
from command_line import commands, options

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
    "report demos.json reward.json -o report.html",
    "study demos.json --samples 100 -o study",
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
    fit = ["fit", "demos.json", "--condition", "force", "--cycle", "2"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for words in (
            ["extract", *(log.name for log in SAMPLES), "-o", "demos.json"],
            [*fit, "--profile", "sigma_p", "-o", "reward.json"],
            [*fit, "-o", "first.json"],
            [*fit, "--only-corrected", "-o", "second.json"],
        ):
            result = CliRunner().invoke(cli, words)
            assert result.exit_code == 0, result.output
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
        assert len(re.findall(rf"^  (-\w, )?{option.opts[-1]}\b", text, re.MULTILINE)) == 1


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


@pytest.mark.parametrize("line", [marked(line) for words, _ in commands() for line in examples_in(help_of(*words))])
def test_examples_run(folder, tmp_path, monkeypatch, line):
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line)[1:]
    output = words[words.index("-o") + 1] if "-o" in words else None
    for path in folder.iterdir():
        if path.name != output:
            (tmp_path / path.name).symlink_to(path)
    result = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert result.stdout
    if output is not None and (beginning := BEGINNINGS.get(Path(output).suffix)):
        assert Path(output).read_bytes().startswith(beginning)
