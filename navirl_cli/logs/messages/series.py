"""The messages of a topic as columns, gathered from files and channels."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container.batches import Channel
from navirl_cli.logs.messages.decode import Columns, Decoder, Part, empty_column
from navirl_cli.logs.messages.schema import Schema, SchemaError, parse_definition


@dataclass(frozen=True, eq=False)
class Series:
    """The messages of a topic, sorted by time of receipt; equal times keep the order of files and in the file."""

    topic: str
    schema_name: str
    #: Time of receipt in ns, shape (n,).
    log_time_ns: IntArray
    #: By wanted field: numbers of the field's own type, shape (n,), or (n, k) for a fixed array of k; times as int64
    #: ns; texts as an object array of str. A field in a sequence, "poses[].position.x", holds the entries of all
    #: messages one after the other, shape (total,).
    columns: dict[str, NDArray[Any]]
    #: By sequence, "poses[]": number of entries of each message, shape (n,).
    counts: dict[str, IntArray]

    def __len__(self) -> int:
        return len(self.log_time_ns)


@dataclass(eq=False)
class Collector:
    """Gathers the parts of one topic."""

    topic: str
    #: Whether only the message received last is kept.
    latest: bool = False
    schema_name: str = ""
    #: By channel; the same definition in several files is one channel.
    decoders: dict[Channel, Decoder] = field(default_factory=dict)
    #: By file.
    files: list[list[Part]] = field(default_factory=list)

    def takes(self, channel: Channel, paths: tuple[str, ...]) -> str:
        """Make the channel's decoder; say why there is none, or nothing."""
        if channel in self.decoders:
            return ""
        if self.decoders and channel.schema_name != self.schema_name:
            return (
                f"expected {self.schema_name}, as in its other channels, found {channel.schema_name}, which is left out"
            )
        try:
            schema = parse_definition(
                channel.schema_name, channel.schema_encoding, channel.schema_text, channel.message_encoding
            )
            leaves = {path: schema.leaf(path) for path in paths}
        except SchemaError as error:
            return (
                "expected cdr with ros2msg or ros2idl, ros1 with ros1msg, or json, found message encoding "
                f"{channel.message_encoding!r}, schema {channel.schema_name!r} ({channel.schema_encoding}): {error}; "
                "its messages are lost"
            )
        if isinstance(schema, Schema) and any(other.leaves != leaves for other in self.decoders.values()):
            return f"{channel.schema_name} is defined otherwise than in its other channels; its messages are lost"
        self.schema_name = channel.schema_name
        self.decoders[channel] = Decoder(schema, paths)
        return ""

    def add(self, parts: list[Part]) -> None:
        """Take up the parts of a file."""
        self.files.append(parts)
        if self.latest:
            whole = [part for file in self.files for part in file if len(part.order)]
            self.files = [[max(whole, key=lambda part: int(part.log_time_ns.max()))] if whole else []]

    def series(self) -> Series:
        """The sorted whole; parts are given up on the way."""
        # a part without messages may not know the kinds of its fields
        numbered = [(number, part) for number, file in enumerate(self.files) for part in file if len(part.order)]
        numbers, parts = [number for number, _ in numbered], [part for _, part in numbered]
        times = _joined([part.log_time_ns for part in parts])
        rows = self._rows(parts, numbers, times)
        if self.latest and len(times):
            rows = np.arange(len(times))[-1:] if rows is None else rows[-1:]
        leaves = next(iter(self.decoders.values())).leaves
        counts = {}
        for sequence in {leaf.sequence for leaf in leaves.values() if leaf.sequence}:
            counts[sequence] = _joined([part.counts[sequence] for part in parts])
        columns: Columns = {}
        for path, leaf in leaves.items():
            column = np.concatenate([part.columns.pop(path) for part in parts] or [empty_column(leaf, 0)])
            if rows is not None:
                column = column[rows if leaf.sequence is None else _entries(counts[leaf.sequence], rows)]
            columns[path] = column
        if rows is not None:
            times, counts = times[rows], {sequence: count[rows] for sequence, count in counts.items()}
        self.files.clear()
        return Series(self.topic, self.schema_name, times, columns, counts)

    def _rows(self, parts: list[Part], numbers: list[int], times: IntArray) -> IntArray | None:
        """The order of time, then of files, then in the file; None where it is that already."""
        if len(self.decoders) > 1:
            files = _joined([np.full(len(part.order), k) for k, part in zip(numbers, parts, strict=True)])
            orders = _joined([part.order for part in parts])
            return np.lexsort((orders, files, times))
        return np.argsort(times, kind="stable") if (np.diff(times) < 0).any() else None


def _joined(arrays: Sequence[IntArray]) -> IntArray:
    return np.concatenate([np.empty(0, dtype=np.int64), *arrays])


def _entries(counts: IntArray, rows: IntArray) -> IntArray:
    """Where the entries of the messages `rows` stand, in this order of messages."""
    first = np.cumsum(counts) - counts
    taken = counts[rows]
    behind = np.cumsum(taken) - taken
    return np.repeat(first[rows] - behind, taken) + np.arange(int(taken.sum()))
