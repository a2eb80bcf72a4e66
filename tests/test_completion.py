"""What the shell completes, through click's own interface, and in bash."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner
from command_line import commands, options

from navirl_cli.cli import COMMANDS, cli
from navirl_cli.evaluation.metrics import BY_NAME
from navirl_cli.logs.roles.topics import ROLES

ROOT = Path(__file__).parent.parent
LOG = ROOT / "sample_logs" / "p01.mcap"


def completed(*words):
    """What is proposed for the last word."""
    *args, incomplete = map(str, words)
    return [
        item.value for item in ShellComplete(cli, {}, "navirl", "_NAVIRL_COMPLETE").get_completions(args, incomplete)
    ]


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    path = tmp_path_factory.mktemp("completion") / "demos.json"
    assert CliRunner().invoke(cli, ["extract", str(LOG), "-o", str(path)]).exit_code == 0
    return path


def test_commands_options_and_their_values():
    assert completed("") == list(COMMANDS)
    assert completed("plot", "pro") == ["properties", "profile"]
    assert completed("extract", "p.mcap", "--wr") == ["--wrench-frame", "--wrench-filter"]
    assert completed("extract", "p.mcap", "--split", "") == ["goal", "stop", "none"]


def test_metrics_in_a_list():
    assert completed("evaluate", "demos.json", "--metrics", "") == [*BY_NAME, "all"]
    assert completed("evaluate", "demos.json", "--metrics", "length_m,mi") == [
        "length_m,min_distance_m",
        "length_m,min_center_distance_m",
    ]
    assert "length_m,length_m" not in completed("evaluate", "demos.json", "--metrics", "length_m,")


def test_parameters():
    assert completed("fit", "demos.json", "--profile", "") == ["c0", "a_g", "a_p", "sigma_p"]
    assert completed("fit", "demos.json", "--init", "c0=-50,a") == ["c0=-50,a_g=", "c0=-50,a_p="]
    assert completed("fit", "demos.json", "--init", "rew") == ["rew"]  # the shell completes the file


def test_trials_and_groups_of_the_demonstrations_at_hand(demos):
    assert completed("plot", "forces", demos, "--trial", "") == [f"p01/{number}" for number in range(1, 8)]
    assert completed("plot", "forces", demos, "--trial", "p01/3") == ["p01/3"]
    groups = ["force, cycle 1", "force, cycle 2"]
    assert completed("plot", "ranks", demos, "--group", "force") == groups
    assert completed("evaluate", demos, "--pair", "force") == groups
    assert completed("evaluate", demos, "--pair", groups[0], "joy") == ["joystick"]
    assert completed("evaluate", demos, "--by", "participant", "--pair", "") == ["p01"]


def test_names_that_choose_demonstrations(demos):
    assert completed("fit", demos, "--cycle", "") == ["1", "2"]
    assert completed("evaluate", demos, "--participant", "") == ["p01"]
    assert completed("plot", "paths", demos, "--set", "") == ["main task"]
    assert completed("select", demos, "--trial", "p01/7") == ["p01/7"]
    assert completed("plan", "r.json", "--scene", demos, "--trial", "p01/7") == ["p01/7"]
    assert completed("plan", "r.json", "--scene", f"{demos}:p01/3", "--cycle", "") == ["1", "2"]


def test_roles_and_topics_of_the_log_at_hand():
    assert completed("extract", "--topic", "") == [f"{role.name}=" for role in ROLES]
    assert completed("extract", LOG, "--topic", "w") == ["wrench=/wrench"]
    assert completed("inspect", LOG, "--topic", "goal=") == ["goal=/goal_pose", "goal=/plan"]
    assert completed("study", LOG, "--topic", "tf_static=/") == ["tf_static=/tf", "tf_static=/tf_static"]


@pytest.mark.parametrize(("words", "command"), [pytest.param(*one, id=" ".join(one[0])) for one in commands()])
def test_completion_neither_raises_nor_prints(tmp_path, monkeypatch, capfd, words, command):
    monkeypatch.chdir(tmp_path)
    Path("demos.json").write_text('{"format": "navirl/demonstrations", "version": "none"}')
    Path("log.mcap").write_bytes(b"\x89MCAP0\r\nhello")
    for given in ("none", "demos.json", "log.mcap", "\udcff", "/dev/null", "."):
        for option in options(command):
            completed(*words, given, option.opts[-1], "")
            completed(*words, given, option.opts[-1], "wrench=/x", "--nonsense", "")
        completed(*words, given, "")
    completed("nonsense", *words, "")
    completed(*words, "--list-metrics", "")
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
@pytest.mark.parametrize(
    ("words", "replies"),
    [
        (["plot", "pol"], ["policy"]),
        (["extract", LOG, "--topic", "w"], ["wrench=/wrench"]),
        (["extract", LOG, "--topic", "goal", "="], ["/goal_pose", "/plan"]),
        (["extract", LOG, "--topic", "goal", "=", "/pl"], ["/plan"]),
        (["extract", LOG, "--split", "=", "st"], ["stop"]),
        (["fit", "demos.json", "--init", "c0", "=", "-50,a_p"], ["-50,a_p="]),
        (["evaluate", "{demos}", "--pair", "force,\\ cycle\\ 1", "jo"], ["joystick"]),
        (["evaluate", "{demos}", "--pair", "force,"], ["force,\\ cycle\\ 1", "force,\\ cycle\\ 2"]),
        (["evaluate", "{demos}", "--pair", "'force, cycle 2"], ["force, cycle 2"]),
    ],
)
def test_bash_completes_words_that_it_splits_and_escapes(tmp_path, demos, words, replies):
    program = tmp_path / "navirl"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "from navirl_cli.cli import main; main()" "$@"\n')
    program.chmod(0o755)
    given = [str(word).replace("{demos}", str(demos)) for word in words]
    quoted = shlex.join(["navirl", *given])  # as bash hands them over, split at equals signs
    script = (
        f'eval "$(_NAVIRL_COMPLETE=bash_source navirl)"; COMP_WORDS=({quoted}); COMP_CWORD={len(given)}; '
        '_navirl_completion navirl; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    env = {**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run([shutil.which("bash"), "-c", script], env=env, capture_output=True, text=True, check=True)
    assert (done.stdout.splitlines(), done.stderr) == (replies, "")
