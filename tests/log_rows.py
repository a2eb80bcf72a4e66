"""Messages as rows of bytes, so that what two readers read can be compared to the bit."""

import json
import struct
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any

import numpy as np
from log_factory import from_idl
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError

from navirl_cli.logs.messages.reader import Contents, Series

#: A message: time of receipt, and its columns' bytes.
Row = tuple[int, tuple[bytes, ...]]
#: Name, encoding and text of a schema, and the messages' encoding.
MessageType = tuple[str, str, bytes, str]
#: What rosbags raises on definitions and payloads that do not parse.
UNDECODABLE = (
    *(TypesysError, SerdeError, SyntaxError, LookupError, ValueError, TypeError, AttributeError, AssertionError),
    *(OverflowError, RecursionError, struct.error),
)


def slow_columns(message_type: MessageType, payload: bytes, paths: Sequence[str], series: Series) -> tuple[bytes, ...]:
    """A message's columns by rosbags or Python's JSON; empty where they cannot decode it."""
    try:
        message = json.loads(payload) if message_type[3] == "json" else decoder(*message_type)(payload)
        return tuple(as_bytes(values_at(message, path), series.columns[path].dtype) for path in paths)
    except UNDECODABLE:
        return ()


@cache
def decoder(name: str, encoding: str, text: bytes, message_encoding: str) -> Callable[[bytes], Any]:
    """The function by which rosbags decodes messages of a definition."""
    store = get_typestore(Stores.EMPTY)
    full = name if name.count("/") != 1 else name.replace("/", "/msg/")
    words = text.decode(errors="replace").replace("\r\n", "\n")
    store.register(from_idl(words) if encoding == "ros2idl" else get_types_from_msg(words, full))
    decode = store.deserialize_ros1 if message_encoding == "ros1" else store.deserialize_cdr
    return lambda payload: decode(payload, full)


def values_at(message: Any, path: str) -> list[Any]:
    """The value of a field, or its values in the entries of a sequence."""
    found = [message]
    for part in path.split("."):
        name = part.removesuffix("[]")
        found = [one[name] if isinstance(one, dict) else getattr(one, name) for one in found]
        if part != name:
            found = [one for many in found for one in many]
    return [in_ns(one) for one in found]


def in_ns(value: Any) -> Any:
    """A time in ns; any other value as it is."""
    fields = value if isinstance(value, dict) else vars(value) if hasattr(value, "__msgtype__") else {}
    return int(fields["sec"]) * 10**9 + int(fields["nanosec"]) if "nanosec" in fields else value


def as_bytes(values: Any, dtype: np.dtype[Any]) -> bytes:
    """Numbers or texts of one message's column."""
    if dtype.hasobject:
        return "\0".join(values).encode()
    return np.array([np.nan if one is None else one for one in values], dtype=dtype).tobytes()


def rows_of(series: Series) -> list[Row]:
    """The messages of a series."""
    columns = []
    for path, column in series.columns.items():
        if "[]" in path:
            ends = np.cumsum(series.counts[path.partition("[]")[0] + "[]"])
            pieces = np.split(column, ends)[:-1]
        else:
            pieces = column[:, None]
        columns.append([as_bytes(piece, column.dtype) for piece in pieces])
    return list(zip(series.log_time_ns.tolist(), zip(*columns, strict=True), strict=True))


def same_series(found: Mapping[str, Series], right: Mapping[str, Series]) -> bool:
    """Whether all topics' columns are the same to the bit."""
    return found.keys() == right.keys() and all(
        np.array_equal(one.log_time_ns, right[topic].log_time_ns)
        and all(same_arrays(column, right[topic].columns[path]) for path, column in one.columns.items())
        and all(same_arrays(count, right[topic].counts[path]) for path, count in one.counts.items())
        for topic, one in found.items()
    )


def same_arrays(one: Any, other: Any) -> bool:
    if one.dtype.hasobject:
        return bool(one.tolist() == other.tolist())
    return bool(one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes())


def same_recordings(one: Any, other: Any) -> bool:
    """Whether two recordings, or parts of them, hold the same; the file's name does not matter."""
    if is_dataclass(one) and type(one) is type(other):
        names = [field.name for field in fields(one) if field.name not in {"log", "notes"}]
        return all(same_recordings(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return same_arrays(one, other)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(same_recordings(a, b) for a, b in zip(one, other, strict=True))
    return bool(type(one) is type(other) and one == other)


def counts_of(contents: Contents) -> Counter[tuple[str, str]]:
    """Messages by topic and type."""
    counts: Counter[tuple[str, str]] = Counter()
    for channel in contents.channels:
        counts[channel.topic, channel.schema_name] += contents.counts[channel.id]
    return counts
