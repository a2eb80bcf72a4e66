"""From payloads to columns: messages that share a layout are decoded at once, others one by one."""

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import IntArray
from navirl_cli.logs.container.batches import Batch, Channel, gathered
from navirl_cli.logs.messages.layout import Layout, derive
from navirl_cli.logs.messages.schema import AnySchema, DecodeError, JsonSchema, Leaf, Schema, value_at
from navirl_cli.logs.messages.single import without_compression

Columns = dict[str, NDArray[Any]]

#: Layouts that are derived for messages of one size in a batch; the rest is decoded one by one.
_MAX_DERIVED: Final = 4
#: Layouts that are kept for one size.
_MAX_REMEMBERED: Final = 16
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True, eq=False)
class DecodedBatch:
    """The columns of a batch, without its bytes."""

    channel: Channel
    #: Number of messages of the batch; the arrays hold the m messages that decode.
    count: int
    #: Time of receipt in ns and place in the file's order, shape (m,).
    log_time_ns: IntArray
    order: IntArray
    #: By wanted field: shape (m, ...), or for a field in a sequence all its entries.
    columns: Columns
    #: By sequence: number of entries of each message, shape (m,).
    counts: dict[str, IntArray]
    #: The reason why the first invalid payload does not decode; empty if all decode.
    error: str


@dataclass
class Decoder:
    """Decodes the messages of one channel, in any number of threads.

    Args:
        schema: The type of the messages.
        paths: Wanted fields, which the type must have.
    """

    schema: AnySchema
    paths: tuple[str, ...]
    _layouts: dict[int, list[Layout]] = field(default_factory=dict)
    _leaves: dict[str, Leaf] = field(default_factory=dict)

    @property
    def leaves(self) -> dict[str, Leaf]:
        """The leaves of the wanted fields by path."""
        if isinstance(self.schema, JsonSchema):
            return {path: self.schema.leaf(path) for path in self.paths}
        if not self._leaves:
            self._leaves = {path: self.schema.leaf(path) for path in self.paths}
        return self._leaves

    def decode(self, batch: Batch) -> DecodedBatch:
        """Decode a batch.

        Args:
            batch: Messages of this decoder's channel.

        Returns:
            The columns of the messages that decode.
        """
        if getattr(self.schema, "encoding", "") != "ros1":
            batch = without_compression(batch)
        if isinstance(self.schema, JsonSchema):
            any(self.schema.learn(batch.payload(row), self.paths) for row in range(len(batch.starts)))
        leaves, sizes = self.leaves, batch.sizes
        least = max((np.dtype(leaf.dtype).itemsize * leaf.count for leaf in leaves.values() if leaf.count), default=0)
        # the columns of a damaged definition would fill the memory
        too_small = isinstance(self.schema, Schema) and least > sizes.max()
        builder = _ColumnBuilder(self.schema, leaves, 0 if too_small else len(sizes))
        if too_small:
            builder.error = f"expected an array of {least} bytes, found messages of up to {sizes.max()} bytes"
        elif isinstance(self.schema, Schema):
            for size in set(sizes.tolist()):
                self._one_size(self.schema, batch, np.flatnonzero(sizes == size), int(size), builder)
        else:
            builder.put_payloads(batch, range(len(sizes)))
        columns, counts = builder.finished()
        good = np.flatnonzero(builder.good)
        times, order = batch.log_time_ns[good], batch.order[good]
        return DecodedBatch(batch.channel, len(sizes), times, order, columns, counts, builder.error)

    def _one_size(self, schema: Schema, batch: Batch, rows: IntArray, size: int, builder: "_ColumnBuilder") -> None:
        """Decode the messages of one size, by known layouts, then by new ones, then one by one."""
        known = self._layouts.setdefault(size, [])
        for layout in tuple(known):
            rows = builder.put(layout, batch, rows)
            if not rows.size:
                return
        for _ in range(_MAX_DERIVED):
            new = derive(schema, batch.payload(int(rows[0])), self.paths)
            if new is None:
                builder.put_payloads(batch, rows[:1].tolist())
                # many of the same must not take long because they are wrong
                rows = rows[1:] if builder.good[rows[0]] else builder.without_equal(batch, rows, size)
            else:
                if len(known) < _MAX_REMEMBERED:
                    known.append(new)
                rows = builder.put(new, batch, rows)
            if not rows.size:
                return
        builder.put_payloads(batch, rows.tolist())


