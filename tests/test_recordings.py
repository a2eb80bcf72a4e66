"""Several recordings at once: a bad one does not spoil the others, and what is lost is listed."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from shutil import copy

import nav_log as nav
import pytest
from robot_log import Run, write_run

from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.recordings import extract_recordings
from navirl_cli.errors import NavirlError
from navirl_cli.files import Input
from navirl_cli.logs.load import LoadOptions, load_recording

LOGS = Path(__file__).parent.parent / "sample_logs"


def extracted(*logs, **options):
    return extract_recordings(logs, ExtractSettings(), LoadOptions(), **options)


def test_recordings_keep_the_order_of_the_arguments_and_the_hashes_of_their_files():
    with ThreadPoolExecutor(2) as pool:
        found = extracted(LOGS / "p02.mcap", str(LOGS / "p01.mcap"), executor=pool)
    assert [one.log for one in found.extractions] == ["p02.mcap", "p01.mcap"]
    assert found.inputs == (Input.of(LOGS / "p02.mcap"), Input.of(LOGS / "p01.mcap"))
    assert [one.id for one in found.demonstrations()][::7] == ["p02/1", "p01/1"]
    assert found.lost == []


def test_a_bad_and_a_repeated_recording_are_listed_beside_a_good_one(tmp_path):
    copy(LOGS / "p01.mcap", tmp_path / "again.mcap")
    (tmp_path / "broken.mcap").write_bytes(b"no log at all")
    with ThreadPoolExecutor(2) as pool:
        found = extracted(LOGS / "p01.mcap", tmp_path / "again.mcap", tmp_path / "broken.mcap", executor=pool)
    assert len(found.demonstrations()) == 7
    assert len(found.lost) == 2
    assert "again.mcap: the same recording as p01.mcap" in found.lost[0]
    assert "broken.mcap" in found.lost[1]


def test_the_error_of_a_lone_bad_recording_is_its_own(tmp_path):
    (tmp_path / "broken.mcap").write_bytes(b"no log at all")
    with pytest.raises(NavirlError, match=r"^\S*broken\.mcap"):
        extracted(tmp_path / "broken.mcap")


def test_progress_ends_at_all_bytes():
    calls = []
    extracted(LOGS / "p01.mcap", progress=lambda done, total: calls.append((done, total)))
    assert calls[-1] == ((LOGS / "p01.mcap").stat().st_size,) * 2


@pytest.mark.parametrize("count", [2, 13])
def test_when_all_fail_each_reason_is_told_once_with_its_count(tmp_path, count):
    without_map = write_run(tmp_path / "no_map.mcap", Run(map=False))
    paths = [copy(without_map, tmp_path / f"p{number:02}.mcap") for number in range(count)]
    without_map.unlink()
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"no log at all")
    with ThreadPoolExecutor(2) as pool, pytest.raises(NavirlError) as caught:
        extracted(*paths, broken, executor=pool)
    text = str(caught.value)
    assert text.startswith(f"none of {count + 1} logs can be used: {count} logs: no map: expected a topic of type ")
    assert text.count("no map") == 1
    assert "broken.mcap: " in text
    assert len(text) < 1000


def test_all_reasons_of_a_log_are_told_each_once(tmp_path):
    path = write_run(tmp_path / "run.mcap", Run(map=False, wrench_topics=(), map_to_odom=False))
    with pytest.raises(NavirlError) as caught:
        extracted(path)
    text = str(caught.value)
    positions = [text.index(part) for part in ("no wrench: ", "no map: ", "transform from 'odom' to 'map'")]
    assert positions == sorted(positions)
    assert text.count("the log holds /") == text.count("run.mcap: ") == 1


def test_topics_without_end_are_not_all_listed(tmp_path):
    log = nav.Log()
    for number in range(300):
        log.add(f"/camera_{number:03}/joy", nav.joy(1 + number, [0.0]), 1 + number)
    with pytest.raises(NavirlError) as caught:
        extracted(log.write(tmp_path / "run.mcap"))
    assert "/camera_019/joy (sensor_msgs/Joy) and 280 more" in str(caught.value)
    assert len(str(caught.value)) < 3000


def test_what_was_lost_is_told_where_no_trial_is_left(tmp_path):
    path = write_run(tmp_path / "run.mcap", Run(odometry_nan=345))
    with pytest.raises(NavirlError, match=r"no trial became a demonstration: trial 1: .*; 345 messages on /odom hold "):
        extracted(path)


def test_links_into_nowhere_and_pipes_in_a_folder_are_listed_beside_a_good_log(tmp_path):
    copy(LOGS / "p01.mcap", tmp_path / "good.mcap")
    (tmp_path / "gone.mcap").symlink_to(tmp_path / "no such file")
    os.mkfifo(tmp_path / "pipe.mcap")
    found = extracted(tmp_path)
    assert len(found.demonstrations()) == 7
    assert len(found.lost) == 2
    assert "gone.mcap: expected an MCAP file, found no file there" in found.lost[0]
    assert "pipe.mcap: expected an MCAP file, found a pipe (FIFO), expected a regular file" in found.lost[1]


def test_an_unexpected_error_in_one_log_is_its_own_and_named(tmp_path, monkeypatch):
    copy(LOGS / "p01.mcap", tmp_path / "bad.mcap")

    def failing(source, *rest):
        if source.name == "bad.mcap":
            raise KeyError("x" * 300)
        return load_recording(source, *rest)

    monkeypatch.setattr("navirl_cli.demos.recordings.load_recording", failing)
    with ThreadPoolExecutor(2) as pool:
        found = extracted(tmp_path / "bad.mcap", LOGS / "p02.mcap", executor=pool)
    assert len(found.demonstrations()) == 7
    (line,) = found.lost
    assert line.startswith("left out: bad.mcap: an unexpected error, KeyError: ")
    assert "(test_recordings.py:" in line
    assert "extract this log alone to see the traceback" in line
    assert len(line) < 300
    with pytest.raises(KeyError):
        extracted(tmp_path / "bad.mcap")
