"""Forged logs: every way an MCAP file is written, every way it breaks, and a slow twin that reads them."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
WRENCH = "geometry_msgs/msg/WrenchStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
TF = "tf2_msgs/msg/TFMessage"
JOY = "sensor_msgs/msg/Joy"
#: A definition no parser takes: it stands beside good ones in every forged run, and must never matter.
BROKEN = "camera_msgs/msg/Blob"
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TF))
START_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True)
class Message:
    topic: str
    typename: str
    log_time_ns: int
    payload: bytes


def build(typename: str, **fields: Any) -> Any:
    return STORE.types[typename](**fields)


def header(t_ns: int, frame_id: str) -> Any:
    stamp = build("builtin_interfaces/msg/Time", sec=t_ns // 10**9, nanosec=t_ns % 10**9)
    return build("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def vector(x: float, y: float, z: float) -> Any:
    return build("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def wrench(t_ns: int, force: Sequence[float], frame_id: str = "ft_sensor") -> Any:
    body = build("geometry_msgs/msg/Wrench", force=vector(*force), torque=vector(0.5, -0.5, 0.25))
    return build(WRENCH, header=header(t_ns, frame_id), wrench=body)


def odometry(t_ns: int, x: float, y: float, frame_id: str = "odom", child: str = "base_link") -> Any:
    pose = build(
        "geometry_msgs/msg/Pose",
        position=build("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
        orientation=build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
    )
    twist = build("geometry_msgs/msg/Twist", linear=vector(x, 0.0, 0.0), angular=vector(0.0, 0.0, y))
    covariance = np.full(36, x)
    return build(
        ODOMETRY,
        header=header(t_ns, frame_id),
        child_frame_id=child,
        pose=build("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance),
        twist=build("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=covariance),
    )


def transforms(t_ns: int, children: Sequence[str], x: float = 1.0) -> Any:
    """A TFMessage with a transform for each child, whose stamps are 1 ns apart."""
    turn = build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.6, w=0.8)
    links = [
        build(
            "geometry_msgs/msg/TransformStamped",
            header=header(t_ns + number, "odom"),
            child_frame_id=child,
            transform=build("geometry_msgs/msg/Transform", translation=vector(x, 10.0 * number, 0.0), rotation=turn),
        )
        for number, child in enumerate(children)
    ]
    return build(TF, transforms=links)


def joy(t_ns: int, axes: Sequence[float], buttons: Sequence[int] = ()) -> Any:
    numbers = {"axes": np.array(axes, dtype=np.float32), "buttons": np.array(buttons, dtype=np.int32)}
    return build(JOY, header=header(t_ns, "joy"), **numbers)


def cdr(message: Any, *, little_endian: bool = True) -> bytes:
    return bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=little_endian))


def in_ros1(message: Any) -> Any:
    """The same message as ROS 1 defines its type; headers have number 7."""
    if isinstance(message, list):
        return [in_ros1(one) for one in message]
    if not hasattr(message, "__msgtype__"):
        return message
    fields = {name: in_ros1(value) for name, value in vars(message).items()}
    number = {"seq": 7} if message.__msgtype__ == "std_msgs/msg/Header" else {}
    return ROS1.types[message.__msgtype__](**number, **fields)


def run(
    n: int = 600, seed: int = 7, *, little_endian: bool = True, frame_ids: Sequence[str] = ("ft",)
) -> list[Message]:
    """n wrenches, n / 10 odometries and n / 20 blobs of a broken type; stamps are one millisecond before receipt."""
    rng = np.random.default_rng(seed)
    messages = []
    for number in range(n):
        t_ns = START_NS + number * 2_000_000
        frame_id = frame_ids[number % len(frame_ids)]
        sample = wrench(t_ns - 10**6, rng.normal(size=3).tolist(), frame_id)
        messages.append(Message("/wrench", WRENCH, t_ns, cdr(sample, little_endian=little_endian)))
        if number % 10 == 0:
            place = odometry(t_ns - 10**6, *rng.normal(size=2).tolist())
            messages.append(Message("/odom", ODOMETRY, t_ns + 1, cdr(place, little_endian=little_endian)))
        if number % 20 == 0:
            messages.append(Message("/camera", BROKEN, t_ns + 2, rng.bytes(400)))
    return messages


def forge(
    path: Path,
    messages: Sequence[Message],
    *,
    compression: CompressionType = CompressionType.ZSTD,
    definitions: Mapping[str, tuple[str, str]] | None = None,
    encodings: Mapping[str, str] | None = None,
    metadata: Sequence[tuple[str, dict[str, str]]] = (),
    channel_for: Mapping[int, int] | None = None,
    **options: Any,
) -> Path:
    """Write messages; `definitions` gives (encoding, text) by type, `encodings` the message encoding by topic.

    `channel_for` maps the number of a message to one of several channels of its topic. `options` are those of mcap's
    Writer.
    """
    options = {"chunk_size": 8192, **options}
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, **options)
        writer.start("ros2", "forged")
        schemas: dict[str, int] = {}
        channels: dict[tuple[str, int], int] = {}
        for name, values in metadata:
            writer.add_metadata(name, values)
        for number, message in enumerate(messages):
            key = (message.topic, (channel_for or {}).get(number, 0))
            if message.typename not in schemas:
                encoding, text = definition(message.typename, definitions or {})
                schemas[message.typename] = writer.register_schema(message.typename, encoding, text.encode())
            if key not in channels:
                encoding = (encodings or {}).get(message.topic, "cdr")
                channels[key] = writer.register_channel(message.topic, encoding, schemas[message.typename])
            writer.add_message(channels[key], message.log_time_ns, message.payload, message.log_time_ns, number)
        writer.finish()
    return path


def definition(typename: str, given: Mapping[str, tuple[str, str]]) -> tuple[str, str]:
    if typename in given:
        return given[typename]
    if typename == BROKEN:
        return "ros2msg", "this is [no definition at all"
    return "ros2msg", STORE.generate_msgdef(typename, ros_version=2)[0]


#: Every way of writing a file that a reader must take, as options of `forge`.
WAYS: dict[str, dict[str, Any]] = {
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed chunks": {"compression": CompressionType.NONE, "enable_crcs": False},
    "no chunks": {"use_chunking": False},
    "no message index": {"index_types": IndexType.ALL & ~IndexType.MESSAGE},
    "no chunk index": {"index_types": IndexType.NONE},
    "no channels in the summary": {"repeat_channels": False, "repeat_schemas": False},
    "no statistics": {"use_statistics": False},
    "no summary": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
    "no summary, no chunks": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
        "use_chunking": False,
    },
}


def slow_read(paths: Path | Sequence[Path], topic: str) -> list[tuple[int, Any]]:
    """Times and message objects of a topic, by mcap's forward reader and rosbags, sorted stably by time."""
    stores: dict[tuple[Path, int], Any] = {}
    found = []
    for path in [paths] if isinstance(paths, Path) else paths:
        with path.open("rb") as file:
            for schema, channel, message in NonSeekingReader(file).iter_messages(topics=[topic], log_time_order=False):
                store = stores.setdefault((path, schema.id), get_typestore(Stores.EMPTY))
                name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/")
                if name not in store.fielddefs:
                    text = schema.data.decode()
                    store.register(from_idl(text) if schema.encoding == "ros2idl" else get_types_from_msg(text, name))
                decode = store.deserialize_ros1 if channel.message_encoding == "ros1" else store.deserialize_cdr
                found.append((message.log_time, decode(message.data, name)))
    return sorted(found, key=lambda pair: pair[0])


