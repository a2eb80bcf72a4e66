"""The commands as a user meets them: outputs, messages, exit codes, files."""

import csv
import io
import json
import os
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest
from click.testing import CliRunner
from robot_log import Run, write_run

from navirl_cli.artefacts.store import read_json
from navirl_cli.cli import COMMANDS, cli

SAMPLES = Path(__file__).parent.parent / "sample_logs"


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """Demonstrations and a reward of one sample log."""
    folder = tmp_path_factory.mktemp("work")
    runner = CliRunner()
    for words in (
        ["extract", SAMPLES / "p01.mcap", "-o", folder / "demos.json"],
        ["fit", folder / "demos.json", "--condition", "force", "--cycle", "2", "-o", folder / "reward.json"],
    ):
        assert runner.invoke(cli, [str(word) for word in words]).exit_code == 0
    return folder


def log_with(tmp_path, name="run.mcap", **changes):
    return write_run(tmp_path / name, replace(Run(), **changes))


def test_help_lists_each_command_as_it_describes_itself(navirl):
    text = navirl("--help").output
    for name, summary in COMMANDS.items():
        module = name.replace("-", "_")
        command = getattr(import_module(f"navirl_cli.commands.{module}"), module)
        assert command.get_short_help_str(200).rstrip(".") == summary.rstrip(".")
        assert summary in " ".join(text.split())
        assert command.help.split(".")[0] in " ".join(navirl(name, "--help").output.split())


def test_an_unknown_command_and_no_command(navirl):
    assert "command: expected one of 'inspect', 'annotate', 'extract', " in navirl("learn", code=2).stderr
    assert "Usage" in navirl(code=2).output


def test_version_and_module():
    out = subprocess.run([sys.executable, "-m", "navirl_cli", "--version"], capture_output=True, text=True, check=True)
    assert out.stdout.startswith("navirl, version 0.")


def test_completion_works():
    env = {**os.environ, "_NAVIRL_COMPLETE": "bash_complete", "COMP_WORDS": "navirl ex", "COMP_CWORD": "1"}
    code = "from navirl_cli.cli import main; main()"
    out = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False)
    assert "extract" in out.stdout


def test_extract_prints_a_row_a_trial(navirl, tmp_path):
    log = log_with(tmp_path)
    result = navirl("extract", log, "-o", "demos.json")
    header, row = result.stdout.splitlines()
    assert header.split("  ")[0] == "trial"
    *words, duration, length, cells, contacts, share, peak, impulse, direction = row.split()
    assert words == ["run/1", "force", "-", "-"]
    assert (float(duration), float(length)) == pytest.approx((10.7, 4.0), abs=0.1)
    assert (cells, contacts) == ("41", "1")
    assert (float(share), float(peak), float(impulse)) == pytest.approx((19, 12.5, 24.0), abs=0.6)
    assert float(direction) == pytest.approx(90, abs=2)
    assert result.stderr.startswith("navirl: run.mcap: guessed, because it is not stated: ")
    assert result.stderr.count("\n") == 1
    document = read_json(Path("demos.json"), "demonstrations")
    assert document["inputs"][0]["file"] == "run.mcap"
    assert document["settings"]["split"] == "goal"
    assert document["settings"]["rasterizer"] == "study"
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_extract_json_has_numbers(navirl, tmp_path):
    document = json.loads(navirl("extract", log_with(tmp_path), "-o", "demos.json", "--json").stdout)
    assert (list(document), document["gain"]) == (["trials", "gain"], None)
    (row,) = document["trials"]
    assert (row["trial"], row["cells"], row["cycle"]) == ("run/1", 41, None)
    assert row["impulse_n_s"] == pytest.approx(24, abs=0.6)


