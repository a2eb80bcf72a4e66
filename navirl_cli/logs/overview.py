"""What is in a recording, and whether extract can use it: the same line of stages as extract's, and tables of topics.

The tables come from indexes, and from the first messages where indexes do not suffice. Of a large log in a store only
the summary is read, which takes a few requests, unless all of it is asked for.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container.batches import Channel
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.log_file import LogFile, threads_here
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.findings import Severity
from navirl_cli.logs.load import Line, LoadOptions, follow
from navirl_cli.logs.messages.decode import DecodedBatch, Decoder
from navirl_cli.logs.messages.definitions import parse_definition
from navirl_cli.logs.messages.reader import Contents, Progress, message_times, scan
from navirl_cli.logs.messages.reader import check as check_messages
from navirl_cli.logs.messages.schema import Schema, SchemaError, full_name
from navirl_cli.logs.roles import message_types
from navirl_cli.logs.roles.clocks import NS_PER_S, Stamped
from navirl_cli.logs.roles.receipts import wrong_receipts
from navirl_cli.logs.roles.topics import Choice, Topic, choose, is_missing, topics_of
from navirl_cli.logs.sources import Source

#: A topic with messages at least this often is regular, s. It has a gap where it pauses this many times longer than
#: usual, and for at least this long, s.
_REGULAR_S, _PAUSE, _GAP_S = 1.0, 5.0, 0.5
#: Roles whose stamps can be the recording's clock, the best first.
_CLOCKS: Final = ("odometry", "wrench", "tf")
#: Chunks in whose messages stamps are looked for.
_SAMPLED: Final = 8
#: A log in a store whose times of receipt take more requests than this is told by its summary alone.
_REQUESTS: Final = 8
_STAMP: Final = "header.stamp"
_TF_STAMP: Final = message_types.TF.fields[_STAMP]
#: A topic and the full name of one of its types.
_Key = tuple[str, str]
_TRANSFORMS: Final = message_types.TF.sequence or ""


@dataclass(frozen=True)
class Flow:
    """When the messages of a topic came in."""

    topic: Topic
    #: "cdr", "ros1", "json" or what the recorder wrote.
    encoding: str
    #: First and last time of receipt, ns; None without messages.
    start_ns: int | None
    end_ns: int | None
    #: Messages a second on average, without gaps; None for less than three messages.
    rate_hz: float | None
    #: Gaps of a regular topic: how many, None where that is not known; the longest in s, and when that begins, s after
    #: the log's first message.
    gaps: int | None
    longest_s: float
    longest_at_s: float
    #: Stamps - times of receipt, s, in the first messages; None without stamps.
    offset_s: float | None


@dataclass(frozen=True, eq=False)
class Overview:
    """What is in a recording."""

    source: Source
    contents: tuple[Contents, ...]
    #: First and last time of receipt, ns; None without messages.
    start_ns: int | None
    end_ns: int | None
    flows: tuple[Flow, ...]
    #: What extract would make of it.
    line: Line
    #: What is lost, in words.
    damage: tuple[str, ...]
    #: Whether only the summary was read.
    is_brief: bool = False

    @property
    def choices(self) -> Mapping[str, Choice]:
        """The topics by role."""
        return self.line.choices

    @property
    def findings(self) -> tuple[str, ...]:
        """What is unusual about clocks, frames and measurements, in words; losses are in `damage`."""
        return tuple(dict.fromkeys(str(one) for one in self.line.findings if one.kind.severity is not Severity.LOSS))

    @property
    def frames(self) -> str:
        """How the frames connect, "map -> odom -> base_link"; empty without tf."""
        tree = self.line.placed.context.tree if self.line.placed else None
        return tree.describe() if tree and tree.frames else ""

    @property
    def refusals(self) -> tuple[str, ...]:
        """Why extract refuses the log although each needed role has a topic, in words."""
        if self._missing:
            return ()
        reasons = [str(one) for one in self.line.refusals]
        if self.line.recording is not None and self.line.recording.no_goal:
            reasons.append(self.line.recording.goal_problem)
        return tuple(dict.fromkeys(reasons))

    @property
    def reference_s(self) -> float:
        """Stamps - times of receipt of the topic whose clock counts, s; 0 where none is known."""
        topics = [topic for role in _CLOCKS for topic in self.choices[role].topics]
        offsets = [flow.offset_s for topic in topics for flow in self.flows if flow.topic == topic]
        return next((offset for offset in offsets if offset is not None), 0.0)

    @property
    def needed(self) -> tuple[str, ...]:
        """The roles that extract needs and the log does not serve; goals too, at which it splits trials by default."""
        no_goal = self.line.recording is not None and bool(self.line.recording.goal_problem)
        return (*self._missing, "goal") if no_goal else self._missing

    @property
    def _missing(self) -> tuple[str, ...]:
        """The needed roles without a topic."""
        return tuple(role for role, choice in self.choices.items() if is_missing(choice, self.choices))


def overview(
    source: Source,
    requested: Mapping[str, Sequence[str]],
    namespace: str | None = None,
    *,
    check: bool = False,
    progress: Progress | None = None,
) -> Overview:
    """What is in a recording.

    Args:
        source: Its files.
        requested: Names of topics by role, where the user named some.
        namespace: Of the robot, where the user named it.
        check: Read every message, so that damage inside of chunks shows too.
        progress: Called with bytes done and bytes in all.

    Raises:
        LogError: A file is no MCAP file, or a requested topic does not fit.
    """
    with ExitStack() as stack:
        files = [stack.enter_context(open_log(path)) for path in source.files]
        if not check and any(map(_is_far, files)):
            return _brief(source, [scan(file) for file in files], requested, namespace)
        timed = [message_times(file) for file in files]
        contents = tuple(one for one, _ in timed)
        line = follow(
            source, files, contents, LoadOptions(topics=requested, namespace=namespace), None if check else progress
        )
        stamped = _first_messages(files)
        damage = _all_damage(files, progress) if check else [note for one in contents for note in one.damage]
    received = _received(timed, line)
    start_ns = min((int(times[0]) for times in received.values() if len(times)), default=None)
    return Overview(
        source,
        contents,
        start_ns,
        max((int(times[-1]) for times in received.values() if len(times)), default=None),
        _flows(contents, received, start_ns or 0, stamped),
        line,
        tuple(dict.fromkeys((*map(str, (*source.damage, *damage)), *line.lost))),
    )


def _is_far(file: RawFile) -> bool:
    """Whether times of receipt alone would take many requests to a store."""
    with LogFile(file) as log:
        return log.requests_of_times > _REQUESTS


def _brief(
    source: Source, contents: Sequence[Contents], requested: Mapping[str, Sequence[str]], namespace: str | None
) -> Overview:
    """What the summaries of a recording in a store state; arguments as of :func:`overview`."""
    topics = topics_of(contents)
    choices = choose(source.name, topics, requested, namespace)
    damage = (*map(str, source.damage), *(str(note) for one in contents for note in one.damage))
    encodings = {_key(channel): channel.message_encoding for one in contents for channel in one.channels}
    flows = [
        Flow(topic, encodings[topic.name, topic.type_name], None, None, None, None, 0.0, 0.0, None) for topic in topics
    ]
    starts, ends = ([getattr(one, end) for one in contents] for end in ("start_ns", "end_ns"))
    return Overview(
        source,
        tuple(contents),
        min((one for one in starts if one is not None), default=None),
        max((one for one in ends if one is not None), default=None),
        tuple(flows),
        Line(choices, None, None, (), damage, None, ()),
        tuple(dict.fromkeys(damage)),
        is_brief=True,
    )


def _received(timed: Sequence[tuple[Contents, Mapping[int, IntArray]]], line: Line) -> dict[_Key, IntArray]:
    """By topic and type (n,) ns of receipt, ascending, without those that cannot be true, and without steps of clocks.

    Where the recorder's clock stepped, other topics than those of extract count only within the times of these.
    """
    by_key: dict[_Key, list[IntArray]] = {}
    for one, by_channel in timed:
        for channel in one.channels:
            by_key.setdefault(_key(channel), []).append(by_channel.get(channel.id, np.zeros(0, dtype=np.int64)))
    received = {key: np.sort(np.concatenate(times)) for key, times in by_key.items()}
    known = line.timed.received_ns if line.timed and line.timed.repaired else {}
    if known:
        first, last = min(int(times[0]) for times in known.values()), max(int(times[-1]) for times in known.values())
        within = {key: times[(times >= first) & (times <= last)] for key, times in received.items()}
        types = Counter(topic for topic, _ in received)
        return {key: known.get(key[0], times) if types[key[0]] == 1 else times for key, times in within.items()}
    wrong = wrong_receipts(np.concatenate([np.zeros(0, dtype=np.int64), *received.values()]))
    if wrong.all():
        return received
    parts = np.split(wrong, np.cumsum([len(times) for times in received.values()]))
    return {key: times[~part] for (key, times), part in zip(received.items(), parts, strict=False)}


def _flows(
    contents: Sequence[Contents], received: Mapping[_Key, IntArray], start_ns: int, stamped: Mapping[_Key, Stamped]
) -> tuple[Flow, ...]:
    """When the messages of each topic came in, by the times of receipt by topic."""
    encodings = {_key(channel): channel.message_encoding for one in contents for channel in one.channels}
    return tuple(
        _flow(topic, encodings[key], received[key], start_ns, stamped.get(key))
        for topic in topics_of(contents)
        for key in [(topic.name, topic.type_name)]
    )


def _key(channel: Channel) -> _Key:
    """The topic that a channel belongs to."""
    return channel.topic, full_name(channel.schema_name)


def _flow(topic: Topic, encoding: str, t_ns: IntArray, start_ns: int, stamped: Stamped | None) -> Flow:
    """When the messages of a topic came in."""
    apart_s = np.diff(t_ns) / NS_PER_S
    usual_s = float(np.median(apart_s)) if len(apart_s) > 1 else np.inf
    gaps = np.flatnonzero(apart_s > max(_PAUSE * usual_s, _GAP_S)) if usual_s < _REGULAR_S else np.zeros(0, dtype=int)
    without = np.delete(apart_s, gaps)
    longest = int(gaps[apart_s[gaps].argmax()]) if len(gaps) else None
    return Flow(
        topic,
        encoding,
        int(t_ns[0]) if len(t_ns) else None,
        int(t_ns[-1]) if len(t_ns) else None,
        len(without) / float(without.sum()) if len(without) > 1 and without.any() else None,
        len(gaps),
        0.0 if longest is None else float(apart_s[longest]),
        0.0 if longest is None else (int(t_ns[longest]) - start_ns) / NS_PER_S,
        None if stamped is None else _offset_s(stamped),
    )


def _offset_s(stamped: Stamped) -> float | None:
    """Stamps - times of receipt, s, without stamps of 0; None where no others are left."""
    if stamped.stamp_ns is None or not stamped.stamp_ns.any():
        return None
    offset_ns = (stamped.stamp_ns - stamped.log_ns)[stamped.stamp_ns != 0]
    return float(np.median(offset_ns) / NS_PER_S)


def _first_messages(files: Sequence[RawFile]) -> dict[_Key, Stamped]:
    """Stamps by topic in the first chunks of a recording, of transforms those of each message's first."""
    decoders: dict[Channel, Decoder | None] = {}
    parts: dict[_Key, list[DecodedBatch]] = {}

    def wanted(channel: Channel) -> bool:
        if channel not in decoders:
            decoders[channel] = _decoder(channel)
        return decoders[channel] is not None

    with LogFile(files[0]) as log:
        for number, batch in enumerate(log.batches(wanted)):
            # without a summary, channels become known as the file is read
            if number >= _SAMPLED * len(log.channels):
                break
            decoder = decoders[batch.channel]
            if decoder is not None:
                part = decoder.decode(batch)
                if len(part.order):
                    parts.setdefault(_key(batch.channel), []).append(part)
    return {key: one for key, some in parts.items() if (one := _stamped(key[0], some)) is not None}


