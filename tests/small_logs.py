"""Small logs that hold a trial, one for each variant of the format, and what stands where in them."""

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import log_factory as forge
import lz4.frame
import numpy as np
import strict_log
import zstandard
from log_factory import ROS1, START_NS, build
from numpy.random import Generator

#: A drive of 3 s and 1.5 m, pushed aside on the way, with few messages.
WRENCH_HZ, ODOMETRY_HZ, TF_HZ, PEOPLE_HZ, IMAGE_HZ, LASTS_S, SPEED_M_S = 30, 10, 1, 1, 1, 3, 0.5


def messages(encoding: str = "cdr", *, little_endian: bool = True, frames: bool = False) -> list[forge.Message]:
    """The messages of a trial: wrench, odometry, map, people, a goal, and blobs whose definition does not parse.

    With `frames`, odometry and wrench are in frames of their own and tf connects them.
    """
    rng = np.random.default_rng(8)

    def written(topic: str, t_ns: int, message: Any) -> forge.Message:
        typename = message.__msgtype__
        if encoding == "json":
            return forge.Message(topic, typename, t_ns, json.dumps(plain(message)).encode())
        if encoding == "ros1":
            return forge.Message(topic, typename, t_ns, bytes(ROS1.serialize_ros1(forge.in_ros1(message), typename)))
        return forge.Message(topic, typename, t_ns, forge.cdr(message, little_endian=little_endian))

    found = [written(topic, t_ns, message) for topic, t_ns, message in drive(rng, frames=frames)]
    found += [forge.Message("/camera", forge.BROKEN, t_ns + 3, rng.bytes(200)) for t_ns in times_ns(IMAGE_HZ)]
    return sorted(found, key=lambda message: message.log_time_ns)


def drive(rng: Generator, *, frames: bool) -> Iterator[tuple[str, int, Any]]:
    """Topic, time and message object of all messages whose definition parses."""
    place = build("geometry_msgs/msg/Point", x=-1.0, y=-1.0, z=0.0)
    here = build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    info = build(
        "nav_msgs/msg/MapMetaData",
        map_load_time=forge.header(START_NS, "").stamp,
        resolution=0.1,
        width=40,
        height=20,
        origin=build("geometry_msgs/msg/Pose", position=place, orientation=here),
    )
    cells = np.zeros(800, dtype=np.int8)
    cells[:40] = 100
    head = forge.header(START_NS, "map")
    yield "/map", START_NS, build("nav_msgs/msg/OccupancyGrid", header=head, info=info, data=cells)
    yield "/goal_pose", START_NS + 1, build("geometry_msgs/msg/PoseStamped", header=head, pose=pose(1.5, 0.0))
    if frames:
        yield "/tf_static", START_NS, link(START_NS, "base_link", "ft_sensor", 0.1)
        for t_ns in times_ns(TF_HZ, 1):
            yield "/tf", t_ns, link(t_ns, "map", "odom", 0.25)
    for t_ns in times_ns(PEOPLE_HZ):
        head = forge.header(t_ns, "map")
        yield "/people", t_ns, build("geometry_msgs/msg/PoseArray", header=head, poses=[pose(0.7, 0.7), pose(1.0, 0.8)])
    for t_ns in times_ns(ODOMETRY_HZ):
        at_s = (t_ns - START_NS) / 1e9
        x, y = SPEED_M_S * at_s - 0.25 * frames, 0.01 * rng.normal()
        yield "/odom", t_ns, forge.odometry(t_ns, x, y, "odom" if frames else "map", "base_link")
    for t_ns in times_ns(WRENCH_HZ):
        pushed = 8.0 if 1e9 < t_ns - START_NS < 1.8e9 else 0.0
        force = np.array([3.0, pushed - 2.0, 5.0]) + 0.1 * rng.normal(size=3)
        yield "/wrench", t_ns + 2, forge.wrench(t_ns, force.tolist(), "ft_sensor" if frames else "base_link")


def times_ns(rate_hz: float, more: int = 0) -> list[int]:
    return [START_NS + round(k * 1e9 / rate_hz) for k in range(LASTS_S * rate_hz + more)]


