"""Ctrl-C: one line, exit code 130, and nothing half done stays."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from navirl_cli.cli import cli

SAMPLES = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))
PTY = pytest.importorskip("pty", reason="needs pseudo-terminals")


def interrupted(words, bar, *, group):
    """Run a command until a progress bar shows on its terminal, interrupt it, and give all that it said."""
    terminal, end = PTY.openpty()
    command = subprocess.Popen(
        [sys.executable, "-m", "navirl_cli", *map(str, words)],
        stderr=end,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    os.close(end)
    said = b""
    while bar not in said:
        said += read(terminal) or pytest.fail(f"ended without a bar: {said.decode()}")
    (os.killpg if group else os.kill)(command.pid, signal.SIGINT)
    while part := read(terminal):
        said += part
    stdout, _ = command.communicate(timeout=60)
    os.close(terminal)
    return command.returncode, stdout.decode(), said.decode()


def read(terminal):
    """What the terminal shows next; nothing when all who could write to it have ended."""
    try:
        return os.read(terminal, 1024)
    except OSError:
        return b""


@pytest.fixture(autouse=True)
def heeded():
    """Commands begin with Ctrl-C in force, also where the tests run in the background of a shell, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    """Demonstrations of a sample log."""
    path = tmp_path_factory.mktemp("interrupt") / "demos.json"
    assert CliRunner().invoke(cli, ["extract", str(SAMPLES[0]), "-o", str(path)]).exit_code == 0
    return path


COMMANDS = {
    "extract": (("extract", *SAMPLES, "-o", "out/demos.json"), b"extract"),
    "extract one log": (("extract", SAMPLES[0], "-o", "out/demos.json"), b"extract"),
    "simulate": (("simulate", "--participants", "4", "-o", "out/new/logs"), b"simulate"),
    "study while extracting": (("study", *SAMPLES, "-o", "out/study"), b"extract"),
    "study while fitting": (("study", "demos.json", "-o", "out/study"), b"fit "),
}
#: Whether the worker processes are interrupted too. Every command and both ways in turn; the other pairs by hand.
GROUPS = {True: "from the terminal", False: "sent to the process"}
FAST = {
    ("extract", True),
    ("extract", False),
    ("extract one log", True),
    ("simulate", True),
    ("study while extracting", False),
    ("study while fitting", True),
}


@pytest.mark.parametrize(
    ("words", "bar", "group"),
    [
        pytest.param(*case, group, id=f"{name}, {sent}", marks=[] if (name, group) in FAST else pytest.mark.slow)
        for name, case in COMMANDS.items()
        for group, sent in GROUPS.items()
    ],
)
def test_an_interrupt_leaves_nothing_behind(tmp_path, monkeypatch, demos, words, bar, group):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent.parent))
    Path("out").mkdir()
    Path("demos.json").symlink_to(demos)
    code, stdout, said = interrupted(words, bar, group=group)
    assert code == 130, said
    assert stdout == ""
    assert said.splitlines()[-1] == "navirl: interrupted"
    assert said.count("navirl:") == 1
    assert "Traceback" not in said
    assert list(Path("out").rglob("*")) == []
