"""A minute of log with 33,000 wanted messages, in variants of the format, and what stands where in it."""

import io
import re
from functools import cache, lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import log_factory as forge
import lz4.frame
import numpy as np
import pytest
import strict_log
import zstandard
from log_factory import START_NS
from mcap.writer import CompressionType, IndexType
from strict_log import StrictMessage

from navirl_cli.logs.messages.reader import read

WRENCHES, ODOMETRIES, IMAGES, SECONDS = 500, 50, 10, 60
#: Noise: a chunk of a second takes two blocks of zstd.
IMAGE_BYTES, CHUNK_BYTES = 16_000, 250_000
ALL = SECONDS * (WRENCHES + ODOMETRIES)
FORCES = np.random.default_rng(1).normal(size=(SECONDS * WRENCHES, 6))
#: Pose, covariance, twist, covariance.
MOTIONS = np.random.default_rng(2).normal(size=(SECONDS * ODOMETRIES, 85))
WRENCH_NS = START_NS + np.arange(len(FORCES)) * (10**9 // WRENCHES)
ODOMETRY_NS = START_NS + np.arange(len(MOTIONS)) * (10**9 // ODOMETRIES) + 1
#: By topic: times of receipt, and columns by field; a stamp is a millisecond older.
TRUTH = {
    "/wrench": (
        WRENCH_NS,
        {"header.stamp": WRENCH_NS - 10**6, "wrench.force.x": FORCES[:, 0], "wrench.torque.z": FORCES[:, 5]},
    ),
    "/odom": (
        ODOMETRY_NS,
        {
            "header.stamp": ODOMETRY_NS - 10**6,
            "pose.pose.position.x": MOTIONS[:, 0],
            "pose.covariance": MOTIONS[:, 7:43],
            "twist.twist.linear.y": MOTIONS[:, 44],
        },
    ),
}
CHANNELS = {"/wrench": 1, "/odom": 2}
WANTS = {topic: tuple(columns) for topic, (_, columns) in TRUTH.items()}
BARE = forge.WAYS["no summary"]
#: Chunks of a second.
OPTIONS = {
    "zstd": {},
    "zstd, no summary": BARE,
    "lz4": {"compression": CompressionType.LZ4},
    "unchecked": {"compression": CompressionType.NONE, "enable_crcs": False},
    "unchecked, no summary": {"compression": CompressionType.NONE, "enable_crcs": False, **BARE},
    "no message index": {"index_types": IndexType.ALL & ~IndexType.MESSAGE},
    "unchunked": {"use_chunking": False, "enable_data_crcs": True},
    "unchunked, no summary": {"use_chunking": False, **BARE},
}
#: The ends of many reasons.
CUT = "the messages before the cut were read, those after it are lost"
BEHIND = "everything after it is lost"


class Log:
    """An intact file, and what stands where in it."""

    def __init__(self, path: Path) -> None:
        self.data = path.read_bytes()
        self.strict = strict_log.walk(self.data)
        #: In the order of the file.
        self.wanted = self.strict.of(*TRUTH)
        self.chunks = self.strict.chunks()

    def chunk_of(self, number: int) -> int:
        """The number of the chunk that holds a wanted message, which is numbered from 1."""
        return self.chunks.index(self.wanted[number - 1].chunk)

    def inside(self, chunk: int) -> list[StrictMessage]:
        return [message for message in self.wanted if message.chunk == self.chunks[chunk]]

    def without(self, lost: list[StrictMessage]) -> list[StrictMessage]:
        gone = {id(message) for message in lost}
        return [message for message in self.wanted if id(message) not in gone]

    def before(self, cut: int) -> list[StrictMessage]:
        """Wanted messages whose bytes all stand before a cut."""
        return [
            message
            for message in self.wanted
            if (message.chunk or message.place).stop <= cut
            or (
                message.chunk
                and message.chunk.start < cut
                and message.place.stop <= len(self.start_of(message.chunk, cut))
            )
        ]

    @cache  # noqa: B019 - as long as the module's tests
    def start_of(self, chunk: strict_log.Record, cut: int) -> bytes:
        """The records that a cut chunk still decompresses to."""
        content = self.data[chunk.start + 9 : cut]
        if len(content) < 60:
            return b""
        _, _, compression, at, _ = strict_log.chunk_head(content)
        return decompressed(compression, content[at:])

    def cut_behind(self, number: int) -> int:
        """The first place for a cut that leaves this number of wanted messages."""
        last = self.wanted[number - 1]
        low, high = last.chunk.start, last.chunk.stop
        while low < high - 1:
            middle = (low + high) // 2
            enough = len(self.start_of(last.chunk, middle)) >= last.place.stop
            low, high = (low, middle) if enough else (middle, high)
        return high

    def span(self, chunk: int) -> tuple[float, float]:
        """Time of a chunk's messages since the file's first one, s."""
        times = [
            message.log_time_ns - START_NS for message in self.strict.messages if message.chunk == self.chunks[chunk]
        ]
        return min(times) / 1e9, max(times) / 1e9

    def end(self, chunk: int) -> int:
        """First byte behind a chunk and its message indexes."""
        behind = [one for one in self.strict.records if one.start >= self.chunks[chunk].stop]
        return next(one.start for one in behind if one.code != strict_log.INDEX)

    def latest_s(self, stop: int) -> float:
        """Time of the last message before a byte, s."""
        times = [
            message.log_time_ns for message in self.strict.messages if (message.chunk or message.place).stop <= stop
        ]
        return (max(times) - START_NS) / 1e9


def decompressed(compression: str, data: bytes) -> bytes:
    """What a compressed stream that is cut decompresses to."""
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)).read()
    if compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(data)
    return data


