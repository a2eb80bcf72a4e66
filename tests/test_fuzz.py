"""Broken logs: never a traceback, a hang, much memory or reading, or a silently shortened result."""

import mmap
import re
import time
from dataclasses import replace

import fuzzing
import numpy as np
import pytest
import verdicts
from fuzzing import Tally, judge_logs, logs, truth
from mutations import MUTATIONS, Mutant, mutant
from rewriting import Part, taken_apart
from strict_log import FaultError
from structured import STRUCTURED
from verdicts import WANTS, ForbiddenError, check_hits, judge

from navirl_cli.errors import LogError
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import read
from navirl_cli.parallel import cores, map_in_order


@pytest.mark.parametrize("numbers", [range(150), pytest.param(range(150, 2000), marks=pytest.mark.slow)], ids=str)
def test_broken_logs(numbers):
    # a process breaks some of the intact logs only, so that it makes no others
    workers = cores()
    tally = Tally()
    for part in map_in_order(
        judge_logs, [[k for k in numbers if k % len(logs()) % workers == one] for one in range(workers)]
    ):
        tally.add(part)
    assert tally.forbidden == {}
    assert sum(tally.outcomes.values()) == len(numbers)
    # other shares would mean that mutations change nothing, or too much
    shares = {outcome: count / len(numbers) for outcome, count in tally.outcomes.items()}
    assert 0.4 < shares["damage reported"] < 0.8, shares
    assert 0.05 < shares["refused"] < 0.4, shares
    assert shares["as before"] > 0.03, shares
    assert shares["another log"] > 0.01, shares


def test_a_number_always_breaks_the_same_log_in_the_same_way():
    assert [mutant(k, logs()) for k in range(40)] == [mutant(k, logs()) for k in range(40)]
    assert mutant(3, logs()).data != mutant(3, logs(), seed=1).data
    many = [mutant(k, logs()) for k in range(400)]
    assert {word for one in many for word in one.what.split(", ")} == {
        one.__name__ for one in (*MUTATIONS, *STRUCTURED)
    }
    assert sum(one.data == one.log.stored for one in many) < 20


def unbroken(name: str) -> tuple[Mutant, verdicts.Truth]:
    """An intact log in the place of a broken one."""
    (number,) = [number for number, log in enumerate(logs()) if log.name == name]
    return Mutant(0, logs()[number], logs()[number].stored, "nothing"), truth(number)


def test_intact_logs_read_as_before(tmp_path):
    for name in ("zstd", "json", "file compressed with lz4"):
        assert judge(*unbroken(name), tmp_path / "intact.mcap") == "as before"


@pytest.mark.parametrize("name", ["zstd", "no summary, no chunks"])
def test_silently_shortened_or_changed_results_are_found(tmp_path, monkeypatch, name):
    intact = unbroken(name)

    def shortened(path, wants):
        result = read(path, wants)
        series = result.series["/wrench"]
        columns = {field: column[:-1] for field, column in series.columns.items()}
        short = replace(series, log_time_ns=series.log_time_ns[:-1], columns=columns)
        return replace(result, series=result.series | {"/wrench": short})

    def changed(path, wants):
        result = read(path, wants)
        columns = result.series["/odom"].columns | {"pose.pose.position.x": np.zeros(30)}
        other = replace(result.series["/odom"], columns=columns)
        return replace(result, series=result.series | {"/odom": other})

    cases = (shortened, "/wrench: 0 wrong, 1 missing of 90"), (changed, "/odom: 29 wrong, 29 missing of 30")
    for wrong, difference in cases:
        monkeypatch.setattr(verdicts, "read", wrong)
        with pytest.raises(ForbiddenError, match=f"the strict twin reads otherwise: {difference}"):
            judge(*intact, tmp_path / "broken.mcap")


def test_only_unprotected_messages_that_were_hit_may_differ_in_a_faulty_file():
    _, intact = unbroken("unchecked, no summary")
    message, fault = intact.log.strict.of("/odom")[3], FaultError("a fault")
    hit = intact.log.data.replace(message.record, b"hit".ljust(len(message.record)))
    rows = intact.rows | {"/odom": [*intact.rows["/odom"][:3], (0, ()), *intact.rows["/odom"][4:]]}
    fewer = intact.rows | {"/odom": [*intact.rows["/odom"][:3], *intact.rows["/odom"][4:]]}
    protected = replace(intact, log=replace(intact.log, protected=True))
    check_hits(intact, intact.rows, hit, fault)
    check_hits(intact, rows, hit, fault)
    # a structure without that message: it may be missing, the others may not
    others = b"".join(one.record for one in intact.log.strict.messages if one is not message)
    check_hits(protected, fewer, b"", fault, others)
    check_hits(protected, fewer, b"", fault, others, hit=True)
    with pytest.raises(ForbiddenError, match="1 messages of /odom are lost or changed; a fault"):
        check_hits(protected, fewer, b"", fault, others + message.record, hit=True)
    for truth_, found, data in ((intact, rows, intact.log.data), (intact, fewer, hit), (protected, rows, hit)):
        with pytest.raises(ForbiddenError, match="1 messages of /odom are lost or changed; a fault"):
            check_hits(truth_, found, data, fault)


