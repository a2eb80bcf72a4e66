"""Damaged logs that still hold a trial: the reports and exit codes of extract and inspect."""

import json
import re
from pathlib import Path

import log_factory as forge
import numpy as np
import pytest
import strict_log
from robot_log import write_run

from navirl_cli.errors import LogError
from navirl_cli.logs.container.records import HEAD_SIZE
from navirl_cli.logs.load import LoadOptions, load_recording


@pytest.fixture(scope="module")
def messages(tmp_path_factory):
    """A robot's drive, as messages for any variant of the format."""
    found = strict_log.walk(write_run(tmp_path_factory.mktemp("run") / "run.mcap").read_bytes())
    return [
        forge.Message(topic, found.schemas[schema_id][0], told.log_time_ns, told.payload)
        for told in found.messages
        for schema_id, topic, _ in [found.channels[told.channel]]
    ]


@pytest.fixture
def written(messages, tmp_path, monkeypatch):
    """Write the drive in a variant, with chunks of a sixth of a second."""
    monkeypatch.chdir(tmp_path)

    def write(way: str) -> Path:
        return forge.forge(tmp_path / "run.mcap", messages, chunk_size=5000, **forge.WAYS[way])

    return write


def cut_tail(path):
    """The recorder was stopped before it closed the file."""
    forge.cut(path, -20)
    return r"bytes \d+ to \d+: the file ends inside its closing records; no message is lost"


def wrong_crc(path):
    """One chunk in the middle of the push."""
    start, _ = forge.chunk_starts(path)[40]
    forge.overwrite(path, start + HEAD_SIZE + 24, b"\1\2\3\4")
    counts = [forge.messages_in_chunk(path, 40, topic) for topic in ("/wrench", "/odom")]
    assert 10 < counts[0] < 40
    return r"the chunk's CRC is 0x\w+, expected 0x04030201; messages lost: {} of /wrench, {} of /odom".format(*counts)


def cut_in_the_last_second(path):
    """The robot stands."""
    (start, size), (following, _) = forge.chunk_starts(path)[-3:-1]
    forge.cut(path, start + size // 2)
    assert following > start + size
    return rf"bytes {start} to {start + size // 2} \(13\.\d+ s to 1\d\.\d+ s\): the file ends inside a chunk"


#: So that nothing is guessed.
STATED = ("--participant", "ann", "--condition", "force", "--cycle", "1")
BREAKS = [cut_tail, wrong_crc, cut_in_the_last_second]


def test_an_intact_log_gives_exit_code_0(written, navirl):
    path = written("zstd")
    assert navirl("extract", path, *STATED, "-o", "demos.json").stderr == ""
    assert navirl("inspect", "--check", path).stderr == ""
    assert load_recording(path, LoadOptions(strict=True)).damage == ()


@pytest.mark.parametrize("broken", BREAKS)
def test_a_damaged_log_is_used_and_its_damage_listed(written, navirl, broken):
    path = written("zstd")
    words = broken(path)
    result = navirl("extract", path, *STATED, "-o", "demos.json", code=3)
    assert re.search(rf"^navirl: .*run\.mcap: (bytes .*: )?{words}", result.stderr, re.MULTILINE)
    # at most a note on the gap is added
    assert len([line for line in result.stderr.splitlines() if "gaps of more than" not in line]) == 1
    (demonstration,) = json.loads(Path("demos.json").read_text())["demonstrations"]
    assert len(demonstration["contacts"]) == 1


@pytest.mark.parametrize("broken", BREAKS)
def test_a_damaged_log_is_refused_on_request(written, broken):
    path = written("zstd")
    words = broken(path)
    with pytest.raises(LogError, match=rf"^run\.mcap: damaged, which `strict` refuses: .*{words}"):
        load_recording(path, LoadOptions(strict=True))


@pytest.mark.parametrize("broken", BREAKS)
def test_inspect_lists_damage(written, navirl, broken):
    path = written("zstd")
    words = broken(path)
    inside = ["--check"] if broken is wrong_crc else []
    result = navirl("inspect", *inside, path, code=3)
    assert re.search(rf"^navirl: .*run\.mcap: (bytes .*: )?{words}", result.stderr, re.MULTILINE)
    assert "/wrench" in result.stdout
    (document,) = json.loads(navirl("inspect", "--json", *inside, path, code=3).stdout)["logs"]
    (told,) = document["damage"]
    assert re.search(words, told)


def test_inspect_reports_the_damage_that_extract_finds(written, navirl):
    path = written("zstd")
    wrong_crc(path)
    inspected = navirl("inspect", path, code=3).stderr
    assert inspected.strip()
    extracted = navirl("extract", path, "-o", path.with_suffix(".json"), code=3).stderr
    assert all(line in extracted for line in inspected.splitlines())


@pytest.mark.parametrize(("topic", "number", "back"), [("/wrench", 700, 48), ("/odom", 200, 84 * 8)])
@pytest.mark.parametrize("bit", [0x20, 0x40])
def test_a_flipped_exponent_is_reported_and_not_passed_on(written, navirl, topic, number, back, bit):
    """A force, or where the robot is: of a double the last byte holds most of the exponent."""
    path = written("uncompressed chunks")
    data = bytearray(path.read_bytes())
    payload = strict_log.walk(bytes(data)).of(topic)[number].payload
    at = data.index(payload) + len(payload) - back
    before = np.frombuffer(bytes(data[at : at + 8]), dtype="<f8")[0]
    data[at + 7] ^= bit
    after = np.frombuffer(bytes(data[at : at + 8]), dtype="<f8")[0]
    assert 0.05 < abs(before) < 5
    assert not 1e-100 < abs(after) < 1e100
    sound = load_recording(path)
    path.write_bytes(data)
    recording = load_recording(path)
    reason = rf"1 message on {topic} holds implausible values \(1 impossible, such as .*e[+-]\d+ (N|m)\); left out"
    (told,) = recording.damage
    assert re.fullmatch(rf"run\.mcap: {reason}", told)
    found, kept = (recording.wrench, sound.wrench) if topic == "/wrench" else (recording, sound)
    assert np.array_equal(found.t_ns, np.delete(kept.t_ns, number))
    assert abs(recording.wrench.force_n).max() < 100
    assert abs(recording.xy_m).max() < 10
    assert re.search(reason, navirl("extract", path, "-o", "demos.json", code=3).stderr)
    with pytest.raises(LogError, match=f"which `strict` refuses: run.mcap: {reason}"):
        load_recording(path, LoadOptions(strict=True))