class _ColumnBuilder:
    """Fills the columns of a batch.

    Args:
        schema: The type of the messages.
        leaves: The leaves of the wanted fields.
        n: Number of messages.
    """

    def __init__(self, schema: AnySchema, leaves: dict[str, Leaf], n: int) -> None:
        self.good = np.ones(n, dtype=np.bool_)
        self.error = ""
        self._schema = schema
        self._leaves = leaves
        self._columns = {path: empty_column(leaf, n) for path, leaf in leaves.items() if leaf.sequence is None}
        self._counts = {leaf.sequence: np.zeros(n, dtype=np.int64) for leaf in leaves.values() if leaf.sequence}
        #: By path in a sequence: rows of shape (k,), and their entries of shape (k, count).
        self._entries: dict[str, list[tuple[IntArray, NDArray[Any]]]] = {
            path: [] for path, leaf in leaves.items() if leaf.sequence
        }

    def put(self, layout: Layout, batch: Batch, rows: IntArray) -> IntArray:
        """Decode the rows that have this layout, one by one if a text is invalid; return the other rows."""
        head = layout.head
        messages = gathered(batch.raw, batch.starts[rows], head)
        fits = np.ones(len(rows), dtype=np.bool_)
        for name, value in layout.checks.items():
            fits &= messages[name] == value
        others = rows[:0]
        if not fits.all():
            others, rows, messages = rows[~fits], rows[fits], messages[fits]
        try:
            found = {path: _field_column(messages, path, leaf, layout) for path, leaf in self._leaves.items()}
            for name in layout.texts:
                if (messages[name] > 127).any():
                    _strings(messages[name])
        except UnicodeDecodeError:
            self.put_payloads(batch, rows.tolist())
            return others
        for sequence, counts in self._counts.items():
            counts[rows] = layout.counts[sequence]
        for path, values in found.items():
            if path in self._columns:
                self._columns[path][rows] = values
            elif values.size:
                self._entries[path].append((rows, values))
        return others

    def without_equal(self, batch: Batch, rows: IntArray, size: int) -> IntArray:
        """Rows of one size of which the first does not decode, without those that are equal to it."""
        payloads = gathered(batch.raw, batch.starts[rows], np.dtype([("all", f"V{size}")] if size else []))
        equal = payloads["all"] == payloads["all"][0] if size else np.ones(len(rows), dtype=np.bool_)
        self.good[rows[equal]] = False
        others: IntArray = rows[~equal]
        return others

    def put_payloads(self, batch: Batch, rows: "list[int] | range") -> None:
        """Decode messages one by one."""
        for row in rows:
            try:
                message = self._schema.deserialize(batch.payload(row))
                found = {path: self._value(message, path, leaf) for path, leaf in self._leaves.items()}
                sizes = self._sizes(found)
                for path, column in self._columns.items():
                    column[row] = found[path]
            except (DecodeError, ValueError, TypeError, OverflowError) as error:
                self.error = self.error or str(error)
                self.good[row] = False
                continue
            for sequence, size in sizes.items():
                self._counts[sequence][row] = size
            for path, entries in self._entries.items():
                if len(found[path]):
                    entries.append((np.array([row]), found[path][None]))

    def finished(self) -> tuple[Columns, dict[str, IntArray]]:
        """The columns of the messages that decode, and the number of entries of their sequences."""
        if self.good.all() and not self._counts:
            return self._columns, {}
        counts = {sequence: counts[self.good] for sequence, counts in self._counts.items()}
        columns = {path: column[self.good] for path, column in self._columns.items()}
        place = np.cumsum(self.good) - 1
        for path, entries in self._entries.items():
            leaf = self._leaves[path]
            of_each = counts[leaf.sequence or ""]
            first = np.cumsum(of_each) - of_each
            column = empty_column(leaf, int(of_each.sum()))
            for rows, values in entries:
                column[first[place[rows]][:, None] + np.arange(values.shape[1])] = values
            columns[path] = column
        return columns, counts

    def _value(self, message: Any, path: str, leaf: Leaf) -> Any:
        """The value of a field of one message for its column."""
        value = value_at(message, path)
        if leaf.sequence is not None:
            column = empty_column(leaf, len(value))
            for number, one in enumerate(value):
                column[number] = one if leaf.nested else _checked(one, leaf)
            return column
        return _checked(value, leaf)

    def _sizes(self, found: dict[str, Any]) -> dict[str, int]:
        """Number of entries by sequence; it must be the same for all fields of a sequence."""
        sizes: dict[str, int] = {}
        for path, leaf in self._leaves.items():
            if leaf.sequence and sizes.setdefault(leaf.sequence, len(found[path])) != len(found[path]):
                raise DecodeError(f"the entries of {leaf.sequence} differ in their fields")
        return sizes