@pytest.mark.parametrize(
    ("changes", "options", "message"),
    [
        ({"wrench_topics": ()}, (), r"run.mcap: no wrench: expected a topic of type geometry_msgs/WrenchStamped"),
        (
            {"odometry": False},
            (),
            "run.mcap: no odometry, and tf does not give poses in its place: transform from 'base' to 'map'",
        ),
        ({"map": False}, (), "run.mcap: no map: expected a topic of type nav_msgs/OccupancyGrid"),
        (
            {"wrench_topics": ("/wrench", "/raw")},
            (),
            "several topics could be the wrench (geometry_msgs/WrenchStamped): /raw, /wrench; choose one with",
        ),
        (
            {},
            ("--topic", "wrench=/nope"),
            "run.mcap: --topic wrench: expected '/wrench', found '/nope'",
        ),
        (
            {},
            ("--topic", "wrench=/odom"),
            "geometry_msgs/Wrench, found '/odom' of type nav_msgs/Odometry",
        ),
        ({"map_to_odom": False}, (), "/odom places 'base' in frame 'odom': transform from 'odom' to 'map'"),
        ({"sensor_mounted": False}, (), "the wrench is given in frame 'sensor': transform from 'sensor' to 'base'"),
        ({"map_yaw": 0.5}, (), "expected a map whose cells run along its frame's axes, found one rotated by 28.6 deg"),
        ({"moves": False}, (), "no trial became a demonstration"),
        ({"goals": ()}, (), "no goal is announced, so that trials cannot be split at goals"),
        ({}, ("--person", "0,0.1"), "a person at x 0.00 m, y 0.10 m stands on the path's start"),
        ({}, ("-o", "/dev/null"), "/dev/null: expected the name of a file to write, found something else"),
        ({}, ("-o", "x" * 300), "cannot be written: File name too long"),
        ({}, ("--goal", "50,50"), "goal unreachable: no free path on the map from x"),
        ({}, ("-o", "no/demos.json"), "no/demos.json: expected an existing folder, found none at no; create it"),
    ],
)
def test_errors_of_extract_are_one_line(navirl, tmp_path, changes, options, message):
    result = navirl("extract", log_with(tmp_path, **changes), "-o", "demos.json", *options, code=1)
    assert message in result.stderr
    assert result.stderr.startswith("navirl: ")
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.mcap"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"#ROSBAG V2.0\n" + b"x" * 50, "rosbags-convert --src"),
        (b"SQLite format 3\0" + b"x" * 50, "rosbags-convert --src"),
        (b"", "empty"),
        (b"hello", "MCAP"),
    ],
)
def test_other_formats_are_named_with_a_remedy(navirl, tmp_path, content, message):
    path = tmp_path / "log.bag"
    path.write_bytes(content)
    stderr = navirl("extract", path, "-o", "demos.json", code=1).stderr
    assert message in stderr
    assert stderr.count("\n") == 1
    assert "log.bag" in stderr


def test_a_missing_log(navirl):
    assert "none.mcap" in navirl("extract", "none.mcap", "-o", "demos.json", code=1).stderr


def test_a_bad_log_among_good_ones_is_left_out_with_exit_code_3(navirl, tmp_path):
    good, bad = log_with(tmp_path, "a.mcap"), log_with(tmp_path, "b.mcap", wrench_topics=())
    result = navirl("extract", good, bad, "-o", "demos.json", code=3)
    assert "left out: " in result.stderr
    assert "b.mcap: no wrench" in result.stderr
    assert [d["id"] for d in read_json(Path("demos.json"), "demonstrations")["demonstrations"]] == ["a/1"]
    other = log_with(tmp_path, "c.mcap", wrench_topics=())
    both = navirl("extract", bad, other, "-o", "other.json", code=1).stderr
    assert both.startswith("navirl: none of 2 logs can be used: 2 logs: no wrench: ")
    assert both.count("no wrench") == 1


def test_a_cut_log_gives_what_is_left_with_exit_code_3(navirl, tmp_path):
    whole = log_with(tmp_path)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-30])
    result = navirl("extract", cut, "-o", "demos.json", code=3)
    assert "cut/1" in result.stdout
    assert "cut.mcap" in result.stderr


def test_a_skipped_trial_is_reported_with_exit_code_3(navirl, tmp_path):
    log = log_with(tmp_path, goals=((1.5, 4.0, 0.0), (13.0, 0.0, 0.0)))
    result = navirl("extract", log, "-o", "demos.json", code=3)
    assert "run.mcap: trial 2: the robot gets no farther than 0.00 m: an empty trial" in result.stderr
    assert result.stdout.count("run/") == 1


def test_a_missing_log_among_good_ones_and_a_log_given_twice(navirl, tmp_path):
    good = log_with(tmp_path)
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(good.read_bytes())
    stderr = navirl("extract", good, "none.mcap", copy, "-o", "demos.json", code=3).stderr
    assert "left out: none.mcap: expected an MCAP file, found no file there" in stderr
    assert "copy.mcap: the same recording as run.mcap" in stderr
    document = read_json(Path("demos.json"), "demonstrations")
    assert [source["file"] for source in document["inputs"]] == ["run.mcap"]


