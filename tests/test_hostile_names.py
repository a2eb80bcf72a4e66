"""Names from files that steer terminals, spoil SVG or have no glyph: cleaned where they are shown."""

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.dom import minidom

import pytest
from click.testing import CliRunner

from navirl_cli.cli import cli

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("names") / "demos.json"
    done = CliRunner().invoke(cli, ["extract", str(ROOT / "sample_logs" / "p01.mcap"), "-o", str(path)])
    assert done.exit_code == 0, done.output
    return json.loads(path.read_text())


def named(document, tmp_path, name):
    """A file whose first demonstration has a set of this name."""
    copy = json.loads(json.dumps(document))
    copy["demonstrations"][0]["set"] = name
    path = tmp_path / "named.json"
    path.write_text(json.dumps(copy))
    return path


def run(*words):
    done = CliRunner().invoke(cli, [str(word) for word in words])
    assert done.exit_code in {0, 1}, done.output
    return done


HOSTILE = "\x1b[31mred\x1b]0;title\x07\nnext\x9b2J"


def test_nothing_that_steers_a_terminal_is_printed(document, tmp_path):
    path = named(document, tmp_path, HOSTILE)
    for words in (("evaluate", path), ("evaluate", path, "--format", "csv"), ("evaluate", path, "--pair", "a", "b")):
        output = run(*words).output
        assert "red" in output
        assert not set(output) & {"\x1b", "\x07", "\x9b"}
        if "csv" not in words:  # where a line break in quotes is part of a cell
            assert all("next" in line for line in output.splitlines() if "red" in line)


def test_an_svg_of_such_names_is_well_formed(document, tmp_path):
    output = tmp_path / "x.svg"
    done = run("plot", "paths", named(document, tmp_path, HOSTILE), "-o", output)
    assert done.exit_code == 0, done.output
    minidom.parse(str(output))  # noqa: S318 our own file


def test_characters_without_a_glyph_are_named_in_one_line(document, tmp_path):
    path = named(document, tmp_path, "試験")
    words = ["plot", "paths", str(path), "-o", str(tmp_path / "x.png")]
    done = subprocess.run(
        [sys.executable, "-m", "navirl_cli", *words],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr.splitlines() in (
        [],  # some machines have a font
        ["navirl: x.png: no font of the figure has 試験; drawn as boxes; choose other names"],
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("words", [("evaluate", "DEMOS"), ("--help",), ("evaluate", "DEMOS", "--json")])
def test_a_full_standard_output_is_one_line(document, tmp_path, words):
    path = named(document, tmp_path, "x")
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "navirl_cli", *(str(path) if word == "DEMOS" else word for word in words)],
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "navirl: standard output cannot be written: No space left on device\n"