def payloads(template: bytes, times_ns: np.ndarray, tails: np.ndarray) -> list[bytes]:
    """Copies of a message that differ in stamp and in the numbers at its end."""
    rows = np.tile(np.frombuffer(template, dtype=np.uint8), (len(times_ns), 1))
    stamps = np.stack(np.divmod(times_ns - 10**6, 10**9), axis=1).astype("<u4")
    rows[:, 4:12] = stamps.view(np.uint8)
    rows[:, -8 * tails.shape[1] :] = tails.astype("<f8").view(np.uint8).reshape(len(tails), -1)
    return [row.tobytes() for row in rows]


@cache
def messages() -> list[forge.Message]:
    """33,000 wanted messages, and images between them that are not wanted."""
    rng = np.random.default_rng(3)
    wrench, odometry = forge.cdr(forge.wrench(0, (0, 0, 0))), forge.cdr(forge.odometry(0, 0, 0))
    rows = {
        ("/wrench", forge.WRENCH): (WRENCH_NS, payloads(wrench, WRENCH_NS, FORCES)),
        ("/odom", forge.ODOMETRY): (ODOMETRY_NS, payloads(odometry, ODOMETRY_NS, MOTIONS)),
        ("/camera", forge.BROKEN): (
            START_NS + np.arange(SECONDS * IMAGES) * (10**9 // IMAGES) + 2,
            [rng.bytes(IMAGE_BYTES) for _ in range(SECONDS * IMAGES)],
        ),
    }
    found = [
        forge.Message(*kind, t_ns, payload)
        for kind, (times_ns, group) in rows.items()
        for t_ns, payload in zip(times_ns.tolist(), group, strict=True)
    ]
    return sorted(found, key=lambda message: message.log_time_ns)


@lru_cache(maxsize=8)
def intact(variant: str) -> Log:
    """The intact file of a variant of `OPTIONS`."""
    with TemporaryDirectory() as folder:
        return Log(forge.forge(Path(folder) / "minute.mcap", messages(), chunk_size=CHUNK_BYTES, **OPTIONS[variant]))


def check(path: Path, data: bytes, kept: list[StrictMessage], *damages: tuple) -> None:
    """Read a damaged file; compare the values bit by bit and the reported damage word by word.

    Args:
        path: Where the file is written.
        data: Its bytes.
        kept: The wanted messages that must be read.
        damages: Of each damage, in order: first byte, first byte after it, span in s or None, pattern of the reason.
    """
    path.write_bytes(data)
    result = read(path, WANTS)
    for topic, (times_ns, columns) in TRUTH.items():
        there = [message.log_time_ns for message in kept if message.channel == CHANNELS[topic]]
        rows = np.searchsorted(times_ns, there)
        series = result.series[topic]
        assert series.log_time_ns.tolist() == there == times_ns[rows].tolist()
        for field, column in columns.items():
            assert series.columns[field].tobytes() == column[rows].tobytes(), field
    assert [(one.start, one.stop) for one in result.damage] == [one[:2] for one in damages]
    for one, (*_, span_s, reason) in zip(result.damage, damages, strict=True):
        assert one.span_s == (span_s if span_s is None else pytest.approx(span_s, abs=1e-9)), one
        assert re.fullmatch(reason, one.reason), one
        assert one.path == path


def body(log: Log, message: StrictMessage) -> slice:
    """Bytes of the file that hold an uncompressed message."""
    if message.chunk is None:
        return slice(*message.place[1:])
    start = message.chunk.start + 9 + strict_log.chunk_head(log.data[message.chunk.contents])[3]
    return slice(start + message.place.start, start + message.place.stop)


def overwritten(log: Log, at: int, new: bytes) -> bytes:
    return log.data[:at] + new + log.data[at + len(new) :]


def lost_in(log: Log, number: int, variant: str) -> str:
    """The text for the lost messages of a chunk, which only its message index counts."""
    if "no summary" in variant:
        return "messages lost: an unknown number"
    counts = [sum(message.channel == channel for message in log.inside(number)) for channel in CHANNELS.values()]
    return "messages lost: {} of /wrench, {} of /odom".format(*counts)


def fewest(log: Log) -> int:
    """The chunk with the fewest wanted messages, except for the first and the last."""
    return min(range(1, len(log.chunks) - 1), key=lambda number: len(log.inside(number)))