def test_ids_stay_with_the_trials_when_some_are_skipped_and_notes_name_them(navirl, tmp_path):
    first = log_with(tmp_path, "a.mcap", goals=((0.2, 4.0, 0.0), (1.5, 0.0, 1.0), (1.9, 4.0, 0.0)))
    second = log_with(tmp_path, "b.mcap", obstacles=((30, 17),))
    result = navirl("extract", first, second, "-o", "demos.json", "--participant", "ann", code=3)
    ids = [d["id"] for d in read_json(Path("demos.json"), "demonstrations")["demonstrations"]]
    assert ids == ["ann/3", "ann/4"]
    assert "a.mcap: trials 1, 2: the robot gets no farther than 0.00 m: an empty trial" in result.stderr
    assert "navirl: ann/4: 5 driven cells that are occupied on the map were freed" in result.stderr


def test_notes_go_to_stderr(navirl, tmp_path):
    log = log_with(tmp_path, obstacles=((30, 17),), people=None)
    stderr = navirl("extract", log, "-o", "demos.json").stderr
    assert "navirl: run/1: 5 driven cells that are occupied on the map were freed" in stderr
    assert "run/1: no people in the scene; give their places with --person x,y" in stderr


def test_a_file_without_demonstrations(navirl, work):
    document = json.loads((work / "demos.json").read_text())
    document["demonstrations"] = []
    Path("none.json").write_text(json.dumps(document))
    reward = ("--reward", work / "reward.json")
    for words in (
        ("fit", "none.json", "-o", "r.json"),
        ("evaluate", "none.json"),
        ("plot", "paths", "none.json", "-o", "a.png"),
        ("plot", "policy", "none.json", *reward, "-o", "a.png"),
        ("plot", "properties", "none.json", "-o", "a.png"),
    ):
        assert navirl(*words, code=1).stderr == "navirl: none.json: holds no demonstrations\n"


def test_debug_shows_the_traceback(navirl):
    with pytest.raises(Exception, match=r"none\.mcap"):
        navirl("--debug", "extract", "none.mcap", "-o", "demos.json")


def test_fit_reports_and_writes_the_reward(navirl, work):
    result = navirl("fit", work / "demos.json", "--condition", "force", "--cycle", "2", "-o", "reward.json")
    lines = result.stdout.splitlines()
    assert lines[0].startswith("Status: open interval: ")
    assert [line.split()[0] for line in lines[3:7]] == ["c0", "a_g", "a_p", "sigma_p"]
    document = read_json(Path("reward.json"), "reward")
    assert document["demonstrations"] == ["p01/3", "p01/4"]
    assert document["participants"] == ["p01"]
    assert document["log_likelihood"] > document["log_likelihood_initial"] > document["log_likelihood_uniform"]
    assert document["inputs"][0]["file"] == "demos.json"
    assert Path("reward.json").read_bytes() == (work / "reward.json").read_bytes()


def test_fit_starts_from_parameters_and_from_an_earlier_reward(navirl, work):
    common = ("fit", work / "demos.json", "--condition", "force", "--cycle", "2", "--intervals", "wald", "--json")
    first = json.loads(navirl(*common, "-o", "a.json", "--init", "c0=-60,a_p=-8").stdout)
    assert first["initial"] == {"c0": -60.0, "a_g": -0.01, "a_p": -8.0, "sigma_p": 2.0}
    again = json.loads(navirl(*common, "-o", "b.json", "--init", "a.json").stdout)
    assert again["log_likelihood_initial"] == pytest.approx(first["log_likelihood"], abs=1e-6)
    for old, new in zip(first["parameters"], again["parameters"], strict=True):
        assert new["value"] == pytest.approx(old["value"], rel=1e-3)


