"""Reading logs: the contents of a file, and its messages as columns."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.errors import Number, counted
from navirl_cli.logs.container.batches import Batch, Channel
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.log_file import LogFile, threads_here
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.messages.decode import DecodedBatch
from navirl_cli.logs.messages.packing import Packer
from navirl_cli.logs.messages.schema import full_name
from navirl_cli.logs.messages.series import Series, SeriesBuilder
from navirl_cli.remote import path_of

#: Called with the bytes done and the bytes of all files.
Progress = Callable[[int, int], None]
#: The name of a file, or a file that is open already, for instance because it had to be decompressed.
Log = Path | str | RawFile
#: A topic, all of whose messages should have one type, or a topic and the full name of one of its types.
TopicKey = str | tuple[str, str]
#: Fields by topic; the keys are of one kind.
Wants = Mapping[str, Sequence[str]] | Mapping[tuple[str, str], Sequence[str]]


@dataclass(frozen=True)
class Contents:
    """The contents of one file."""

    path: Path
    profile: str
    library: str
    channels: tuple[Channel, ...]
    #: Number of messages by channel id.
    counts: dict[int, int]
    #: First and last time of receipt in ns; None where there are no messages.
    start_ns: int | None
    end_ns: int | None
    #: Metadata records by name, in the file's order.
    metadata: dict[str, tuple[dict[str, str], ...]]
    damage: tuple[Damage, ...]

    def topic_count(self, topic: str) -> int:
        """Number of messages on a topic, over all its channels."""
        return sum(self.counts.get(channel.id, 0) for channel in self.channels if channel.topic == topic)


@dataclass(frozen=True, eq=False)
class ReadResult:
    """A series for each topic that a file has and that decodes, and what could not be read."""

    series: dict[TopicKey, Series]
    damage: tuple[Damage, ...]


def scan(path: Log) -> Contents:
    """List the contents of a file: from its summary section if that is intact and complete, or else from its messages.

    Args:
        path: An MCAP file.

    Returns:
        Its contents. Damage inside chunks is found only if the file has no summary, or by `read`.

    Raises:
        LogError: It is not an MCAP file.
    """
    with LogFile(path) as log:
        statistics = log.summary.statistics if log.summary else None
        if statistics is None or statistics.channels > len(log.channels):
            return _contents(log, log.times())
        metadata = [log.metadata_at(offset) for offset in log.summary.metadata_offsets] if log.summary else []
        if len(metadata) < statistics.metadata or None in metadata:
            _ = list(log.batches(lambda _: False))
            metadata = list(log.metadata)
        first, last = (statistics.start_ns, statistics.end_ns) if statistics.messages else (None, None)
        counts = {channel.id: statistics.by_channel.get(channel.id, 0) for channel in log.channels}
        grouped = _by_name([entry for entry in metadata if entry])
        return Contents(
            log.path, log.profile, log.library, log.channels, counts, first, last, grouped, tuple(log.damage)
        )


def message_times(path: Log) -> tuple[Contents, dict[int, IntArray]]:
    """Contents of a file, and the times of receipt of all its messages.

    Chunks are opened only where message indexes are missing.

    Args:
        path: An MCAP file.

    Returns:
        Its contents, and times in ns, ascending, by channel id.

    Raises:
        LogError: It is not an MCAP file.
    """
    with LogFile(path) as log:
        times = log.times()
        return _contents(log, times), times


def read(
    paths: Log | Sequence[Log],
    wants: Wants,
    progress: Progress | None = None,
    threads: int | None = None,
    packed: Collection[TopicKey] = (),
) -> ReadResult:
    """Read topics from one or several files.

    Args:
        paths: MCAP files; messages of equal times are returned in this order.
        wants: By topic, or by topic and type: dotted fields such as "header.stamp", "wrench.force.x" or
            "poses[].position.x", which become columns.
        progress: Called with the bytes done and the bytes of all files.
        threads: Number of threads that decompress and decode; by default one for each core, four at most.
        packed: Topics whose sequences are int8 and are kept compressed by zlib, one object of bytes a message, such as
            maps that are sent repeatedly.

    Returns:
        A series for each wanted topic that a file has, and the damage. Damage includes channels whose encoding,
        definition or payloads are invalid, and channels that lack a wanted field.

    Raises:
        LogError: A file is not an MCAP file.
    """
    files = [paths] if isinstance(paths, Path | str | RawFile) else list(paths)
    sizes = [_size(path) for path in files]
    fields: dict[TopicKey, tuple[str, ...]] = {key: tuple(paths) for key, paths in wants.items()}
    builders: dict[TopicKey, SeriesBuilder] = {
        key: SeriesBuilder(key if isinstance(key, str) else key[0], Packer() if key in packed else None)
        for key in fields
    }
    damage: list[Damage] = []
    begin = 0
    for number, path in enumerate(files):

        def report(share: float, done: int = sum(sizes[:number]), size: int = sizes[number]) -> None:
            if progress is not None:
                progress(done + round(share * size), sum(sizes))

        batches, found = _read_file(path, fields, builders, report, threads or threads_here())
        for key, some in batches.items():
            builders[key].add(some, begin)
        begin += 1 + max(
            (int(one.order.max()) for some in batches.values() for one in some if len(one.order)), default=0
        )
        damage += found
        report(1.0)
    series = {key: builder.series() for key, builder in builders.items() if builder.decoders}
    return ReadResult(series, tuple(damage))


def _size(path: Log) -> int:
    """Bytes of a file, for the progress; 0 if it is missing."""
    if isinstance(path, RawFile):
        return path.size
    path = path_of(path)
    return path.stat().st_size if path.is_file() else 0


def _read_file(
    path: Log,
    wants: Mapping[TopicKey, tuple[str, ...]],
    builders: Mapping[TopicKey, SeriesBuilder],
    progress: Callable[[float], None],
    threads: int,
) -> tuple[dict[TopicKey, list[DecodedBatch]], list[Damage]]:
    """The batches of one file by topic, and its damage; without message indexes if those lack messages."""
    for trust_indexes in (True, False):
        with LogFile(path, trust_indexes=trust_indexes) as log:
            walk = _Walk(wants, builders, {key: [] for key in wants})
            walk.over(log, progress, threads)
            missing = walk.missing(log)
            texts = [*walk.undecodable(log), *missing]
            texts += [text for batches in walk.batches.values() for text in _undecoded(batches)]
            damage = [*log.damage, *(Damage(log.path, 0, log.size, text) for text in texts)]
        if not missing:
            break
    return walk.batches, damage


@dataclass(eq=False)
class _Walk:
    """One walk over a file's wanted messages."""

    wants: Mapping[TopicKey, tuple[str, ...]]
    builders: Mapping[TopicKey, SeriesBuilder]
    #: By topic.
    batches: dict[TopicKey, list[DecodedBatch]]
    #: Number of messages found, by channel.
    seen: Counter[int] = field(default_factory=Counter)
    #: The reasons why channels cannot be decoded, by channel.
    unusable: dict[int, str] = field(default_factory=dict)
    #: Those of them whose messages the walk met, whatever the statistics count.
    met: set[int] = field(default_factory=set)

    def key(self, channel: Channel) -> TopicKey:
        """The wanted topic that a channel belongs to: its name, or its name with the type where types are named."""
        return channel.topic if channel.topic in self.builders else (channel.topic, full_name(channel.schema_name))

    def over(self, log: LogFile, progress: Callable[[float], None], threads: int) -> None:
        """Walk over a file."""
        for decoded, count in log.results(self.wanted, self.decoded, threads):
            self.seen[decoded.channel.id] += count
            self.batches[self.key(decoded.channel)].append(decoded)
            progress(log.position / log.size)
        self.met = set(self.unusable)
        for channel in log.channels:
            self.wanted(channel)

    def wanted(self, channel: Channel) -> bool:
        """Whether a channel's messages are wanted and can be decoded."""
        key = self.key(channel)
        if key not in self.builders:
            return False
        error = self.builders[key].add_channel(channel, self.wants[key])
        if error:
            self.unusable[channel.id] = f"topic {channel.topic}: {error}"
        return not error

    def decoded(self, batch: Batch) -> tuple[DecodedBatch, int]:
        """A batch's columns, and its number of messages; in any thread."""
        builder = self.builders[self.key(batch.channel)]
        decoded = builder.decoders[batch.channel].decode(batch)
        if builder.packer is not None:
            decoded = builder.packer.packed(decoded)
        return decoded, len(batch.starts)

    def undecodable(self, log: LogFile) -> list[str]:
        """The reasons why channels cannot be decoded, without those that have no messages."""
        counted = _counted(log)
        return [
            text
            for number, text in self.unusable.items()
            if counted is None or counted.get(number) or number in self.met
        ]

    def missing(self, log: LogFile) -> list[str]:
        """The wanted channels of which messages are missing."""
        wanted = [one for one in log.channels if self.key(one) in self.builders and one.id not in self.unusable]
        return _missing(log, wanted, self.seen)