def from_idl(text: str) -> Any:
    """Types of definitions in IDL, without their separators and what they include."""
    lines = [line for line in text.splitlines() if not line.startswith(("===", "IDL:", "#include"))]
    return get_types_from_idl("\n".join(lines))


def entries(message: Any, path: str) -> list[Any]:
    """What a column has of a message: one value, or those of a field in a sequence; times in ns."""
    found = [message]
    for part in path.split("."):
        name = part.removesuffix("[]")
        found = [getattr(one, name) for one in found]
        if part != name:
            found = [entry for many in found for entry in many]
    return [one.sec * 10**9 + one.nanosec if hasattr(one, "nanosec") else one for one in found]


def chunk_starts(path: Path) -> list[tuple[int, int]]:
    """First byte and size of each chunk record."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return [(index.chunk_start_offset, index.chunk_length) for index in summary.chunk_indexes]


def summary_start(path: Path) -> int:
    start: int = struct.unpack("<Q", path.read_bytes()[-28:-20])[0]
    return start


def cut(path: Path, size: int) -> Path:
    """Keep the first bytes only; a negative size drops that many from the end."""
    path.write_bytes(path.read_bytes()[:size])
    return path


def overwrite(path: Path, at: int, data: bytes) -> Path:
    content = bytearray(path.read_bytes())
    content[at : at + len(data)] = data
    path.write_bytes(bytes(content))
    return path


def messages_in_chunk(path: Path, number: int, topic: str) -> int:
    """How many messages of a topic a chunk holds."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        ids = [channel.id for channel in summary.channels.values() if channel.topic == topic]
        offsets = summary.chunk_indexes[number].message_index_offsets
        count = 0
        for channel_id in ids:
            if channel_id in offsets:
                file.seek(offsets[channel_id] + 1)
                (length,) = struct.unpack("<Q", file.read(8))
                count += (length - 6) // 16
    return count
