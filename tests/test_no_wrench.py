"""Logs without a wrench: contact is unknown, and all that needs it is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
from robot_log import Run, write_run

from navirl_cli.artefacts.demonstrations import demonstrations_document, read_demonstrations
from navirl_cli.artefacts.store import read_json, write_json
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import DemonstrationError, LogError
from navirl_cli.logs.load import Forces, LoadOptions, load_recording

NONE = Run(wrench_topics=())
UNKNOWN = "run.mcap: contact is unknown: no wrench was read"


def loaded(tmp_path, run, forces):
    return load_recording(write_run(tmp_path / "run.mcap", run), LoadOptions(forces=forces))


def one(recording):
    (demonstration,) = extract(recording, ExtractSettings()).demonstrations
    return demonstration


@pytest.mark.parametrize(("run", "forces"), [(NONE, Forces.OPTIONAL), (NONE, Forces.IGNORED), (Run(), Forces.IGNORED)])
def test_without_a_wrench_contact_and_condition_are_unknown(tmp_path, run, forces):
    recording = loaded(tmp_path, run, forces)
    assert recording.wrench is None
    d = one(recording)
    assert (d.condition, d.corrected, d.contacts, d.contact_s, d.force_n) == (Condition.UNKNOWN, None, None, None, None)
    assert UNKNOWN in extract(recording, ExtractSettings()).notes


def test_an_optional_wrench_is_taken_where_there_is_one(tmp_path):
    needed = one(loaded(tmp_path, Run(), Forces.OPTIONAL))
    assert needed.condition is Condition.FORCE
    assert len(needed.contacts) == 1


def test_the_user_chooses_between_two_wrenches_also_where_wrenches_are_optional(tmp_path):
    with pytest.raises(LogError, match=r"several topics could be the wrench .* choose one with `topic` wrench=/arm"):
        loaded(tmp_path, Run(wrench_topics=("/wrench", "/arm")), Forces.OPTIONAL)
    assert load_recording(tmp_path / "run.mcap", LoadOptions(forces=Forces.IGNORED)).wrench is None


def test_a_moved_joystick_shows_without_a_wrench(tmp_path):
    d = one(loaded(tmp_path, Run(wrench_topics=(), joystick="moved"), Forces.IGNORED))
    assert (d.condition, d.corrected) == (Condition.JOYSTICK, True)


def test_a_declared_condition_stands_and_contact_stays_unknown(tmp_path):
    session = {"trials": json.dumps([{"t_ns": 1_700_000_001_500_000_000, "condition": "force", "cycle": 2}])}
    d = one(loaded(tmp_path, Run(wrench_topics=(), session=session), Forces.IGNORED))
    assert (d.condition, d.cycle, d.corrected) == (Condition.FORCE, 2, None)


def test_neither_odometry_nor_wrench_leaves_no_clock(tmp_path):
    with pytest.raises(LogError, match=r"no odometry, and tf does not give poses in its place"):
        loaded(tmp_path, Run(wrench_topics=(), odometry=False), Forces.IGNORED)
    (bare := tmp_path / "bare").mkdir()
    with pytest.raises(LogError, match=r"no odometry: expected a topic of type nav_msgs/Odometry") as caught:
        loaded(bare, Run(wrench_topics=(), odometry=False, map_to_odom=False, sensor_mounted=False), Forces.IGNORED)
    assert "found none of them" not in str(caught.value)


def test_the_file_holds_what_is_unknown(tmp_path):
    d = one(loaded(tmp_path, NONE, Forces.IGNORED))
    path = tmp_path / "demos.json"
    write_json(path, "demonstrations", demonstrations_document([d], [], {}), force=False)
    (content,) = read_json(path, "demonstrations")["demonstrations"]
    assert (content["contacts"], content["corrected"], content["force_x_n"]) == (None, None, None)
    (read,) = read_demonstrations(path)
    assert (read.contacts, read.corrected, read.force_n, read.condition) == (None, None, None, Condition.UNKNOWN)


def test_set_nominal_and_laid_out_speed_are_read_back(tmp_path):
    entry = {"t_ns": 1_700_000_001_500_000_000, "set": "obstacle course", "nominal_m": [[0, 0.5], [4, 0.5]]}
    session = {"trials": json.dumps([entry]), "laid_out_m_s": "0.4"}
    d = one(loaded(tmp_path, Run(wrench_topics=(), session=session), Forces.IGNORED))
    path = tmp_path / "demos.json"
    write_json(path, "demonstrations", demonstrations_document([d], [], {}), force=False)
    (read,) = read_demonstrations(path)
    for found in (d, read):
        assert (found.set, found.laid_out_m_s) == ("obstacle course", 0.4)
        assert found.nominal_m.tolist() == [[0.0, 0.5], [4.0, 0.5]]


class TestCommand:
    def test_a_log_without_wrench_needs_the_option(self, navirl, tmp_path):
        log = write_run(tmp_path / "run.mcap", NONE)
        refused = navirl("extract", log, "-o", "demos.json", code=1)
        assert "or extract with --no-wrench" in refused.stderr
        result = navirl("extract", log, "-o", "demos.json", "--no-wrench")
        assert result.stdout.splitlines()[1].split()[-5:] == ["-"] * 5
        assert f"navirl: {UNKNOWN}" in result.stderr
        assert read_json(tmp_path / "demos.json", "demonstrations")["settings"]["wrench"] is False

    @pytest.mark.parametrize("other", [("--gain",), ("--wrench-frame", "ft")])
    def test_what_needs_forces_excludes_it(self, navirl, tmp_path, other):
        result = navirl("extract", write_run(tmp_path / "run.mcap"), "-o", "demos.json", "--no-wrench", *other, code=2)
        assert "these need: leave out --" in result.stderr

    def test_fits_that_ask_for_contact_are_refused(self, navirl, tmp_path):
        navirl("extract", write_run(tmp_path / "run.mcap", NONE), "-o", "demos.json", "--no-wrench")
        result = navirl("fit", "demos.json", "-o", "reward.json", "--only-corrected", code=1)
        assert "--only-corrected: expected demonstrations with a wrench, found run/1" in result.stderr
        result = navirl("fit", "demos.json", "-o", "reward.json", "--steps", "contact", code=1)
        assert "demonstration run/1: contact is unknown, because it was extracted without a wrench" in result.stderr

    def test_times_that_were_laid_out_are_no_durations(self, navirl, tmp_path):
        log = write_run(tmp_path / "run.mcap", Run(session={"laid_out_m_s": "0.4"}))
        result = navirl("extract", log, "--gain", "-o", "demos.json", "--json")
        (trial,) = json.loads(result.stdout)["trials"]
        timed = ("duration_s", "contact_share", "impulse_n_s", "direction_rad")
        assert [trial[name] for name in timed] == [None] * 4
        assert trial["contacts"] == 1
        assert trial["peak_force_n"] > 5
        assert "the positions came without times and were laid out at 0.4 m/s" in result.stderr
        assert "the gain is unknown, because the positions came without times" in result.stderr
        summary = json.loads(navirl("info", "demos.json", "--json").stdout)
        assert summary["duration_s"] is None
        assert "duration" not in navirl("info", "demos.json").stdout

    def test_notes_of_several_logs_are_put_together(self, navirl, tmp_path):
        logs = [
            write_run(tmp_path / f"{name}.mcap", Run(wrench_topics=(), lasts_s=14 + i)) for i, name in enumerate("ab")
        ]
        result = navirl("extract", *logs, "-o", "demos.json", "--no-wrench")
        assert "navirl: a.mcap, b.mcap: contact is unknown: no wrench was read" in result.stderr.splitlines()


def test_a_bent_nominal_line_is_refused(tmp_path):
    d = one(loaded(tmp_path, NONE, Forces.IGNORED))
    with pytest.raises(DemonstrationError, match=r"run/1: nominal_m needs the shape \(2, 2\), found \(2, 3\)"):
        replace(d, nominal_m=np.zeros((2, 3)))
