"""Writing logs as rosbag2 does: MCAP with profile ros2, zstd chunks, CDR messages and embedded definitions."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import ArrayLike, NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from navirl_cli import __version__
from navirl_cli.errors import LogError
from navirl_cli.files import replacing
from navirl_cli.logs.container.batches import Batch, Channel, gathered
from navirl_cli.logs.messages.layout import derive
from navirl_cli.logs.messages.schema import Schema, SchemaError

_COMPRESSION: Final = {"zstd": CompressionType.ZSTD, "lz4": CompressionType.LZ4, "none": CompressionType.NONE}
_NS_PER_S: Final = 1_000_000_000
#: What stands before a message's payload in its record.
_MESSAGE_TIMES: Final = np.dtype([("sequence", "<u4"), ("log_time", "<u8"), ("publish_time", "<u8")])


#: Foxglove's type for grids of numbers, as its ROS 2 package foxglove_msgs defines it: definitions by type.
_FOXGLOVE: Final = {
    "foxglove_msgs/msg/Vector2": "float64 x\nfloat64 y\n",
    "foxglove_msgs/msg/PackedElementField": (
        "string name\nuint32 offset\nuint8 UNKNOWN=0\nuint8 UINT8=1\nuint8 INT8=2\nuint8 UINT16=3\nuint8 INT16=4\n"
        "uint8 UINT32=5\nuint8 INT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\nuint8 type\n"
    ),
    "foxglove_msgs/msg/Grid": (
        "builtin_interfaces/Time timestamp\nstring frame_id\ngeometry_msgs/Pose pose\nuint32 column_count\n"
        "foxglove_msgs/Vector2 cell_size\nuint32 row_stride\nuint32 cell_stride\n"
        "foxglove_msgs/PackedElementField[] fields\nuint8[] data\n"
    ),
}


@cache
def _builtin() -> Typestore:
    """The standard message types, loaded once because that takes a tenth of a second."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in _FOXGLOVE.items():
        store.register(get_types_from_msg(definition, name))
    return store


def message_type(name: str) -> Any:
    """The class of a standard message type.

    Args:
        name: "geometry_msgs/msg/WrenchStamped", or Foxglove's "foxglove_msgs/msg/Grid".

    Returns:
        A dataclass whose fields are those of the message; numeric arrays must be numpy arrays of the exact type.

    Raises:
        LogError: It is not a standard type.
    """
    try:
        return _builtin().types[name]
    except KeyError:
        raise LogError(
            f"message type {name!r}: expected a standard ROS 2 type such as geometry_msgs/msg/WrenchStamped, found "
            "no type of this name; navirl writes standard types only"
        ) from None


def time_message(t_ns: int) -> Any:
    """A builtin_interfaces/msg/Time of nanoseconds since the clock's zero."""
    seconds, nanoseconds = divmod(int(t_ns), _NS_PER_S)
    return message_type("builtin_interfaces/msg/Time")(sec=seconds, nanosec=nanoseconds)


def header(t_ns: int, frame_id: str) -> Any:
    """A std_msgs/msg/Header; `t_ns` in nanoseconds."""
    return message_type("std_msgs/msg/Header")(stamp=time_message(t_ns), frame_id=frame_id)


