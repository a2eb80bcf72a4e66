"""What reading a broken log may come to, and what it may never.

A broken log may be refused by one line, or be read with its damage told. Where neither happens, what was read must be

- what the sound log holds: the mutation hit what nobody needs, or what the file says twice; or
- what the strict twin reads in the broken file (`strict_log`), which knows no index, goes on behind no fault and checks
  every CRC. Then the file is sound, but another one: its topic has another name, a record was taken out whole, or a
  payload has other bytes that no CRC protects. Nothing in it may promise more messages than were read, neither its
  statistics nor its message indexes; or
- in a file that the twin refuses, what the sound log holds, but for messages that no CRC protects and whose own bytes
  were hit; as many as before must be there.

Everything else is a silently shortened or changed result. A recording must tell what reading its topics tells, and be
that of the sound log where all topics are. A topic whose type was changed is another topic for a recording.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import strict_log
from log_rows import Kind, Row, counts_of, rows_of, same_recordings, same_series, slow_columns
from mutations import Mutant
from small_logs import Base, packed

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import NavirlError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import ReadResult, Series, read, scan
from navirl_cli.logs.overview import overview
from navirl_cli.logs.recording import Recording
from navirl_cli.logs.sources import Source

STAMP = ("header.stamp", "header.frame_id")


def fields(path: str, names: str = "xyz") -> tuple[str, ...]:
    return tuple(f"{path}.{name}" for name in names)


def pose(path: str) -> tuple[str, ...]:
    return fields(f"{path}.position") + fields(f"{path}.orientation", "xyzw")


LINK = (*STAMP, "child_frame_id", *fields("transform.translation"), *fields("transform.rotation", "xyzw"))
#: What is read of every log: all that an extraction needs.
WANTS = {
    "/wrench": (*STAMP, *fields("wrench.force")),
    "/odom": (*STAMP, "child_frame_id", *pose("pose.pose"), *fields("twist.twist.linear", "xy")),
    "/map": (*STAMP, "info.resolution", "info.width", "info.height", *pose("info.origin"), "data[]"),
    "/goal_pose": (*STAMP, *pose("pose")),
    "/people": (*STAMP, *fields("poses[].position")),
    "/tf": tuple(f"transforms[].{name}" for name in LINK),
    "/tf_static": tuple(f"transforms[].{name}" for name in LINK),
}


class ForbiddenError(Exception):
    """Something came out that never may; the message says what."""


@dataclass(frozen=True)
class Truth:
    """What is in a sound log."""

    base: Base
    #: Columns by topic, their rows, and the row of each payload.
    series: dict[str, Series]
    rows: dict[str, list[Row]]
    by_payload: dict[tuple[str, bytes], tuple[bytes, ...]]
    #: Schema and encoding of the messages by topic.
    kinds: dict[str, Kind]
    counts: Counter[tuple[str, str]]
    recording: Recording


def in_order(base: Base, topic: str) -> list[strict_log.Told]:
    """A topic's messages by time of receipt."""
    return sorted(base.strict.of(topic), key=lambda told: told.log_time_ns)


#: Calls a function under a name, and returns what it returns, or the known trouble that it raises.
Call = Callable[[str, Callable[[], Any]], Any]


def truth_of(base: Base, folder: Path) -> Truth:
    """Read a sound log; the strict twin must agree."""
    path = folder / "sound.mcap"
    path.write_bytes(packed(base.data, base.packing))
    result, recording = read(path, WANTS), load_recording(path)
    assert not result.damage, base.name
    assert not recording.damage, base.name
    assert len(extract(recording, ExtractSettings()).demonstrations) == 1, base.name
    rows = {topic: rows_of(series) for topic, series in result.series.items()}
    kinds = dict(kind_of(number, base.strict) for number in base.strict.channels)
    truth = Truth(base, result.series, rows, {}, kinds, counts_of(scan(path)), recording)
    assert rows == expected_rows(truth, base.strict, result.series), base.name
    for topic, found in rows.items():
        for told, (_, columns) in zip(in_order(base, topic), found, strict=True):
            truth.by_payload[topic, told.payload] = columns
    return truth


def plain_call(name: str, work: Callable[[], Any]) -> Any:
    """Call a function that may find known trouble.

    Raises:
        ForbiddenError: The trouble is not told in one line.
    """
    try:
        return work()
    except NavirlError as error:
        if not str(error).strip() or "\n" in str(error):
            raise ForbiddenError(f"{name}: an error that is no line: {str(error)!r}") from error
        return error