def check(path: Log, progress: Callable[[float], None] | None = None, threads: int | None = None) -> list[Damage]:
    """Read every message of a file, by the same rule as `read`, and hold message indexes against the messages.

    Args:
        path: An MCAP file.
        progress: Called with the share that is done.
        threads: Number of threads that decompress; by default one for each core, four at most.

    Returns:
        Its damage.

    Raises:
        LogError: It is not an MCAP file.
    """
    with LogFile(path) as log:
        listed = log.times()
    for trust_indexes in (True, False):
        with LogFile(path, trust_indexes=trust_indexes) as log:
            times: dict[int, list[IntArray]] = {}
            results = log.results(
                lambda _: True, lambda one: (one.channel.id, one.log_time_ns), threads or threads_here()
            )
            for number, some in results:
                times.setdefault(number, []).append(some)
                if progress is not None:
                    progress(log.position / log.size)
            found = {number: np.sort(np.concatenate(several)) for number, several in times.items()}
            missing = _missing(log, log.channels, {number: len(some) for number, some in found.items()})
            wrong = [
                f"the message indexes give other times of receipt of {channel.topic} than its messages"
                for channel in log.channels
                if channel.id in found
                and channel.id in listed
                and len(found[channel.id]) == len(listed[channel.id])
                and not np.array_equal(found[channel.id], listed[channel.id])
            ]
            fewer = [
                f"the message indexes list {counted(count, 'message')} of {channel.topic}, "
                f"{len(found[channel.id])} {Number(len(found[channel.id])):was|were} found"
                for channel in log.channels
                if channel.id in found and (count := len(listed.get(channel.id, ()))) < len(found[channel.id])
            ]
            damage = [*log.damage, *(Damage(log.path, 0, log.size, text) for text in (*missing, *fewer, *wrong))]
        if not missing:
            break
    return damage


