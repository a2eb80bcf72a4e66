"""Write a log of any length of a robot that is pushed around with its camera on, as rosbag2 does.

The two wanted topics are mixed with others: wrenches at 500 Hz, odometry and transforms at 50 Hz, and images of bytes
that do not compress at 10 Hz, which fill most of the file: 20 minutes make 1 GB. Chunks of 1 MiB, message indexes and
summary are those of rosbag2. Its options decide whether chunks are compressed and have CRCs: by default neither, and
its presets with zstd have no CRCs, which other recorders write. The same length gives the same bytes.
"""

import os
import shutil
import sys
from collections.abc import Iterator
from heapq import merge
from operator import itemgetter
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from log_factory import START_NS, build, cdr, definition, header, odometry, vector, wrench

from navirl_cli.arrays import FloatArray

SEED = 4
#: Bytes lost from the end of the second log: without footer and magic the summary cannot be found.
CUT_BYTES = 20
WRENCH_HZ, ODOMETRY_HZ, IMAGE_HZ = 500, 50, 10
IMAGE_BYTES = 78_500
TYPES = {
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/odom": "nav_msgs/msg/Odometry",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/camera": "sensor_msgs/msg/CompressedImage",
}
_COMPRESSION = {"": CompressionType.NONE, "zstd": CompressionType.ZSTD}

#: Messages of one topic in order: time of receipt in ns, topic, payload.
Stream = Iterator[tuple[int, str, bytes]]


