"""A minute of log with 33,000 wanted messages, in every way of writing, and what is where in it."""

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
from strict_log import Told

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
#: What many notes on damage end with.
CUT = "the messages before the cut were read, those behind it are lost"
BEHIND = "what stands behind it is lost"


class Log:
    """A sound file, and what is where in it."""

    def __init__(self, path: Path) -> None:
        self.data = path.read_bytes()
        self.strict = strict_log.walk(self.data)
        #: In the order of the file.
        self.wanted = self.strict.of(*TRUTH)
        self.chunks = self.strict.chunks()

    def chunk_of(self, number: int) -> int:
        """Which chunk the wanted message of that number (from 1) is in."""
        return self.chunks.index(self.wanted[number - 1].chunk)

    def inside(self, chunk: int) -> list[Told]:
        return [told for told in self.wanted if told.chunk == self.chunks[chunk]]

    def without(self, lost: list[Told]) -> list[Told]:
        gone = {id(told) for told in lost}
        return [told for told in self.wanted if id(told) not in gone]

    def before(self, cut: int) -> list[Told]:
        """Wanted messages whose bytes all stand before a cut."""
        return [
            told
            for told in self.wanted
            if (told.chunk or told.place).stop <= cut
            or (told.chunk and told.chunk.start < cut and told.place.stop <= len(self.start_of(told.chunk, cut)))
        ]

    @cache  # noqa: B019 - as long as the module's tests
    def start_of(self, chunk: strict_log.Record, cut: int) -> bytes:
        """What a cut chunk's bytes decompress to."""
        content = self.data[chunk.start + 9 : cut]
        if len(content) < 60:
            return b""
        _, _, compression, at, _ = strict_log.chunk_head(content)
        return unpacked(compression, content[at:])

    def cut_behind(self, number: int) -> int:
        """The first place at which a cut leaves so many wanted messages."""
        last = self.wanted[number - 1]
        low, high = last.chunk.start, last.chunk.stop
        while low < high - 1:
            middle = (low + high) // 2
            enough = len(self.start_of(last.chunk, middle)) >= last.place.stop
            low, high = (low, middle) if enough else (middle, high)
        return high

    def span(self, chunk: int) -> tuple[float, float]:
        """Time of a chunk's messages since the file's first one, s."""
        times = [told.log_time_ns - START_NS for told in self.strict.messages if told.chunk == self.chunks[chunk]]
        return min(times) / 1e9, max(times) / 1e9

    def end(self, chunk: int) -> int:
        """First byte behind a chunk and its message indexes."""
        behind = [one for one in self.strict.records if one.start >= self.chunks[chunk].stop]
        return next(one.start for one in behind if one.code != strict_log.INDEX)

    def latest_s(self, stop: int) -> float:
        """Time of the last message before a byte, s."""
        times = [told.log_time_ns for told in self.strict.messages if (told.chunk or told.place).stop <= stop]
        return (max(times) - START_NS) / 1e9


def unpacked(compression: str, data: bytes) -> bytes:
    """The start of a compressed stream that is cut."""
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)).read()
    if compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(data)
    return data


def payloads(template: bytes, times_ns: np.ndarray, tails: np.ndarray) -> list[bytes]:
    """Copies of a message with other stamps and other numbers at its end."""
    rows = np.tile(np.frombuffer(template, dtype=np.uint8), (len(times_ns), 1))
    stamps = np.stack(np.divmod(times_ns - 10**6, 10**9), axis=1).astype("<u4")
    rows[:, 4:12] = stamps.view(np.uint8)
    rows[:, -8 * tails.shape[1] :] = tails.astype("<f8").view(np.uint8).reshape(len(tails), -1)
    return [row.tobytes() for row in rows]


@cache
def messages() -> list[forge.Message]:
    """33,000 wanted messages, and images between them that nobody wants."""
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
def sound(way: str) -> Log:
    """The sound file that is written in a way of `OPTIONS`."""
    with TemporaryDirectory() as folder:
        return Log(forge.forge(Path(folder) / "minute.mcap", messages(), chunk_size=CHUNK_BYTES, **OPTIONS[way]))


def check(path: Path, data: bytes, kept: list[Told], *notes: tuple) -> None:
    """Read a damaged file, and compare bit by bit what is read, and word by word what is said.

    Args:
        path: Where it is written to.
        data: Its bytes.
        kept: The wanted messages that must be read.
        notes: Of each damage, in order: first byte, first byte behind it, span in s or None, pattern of the reason.
    """
    path.write_bytes(data)
    result = read(path, WANTS)
    for topic, (times_ns, columns) in TRUTH.items():
        there = [told.log_time_ns for told in kept if told.channel == CHANNELS[topic]]
        rows = np.searchsorted(times_ns, there)
        series = result.series[topic]
        assert series.log_time_ns.tolist() == there == times_ns[rows].tolist()
        for field, column in columns.items():
            assert series.columns[field].tobytes() == column[rows].tobytes(), field
    found = [(note.start, note.stop, note.span_s, note.reason) for note in result.damage]
    assert [note[:2] for note in found] == [note[:2] for note in notes]
    for note, (*_, span_s, reason) in zip(found, notes, strict=True):
        assert note[2] == (span_s if span_s is None else pytest.approx(span_s, abs=1e-9)), note
        assert re.fullmatch(reason, note[3]), note
    assert all(note.path == path for note in result.damage)


def body(log: Log, told: Told) -> slice:
    """Bytes of the file in which a message stands that is not compressed."""
    if told.chunk is None:
        return slice(*told.place[1:])
    start = told.chunk.start + 9 + strict_log.chunk_head(log.data[told.chunk.inside])[3]
    return slice(start + told.place.start, start + told.place.stop)


def overwritten(log: Log, at: int, new: bytes) -> bytes:
    return log.data[:at] + new + log.data[at + len(new) :]


def lost_in(log: Log, number: int, way: str) -> str:
    """Words for the messages of a chunk, which only its message index counts."""
    if "no summary" in way:
        return "messages lost: an unknown number"
    counts = [sum(told.channel == channel for told in log.inside(number)) for channel in CHANNELS.values()]
    return "messages lost: {} of /wrench, {} of /odom".format(*counts)


def fewest(log: Log) -> int:
    """The chunk with fewest wanted messages, but for the first and the last."""
    return min(range(1, len(log.chunks) - 1), key=lambda number: len(log.inside(number)))