def test_errors_of_fit_are_one_line(navirl, work, tmp_path):
    demos = work / "demos.json"
    for words, message in (
        (("--condition", "joystick", "--cycle", "2"), "--condition and --cycle: expected one of 'autonomous, "),
        (("--init", "none.json"), "none.json: cannot be read"),
        (("--init", "c0=-5"), "infinite partition function: a step costs so little"),
        (("--init", demos), "expected navirl reward (format 'navirl/reward'), found a file of format"),
    ):
        stderr = navirl("fit", demos, "-o", "r.json", *words, code=1).stderr
        assert message in stderr
        assert stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
    Path("r.json").write_text("mine")
    assert "r.json: exists already" in navirl("fit", demos, "-o", "r.json", code=1).stderr
    assert Path("r.json").read_text() == "mine"


def test_evaluate_prints_a_table_json_and_csv_of_the_same_numbers(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "reward.json", "--samples", "20", "--all")
    table = navirl(*words, "-o", "metrics.csv").stdout
    document = json.loads(navirl(*words, "--json", "-o", "metrics.json").stdout)
    assert read_json(Path("metrics.json"), "metrics")["groups"] == document["groups"]
    rows = list(csv.DictReader(io.StringIO(navirl(*words, "--format", "csv").stdout)))
    assert Path("metrics.csv").read_text() == navirl(*words, "--format", "csv").stdout
    assert len(rows) == len(document["groups"]) == 4 * 5
    for row, group in zip(rows, document["groups"], strict=True):
        assert (row["group"], row["path_type"], int(row["n"])) == (group["group"], group["path_type"], group["count"])
        assert float(row["length_m_mean"]) == pytest.approx(group["mean"]["length_m"], rel=1e-5)
        assert f"{group['mean']['area_m2']:.3f}" in table
    assert [d["id"] for d in document["demonstrations"]] == [f"p01/{n}" for n in range(1, 8)]


def test_evaluate_depends_on_the_seed(navirl, work):
    words = ("evaluate", work / "demos.json", "--reward", work / "reward.json", "--samples", "5", "--format", "csv")
    assert navirl(*words).stdout == navirl(*words, "--seed", "0").stdout
    assert navirl(*words).stdout != navirl(*words, "--seed", "1").stdout


def test_evaluate_without_a_reward_measures_no_learnt_paths(navirl, work):
    document = json.loads(navirl("evaluate", work / "demos.json", "--json").stdout)
    assert document["samples"] == 0
    assert {group["path_type"] for group in document["groups"]} == {"driven", "driven, on grid", "nominal", "avoidance"}


def test_errors_of_plot_are_one_line(navirl, work, tmp_path):
    demos, reward = work / "demos.json", ("--reward", work / "reward.json")
    for words, message in (
        (("policy", demos, *reward, "-o", "a.png", "--trial", "p9/9"), "--trial: expected one of 'p01/1', "),
        (("policy", demos, "--reward", demos, "-o", "a.png"), "expected navirl reward"),
    ):
        assert message in navirl("plot", *words, code=1).stderr
    assert list(tmp_path.iterdir()) == []


def test_simulate_writes_logs_that_extract_reads(navirl):
    out = navirl("simulate", "-o", "logs", "--participants", "1", "--seed", "3").stdout
    assert [line.split()[:2] for line in out.splitlines()] == [["log", "trials"], ["logs/p01.mcap", "7"]]
    document = json.loads(navirl("simulate", "-o", "again", "--participants", "1", "--seed", "3", "--json").stdout)
    size = Path("again/p01.mcap").stat().st_size
    assert document == {"logs": [{"log": "again/p01.mcap", "trials": 7, "size_bytes": size}]}
    assert Path("again/p01.mcap").read_bytes() == Path("logs/p01.mcap").read_bytes()
    navirl("extract", "logs/p01.mcap", "-o", "demos.json")
    assert "exists already" in navirl("simulate", "-o", "logs", "--participants", "1", code=1).stderr
    Path("file").write_text("")
    assert "file: cannot be made a folder" in navirl("simulate", "-o", "file", code=1).stderr


@pytest.mark.parametrize(("given", "expected"), [(None, "1"), ("3", "3")])
def test_one_thread_of_blas_unless_the_user_sets_more(given, expected):
    code = (
        "import os, sys\nfrom navirl_cli.cli import main\nsys.argv[1:] = ['--version']\n"
        "try: main()\nfinally: print(os.environ['OPENBLAS_NUM_THREADS'])"
    )
    env = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    env |= {} if given is None else {"OPENBLAS_NUM_THREADS": given}
    out = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True).stdout
    assert out.split()[-1] == expected