def planar_pose(x: float, y: float, yaw: float) -> Any:
    """A geometry_msgs/msg/Pose in the plane: x and y in m, yaw in rad."""
    point = message_type("geometry_msgs/msg/Point")(float(x), float(y), 0.0)
    turn = message_type("geometry_msgs/msg/Quaternion")(0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    return message_type("geometry_msgs/msg/Pose")(point, turn)


@dataclass(frozen=True)
class _Channel:
    id: int
    typename: str


class LogWriter:
    """Writes one MCAP file; a context manager.

    Messages are kept in memory and written in the order of their log times, as a recorder receives them, for any order
    of the calls. The file appears under its name when the block ends without an exception; otherwise nothing is left.
    The same calls write the same bytes.

    Args:
        path: The file to write.
        compression: Of the chunks: "zstd", "lz4" or "none".
        chunk_size: Bytes of a chunk before compression.
        force: Whether to replace an existing file.

    Raises:
        LogError: The compression is unknown.
        ArtefactError: The file exists already and `force` is not given, or it cannot be written.
    """

    def __init__(
        self, path: Path | str, *, compression: str = "zstd", chunk_size: int = 1 << 20, force: bool = False
    ) -> None:
        self.path = Path(path)
        if compression not in _COMPRESSION:
            raise LogError(f"{self.path}: expected compression zstd, lz4 or none, found {compression!r}")
        self._compression = _COMPRESSION[compression]
        self._chunk_size = chunk_size
        self._force = force
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, _Channel] = {}
        self._sequences: dict[int, int] = {}
        self._held: list[tuple[int, int, bytes, int]] = []
        self._copied: dict[Channel, int] = {}

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            temporary = stack.enter_context(replacing(self.path, force=self._force))
            stream = stack.enter_context(temporary.open("wb"))
            self._stack = stack.pop_all()
        self._writer = Writer(stream, chunk_size=self._chunk_size, compression=self._compression)
        self._writer.start(profile="ros2", library=f"navirl {__version__}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._stack.__exit__(kind, error, trace)
            return
        with self._stack:
            self.flush()
            self._writer.finish()  # type: ignore[no-untyped-call]

    @property
    def topics(self) -> list[str]:
        """The topics so far, without those of copied messages."""
        return list(self._channels)

    def flush(self) -> None:
        """Write the messages so far in the order of log time; later messages must have later times."""
        self._held.sort(key=itemgetter(0))
        for log_time_ns, channel, payload, publish_time_ns in self._held:
            sequence = self._sequences.get(channel, 0)
            self._sequences[channel] = sequence + 1
            self._writer.add_message(channel, log_time_ns, payload, publish_time_ns, sequence)
        self._held.clear()

    def message(self, topic: str, message: Any, log_time_ns: int, publish_time_ns: int | None = None) -> None:
        """Write one message.

        Args:
            topic: "/odom".
            message: An object of a `message_type` class.
            log_time_ns: When it was received, in ns.
            publish_time_ns: When it was published, in ns; None for the time of receipt.

        Raises:
            LogError: The topic already has messages of another type.
        """
        channel = self._channel(topic, message.__msgtype__)
        payload = _builtin().serialize_cdr(message, channel.typename, little_endian=True)
        self._add(channel, bytes(payload), log_time_ns, log_time_ns if publish_time_ns is None else publish_time_ns)

    def columns(self, topic: str, template: Any, log_time_ns: ArrayLike, columns: Mapping[str, ArrayLike]) -> None:
        """Write many messages that differ only in numbers and times, without an object for each.

        Args:
            topic: "/wrench".
            template: A message that gives the fields that `columns` does not name.
            log_time_ns: Shape (n,), ns; also the time of publishing.
            columns: Values by dotted field: shape (n,), or (n, k) for a fixed array of k numbers; times such as
                "header.stamp" in ns. No texts.

        Raises:
            LogError: A field does not exist or is a text, a column's shape is wrong, or the topic already has
                messages of another type.
        """
        channel = self._channel(topic, template.__msgtype__)
        times = np.asarray(log_time_ns, dtype=np.int64)
        rows = _fill(topic, template, len(times), columns)
        size = rows.dtype.itemsize
        data = rows.tobytes()
        for number, t_ns in enumerate(times.tolist()):
            self._add(channel, data[number * size : (number + 1) * size], t_ns, t_ns)

    def copy(self, batch: Batch, metadata: Mapping[str, str] | None = None) -> None:
        """Write messages of another log at once, with their bytes, times and numbers, on a channel of their own.

        Args:
            batch: The messages.
            metadata: Of their channel.
        """
        one = replace(batch.channel, id=0)  # the files of a bag number their channels by themselves
        if one not in self._copied:
            known = one.schema_name or one.schema_text
            text = one.schema_text.encode()
            schema = self._writer.register_schema(one.schema_name, one.schema_encoding, text) if known else 0
            channel = self._writer.register_channel(one.topic, one.message_encoding, schema, dict(metadata or {}))
            self._copied[one] = channel
        heads = gathered(batch.raw, batch.starts - _MESSAGE_TIMES.itemsize, _MESSAGE_TIMES)
        for number, (sequence, log_time_ns, publish_time_ns) in enumerate(heads.tolist()):
            payload = batch.payload(number)
            self._writer.add_message(self._copied[one], log_time_ns, payload, publish_time_ns, sequence)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record with a name and texts by key."""
        self._writer.add_metadata(name, dict(values))

    def _add(self, channel: _Channel, payload: bytes, log_time_ns: int, publish_time_ns: int) -> None:
        self._held.append((int(log_time_ns), channel.id, payload, int(publish_time_ns)))

    def _channel(self, topic: str, typename: str) -> _Channel:
        """The topic's channel; its first use registers it with its definition."""
        channel = self._channels.get(topic)
        if channel is None:
            if typename not in self._schemas:
                text, _ = _builtin().generate_msgdef(typename, ros_version=2)
                self._schemas[typename] = self._writer.register_schema(typename, "ros2msg", text.encode())
            channel = _Channel(self._writer.register_channel(topic, "cdr", self._schemas[typename]), typename)
            self._channels[topic] = channel
        if channel.typename != typename:
            raise LogError(
                f"{self.path}: topic {topic}: expected messages of type {channel.typename}, found one of {typename}; "
                "write it to another topic"
            )
        return channel


def _fill(topic: str, template: Any, n: int, columns: Mapping[str, ArrayLike]) -> NDArray[np.void]:
    """The payloads of `LogWriter.columns`, as a structured array of shape (n,)."""
    schema = Schema(template.__msgtype__, _builtin().fielddefs)
    payload = bytes(_builtin().serialize_cdr(template, schema.name, little_endian=True))
    try:
        leaves = {path: schema.leaf(path) for path in columns}
    except SchemaError as error:
        raise LogError(f"topic {topic}: {error}") from error
    layout = derive(schema, payload, leaves)
    if layout is None:
        raise LogError(
            f"topic {topic}: expected a type that can be filled by columns, found {schema.name}; write single messages"
        )
    rows = np.frombuffer(bytearray(payload * n), dtype=layout.dtype)
    for path, leaf in leaves.items():
        values = np.asarray(columns[path])
        if leaf.value_type == "string":
            raise LogError(f"topic {topic}: {path}: expected numbers or times, found a text; set it in the template")
        if values.shape != (n, *leaf.shape):
            raise LogError(f"topic {topic}: {path}: expected shape {(n, *leaf.shape)}, found {values.shape}")
        if leaf.value_type == "time":
            rows[path + "/sec"], rows[path + "/nanosec"] = np.divmod(values.astype(np.int64), _NS_PER_S)
        else:
            rows[path] = values
    return rows
