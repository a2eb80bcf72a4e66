"""Two thousand broken logs: never a traceback, a hang, much memory, or a silently shortened result."""

import mmap
import re
import time
from dataclasses import replace

import fuzzing
import numpy as np
import pytest
import verdicts
from fuzzing import Tally, judged, sound_logs, truth
from mutations import MUTATIONS, Mutant, mutant
from small_logs import packed
from strict_log import FaultError
from verdicts import ForbiddenError, check_hits, judge

from navirl_cli.errors import LogError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import read
from navirl_cli.parallel import cores, map_in_order

COUNT = 2000


def test_two_thousand_broken_logs():
    # a process has to do with some of the sound logs only
    logs, workers = len(sound_logs()), cores()
    tally = Tally()
    for part in map_in_order(
        judged, [[k for k in range(COUNT) if k % logs % workers == one] for one in range(workers)]
    ):
        tally.add(part)
    assert tally.forbidden == {}
    assert sum(tally.kinds.values()) == COUNT
    # else mutations do nothing, or too much
    shares = {kind: count / COUNT for kind, count in tally.kinds.items()}
    assert 0.4 < shares["damage told"] < 0.8, shares
    assert 0.1 < shares["refused"] < 0.4, shares
    assert shares["as before"] > 0.03, shares
    assert shares["another log"] > 0.01, shares


def test_a_number_always_breaks_the_same_log_in_the_same_way():
    logs = list(sound_logs())
    assert [mutant(k, logs) for k in range(40)] == [mutant(k, logs) for k in range(40)]
    assert mutant(3, logs).data != mutant(3, logs, seed=1).data
    many = [mutant(k, logs) for k in range(400)]
    assert {word for one in many for word in one.what.split(", ")} == {one.__name__ for one in MUTATIONS}
    assert sum(one.data == packed(one.base.data, one.base.packing) for one in many) < 20


def unbroken(name: str) -> tuple[Mutant, verdicts.Truth]:
    """A sound log in the place of a broken one."""
    (number,) = [number for number, one in enumerate(sound_logs()) if one.name == name]
    sound = truth(number)
    return Mutant(0, sound.base, packed(sound.base.data, sound.base.packing), "nothing"), sound


def test_what_is_sound_is_as_before(tmp_path):
    for name in ("zstd", "json", "packed with lz4"):
        assert judge(*unbroken(name), tmp_path / "sound.mcap") == "as before"


@pytest.mark.parametrize("name", ["zstd", "no summary, no chunks"])
def test_what_is_silently_shortened_or_changed_is_found(tmp_path, monkeypatch, name):
    sound = unbroken(name)

    def shortened(path, wants):
        result = read(path, wants)
        series = result.series["/wrench"]
        columns = {field: column[:-1] for field, column in series.columns.items()}
        short = replace(series, log_time_ns=series.log_time_ns[:-1], columns=columns)
        return replace(result, series=result.series | {"/wrench": short})

    def bent(path, wants):
        result = read(path, wants)
        columns = result.series["/odom"].columns | {"pose.pose.position.x": np.zeros(30)}
        other = replace(result.series["/odom"], columns=columns)
        return replace(result, series=result.series | {"/odom": other})

    for false, words in ((shortened, "/wrench: 0 wrong, 1 missing of 90"), (bent, "/odom: 29 wrong, 29 missing of 30")):
        monkeypatch.setattr(verdicts, "read", false)
        with pytest.raises(ForbiddenError, match=f"the strict twin reads otherwise: {words}"):
            judge(*sound, tmp_path / "broken.mcap")


