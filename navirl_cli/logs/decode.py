"""Payloads become columns: all messages of a layout at once where they share one, else one by one."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError

from navirl_cli.errors import LogError
from navirl_cli.logs.layout import Layout, derive
from navirl_cli.logs.parts import Batch, Channel
from navirl_cli.logs.schema import Leaf, Schema, SchemaError, parse_definition, value_at

IntArray = NDArray[np.int64]
Columns = dict[str, NDArray[Any]]

#: Layouts derived for the messages of one size in a batch before the rest is decoded one by one.
_MAX_DERIVED: Final = 4
#: Layouts remembered for one size.
_MAX_REMEMBERED: Final = 16
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True)
class Part:
    """A decoded batch: columns or messages of the payloads that decode."""

    #: Which messages of the batch decode, shape (n,).
    good: NDArray[np.bool_]
    columns: Columns
    messages: list[Any]


@dataclass
class Decoder:
    """Decodes one channel's messages; made by `decoder`."""

    schema: Schema
    #: Wanted fields by path; None for whole messages.
    leaves: dict[str, Leaf] | None
    #: Why the first payload that does not decode does not.
    trouble: str = ""
    _layouts: dict[int, list[Layout]] = field(default_factory=dict)

    def decode(self, batch: Batch) -> Part:
        """Decode a batch.

        Args:
            batch: Messages of this decoder's channel.

        Returns:
            Columns (or messages) of those that decode.
        """
        good = np.ones(len(batch.starts), dtype=np.bool_)
        if self.leaves is None:
            messages = [self._object(batch, row, good) for row in range(len(good))]
            return Part(good, {}, [message for message in messages if message is not None])
        columns = empty_columns(self.leaves, len(good))
        for size in np.unique(batch.sizes).tolist():
            self._one_size(batch, np.flatnonzero(batch.sizes == size), int(size), columns, good)
        if not good.all():
            columns = {path: column[good] for path, column in columns.items()}
        return Part(good, columns, [])

    def _one_size(self, batch: Batch, rows: IntArray, size: int, columns: Columns, good: NDArray[np.bool_]) -> None:
        """Decode the messages of one size, by known layouts, then by new ones, then one by one."""
        known = self._layouts.setdefault(size, [])
        for layout in known:
            rows = self._gather(layout, batch, rows, columns)
            if not rows.size:
                return
        for _ in range(_MAX_DERIVED):
            new = derive(self.schema, batch.payload(int(rows[0])), self.leaves or ())
            if new is None:
                self._single(batch, int(rows[0]), columns, good)
                rows = rows[1:]
            else:
                if len(known) < _MAX_REMEMBERED:
                    known.append(new)
                rows = self._gather(new, batch, rows, columns)
            if not rows.size:
                return
        for row in rows.tolist():
            self._single(batch, row, columns, good)

    def _gather(self, layout: Layout, batch: Batch, rows: IntArray, columns: Columns) -> IntArray:
        """Decode the rows that have this layout; return the others."""
        size = layout.dtype.itemsize
        view = np.ndarray((len(batch.raw) - size + 1,), layout.dtype, batch.raw, strides=(1,))
        table = view[batch.starts[rows]]
        fits = np.ones(len(rows), dtype=np.bool_)
        for name, value in layout.checks.items():
            fits &= table[name] == value
        others = rows[~fits]
        if others.size:
            rows, table = rows[fits], table[fits]
        try:
            for path, leaf in (self.leaves or {}).items():
                columns[path][rows] = _column(table, path, leaf)
        except UnicodeDecodeError:
            return np.sort(np.concatenate((rows, others)))
        return others

    def _single(self, batch: Batch, row: int, columns: Columns, good: NDArray[np.bool_]) -> None:
        """Decode one message by rosbags."""
        message = self._object(batch, row, good)
        if message is None:
            return
        for path, leaf in (self.leaves or {}).items():
            value: Any = value_at(message, path)
            columns[path][row] = value.sec * _NS_PER_S + value.nanosec if leaf.kind == "time" else value

    def _object(self, batch: Batch, row: int, good: NDArray[np.bool_]) -> object | None:
        try:
            return self.schema.deserialize(batch.payload(row))
        except SerdeError as error:
            self.trouble = self.trouble or str(error)
            good[row] = False
            return None


def decoder(path: Path, channel: Channel, fields: Sequence[str] | None) -> Decoder:
    """Make the decoder of a channel.

    Args:
        path: The file, for messages.
        channel: The channel.
        fields: Wanted fields, dotted; None for whole messages.

    Raises:
        LogError: The encoding is not supported, the definition does not parse, or a field is not in it.
    """
    found = f"message encoding {channel.message_encoding!r}, schema {channel.schema_name!r} ({channel.schema_encoding})"
    if channel.message_encoding != "cdr":
        raise LogError(
            f"{path}: topic {channel.topic}: expected cdr with ros2msg or ros2idl, found {found}; "
            "record or convert it as ROS 2"
        )
    try:
        schema = parse_definition(channel.schema_name, channel.schema_encoding, channel.schema_text)
    except SchemaError as error:
        raise LogError(
            f"{path}: topic {channel.topic}: expected cdr with ros2msg or ros2idl, found {found}: {error}; "
            "record the topic again with its definition"
        ) from error
    try:
        return Decoder(schema, None if fields is None else {name: schema.leaf(name) for name in fields})
    except SchemaError as error:
        raise LogError(f"{path}: topic {channel.topic}: {error}; choose another topic or field") from error


def empty_columns(leaves: dict[str, Leaf], n: int) -> Columns:
    """Columns of n entries, to be filled."""
    return {
        path: np.empty((n, *leaf.shape), dtype=np.dtype(leaf.dtype).newbyteorder("=")) for path, leaf in leaves.items()
    }


def _column(table: NDArray[np.void], path: str, leaf: Leaf) -> NDArray[Any]:
    """One column of gathered messages."""
    if leaf.kind == "time":
        seconds: IntArray = table[path + "/sec"].astype(np.int64)
        nanoseconds: IntArray = table[path + "/nanosec"].astype(np.int64)
        return seconds * _NS_PER_S + nanoseconds
    if leaf.kind == "string":
        return _strings(table[path])
    if leaf.count == 0:
        return np.empty((len(table), 0))
    numbers: NDArray[Any] = table[path]
    return numbers


def _strings(letters: NDArray[np.uint8]) -> NDArray[np.object_]:
    """Texts of shape (n,) from their bytes of shape (n, length); mostly they are all the same."""
    texts = np.empty(len(letters), dtype=np.object_)
    if len(letters) and (letters == letters[0]).all():
        texts[:] = letters[0].tobytes().decode()
    else:
        texts[:] = [row.tobytes().decode() for row in letters]
    return texts
