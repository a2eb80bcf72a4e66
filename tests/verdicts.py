"""What reading a broken log may come to, and what it may never come to.

A broken log may be refused in one line, or be read with its damage reported. Where neither happens, what was read must
be one of these:

- What the intact log holds. The mutation hit bytes that are not needed, or that the file states twice.
- What the strict twin (`strict_log`) reads in the broken file. It uses no index, stops at the first fault and checks
  every CRC, so the file is intact but another one: a topic has another name, a record is missing, or a payload that no
  CRC protects has other bytes. Neither the statistics nor the message indexes may count more messages than were read.
- In a file that the twin refuses: what the intact log holds, except for messages that no CRC protects and whose own
  bytes were hit. The number of messages must be the same. Of a changed structure, the messages that it still holds
  count.

Everything else is a result that was shortened or changed in silence. A recording must report what reading its topics
reports, and must equal that of the intact log where all topics do. A topic whose type was changed is another topic.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import strict_log
from log_rows import MessageType, Row, counts_of, rows_of, same_recordings, same_series, slow_columns
from mutations import Mutant
from small_logs import IntactLog

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import NavirlError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import Contents, ReadResult, Series, read, scan
from navirl_cli.logs.overview import overview
from navirl_cli.logs.recording import Recording
from navirl_cli.logs.sources import Source

STAMP = ("header.stamp", "header.frame_id")


def fields(path: str, names: str = "xyz") -> tuple[str, ...]:
    return tuple(f"{path}.{name}" for name in names)


def pose(path: str) -> tuple[str, ...]:
    return fields(f"{path}.position") + fields(f"{path}.orientation", "xyzw")


LINK = (*STAMP, "child_frame_id", *fields("transform.translation"), *fields("transform.rotation", "xyzw"))
#: The fields that are read of every log: all that an extraction needs.
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
    """Something came of a broken log that never may; the message says what."""


@dataclass(frozen=True)
class Truth:
    """What is in an intact log."""

    log: IntactLog
    #: Columns by topic, their rows, and the row of each payload.
    series: dict[str, Series]
    rows: dict[str, list[Row]]
    by_payload: dict[tuple[str, bytes], tuple[bytes, ...]]
    #: By topic.
    types: dict[str, MessageType]
    counts: Counter[tuple[str, str]]
    contents: Contents
    recording: Recording


def in_order(log: IntactLog, topic: str) -> list[strict_log.StrictMessage]:
    """A topic's messages by time of receipt."""
    return sorted(log.strict.of(topic), key=lambda message: message.log_time_ns)


#: Calls a function under a name, and returns what it returns, or the expected error that it raises.
Call = Callable[[str, Callable[[], Any]], Any]


def truth_of(log: IntactLog, folder: Path) -> Truth:
    """Read an intact log; the strict twin must agree."""
    path = folder / "intact.mcap"
    path.write_bytes(log.stored)
    result, recording = read(path, WANTS), load_recording(path)
    assert not result.damage, log.name
    assert not recording.damage, log.name
    assert len(extract(recording, ExtractSettings()).demonstrations) == 1, log.name
    rows = {topic: rows_of(series) for topic, series in result.series.items()}
    types = dict(type_of(number, log.strict) for number in log.strict.channels)
    contents = scan(path)
    truth = Truth(log, result.series, rows, {}, types, counts_of(contents), contents, recording)
    assert rows == expected_rows(truth, log.strict, result.series), log.name
    for topic, found in rows.items():
        for message, (_, columns) in zip(in_order(log, topic), found, strict=True):
            truth.by_payload[topic, message.payload] = columns
    return truth


def plain_call(name: str, work: Callable[[], Any]) -> Any:
    """Call a function that may raise an expected error; return its result, or that error.

    Raises:
        ForbiddenError: The error's message is not one line.
    """
    try:
        return work()
    except NavirlError as error:
        if not str(error).strip() or "\n" in str(error):
            raise ForbiddenError(f"{name}: an error message that is not one line: {str(error)!r}") from error
        return error


def judge(mutant: Mutant, truth: Truth, path: Path, call: Call = plain_call) -> str:
    """Read a broken log by every function that reads logs.

    Args:
        mutant: The log.
        truth: What is in the intact log.
        path: Where the broken log is written.
        call: Calls each function; measures it, where wished.

    Returns:
        The outcome: "refused", "damage reported", "as before", "another log" or "payloads hit".

    Raises:
        ForbiddenError: Something came of it that never may.
    """
    path.write_bytes(mutant.data)
    contents = call("scan", lambda: scan(path))
    # overview calls message_times
    view = call("overview", lambda: overview(Source(path.name, (path,)), {}, check=True))
    result = call("read", lambda: read(path, WANTS))
    recording = call("load_recording", lambda: load_recording(path))
    if isinstance(recording, Recording) and mutant.number % 4 == 0:
        call("extract", lambda: extract(recording, ExtractSettings()))
    if isinstance(result, NavirlError):
        if not isinstance(recording, NavirlError):
            raise ForbiddenError("load_recording accepts what read refuses")
        return "refused"
    outcome = reported_or_right(mutant, truth, result)
    if outcome != "damage reported":
        check_counts(mutant, truth, view)
    if isinstance(recording, Recording) and not recording.damage:
        counts = counts_of(contents)
        if outcome == "damage reported":
            alike = {
                topic: WANTS[topic] for topic, type_name in truth.counts if counts[topic, type_name] and topic in WANTS
            }
            if damage := read(path, alike, packed=("/map",)).damage:
                raise ForbiddenError(f"load_recording does not report: {damage[0]}")
        elif outcome == "as before" and counts == truth.counts and not same_recordings(recording, truth.recording):
            raise ForbiddenError("the columns are those of the intact log, the recording is not")
    return outcome