def prepare(folder: Path, stem: str, seconds: int, *, compression: str, crc: bool) -> tuple[Path, Path, int, int, int]:
    """Write a log and a second one without its last bytes, unless they exist already.

    Returns:
        Their paths, and bytes, messages and chunks of the first one. Both are in the page cache and on the disk, so
        that the disk is not used during the measurement.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path, cut, part = (folder / f"{stem}{end}" for end in (".mcap", "-cut.mcap", ".part"))
    if not path.exists():
        write(part, seconds, compression=compression, crc=crc)
        part.rename(path)
    if not cut.exists():
        shutil.copyfile(path, part)
        os.truncate(part, path.stat().st_size - CUT_BYTES)
        part.rename(cut)
    os.sync()
    for one in (path, cut):
        with one.open("rb") as file:
            while file.read(1 << 20):
                pass
    with path.open("rb") as file:
        counts = make_reader(file).get_summary().statistics
    return path, cut, path.stat().st_size, counts.message_count, counts.chunk_count


def write(path: Path, seconds: int, *, compression: str, crc: bool) -> None:
    """Write a log.

    Args:
        path: The file.
        seconds: Its duration.
        compression: Of the chunks: "zstd", or "" for none.
        crc: Whether chunks and summary have CRCs.
    """
    streams = wrenches(seconds), odometries(seconds), transforms(seconds), static_transform(), images(seconds)
    with path.open("wb") as file:
        writer = Writer(file, compression=_COMPRESSION[compression], enable_crcs=crc)
        writer.start("ros2", "benchmark")
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for topic, name in TYPES.items():
            if name not in schemas:
                encoding, text = definition(name, {})
                schemas[name] = writer.register_schema(name, encoding, text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schemas[name])
        for number, (log_time_ns, topic, payload) in enumerate(merge(*streams, key=itemgetter(0))):
            writer.add_message(channels[topic], log_time_ns, payload, log_time_ns, number)
        writer.finish()


def wrenches(seconds: int) -> Stream:
    """Forces and torques of white noise."""
    rng = np.random.default_rng((SEED, 1))
    n = seconds * WRENCH_HZ
    return filled("/wrench", cdr(wrench(0, (0.0, 0.0, 0.0), "ft_sensor")), 4, rng.normal(0.0, 5.0, (n, 6)), WRENCH_HZ)


def odometries(seconds: int) -> Stream:
    """The robot on a large eight, with constant covariances and a noisy twist."""
    poses = driven(seconds)
    n = len(poses)
    covariance = np.broadcast_to(np.diag(np.full(6, 1e-3)).ravel(), (n, 36))
    twist = np.random.default_rng((SEED, 2)).normal(0.0, 0.2, (n, 6))
    tails = np.concatenate([poses, covariance, twist, covariance], axis=1)
    return filled("/odom", cdr(odometry(0, 0.0, 0.0, "odom", "base")), 4, tails, ODOMETRY_HZ)


def transforms(seconds: int) -> Stream:
    """The same poses as transforms from odom to base."""
    return filled("/tf", cdr(transform("odom", "base")), 8, driven(seconds), ODOMETRY_HZ)


def static_transform() -> Stream:
    """Where the force sensor is mounted."""
    yield START_NS, "/tf_static", cdr(transform("base", "ft_sensor"))


def images(seconds: int) -> Stream:
    """Images of noise, generated one by one."""
    rng = np.random.default_rng((SEED, 3))
    body = np.zeros(IMAGE_BYTES, dtype=np.uint8)
    template = cdr(build("sensor_msgs/msg/CompressedImage", header=header(0, "camera"), format="jpeg", data=body))
    heads = filled("/camera", template[:-IMAGE_BYTES], 4, np.zeros((seconds * IMAGE_HZ, 0)), IMAGE_HZ)
    return ((t_ns, topic, head + rng.bytes(IMAGE_BYTES)) for t_ns, topic, head in heads)


def filled(topic: str, template: bytes, stamp_at: int, tails: FloatArray, rate_hz: int) -> Stream:
    """Messages that differ in their stamps and in the float64 numbers at their ends.

    Args:
        topic: "/odom".
        template: A message as little-endian CDR.
        stamp_at: Where its stamp stands in it.
        tails: Shape (n, k), the numbers that end each message; k may be 0.
        rate_hz: Messages a second.
    """
    n = len(tails)
    rng = np.random.default_rng((SEED, rate_hz))
    stamp_ns = START_NS + np.arange(n) * (10**9 // rate_hz)
    log_time_ns = stamp_ns + rng.integers(100_000, 900_000, n)  # received a fraction of a millisecond later
    rows = np.tile(np.frombuffer(template, dtype=np.uint8), (n, 1))
    rows[:, stamp_at : stamp_at + 8] = np.stack(np.divmod(stamp_ns, 10**9), axis=1).astype("<u4").view(np.uint8)
    rows[:, len(template) - 8 * tails.shape[1] :] = tails.astype("<f8").view(np.uint8).reshape(n, -1)
    for t_ns, row in zip(log_time_ns.tolist(), rows, strict=True):
        yield t_ns, topic, row.tobytes()


def driven(seconds: int) -> FloatArray:
    """Poses on a large eight over a floor that is not quite level, (n, 7): position in m, quaternion x, y, z, w."""
    rng = np.random.default_rng((SEED, 4))
    turn = np.arange(seconds * ODOMETRY_HZ) / ODOMETRY_HZ / 10.0
    xyz_m = np.stack([4.0 * np.sin(turn), 2.0 * np.sin(2.0 * turn), 0.0 * turn], axis=1)
    xyz_m += rng.normal(0.0, 1e-3, xyz_m.shape)
    yaw_rad = np.arctan2(4.0 * np.cos(2.0 * turn), 4.0 * np.cos(turn))
    angles_rad = np.stack([yaw_rad, *rng.normal(0.0, 1e-2, (2, len(turn)))], axis=1)
    return np.concatenate([xyz_m, Rotation.from_euler("ZYX", angles_rad).as_quat()], axis=1)


def transform(parent: str, child: str) -> object:
    """A message of one identity transform."""
    identity = build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    body = build("geometry_msgs/msg/Transform", translation=vector(0.0, 0.0, 0.0), rotation=identity)
    head = header(START_NS, parent)
    one = build("geometry_msgs/msg/TransformStamped", header=head, child_frame_id=child, transform=body)
    return build("tf2_msgs/msg/TFMessage", transforms=[one])