def empty_column(leaf: Leaf, n: int) -> NDArray[Any]:
    """A column for n entries."""
    return np.empty((n, *leaf.shape), dtype=np.dtype(leaf.dtype).newbyteorder("="))


def _checked(value: Any, leaf: Leaf) -> Any:
    """A value of a message object for its column; checks its type."""
    if leaf.value_type == "time":
        return _time_ns(value)
    if leaf.value_type == "string":
        if not isinstance(value, str):
            raise DecodeError(f"expected a text, found {type(value).__name__}")
        return value
    if leaf.count is None:
        return _number(value)
    if isinstance(value, np.ndarray):
        # rosbags passes the byte of a bool on, which may be other than 0 and 1
        return value != 0 if value.dtype == np.bool_ else value
    if not isinstance(value, list) or len(value) != leaf.count:
        raise DecodeError(f"expected {leaf.count} numbers, found {value!r:.60}")
    return [_number(one) for one in value]


def _number(value: Any) -> Any:
    """A number; in JSON null stands for NaN."""
    if isinstance(value, str | dict | list):
        raise DecodeError(f"expected a number, found {value!r:.60}")
    return np.nan if value is None else value


def _time_ns(value: Any) -> int:
    """A time in ns, of a message object or of a JSON object with the usual keys."""
    if hasattr(value, "__msgtype__"):
        return int(value.sec) * _NS_PER_S + int(value.nanosec)
    if not isinstance(value, dict):
        raise DecodeError(f"expected a time, found {type(value).__name__}")
    for seconds, nanoseconds in (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs")):
        if seconds in value and nanoseconds in value:
            return _integer(value[seconds]) * _NS_PER_S + _integer(value[nanoseconds])
    raise DecodeError(f"expected a time with sec and nanosec, found keys {', '.join(map(str, value))}")


def _integer(value: Any) -> int:
    """An integer, which may be written as a float or a text."""
    if isinstance(value, float) and not value.is_integer():
        raise DecodeError(f"expected whole seconds and nanoseconds, found {value}")
    return int(value)


def _field_column(messages: NDArray[np.void], path: str, leaf: Leaf, layout: Layout) -> NDArray[Any]:
    """A field of gathered messages, shape (k, ...); of a field in a sequence, shape (k, count)."""
    if leaf.sequence is None:
        return _column(messages, path, leaf)
    count = layout.counts[leaf.sequence]
    if leaf.value_type == "number" and path == leaf.sequence:
        return messages[path] if count else np.empty((len(messages), 0))
    entries = [_column(messages, f"{path}#{number}", leaf) for number in range(count)]
    return np.stack(entries, axis=1) if entries else np.empty((len(messages), 0))


def _column(messages: NDArray[np.void], path: str, leaf: Leaf) -> NDArray[Any]:
    """A column of gathered messages."""
    if leaf.value_type == "time":
        seconds: IntArray = messages[path + "/sec"].astype(np.int64)
        nanoseconds: IntArray = messages[path + "/nanosec"].astype(np.int64)
        return seconds * _NS_PER_S + nanoseconds
    if leaf.value_type == "string":
        return _strings(messages[path])
    if leaf.count == 0:
        return np.empty((len(messages), 0))
    numbers: NDArray[Any] = messages[path]
    return numbers


def _strings(letters: NDArray[np.uint8]) -> NDArray[np.object_]:
    """Texts, shape (n,), from their bytes, shape (n, length); mostly all texts are the same."""
    texts = np.empty(len(letters), dtype=np.object_)
    if len(letters) and (letters == letters[0]).all():
        texts[:] = letters[0].tobytes().decode()
    else:
        texts[:] = [row.tobytes().decode() for row in letters]
    return texts
