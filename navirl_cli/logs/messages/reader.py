"""Reading logs: what is in a file, and its messages as columns."""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container.batches import Batch, Channel
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.log_file import LogFile, threads_here
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.messages.decode import Part
from navirl_cli.logs.messages.series import Collector, Series

#: Called with the bytes done and the bytes of all files.
Progress = Callable[[int, int], None]
#: A file by its name, or one that is open already, since it had to be decompressed as a whole.
Log = Path | str | RawFile


@dataclass(frozen=True)
class Contents:
    """What is in one file."""

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
    """Series by topic (only topics that some file has and that decode), and what could not be read."""

    series: dict[str, Series]
    damage: tuple[Damage, ...]


def scan(path: Log) -> Contents:
    """Say what is in a file, from its summary section where that is sound and complete, else from its messages.

    Args:
        path: An MCAP file.

    Returns:
        Its contents. Damage inside of chunks shows only where there is no summary, or in `read`.

    Raises:
        LogError: It is no MCAP file.
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

    Payloads are read only where message indexes are missing.

    Args:
        path: An MCAP file.

    Returns:
        Its contents, and times in ns, ascending, by channel id.

    Raises:
        LogError: It is no MCAP file.
    """
    with LogFile(path) as log:
        times = log.times()
        return _contents(log, times), times


def read(
    paths: Log | Sequence[Log],
    wants: Mapping[str, Sequence[str]],
    progress: Progress | None = None,
    threads: int | None = None,
    latest: Collection[str] = (),
) -> ReadResult:
    """Read topics from one or several files.

    Args:
        paths: MCAP files, in the order that equal times shall have.
        wants: By topic: dotted fields such as "header.stamp", "wrench.force.x" or "poses[].position.x", which become
            columns.
        progress: Called with the bytes done and the bytes of all files.
        threads: How many decompress and decode; by default as many as there are cores, up to four.
        latest: Topics of which only the message received last is wanted, such as maps that are sent again and again.

    Returns:
        A series for each wanted topic that some file has, and the damage met on the way. A channel whose encoding,
        definition or payloads are not what they should be, or that lacks a wanted field, is damage like any other.

    Raises:
        LogError: A file is no MCAP file.
    """
    files = [paths] if isinstance(paths, Path | str | RawFile) else list(paths)
    sizes = [_size(path) for path in files]
    collectors = {topic: Collector(topic, topic in latest) for topic in wants}
    damage: list[Damage] = []
    for number, path in enumerate(files):

        def tell(share: float, done: int = sum(sizes[:number]), size: int = sizes[number]) -> None:
            if progress is not None:
                progress(done + round(share * size), sum(sizes))

        parts, notes = _read_file(path, wants, collectors, tell, threads or threads_here())
        for topic, found in parts.items():
            collectors[topic].add(found)
        damage += notes
        tell(1.0)
    series = {topic: collector.series() for topic, collector in collectors.items() if collector.decoders}
    return ReadResult(series, tuple(damage))


def _size(path: Log) -> int:
    """Bytes of a file, as far as a progress bar is concerned."""
    if isinstance(path, RawFile):
        return path.size
    return Path(path).stat().st_size if Path(path).is_file() else 0


def _read_file(
    path: Log,
    wants: Mapping[str, Sequence[str]],
    collectors: Mapping[str, Collector],
    progress: Callable[[float], None],
    threads: int,
) -> tuple[dict[str, list[Part]], list[Damage]]:
    """The parts of one file by topic, and its damage; a file whose indexes lack messages is walked over."""
    for trust_indexes in (True, False):
        with LogFile(path, trust_indexes=trust_indexes) as log:
            walk = _Walk(wants, collectors, {topic: [] for topic in wants})
            walk.over(log, progress, threads)
            missing = walk.missing(log)
            texts = [*walk.spoilt(log), *missing]
            texts += [text for topic, parts in walk.parts.items() for text in _undecoded(topic, parts)]
            damage = [*log.damage, *(Damage(log.path, 0, log.size, text) for text in texts)]
        if not missing:
            break
    return walk.parts, damage


@dataclass(eq=False)
class _Walk:
    """One walk over a file's wanted messages."""

    wants: Mapping[str, Sequence[str]]
    collectors: Mapping[str, Collector]
    #: By topic.
    parts: dict[str, list[Part]]
    #: Messages met by channel.
    seen: Counter[int] = field(default_factory=Counter)
    #: By channel that cannot be decoded: why.
    unusable: dict[int, str] = field(default_factory=dict)

    def over(self, log: LogFile, progress: Callable[[float], None], threads: int) -> None:
        """Walk."""
        for part, count in log.results(self.wanted, self.decoded, threads):
            self.seen[part.channel.id] += count
            parts = self.parts[part.channel.topic]
            parts.append(part)
            if self.collectors[part.channel.topic].latest:
                decoded = [one for one in parts if len(one.order)]
                parts[:] = sorted(decoded, key=lambda one: int(one.log_time_ns.max()))[-1:] or parts
            progress(log.position / log.size)
        for channel in log.channels:
            self.wanted(channel)

    def wanted(self, channel: Channel) -> bool:
        """Whether a channel's messages are wanted and can be decoded."""
        if channel.topic not in self.wants:
            return False
        trouble = self.collectors[channel.topic].takes(channel, tuple(self.wants[channel.topic]))
        if trouble:
            self.unusable[channel.id] = f"topic {channel.topic}: {trouble}"
        return not trouble

    def decoded(self, batch: Batch) -> tuple[Part, int]:
        """A batch's columns, and how many messages it has; in any thread."""
        collector = self.collectors[batch.channel.topic]
        decoder = collector.decoders[batch.channel]
        newest = decoder.decode(batch.newest()) if collector.latest else None
        part = newest if newest is not None and len(newest.order) else decoder.decode(batch)
        return part, len(batch.starts)

    def spoilt(self, log: LogFile) -> list[str]:
        """What is lost by channels that cannot be decoded; those without messages are no loss."""
        promised = _promised(log)
        return [text for number, text in self.unusable.items() if promised is None or promised.get(number)]

    def missing(self, log: LogFile) -> list[str]:
        """What the statistics promise beside what is there and what is known to be lost."""
        promised = _promised(log) or {}
        return [
            f"{count} messages of {channel.topic} promised by the statistics, {self.seen[channel.id]} are there"
            for channel in log.channels
            if channel.topic in self.wants
            and channel.id not in self.unusable
            and (count := promised.get(channel.id, 0)) > self.seen[channel.id] + log.lost.get(channel.id, 0)
        ]


def _promised(log: LogFile) -> Mapping[int, int] | None:
    """Number of messages by channel as the statistics have it, None without statistics."""
    return log.summary.statistics.by_channel if log.summary and log.summary.statistics else None


def _undecoded(topic: str, parts: Sequence[Part]) -> list[str]:
    """What is lost by payloads that do not decode."""
    seen = sum(part.count for part in parts)
    bad = seen - sum(len(part.order) for part in parts)
    if not bad:
        return []
    trouble = next(part.trouble for part in parts if part.trouble)
    name = parts[0].channel.schema_name
    many = f"all {seen}" if bad == seen else f"{bad} of {seen}"
    return [f"{many} messages of {topic} do not decode as {name} and are lost ({trouble})"]


def _contents(log: LogFile, times: Mapping[int, IntArray]) -> Contents:
    """Contents from the messages themselves."""
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
