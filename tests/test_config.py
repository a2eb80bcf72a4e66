"""``navirl.toml``: below the command line, above defaults; ``navirl config``; ``--quiet`` and ``--verbose``."""

import json
from pathlib import Path

import factories as make
import pytest
from command_line import commands

import navirl_cli as navirl_python
from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.commands.experiment import CONSTANTS

LOG = Path(__file__).parent.parent / "sample_logs" / "p01.mcap"
CELLS = [[0, 1], [1, 1], [2, 2], [3, 2]]


def settings(file):
    return json.loads(Path(file).read_text())["settings"]


def test_every_constant_is_an_option_of_a_command():
    known = {max(one.opts, key=len) for _, command in commands() for one in command.params}
    assert {f"--{name}" for name in CONSTANTS} <= known


def test_the_file_beside_the_data_is_below_the_command_line_and_above_defaults(navirl, tmp_path):
    (tmp_path / "day").mkdir()
    (tmp_path / "day" / "p01.mcap").symlink_to(LOG)
    text = 'robot-radius = 0.35\nresolution = 0.2\n[topic]\nwrench = "/wrench"\n[extract]\nwrench-filter = 4\n'
    (tmp_path / "day" / "navirl.toml").write_text(text)
    found = navirl("extract", "day/p01.mcap", "--resolution", "0.1", "-o", "a.json")
    assert "navirl: day/navirl.toml: --topic wrench=/wrench, --wrench-filter 4, --robot-radius 0.35\n" in found.stderr
    own = settings("a.json")
    assert (own["robot_radius_m"], own["resolution_m"], own["push"]["cutoff_hz"]) == (0.35, 0.1, 4.0)
    assert own["topics"] == {"wrench": ["/wrench"]}
    shown = {
        (one["command"], one["option"]): (one["value"], one["source"])
        for one in json.loads(navirl("config", "day", "--json").stdout)["options"]
    }
    assert shown["extract", "resolution"] == ("0.2", "navirl.toml")
    assert shown["extract", "contact-force"] == ("3.0", "default")
    assert shown["extract", "namespace"] == ("", "not set")
    assert shown["plan", "robot-radius"] == ("0.35", "navirl.toml")
    assert "day/navirl.toml\n" in navirl("config", "day").stdout
    assert "no navirl.toml here" in navirl("config").stdout


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("robot_radius = 1", "robot_radius: expected one of 'robot-radius', "),
        ("[selekt]\ncycle = 2", "selekt: expected one of"),
        ("[select]\ncycles = 2", "[select] cycles: expected one of 'condition', 'cycle'"),
        ('[select]\noutput = "b.json"', "[select] output: expected one of"),
        ("select = 3", "select: expected a table, found 3"),
        ("[select", "expected TOML, found none"),
    ],
)
def test_what_nothing_reads_is_refused(navirl, text, message):
    Path("navirl.toml").write_text(text)
    assert f"navirl.toml: {message}" in navirl("select", "a.json", "-o", "b.json", code=1).stderr


def test_wrong_values_are_refused_as_on_the_command_line(navirl):
    Path("navirl.toml").write_text("[select]\ncycle = ['two']")
    words = " ".join(navirl("select", "a.json", "-o", "b.json", code=2).stderr.split())
    assert words.endswith("Invalid value for '--cycle': 'two' is not a valid integer. (navirl.toml)"), (
        "and say from where"
    )
    assert "navirl.toml" not in navirl("select", "a.json", "-o", "b.json", "--cycle", "two", code=2).stderr


def test_config_refuses_what_a_command_would_refuse(navirl):
    Path("navirl.toml").write_text('[extract]\nrobot-radius = "wide"\n')
    told = navirl("config", ".", code=1).stderr
    assert "navirl.toml: robot-radius: 'wide' is not a valid number" in told


def test_quiet_leaves_out_remarks_and_verbose_adds_lines(navirl):
    ones = [make.demonstration(make.open_grid(8, 4), CELLS, number=number, cycle=number) for number in (1, 2)]
    write_json(Path("a.json"), "demonstrations", demonstrations_document(ones, [], {}), force=False)
    Path("navirl.toml").write_text("[select]\ncycle = 2")
    plain = navirl("select", "a.json", "-o", "b.json")
    assert (plain.stdout, plain.stderr) == ("b.json: 1 of 2 demonstrations\n", "navirl: navirl.toml: --cycle 2\n")
    assert navirl("select", "a.json", "-o", "c.json", "--quiet").stderr == ""
    lines = navirl("evaluate", "a.json", "--verbose").stderr
    assert "navirl: navirl.toml: nothing for this command\n" in lines
    assert "navirl: evaluate 2 of 2\n" in lines
    assert "s of CPU\n" in lines
    assert "exclude each other" in navirl("select", "a.json", "-o", "d.json", "--quiet", "--verbose", code=2).stderr


def test_python_does_not_read_the_settings_and_the_command_line_keeps_what_it_took(navirl):
    ones = [make.demonstration(make.open_grid(8, 4), CELLS, number=number, cycle=number) for number in (1, 2)]
    write_json(Path("a.json"), "demonstrations", demonstrations_document(ones, [], {}), force=False)
    Path("navirl.toml").write_text("[fit]\ncycle = 2\nintervals = 'wald'\nterms = 'length'")
    navirl("fit", "a.json", "-o", "r.json", "--l2", "0")
    kept = read_json(Path("r.json"), "reward")
    assert kept["options"] == ["--cycle", "2", "--intervals", "wald", "--l2", "0", "--terms", "length"]
    assert kept["demonstrations"] == [ones[1].id]
    Path("navirl.toml").write_text("nothing_reads_this = 1")
    found = navirl_python.fit("a.json", terms="length", intervals="wald")
    assert sorted(found.demonstrations) == [one.id for one in ones]
