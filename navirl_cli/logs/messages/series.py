"""The messages of a topic as columns, joined from all files and channels."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container.batches import Channel
from navirl_cli.logs.messages.decode import Columns, DecodedBatch, Decoder, empty_column
from navirl_cli.logs.messages.definitions import parse_definition
from navirl_cli.logs.messages.packing import Packer
from navirl_cli.logs.messages.schema import Schema, SchemaError


@dataclass(frozen=True, eq=False)
class Series:
    """The messages of a topic, sorted by time of receipt; equal times keep the order of the files and in the file."""

    topic: str
    schema_name: str
    #: Time of receipt in ns, shape (n,).
    log_time_ns: IntArray
    #: Place of each message in the order of the files and in the file, shape (n,): of two messages of a recording, on
    #: whatever topics, the one with the smaller place was written first. Different rows have different places.
    order: IntArray
    #: By wanted field: numbers of the field's own type, shape (n,), or (n, k) for a fixed array of k; times as int64
    #: ns; texts as an object array of str. A field in a sequence, "poses[].position.x", holds the entries of all
    #: messages one after the other, shape (total,); where sequences are packed, one object of bytes a message.
    columns: dict[str, NDArray[Any]]
    #: By sequence, "poses[]": number of entries of each message, shape (n,).
    counts: dict[str, IntArray]

    def __len__(self) -> int:
        return len(self.log_time_ns)


def lacks_definition(channel: Channel) -> bool:
    """Whether a recorder has left out a channel's definition: there is no text, and no encoding is named."""
    return not channel.schema_text.strip() and not channel.schema_encoding and channel.message_encoding != "json"


@dataclass(eq=False)
class SeriesBuilder:
    """Joins the batches of one topic to a series."""

    topic: str
    #: What compresses its sequences; None where they become columns.
    packer: Packer | None = None
    schema_name: str = ""
    #: By channel; channels of several files with the same definition are one.
    decoders: dict[Channel, Decoder] = field(default_factory=dict)
    #: By file: where its messages begin in the order of all files, and its batches.
    files: list[tuple[int, list[DecodedBatch]]] = field(default_factory=list)

    def add_channel(self, channel: Channel, paths: tuple[str, ...]) -> str:
        """Make the channel's decoder; return the reason why it cannot be decoded, or ""."""
        if channel in self.decoders:
            return ""
        if self.decoders and channel.schema_name != self.schema_name:
            found = f"found {channel.schema_name}, which is ignored"
            return f"expected {self.schema_name}, as in its other channels, {found}"
        if lacks_definition(channel):
            name = channel.schema_name or "a schema without a name"
            return f"{name} has no definition in the file, so that its messages cannot be decoded; record it"
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
            return f"{channel.schema_name} is defined differently in its other channels; its messages are lost"
        self.schema_name = channel.schema_name
        self.decoders[channel] = Decoder(schema, paths)
        return ""

    def add(self, batches: list[DecodedBatch], begin: int) -> None:
        """Add the batches of a file, whose messages begin at this place of the order of all files."""
        self.files.append((begin, batches))

    def series(self) -> Series:
        """The series; the batches are consumed."""
        # a batch without messages may have other types of columns
        filled = [(begin, batch) for begin, file in self.files for batch in file if len(batch.order)]
        batches = [batch for _, batch in filled]
        times = _joined([batch.log_time_ns for batch in batches])
        order = _joined([begin + batch.order for begin, batch in filled])
        rows = self._rows(times, order)
        leaves = next(iter(self.decoders.values())).leaves
        counts = {}
        for sequence in {leaf.sequence for leaf in leaves.values() if leaf.sequence}:
            counts[sequence] = _joined([batch.counts[sequence] for batch in batches])
        columns: Columns = {}
        for path, leaf in leaves.items():
            column = np.concatenate([batch.columns.pop(path) for batch in batches] or [empty_column(leaf, 0)])
            if rows is not None:
                by_message = leaf.sequence is None or self.packer is not None
                column = column[rows if by_message else _entries(counts[leaf.sequence or ""], rows)]
            columns[path] = column
        if rows is not None:
            times, order = times[rows], order[rows]
            counts = {sequence: count[rows] for sequence, count in counts.items()}
        self.files.clear()
        return Series(self.topic, self.schema_name, times, order, columns, counts)

    def _rows(self, times: IntArray, order: IntArray) -> IntArray | None:
        """The order by time, then by file, then in the file; None if the batches are already in this order."""
        if len(self.decoders) > 1:
            return np.lexsort((order, times))
        return np.argsort(times, kind="stable") if (times[1:] < times[:-1]).any() else None


def _joined(arrays: Sequence[IntArray]) -> IntArray:
    return np.concatenate([np.empty(0, dtype=np.int64), *arrays])


def _entries(counts: IntArray, rows: IntArray) -> IntArray:
    """The places of the entries of the messages `rows`, in this order of the messages."""
    first = np.cumsum(counts) - counts
    taken = counts[rows]
    before = np.cumsum(taken) - taken
    return np.repeat(first[rows] - before, taken) + np.arange(int(taken.sum()))
