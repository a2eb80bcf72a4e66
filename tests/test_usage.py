"""How the command line speaks, for all commands alike."""

import ast
import re
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from command_line import option_names

import navirl_cli
from navirl_cli.cli import cli
from navirl_cli.commands import shared
from navirl_cli.commands.usage import as_options
from navirl_cli.errors import Number, counted, nearest, unknown
from navirl_cli.logs.findings import Kind

SAMPLES = Path(__file__).parent.parent / "sample_logs"
PACKAGE = Path(navirl_cli.__file__).parent
#: Rooms whose messages still name options.
PENDING = {"artefacts", "evaluation", "reports"}
#: Commands of other tools, which have options of their own.
OTHER_TOOLS = re.compile(r"rosbags-convert|zstd |--ros-args")


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """Demonstrations and a reward of one sample log."""
    folder = tmp_path_factory.mktemp("work")
    for words in (
        ["extract", SAMPLES / "p01.mcap", "-o", folder / "demos.json"],
        ["fit", folder / "demos.json", "--condition", "force", "--cycle", "2", "-o", folder / "reward.json"],
    ):
        assert CliRunner().invoke(cli, [str(word) for word in words]).exit_code == 0
    return folder


def files_below_the_commands():
    for path in sorted(PACKAGE.rglob("*.py")):
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if room not in {"api", "cli", "commands"}:  # what is called from Python names its own arguments
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


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("p1/3", ["p01/3", "p01/1"]),
        ("P01/1", ["p01/1", "p01/3"]),
        ("force", ["force, cycle 1"]),
        ("LENGTH_M", ["length_m"]),
        ("nothing like it", []),
        ("", []),
    ],
)
def test_names_that_contain_a_name_or_have_similar_spelling_are_near(name, near):
    assert nearest(name, ["p01/1", "p01/3", "force, cycle 1", "length_m"]) == near


@pytest.mark.parametrize(
    ("what", "name", "known", "message"),
    [
        (
            "`trial`",
            "p2",
            ["p01", "p02"],
            "`trial`: expected one of 'p01', 'p02', found 'p2'; did you mean 'p02'?",
        ),
        ("", "x", ["force"], "expected 'force', found 'x'"),
        ("group", "x", [], "group: expected nothing, found 'x'"),
        (
            "n",
            "x",
            map(str, range(22)),
            f"n: expected one of {', '.join(map(repr, map(str, range(20))))}, 2 more, found 'x'",
        ),
    ],
)
def test_the_message_for_an_unknown_name(what, name, known, message):
    assert unknown(what, name, known) == message


@pytest.mark.parametrize(
    ("words", "code", "near"),
    [
        (["extrakt"], 2, "'extract'"),
        (["plot", "polcy"], 2, "'policy'"),
        (["extract", "p.mcap", "--spilt", "goal"], 2, ""),
        (["extract", "p.mcap", "-o", "x.json", "--split", "gaol"], 2, "'goal'"),
        (["extract", "p.mcap", "-o", "x.json", "--topic", "wrensh=/ft"], 2, "'wrench'"),
        (["extract", SAMPLES / "p01.mcap", "-o", "x.json", "--topic", "wrench=/wrensh"], 1, "'/wrench'"),
        (["fit", "{}/demos.json", "-o", "x.json", "--condition", "forse"], 2, "'force'"),
        (["fit", "{}/demos.json", "-o", "x.json", "--profile", "sigma"], 1, "'sigma_p'"),
        (["fit", "{}/demos.json", "-o", "x.json", "--init", "sigma=2"], 2, "'sigma_p'"),
        (["evaluate", "{}/demos.json", "--metrics", "lenght_m"], 2, "'length_m'"),
        (["evaluate", "{}/demos.json", "--by", "conditions"], 2, "'condition'"),
        (["evaluate", "{}/demos.json", "--pair", "force", "joystick"], 1, "'force, cycle 1' or 'force, cycle 2'"),
        (["plot", "forces", "{}/demos.json", "-o", "x.png", "--trial", "p1/3"], 1, "'p01/3'"),
        (["plot", "compare", "{}/demos.json", "-o", "x.png", "--group", "joystik", "--group", "x"], 1, "'joystick'"),
    ],
)
def test_near_names_are_proposed(navirl, work, words, code, near):
    message = " ".join(navirl(*(str(word).format(work) for word in words), code=code).stderr.split())
    assert f"did you mean {near}" in message.replace("Did you mean --split", "did you mean '--split'").replace(
        "Did", "did"
    )
    assert not list(Path().iterdir())


def test_lines_of_progress_estimate_the_time_that_is_left(monkeypatch, capsys):
    clock = iter([0.0, 30.0, 60.0, 300.0, 330.0])
    monkeypatch.setattr(shared, "monotonic", lambda: next(clock))
    with click.Context(cli), shared.progress_bar("fit", 8, line_every=2) as update:
        for done, word in ((1, "a"), (2, "b"), (4, ""), (8, "c")):
            update(done, word)
    assert capsys.readouterr().err.splitlines() == [
        "navirl: fit 2 of 8: b; about 3 min left",
        "navirl: fit 4 of 8; about 5 min left",
        "navirl: fit 8 of 8: c",
    ]


def test_a_number_chooses_the_words_beside_it():
    words = "{0} message{0:|s} {0:repeats|repeat} {0:its|their} time"
    assert words.format(Number(1)) == "1 message repeats its time"
    assert words.format(Number(0)) == "0 messages repeat their time"
    assert f"{Number(7):03d} {counted(2, 'log')}" == "007 2 logs"


@pytest.mark.parametrize("kind", [kind for kind in Kind if "{count" in kind.sentence])
def test_a_finding_agrees_with_its_number(kind):
    given = {"about": "/x", "size": 0.5, "at_s": 1.0, "change": 0.0, "detail": "y"}
    one, several = (kind.sentence.format(count=Number(number), **given) for number in (1, 2))
    assert re.sub(r"\b[12]\b", "", one) != re.sub(r"\b[12]\b", "", several), "the same words for one and for several"
    assert not re.search(r"\b1 (messages|poses|times|maps|updates|entries|goals|places)\b", one)