def test_of_a_faulty_file_only_unprotected_messages_that_were_hit_may_differ():
    _, sound = unbroken("unchecked, no summary")
    told, fault = sound.base.strict.of("/odom")[3], FaultError("a fault")
    hit = sound.base.data.replace(told.whole, b"hit".ljust(len(told.whole)))
    rows = sound.rows | {"/odom": [*sound.rows["/odom"][:3], (0, ()), *sound.rows["/odom"][4:]]}
    fewer = sound.rows | {"/odom": [*sound.rows["/odom"][:3], *sound.rows["/odom"][4:]]}
    protected = replace(sound, base=replace(sound.base, protected=True))
    check_hits(sound, sound.rows, hit, fault)
    check_hits(sound, rows, hit, fault)
    for truth_, found, data in ((sound, rows, sound.base.data), (sound, fewer, hit), (protected, rows, hit)):
        with pytest.raises(ForbiddenError, match="1 messages of /odom are lost or changed; a fault"):
            check_hits(truth_, found, data, fault)


def test_messages_that_something_promises_are_missed(tmp_path, monkeypatch):
    """A message of another channel leaves a sound file, but for its index and statistics."""
    sound, right = unbroken("uncompressed chunks")
    told = right.base.strict.of("/people")[1]
    number = next(number for number, (_, topic, _) in right.base.strict.channels.items() if topic == "/camera")
    whole = told.whole[:9] + number.to_bytes(2, "little") + told.whole[11:]
    broken = replace(sound, data=sound.data.replace(told.whole, whole))
    assert judge(broken, right, tmp_path / "broken.mcap") == "damage told"
    monkeypatch.setattr(verdicts, "read", lambda path, wants: replace(read(path, wants), damage=()))
    with pytest.raises(ForbiddenError, match="the statistics promise 3 messages of /people, 2 were read"):
        judge(broken, right, tmp_path / "broken.mcap")


def test_what_only_the_recording_loses_is_found(tmp_path, monkeypatch):
    def without_people(path):
        return replace(load_recording(path), people=())

    monkeypatch.setattr(verdicts, "load_recording", without_people)
    with pytest.raises(ForbiddenError, match="the columns are those of the sound log, the recording is not"):
        judge(*unbroken("zstd"), tmp_path / "sound.mcap")


def test_damage_that_a_recording_does_not_tell_is_found(tmp_path, monkeypatch):
    sound, right = unbroken("zstd")
    broken = replace(sound, data=sound.data[:-20])
    monkeypatch.setattr(verdicts, "load_recording", lambda path: replace(load_recording(path), damage=()))
    with pytest.raises(ForbiddenError, match=r"load_recording does not tell: .*inside its closing records"):
        judge(broken, right, tmp_path / "broken.mcap")


def fresh_memory(megabytes):
    """Touch memory that no earlier test has left to the heap."""
    with mmap.mmap(-1, megabytes << 20) as pages:
        for _ in range(megabytes):
            pages.write(bytes(1 << 20))


@pytest.mark.parametrize(
    ("false", "words"),
    [
        (lambda _: 1 / 0, r"ZeroDivisionError: division by zero \(.*test_fuzz.py:\d+\)"),
        (lambda path: open(path, "rb").read(1) and None, "spilt: ResourceWarning"),  # noqa: PTH123, SIM115
        (lambda _: np.zeros(1) / 0, "RuntimeWarning: invalid value encountered in divide"),
        (lambda _: fresh_memory(120), "MB of memory more than before"),
        (lambda _: time.sleep(3), "scan takes (more than )?[0-9.]+ s"),
    ],
)
def test_what_else_never_may_happen_is_found(monkeypatch, false, words):
    monkeypatch.setattr(verdicts, "scan", false)
    monkeypatch.setattr(fuzzing, "MOST_S", 1.0)
    monkeypatch.setattr(fuzzing, "MOST_MB", 50.0)
    tally = judged([0])
    assert tally.kinds["forbidden"] == 1
    assert re.search(words, tally.forbidden[0]), tally.forbidden


def test_an_error_of_several_lines_is_found(tmp_path, monkeypatch):
    def refuse(_):
        raise LogError("one line\nand another")

    monkeypatch.setattr(verdicts, "scan", refuse)
    with pytest.raises(ForbiddenError, match="scan: an error that is no line: "):
        judge(*unbroken("zstd"), tmp_path / "sound.mcap")
