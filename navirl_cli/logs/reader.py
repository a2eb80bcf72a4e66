"""Reading logs: what is in a file, and its messages as columns."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.errors import LogError
from navirl_cli.logs.container import LogFile
from navirl_cli.logs.decode import Columns, Decoder, Part, decoder, empty_columns
from navirl_cli.logs.parts import Batch, Channel, Damage

IntArray = NDArray[np.int64]
#: Called with the bytes done and the bytes of all files.
Progress = Callable[[int, int], None]


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


@dataclass(frozen=True)
class Series:
    """The messages of a topic, sorted by time of receipt; equal times keep the order of files and in the file."""

    topic: str
    schema_name: str
    #: Time of receipt in ns, shape (n,).
    log_time_ns: IntArray
    #: By wanted field: numbers of the field's own type, shape (n,), or (n, k) for a fixed array of k; times as int64
    #: ns; texts as an object array of str.
    columns: dict[str, NDArray[Any]]
    #: Message objects, where whole messages were wanted.
    messages: list[Any]

    def __len__(self) -> int:
        return len(self.log_time_ns)


@dataclass(frozen=True)
class ReadResult:
    """Series by topic (only topics that some file has), and what could not be read."""

    series: dict[str, Series]
    damage: tuple[Damage, ...]


def scan(path: Path | str) -> Contents:
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
            return _walked(log)
        metadata = [log.metadata_at(offset) for offset in log.summary.metadata_offsets] if log.summary else []
        if len(metadata) < statistics.metadata or None in metadata:
            _ = list(log.batches(lambda _: False))
            metadata = list(log.metadata)
        times = (statistics.start_ns, statistics.end_ns) if statistics.messages else None
        counts = {channel.id: statistics.by_channel.get(channel.id, 0) for channel in log.channels}
        return _contents(log, counts, times, [entry for entry in metadata if entry])


def read(
    paths: Path | str | Sequence[Path | str],
    wants: Mapping[str, Sequence[str] | None],
    progress: Progress | None = None,
) -> ReadResult:
    """Read topics from one or several files.

    Args:
        paths: MCAP files, in the order that equal times shall have.
        wants: By topic: dotted fields such as "header.stamp" or "wrench.force.x", which become columns; None for whole
            message objects.
        progress: Called with the bytes done and the bytes of all files.

    Returns:
        A series for each wanted topic that some file has, and the damage met on the way.

    Raises:
        LogError: A file is no MCAP file; a wanted topic is no CDR or its definition does not parse; a field does not
            exist; no message of a topic decodes. Topics that are not wanted never matter.
    """
    files = [Path(paths)] if isinstance(paths, Path | str) else [Path(path) for path in paths]
    total = sum(path.stat().st_size for path in files if path.is_file())
    collectors: dict[str, _Collector] = {}
    damage: list[Damage] = []
    done = 0
    for number, path in enumerate(files):
        with LogFile(path) as log:
            seen: Counter[int] = Counter()
            for batch in log.batches(lambda channel: channel.topic in wants):
                _collector(collectors, path, batch.channel, wants).add(number, batch)
                seen[batch.channel.id] += len(batch.starts)
                if progress is not None:
                    progress(done + log.position, total)
            for channel in log.channels:
                if channel.topic in wants:
                    _collector(collectors, path, channel, wants)
            damage += log.damage or _missing(log, seen, wants)
            done += log.size
        damage += [note for collector in collectors.values() for note in collector.undecoded(path)]
        if progress is not None:
            progress(done, total)
    return ReadResult({topic: collectors[topic].series() for topic in wants if topic in collectors}, tuple(damage))


@dataclass
class _Collector:
    """Gathers the parts of one topic."""

    topic: str
    schema_name: str
    fields: Sequence[str] | None
    decoders: dict[Channel, Decoder] = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)
    times: list[IntArray] = field(default_factory=list)
    #: Number of the file and place in it, each of shape (n,).
    places: list[tuple[IntArray, IntArray]] = field(default_factory=list)
    bad: int = 0
    seen: int = 0

    def add(self, number: int, batch: Batch) -> None:
        """Decode a batch of file `number`."""
        part = self.decoders[batch.channel].decode(batch)
        self.parts.append(part)
        self.times.append(batch.log_time_ns[part.good])
        order = batch.order[part.good]
        self.places.append((np.full(len(order), number), order))
        self.bad += int((~part.good).sum())
        self.seen += len(part.good)

    def undecoded(self, path: Path) -> list[Damage]:
        """Damage by payloads of this file that do not decode."""
        bad, seen, self.bad, self.seen = self.bad, self.seen, 0, 0
        if not bad:
            return []
        trouble = next(decoder.trouble for decoder in self.decoders.values() if decoder.trouble)
        if bad == seen:
            raise LogError(
                f"{path}: topic {self.topic}: expected CDR messages of type {self.schema_name}, found none among "
                f"{seen} ({trouble}); the recorder's encoding or definition is wrong: record it again"
            )
        reason = (
            f"{bad} of {seen} messages of {self.topic} do not decode as {self.schema_name} and are lost ({trouble})"
        )
        return [Damage(path, 0, path.stat().st_size, reason)]

    def series(self) -> Series:
        """The sorted whole."""
        times = np.concatenate([np.empty(0, dtype=np.int64), *self.times])
        file_numbers = np.concatenate([np.empty(0, dtype=np.int64), *(number for number, _ in self.places)])
        orders = np.concatenate([np.empty(0, dtype=np.int64), *(order for _, order in self.places)])
        rows = np.lexsort((orders, file_numbers, times))
        messages = [message for part in self.parts for message in part.messages]
        leaves = next(iter(self.decoders.values())).leaves or {}
        columns: Columns = {}
        for path, empty in empty_columns(leaves, 0).items():
            columns[path] = np.concatenate([empty, *(part.columns.pop(path) for part in self.parts)])[rows]
        if messages:
            messages = [messages[row] for row in rows.tolist()]
        return Series(self.topic, self.schema_name, times[rows], columns, messages)


def _collector(
    collectors: dict[str, _Collector], path: Path, channel: Channel, wants: Mapping[str, Sequence[str] | None]
) -> _Collector:
    """The collector of a channel's topic, with a decoder for the channel."""
    fields = wants[channel.topic]
    collector = collectors.setdefault(channel.topic, _Collector(channel.topic, channel.schema_name, fields))
    if channel.schema_name != collector.schema_name:
        raise LogError(
            f"{path}: topic {channel.topic}: expected {collector.schema_name}, as in its other channels, found "
            f"{channel.schema_name}; read the files apart"
        )
    if channel not in collector.decoders:
        collector.decoders[channel] = decoder(path, channel, fields)
    return collector