def _receipts(batch: Batch) -> tuple[int, IntArray]:
    return batch.channel.id, batch.log_time_ns


def _missing(log: LogFile, channels: Iterable[Channel], seen: Mapping[int, int]) -> list[str]:
    """The channels of which the statistics count more messages than were found and than are known to be lost."""
    known = _counted(log) or {}
    return [
        f"the statistics count {counted(count, 'message')} of {channel.topic}, {there} {there:was|were} found"
        for channel in channels
        if (count := known.get(channel.id, 0))
        > (there := Number(seen.get(channel.id, 0))) + log.lost.get(channel.id, 0)
    ]


def _counted(log: LogFile) -> Mapping[int, int] | None:
    """Number of messages by channel, by the file's statistics; None without statistics."""
    return log.summary.statistics.by_channel if log.summary and log.summary.statistics else None


def _undecoded(batches: Sequence[DecodedBatch]) -> list[str]:
    """The damage of payloads that do not decode."""
    seen = sum(decoded.count for decoded in batches)
    bad = seen - sum(len(decoded.order) for decoded in batches)
    if not bad:
        return []
    error = next(decoded.error for decoded in batches if decoded.error)
    name = batches[0].channel.schema_name
    topic = batches[0].channel.topic
    many = f"{bad} of {seen}" if bad < seen else "the only" if seen == 1 else f"all {seen}"
    lost = f"{Number(bad):does|do} not decode as {name} and {Number(bad):is|are} lost ({error})"
    return [f"{many} message{Number(seen):|s} of {topic} {lost}"]


def _contents(log: LogFile, times: Mapping[int, IntArray]) -> Contents:
    """The contents of a file, counted by the times of its messages."""
    counts = {channel.id: len(times.get(channel.id, ())) for channel in log.channels}
    start = min((int(one[0]) for one in times.values()), default=None)
    end = max((int(one[-1]) for one in times.values()), default=None)
    grouped = _by_name(log.metadata)
    return Contents(log.path, log.profile, log.library, log.channels, counts, start, end, grouped, tuple(log.damage))


def _by_name(metadata: Sequence[tuple[str, dict[str, str]]]) -> dict[str, tuple[dict[str, str], ...]]:
    grouped: dict[str, tuple[dict[str, str], ...]] = {}
    for name, values in metadata:
        grouped[name] = (*grouped.get(name, ()), values)
    return grouped
