"""How the command line speaks, for all commands alike."""

import ast
import re
from pathlib import Path

import pytest
from command_line import option_names

import navirl_cli
from navirl_cli.commands.usage import as_options

PACKAGE = Path(navirl_cli.__file__).parent
#: Rooms whose messages still name options.
PENDING = {"artefacts", "evaluation", "reports"}
#: Commands of other tools, which have options of their own.
OTHER_TOOLS = re.compile(r"rosbags-convert|zstd ")


def files_below_the_commands():
    for path in sorted(PACKAGE.rglob("*.py")):
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if room not in {"cli", "commands"}:
            yield room, path


def texts_in(tree):
    """Texts in a file that are no docstrings."""
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.value


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("name it with `wrench_frame`", "name it with --wrench-frame"),
        ("choose `topic` odometry=/odom, or `split` stop", "choose --topic odometry=/odom, or --split stop"),
        ("a larger `l2`", "a larger --l2"),
        ("make it by `ros2 bag reindex`; see `metadata.yaml`", "make it by `ros2 bag reindex`; see `metadata.yaml`"),
        ("nothing is named", "nothing is named"),
    ],
)
def test_arguments_in_messages_are_shown_as_options(text, shown):
    assert as_options(text) == shown


def test_messages_below_the_commands_name_no_options():
    found = [
        f"{path.relative_to(PACKAGE)}: {line.strip()}"
        for room, path in files_below_the_commands()
        if room not in PENDING
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.search(r"(?<![\w-])--[a-z]", line) and not OTHER_TOOLS.search(line)
    ]
    assert found == []


def test_arguments_that_messages_name_are_options():
    known = option_names()
    unknown = [
        f"{path.relative_to(PACKAGE)}: {shown}"
        for room, path in files_below_the_commands()
        if room != "api"  # speaks to Python only
        for text in texts_in(ast.parse(path.read_text(encoding="utf-8")))
        for name in re.findall(r"`([a-z][a-z0-9_]*)`", text)
        if (shown := as_options(f"`{name}`")) not in known
    ]
    assert unknown == []


def test_errors_notes_and_results_pass_the_boundary(navirl, monkeypatch):
    from navirl_cli.commands import inspect
    from navirl_cli.errors import LogError

    def refuse(*_, **__):
        raise LogError("run.mcap: no map; give it with `map`")

    monkeypatch.setattr(inspect, "sources_of", refuse)
    assert navirl("inspect", "run.mcap", code=1).stderr == "navirl: run.mcap: no map; give it with --map\n"