def _missing(log: LogFile, seen: Mapping[int, int], wants: Mapping[str, Any]) -> list[Damage]:
    """Damage by messages that the statistics record promises and that are not there."""
    statistics = log.summary.statistics if log.summary else None
    if statistics is None:
        return []
    return [
        Damage(
            log.path,
            0,
            log.size,
            f"{promised} messages of {channel.topic} promised by the statistics, {seen.get(channel.id, 0)} are there",
        )
        for channel in log.channels
        if channel.topic in wants and (promised := statistics.by_channel.get(channel.id, 0)) > seen.get(channel.id, 0)
    ]


def _walked(log: LogFile) -> Contents:
    """Contents from the messages themselves."""
    counts: dict[int, int] = {}
    first: list[int] = []
    last: list[int] = []
    for batch in log.batches(lambda _: True):
        counts[batch.channel.id] = counts.get(batch.channel.id, 0) + len(batch.starts)
        first.append(int(batch.log_time_ns.min()))
        last.append(int(batch.log_time_ns.max()))
    counts = {channel.id: counts.get(channel.id, 0) for channel in log.channels}
    return _contents(log, counts, (min(first), max(last)) if first else None, log.metadata)


def _contents(
    log: LogFile, counts: dict[int, int], times: tuple[int, int] | None, metadata: list[tuple[str, dict[str, str]]]
) -> Contents:
    grouped: dict[str, tuple[dict[str, str], ...]] = {}
    for name, values in metadata:
        grouped[name] = (*grouped.get(name, ()), values)
    start_ns, end_ns = times or (None, None)
    return Contents(
        log.path, log.profile, log.library, log.channels, counts, start_ns, end_ns, grouped, tuple(log.damage)
    )