def test_missing_messages_that_statistics_count_are_found(tmp_path, monkeypatch):
    """A message that moves to another channel leaves an intact file, except for its index and statistics."""
    intact, right = unbroken("uncompressed chunks")
    message = right.log.strict.of("/people")[1]
    number = next(number for number, (_, topic, _) in right.log.strict.channels.items() if topic == "/camera")
    moved = message.record[:9] + number.to_bytes(2, "little") + message.record[11:]
    broken = replace(intact, data=intact.data.replace(message.record, moved))
    assert judge(broken, right, tmp_path / "broken.mcap") == "damage reported"
    monkeypatch.setattr(verdicts, "read", lambda path, wants: replace(read(path, wants), damage=()))
    with pytest.raises(ForbiddenError, match="the statistics count 3 messages of /people, 2 were read"):
        judge(broken, right, tmp_path / "broken.mcap")


def test_losses_of_the_recording_alone_are_found(tmp_path, monkeypatch):
    intact = unbroken("zstd")

    def without_people(path):
        return replace(load_recording(path), people=())

    monkeypatch.setattr(verdicts, "load_recording", without_people)
    with pytest.raises(ForbiddenError, match="the columns are those of the intact log, the recording is not"):
        judge(*intact, tmp_path / "intact.mcap")


def test_damage_that_a_recording_does_not_report_is_found(tmp_path, monkeypatch):
    intact, right = unbroken("zstd")
    broken = replace(intact, data=intact.data[:-20])
    monkeypatch.setattr(verdicts, "load_recording", lambda path: replace(load_recording(path), damage=()))
    with pytest.raises(ForbiddenError, match=r"load_recording does not report: .*inside its closing records"):
        judge(broken, right, tmp_path / "broken.mcap")


def fresh_memory(megabytes):
    """Touch memory that no earlier test has left to the heap."""
    with mmap.mmap(-1, megabytes << 20) as pages:
        for _ in range(megabytes):
            pages.write(bytes(1 << 20))


def read_often(path):
    """Read a file from its start again and again."""
    with open_log(path) as raw:
        for _ in range(101):
            raw.read(0, raw.size)


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        (lambda _: 1 / 0, r"ZeroDivisionError: division by zero \(.*test_fuzz.py:\d+\)"),
        (lambda path: open(path, "rb").read(1) and None, "cannot be raised: ResourceWarning"),  # noqa: PTH123, SIM115
        (lambda _: np.zeros(1) / 0, "RuntimeWarning: invalid value encountered in divide"),
        (lambda _: fresh_memory(120), "MB of memory more than before"),
        (read_often, "scan reads 101 times the log's bytes"),
    ],
)
def test_other_forbidden_outcomes_are_found(monkeypatch, wrong, problem):
    truth(0)  # read before what reads it is replaced
    monkeypatch.setattr(verdicts, "scan", wrong)
    monkeypatch.setattr(fuzzing, "MOST_MB", 50.0)
    tally = judge_logs([0])
    assert tally.outcomes["forbidden"] == 1
    assert re.search(problem, tally.forbidden[0]), tally.forbidden


def test_a_hang_is_found(monkeypatch):
    truth(0)
    monkeypatch.setattr(verdicts, "scan", lambda _: time.sleep(60))
    monkeypatch.setattr(fuzzing, "HANGS_S", 0.2)
    assert "scan hangs: no answer after 0.2 s" in judge_logs([0]).forbidden[0]


def test_an_error_of_several_lines_is_found(tmp_path, monkeypatch):
    def refuse(_):
        raise LogError("one line\nand another")

    intact = unbroken("zstd")
    monkeypatch.setattr(verdicts, "scan", refuse)
    with pytest.raises(ForbiddenError, match="scan: an error message that is not one line: "):
        judge(*intact, tmp_path / "intact.mcap")


def test_a_summary_that_defines_a_channel_otherwise_than_the_data_is_reported(tmp_path):
    """Its CRC is right, so that no byte is damaged: one of the two is wrong all the same."""
    parts = taken_apart(next(log for log in logs() if log.name == "zstd").data)
    parts.summary[:] = [Part(one.code, one.content.replace(b"/odom", b"/idom")) for one in parts.summary]
    path = tmp_path / "run.mcap"
    path.write_bytes(parts.stored())
    (damage, *_) = read(path, WANTS).damage
    assert "is defined twice, as" in damage.reason
    assert "'/idom'" in damage.reason