def _decoder(channel: Channel) -> Decoder | None:
    """A decoder of a channel's stamps, or of those of its transforms; None where it has none or cannot be decoded."""
    paths = (_TF_STAMP if full_name(channel.schema_name) == message_types.TF.name else _STAMP,)
    try:
        schema = parse_definition(
            channel.schema_name, channel.schema_encoding, channel.schema_text, channel.message_encoding
        )
        leaves = [schema.leaf(path) for path in paths]
    except SchemaError:
        return None
    return Decoder(schema, paths) if isinstance(schema, Schema) and leaves[0].value_type == "time" else None


def _stamped(topic: str, parts: Sequence[DecodedBatch]) -> Stamped | None:
    """The stamps of a topic's first messages."""
    logs, stamps = [], []
    for part in parts:
        if _STAMP in part.columns:
            logs.append(part.log_time_ns)
            stamps.append(part.columns[_STAMP])
        else:
            counts = part.counts[_TRANSFORMS]
            some = counts > 0
            logs.append(part.log_time_ns[some])
            stamps.append(part.columns[_TF_STAMP][(np.cumsum(counts) - counts)[some]])
    log_ns, stamp_ns = np.concatenate(logs), np.concatenate(stamps)
    rows = np.argsort(log_ns, kind="stable")
    return Stamped(topic, log_ns[rows], stamp_ns[rows]) if rows.size else None


def _all_damage(files: Sequence[RawFile], progress: Progress | None) -> list[Damage]:
    """Damage that shows when every message is read."""
    total = sum(file.size for file in files)
    notes: list[Damage] = []
    done = 0
    for file in files:

        def report(share: float, done: int = done, size: int = file.size) -> None:
            if progress is not None:
                progress(done + round(share * size), total)

        notes += check_messages(file, report, threads_here())
        done += file.size
    return notes