def judge(mutant: Mutant, truth: Truth, path: Path, call: Call = plain_call) -> str:
    """Read a broken log in every way.

    Args:
        mutant: The log.
        truth: What it was.
        path: Where it is written to.
        call: Stands between, to measure.

    Returns:
        The kind of what came out.

    Raises:
        ForbiddenError: Something came out that never may.
    """
    path.write_bytes(mutant.data)
    contents = call("scan", lambda: scan(path))
    # which calls message_times
    view = call("overview", lambda: overview(Source(path.name, (path,)), {}, check=True))
    result = call("read", lambda: read(path, WANTS))
    recording = call("load_recording", lambda: load_recording(path))
    if isinstance(recording, Recording) and mutant.number % 4 == 0:
        call("extract", lambda: extract(recording, ExtractSettings()))
    if isinstance(result, NavirlError):
        # nothing can be had from such a file
        if not isinstance(recording, NavirlError):
            raise ForbiddenError("load_recording takes what read refuses")
        return "refused"
    kind = told_or_right(mutant, truth, result)
    if kind != "damage told":
        check_counts(mutant, truth, view)
    if isinstance(recording, Recording) and not recording.damage:
        counts = counts_of(contents)
        if kind == "damage told":
            alike = {
                topic: WANTS[topic] for topic, type_name in truth.counts if counts[topic, type_name] and topic in WANTS
            }
            # of maps only the latest matters
            if damage := read(path, alike, latest=("/map",)).damage:
                raise ForbiddenError(f"load_recording does not tell: {damage[0]}")
        elif kind == "as before" and counts == truth.counts and not same_recordings(recording, truth.recording):
            raise ForbiddenError("the columns are those of the sound log, the recording is not")
    return kind


def told_or_right(mutant: Mutant, truth: Truth, result: ReadResult) -> str:
    """The kind of a result; it must be right where no damage is told."""
    if result.damage:
        return "damage told"
    if same_series(result.series, truth.series):
        return "as before"
    rows = {topic: found for topic, series in result.series.items() if (found := rows_of(series))}
    data = b""
    try:
        data = strict_log.unpacked(mutant.data)
        strict = strict_log.walk(data)
    except strict_log.FaultError as fault:
        check_hits(truth, rows, data, fault)
        return "payloads hit"
    right = expected_rows(truth, strict, result.series)
    if rows != right:
        raise ForbiddenError(f"the strict twin reads otherwise: {differences(rows, right)}")
    for number, (_, topic, _) in strict.channels.items():
        found = len(rows.get(topic, ()))
        for source, counts in (("statistics", strict.promised), ("message indexes", strict.indexed)):
            if topic in WANTS and found < min(counts.get(number, 0), len(truth.rows.get(topic, ()))):
                raise ForbiddenError(f"the {source} promise {counts[number]} messages of {topic}, {found} were read")
    return "another log"


def check_hits(truth: Truth, rows: dict[str, list[Row]], data: bytes, fault: strict_log.FaultError) -> None:
    """Check that of a faulty file only messages changed that no CRC protects and that stand nowhere as they were."""
    for topic, sound in truth.rows.items():
        missing = Counter(sound) - Counter(rows.get(topic, ()))
        gone = [told for told, row in zip(in_order(truth.base, topic), sound, strict=True) if row in missing]
        unhit = [told for told in gone if truth.base.protected or told.whole in data]
        if unhit or len(rows.get(topic, ())) < len(sound):
            raise ForbiddenError(f"{len(gone)} messages of {topic} are lost or changed; {fault}")


def check_counts(mutant: Mutant, truth: Truth, view: Any) -> None:
    """Where no damage is told, as many messages are counted as there are."""
    if isinstance(view, NavirlError) or view.damage or view.contents[0].damage:
        return
    found = {topic: view.contents[0].topic_count(topic) for topic in WANTS}
    if found == {topic: len(truth.rows.get(topic, ())) for topic in WANTS}:
        return
    try:
        strict = strict_log.walk(strict_log.unpacked(mutant.data))
    except strict_log.FaultError as fault:
        raise ForbiddenError(f"the overview counts {found}; {fault}") from fault
    right = {topic: len(strict.of(topic)) for topic in WANTS}
    if found != right:
        raise ForbiddenError(f"the overview counts {found}, the strict twin {right}")


def differences(rows: dict[str, list[Row]], right: dict[str, list[Row]]) -> str:
    """Where rows differ from what they should be."""
    told = []
    for topic in sorted({*rows, *right}):
        extra = Counter(rows.get(topic, ())) - Counter(right.get(topic, ()))
        missing = Counter(right.get(topic, ())) - Counter(rows.get(topic, ()))
        if rows.get(topic) != right.get(topic):
            told.append(f"{topic}: {extra.total()} wrong, {missing.total()} missing of {len(right.get(topic, ()))}")
    return "; ".join(told)


def expected_rows(truth: Truth, strict: strict_log.Strict, series: Mapping[str, Series]) -> dict[str, list[Row]]:
    """Rows by topic as the strict twin has them.

    Args:
        truth: The sound log.
        strict: The broken one, as the twin has it.
        series: What was read, whose types of columns are taken.
    """
    found: dict[str, list[Row]] = {}
    kinds = {number: kind_of(number, strict) for number in strict.channels}
    for told in strict.messages:
        topic, kind = kinds[told.channel]
        if topic in WANTS:
            columns = truth.by_payload.get((topic, told.payload)) if kind == truth.kinds.get(topic) else None
            if columns is None and topic in series:
                columns = slow_columns(kind, told.payload, WANTS[topic], series[topic])
            found.setdefault(topic, []).append((told.log_time_ns, columns or ()))
    return {topic: sorted(rows, key=lambda row: row[0]) for topic, rows in found.items()}


def kind_of(number: int, strict: strict_log.Strict) -> tuple[str, Kind]:
    """Topic and definition of a channel."""
    schema_id, topic, encoding = strict.channels[number]
    return topic, (*strict.schemas.get(schema_id, ("", "", b"")), encoding)