def reported_or_right(mutant: Mutant, truth: Truth, result: ReadResult) -> str:
    """The outcome of reading; what was read must be right where no damage is reported."""
    if result.damage:
        return "damage reported"
    if same_series(result.series, truth.series):
        return "as before"
    rows = {topic: found for topic, series in result.series.items() if (found := rows_of(series))}
    data = b""
    try:
        data = strict_log.decompressed(mutant.data)
        strict = strict_log.walk(data)
    except strict_log.FaultError as fault:
        check_hits(truth, rows, data, fault, mutant.records, hit=mutant.hit)
        return "payloads hit"
    right = expected_rows(truth, strict, result.series)
    if rows != right:
        raise ForbiddenError(f"the strict twin reads otherwise: {differences(rows, right)}")
    for number, (_, topic, _) in strict.channels.items():
        found = len(rows.get(topic, ()))
        for source, counts in (("statistics", strict.counted), ("message indexes", strict.indexed)):
            if topic in WANTS and found < min(counts.get(number, 0), len(truth.rows.get(topic, ()))):
                raise ForbiddenError(f"the {source} count {counts[number]} messages of {topic}, {found} were read")
    return "another log"


def check_hits(
    truth: Truth,
    rows: dict[str, list[Row]],
    data: bytes,
    fault: strict_log.FaultError,
    records: bytes | None = None,
    *,
    hit: bool = False,
) -> None:
    """Check that only those messages of a faulty file differ that no CRC protects and whose bytes were hit.

    Args:
        truth: What is in the intact log.
        rows: What was read.
        data: The file, decompressed.
        fault: Why the twin refuses it.
        records: Where the structure was changed: the records of all its chunks without compression, which may be fewer.
        hit: Whether bytes were changed after that.
    """
    protected = truth.log.protected and records is None
    if records is not None:
        data = data + records if not hit else records if truth.log.protected else data
    for topic, intact in truth.rows.items():
        missing = Counter(intact) - Counter(rows.get(topic, ()))
        gone = [message for message, row in zip(in_order(truth.log, topic), intact, strict=True) if row in missing]
        not_hit = [message for message in gone if protected or message.record in data]
        if not_hit or (records is None and len(rows.get(topic, ())) < len(intact)):
            raise ForbiddenError(f"{len(gone)} messages of {topic} are lost or changed; {fault}")


def check_counts(mutant: Mutant, truth: Truth, view: Any) -> None:
    """Check that the overview counts as many messages, and states the times, that the log holds without damage."""
    if isinstance(view, NavirlError) or view.damage or view.contents[0].damage:
        return
    contents = view.contents[0]
    found = {topic: contents.topic_count(topic) for topic in WANTS}
    times = truth.contents.start_ns, truth.contents.end_ns
    if found == {topic: len(truth.rows.get(topic, ())) for topic in WANTS} and times == (
        contents.start_ns,
        contents.end_ns,
    ):
        return
    try:
        strict = strict_log.walk(strict_log.decompressed(mutant.data))
    except strict_log.FaultError as fault:
        if mutant.records is not None:
            return  # the messages of a changed structure are others, and only the twin could count them
        raise ForbiddenError(f"the overview counts {found}; {fault}") from fault
    right = {topic: len(strict.of(topic)) for topic in WANTS}
    if found != right:
        raise ForbiddenError(f"the overview counts {found}, the strict twin {right}")
    all_ns = [message.log_time_ns for message in strict.messages]
    span_ns = (min(all_ns), max(all_ns)) if all_ns else (None, None)
    if (contents.start_ns, contents.end_ns) != span_ns:
        raise ForbiddenError(f"the overview says {contents.start_ns} to {contents.end_ns}, the strict twin {span_ns}")


def differences(rows: dict[str, list[Row]], right: dict[str, list[Row]]) -> str:
    """Where rows differ from what they should be."""
    texts = []
    for topic in sorted({*rows, *right}):
        extra = Counter(rows.get(topic, ())) - Counter(right.get(topic, ()))
        missing = Counter(right.get(topic, ())) - Counter(rows.get(topic, ()))
        if rows.get(topic) != right.get(topic):
            texts.append(f"{topic}: {extra.total()} wrong, {missing.total()} missing of {len(right.get(topic, ()))}")
    return "; ".join(texts)


def expected_rows(truth: Truth, strict: strict_log.StrictLog, series: Mapping[str, Series]) -> dict[str, list[Row]]:
    """Rows by topic as the strict twin reads them.

    Args:
        truth: What is in the intact log.
        strict: The broken log, as the twin reads it.
        series: What was read; gives the types of the columns.
    """
    found: dict[str, list[Row]] = {}
    types = {number: type_of(number, strict) for number in strict.channels}
    for message in strict.messages:
        topic, own_type = types[message.channel]
        if topic in WANTS:
            columns = truth.by_payload.get((topic, message.payload)) if own_type == truth.types.get(topic) else None
            if columns is None and topic in series:
                columns = slow_columns(own_type, message.payload, WANTS[topic], series[topic])
                # of a definition that only the twin cannot parse, the intact log's values are the right ones
                columns = columns or truth.by_payload.get((topic, message.payload))
            found.setdefault(topic, []).append((message.log_time_ns, columns or ()))
    return {topic: sorted(rows, key=lambda row: row[0]) for topic, rows in found.items()}


def type_of(number: int, strict: strict_log.StrictLog) -> tuple[str, MessageType]:
    """Topic and message type of a channel."""
    schema_id, topic, encoding = strict.channels[number]
    return topic, (*strict.schemas.get(schema_id, ("", "", b"")), encoding)