def pose(x: float, y: float) -> Any:
    here = build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    point = build("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
    return build("geometry_msgs/msg/Pose", position=point, orientation=here)


def link(t_ns: int, parent: str, child: str, x: float) -> Any:
    """A TFMessage of one transform."""
    here = build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    moved = build("geometry_msgs/msg/Transform", translation=forge.vector(x, 0.0, 0.0), rotation=here)
    head = forge.header(t_ns, parent)
    one = build("geometry_msgs/msg/TransformStamped", header=head, child_frame_id=child, transform=moved)
    return build(forge.TF, transforms=[one])


def plain(message: Any) -> Any:
    """A message object as JSON represents it."""
    if isinstance(message, np.ndarray):
        return message.tolist()
    if isinstance(message, list):
        return [plain(one) for one in message]
    return {k: plain(v) for k, v in vars(message).items()} if hasattr(message, "__msgtype__") else message


#: By code of a record: its name, and the format of the numbers that it starts with.
NUMBERS = {
    strict_log.HEADER: ("header", "I"),
    strict_log.FOOTER: ("footer", "QQI"),
    strict_log.SCHEMA: ("schema", "HI"),
    strict_log.CHANNEL: ("channel", "HHI"),
    strict_log.MESSAGE: ("payload", "HIQQ"),
    strict_log.CHUNK: ("chunk", "QQQIIIQ"),
    strict_log.INDEX: ("message index", "HIQQQQ"),
    strict_log.STATISTICS: ("statistics", "QHIIIIQQI"),
    strict_log.METADATA: ("metadata", "III"),
    strict_log.DATA_END: ("data end", "I"),
    0x08: ("chunk index", "QQQQIHQHQ"),
    0x0D: ("metadata index", "QQI"),
    0x0E: ("summary offset", "BQQ"),
}


@dataclass(frozen=True)
class IntactLog:
    """A log that is to be broken."""

    name: str
    #: The bytes of MCAP.
    data: bytes
    #: Compression of the file: "zstd", "lz4" or "".
    compression: str
    #: Whether CRCs protect all messages.
    protected: bool
    strict: strict_log.StrictLog
    #: Bytes [start, stop), by what stands there.
    spots: dict[str, list[tuple[int, int]]]
    #: Place and width of all lengths, places, ids and times.
    fields: list[tuple[int, int]]

    @property
    def stored(self) -> bytes:
        """The bytes of the file."""
        return compressed(self.data, self.compression)


def compressed(data: bytes, compression: str) -> bytes:
    """A file's bytes, compressed or as they are."""
    if compression == "zstd":
        return zstandard.ZstdCompressor(write_checksum=True).compress(data)
    return lz4.frame.compress(data) if compression == "lz4" else data


def intact_logs(folder: Path) -> list[IntactLog]:
    """A log for each variant of writing, byte order, encoding and compression."""
    unchecked = forge.WAYS["uncompressed chunks"]
    plain = forge.WAYS["no summary, no chunks"]
    found = [
        intact(folder, name, messages(frames=name in {"zstd", "uncompressed chunks", "no summary, no chunks"}), options)
        for name, options in forge.WAYS.items()
    ]
    found += [
        intact(folder, "unchunked, data CRC", messages(), {"use_chunking": False, "enable_data_crcs": True}),
        intact(folder, "unchecked, no summary", messages(), {**forge.WAYS["no summary"], **unchecked}),
        intact(folder, "big-endian", messages(little_endian=False), unchecked),
        intact(folder, "ros1", messages("ros1"), unchecked, "ros1"),
        intact(folder, "ros1, no chunks", messages("ros1"), plain, "ros1"),
        intact(folder, "json", messages("json"), unchecked, "json"),
        intact(folder, "json, no chunks", messages("json"), plain, "json"),
        intact(folder, "file compressed with zstd", messages(), unchecked, compression="zstd"),
        intact(folder, "file compressed with lz4", messages(), {}, compression="lz4"),
    ]
    return found


def intact(
    folder: Path,
    name: str,
    messages: list[forge.Message],
    options: dict[str, Any],
    encoding: str = "cdr",
    compression: str = "",
) -> IntactLog:
    """A log and what stands where in it."""
    types = {message.typename for message in messages if message.typename != forge.BROKEN}
    definitions = {
        "cdr": {},
        "ros1": {one: ("ros1msg", ROS1.generate_msgdef(one, ros_version=1)[0]) for one in types if encoding == "ros1"},
        "json": dict.fromkeys(types, ("jsonschema", "{}")),
    }[encoding]
    path = forge.forge(
        folder / "intact.mcap",
        messages,
        definitions=definitions,
        encodings={message.topic: encoding for message in messages if message.topic != "/camera"},
        metadata=[("rosbag2", {"a": "1"})],
        **{"chunk_size": 14_000, **options},
    )
    data = path.read_bytes()
    strict = strict_log.walk(data)
    chunked, checked = options.get("use_chunking", True), options.get("enable_crcs", True)
    spots, fields = landmarks(data, strict)
    protected = bool(options.get("enable_data_crcs")) or (chunked and checked)
    return IntactLog(name, data, compression, protected, strict, spots, fields)


def landmarks(
    data: bytes, strict: strict_log.StrictLog
) -> tuple[dict[str, list[tuple[int, int]]], list[tuple[int, int]]]:
    """The `spots` and `fields` that mutations aim at."""
    spots: dict[str, list[tuple[int, int]]] = {"start": [(0, 60)], "end": [(len(data) - 60, len(data))]}
    fields: list[tuple[int, int]] = []

    def mark(record: strict_log.Record, base: int) -> None:
        name, inside = NUMBERS.get(record.code, ("other", ""))
        start = base + record.start
        fields.append((start + 1, 8))
        head = 9 + struct.calcsize(f"<{inside}")
        at = start + 9
        for width in (struct.calcsize(f"<{letter}") for letter in inside):
            fields.append((at, width))
            at += width
        spots.setdefault("record head", []).append((start, start + 9))
        spots.setdefault(f"{name} head", []).append((start, start + head))
        spots.setdefault(name, []).append((start + min(head, record.stop - record.start), base + record.stop))

    for record in strict.records:
        mark(record, 0)
    for message in strict.messages:
        if message.chunk is None:
            continue
        _, _, compression, at, _ = strict_log.chunk_head(data[message.chunk.contents])
        if not compression:
            mark(message.place, message.chunk.start + 9 + at)
    return {name: [one for one in places if one[0] < one[1]] for name, places in spots.items()}, fields
