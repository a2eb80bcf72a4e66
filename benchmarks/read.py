"""Measure the time to read a long log, compared with reading and decompressing alone and with other readers.

python benchmarks/read.py [--quick] [--json] [--folder FOLDER]. Each row ends with its bar; the exit code is 0 only
where every bar holds. The task is to read (t, fx, fy) of all wrenches and (t, x, y, yaw) of all odometry as arrays,
from a log of 20 minutes and 1 GB (read_log.py) in the page cache. Each run of a reader is a new process. Its peak
memory includes the interpreter. The readers run alternately: slow ones once, fast ones three times. Times are medians
without imports, which have their own column. Ratios are medians over the rounds. Values are
compared by digests of their bytes.

The bound reads the chunks that hold the topics and decompresses them in one thread. It knows their positions and checks
nothing. It is measured twice: as a plain Python program, and with the file read into one buffer. With glibc the former
takes four times as long, because each freed megabyte is returned to the system and comes back page by page.

--quick reads 2 minutes instead of 20. Its ratios have no bars, because they include the cost of first calls. --folder
keeps the logs, or uses existing ones.
"""

import argparse
import json
import multiprocessing
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rows import Row, report

# Imports at the top count in the memory of every reader, and on Linux the peak of a process starts from its parent's.
# Numpy and the readers are therefore imported where they are used, and this process reads nothing.
if TYPE_CHECKING:
    from numpy.typing import NDArray

    Columns = dict[str, NDArray[Any]]
    #: Does the task and returns its arrays by name; the bound returns None.
    Work = Callable[[], object]

MINUTES, MINUTES_QUICK, TURNS = 20, 2, 3
_POSE = ("position.x", "position.y", "orientation.x", "orientation.y", "orientation.z", "orientation.w")
WANTS = {
    "/wrench": ["header.stamp", "wrench.force.x", "wrench.force.y"],
    "/odom": ["header.stamp", *(f"pose.pose.{part}" for part in _POSE)],
}


@dataclass(frozen=True)
class Log:
    """A log on the disk."""

    variant: str
    path: Path
    #: The same log without its last bytes, so that the summary is lost.
    cut: Path
    size: int
    messages: int
    chunks: int


@dataclass(frozen=True)
class Measured:
    """One run of a reader."""

    variant: str
    reader: str
    #: Time of imports and of preparation that does not count.
    ready_s: float
    work_s: float
    peak_mb: float
    #: Digest of the bytes of each of the task's arrays.
    digests: dict[str, str]


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="2 minutes of log in place of 20")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    parser.add_argument("--folder", type=Path, metavar="FOLDER", help="keep the logs here, or use those that are there")
    options = parser.parse_args()
    if find_spec("mcap_ros2") is None:
        parser.error("mcap-ros2-support, one of the readers, is not installed: pip install -e '.[bench]'")
    logs, runs, rows = [], [], []
    for variant in VARIANTS:
        with tempfile.TemporaryDirectory() as scratch:
            log = apart(prepared, options.folder or Path(scratch), MINUTES_QUICK if options.quick else MINUTES, variant)
            found = measured_in_turns(log)
        logs.append(log)
        runs += found
        rows += bars(variant, found, quick=options.quick)
    if options.json:
        tables = {"logs": logs, "runs": runs, "bars": rows}
        print(json.dumps({name: [asdict(one) for one in table] for name, table in tables.items()}, default=str))
        return 0 if all(row.holds for row in rows) else 1
    print_tables(logs, runs)
    return report(rows, as_json=False)


def apart(function: Callable[..., Any], *arguments: object) -> Any:
    """Call a function in a fresh process."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()


def prepared(folder: Path, minutes: int, variant: str) -> Log:
    """A log of a variant in a folder; it is written unless it is there already."""
    from read_log import prepare

    compression, crc = VARIANTS[variant]
    stem = f"{minutes}min-{variant.replace(' ', '-')}"
    return Log(variant, *prepare(folder, stem, 60 * minutes, compression=compression, crc=crc))


def measured_in_turns(log: Log) -> list[Measured]:
    """Run the fast readers in turns, and one of the slow ones at the end of each of the first turns."""
    slow = [] if log.variant == CHECKED else list(SLOW)
    return [apart(measure, log, reader) for turn in range(TURNS) for reader in (*FAST, *slow[turn : turn + 1])]


def measure(log: Log, reader: str) -> Measured:
    """Read a log, in this process."""
    import hashlib
    import resource

    begun = time.perf_counter()
    work = {**FAST, **SLOW}[reader](log.cut if reader == WALK else log.path)
    ready = time.perf_counter()
    found = work()
    done = time.perf_counter()
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e6
    columns = found if isinstance(found, dict) else {}
    digests = {name: hashlib.sha256(values.tobytes()).hexdigest() for name, values in columns.items()}
    return Measured(log.variant, reader, ready - begun, done - ready, peak_mb, digests)


def bound(path: Path, *, kept: bool = False) -> "Work":
    """Read the chunks that hold the topics, into one buffer if `kept`, and decompress them."""
    from mcap.reader import make_reader
    from zstandard import ZstdDecompressor

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    ids = {number for number, channel in summary.channels.items() if channel.topic in WANTS}
    chunks = [chunk for chunk in summary.chunk_indexes if ids & chunk.message_index_offsets.keys()]
    buffer = memoryview(bytearray(max(chunk.compressed_size for chunk in chunks) if kept else 0))

    def work() -> None:
        zstd = ZstdDecompressor()
        with path.open("rb", buffering=0) as file:
            for chunk in chunks:
                file.seek(chunk.chunk_start_offset + chunk.chunk_length - chunk.compressed_size)  # data ends the record
                if kept:
                    data = buffer[: chunk.compressed_size]
                    file.readinto(data)
                else:
                    data = file.read(chunk.compressed_size)
                if chunk.compression:
                    zstd.decompress(data, max_output_size=chunk.uncompressed_size)

    return work


def navirl(path: Path) -> "Work":
    """Columns by navirl's reader."""
    from navirl_cli.logs.messages.reader import read

    def work() -> "Columns":
        series = read(path, WANTS).series
        return task_columns(*([series[topic].columns[field] for field in fields] for topic, fields in WANTS.items()))

    return work


def scanned(path: Path) -> "Work":
    """Contents without payloads by navirl's reader."""
    from navirl_cli.logs.messages.reader import scan

    return lambda: scan(path)


def mcap_ros2(path: Path) -> "Work":
    """Message objects by mcap's reader and mcap-ros2-support, in its default order."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    def messages() -> Iterator[tuple[str, Any]]:
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages(topics=list(WANTS)):
                yield channel.topic, message

    return lambda: gathered(messages())


def rosbags(path: Path) -> "Work":
    """Message objects by rosbags' AnyReader."""
    from rosbags.highlevel import AnyReader

    def messages() -> Iterator[tuple[str, Any]]:
        with AnyReader([path]) as reader:
            connections = [one for one in reader.connections if one.topic in WANTS]
            for connection, _, payload in reader.messages(connections=connections):
                yield connection.topic, reader.deserialize(payload, connection.msgtype)

    return lambda: gathered(messages())


def gathered(messages: Iterable[tuple[str, Any]]) -> "Columns":
    """The task's columns from message objects, gathered in arrays of machine numbers, which are fast and small."""
    from array import array

    import numpy as np

    stamps, numbers = ({topic: array(code) for topic in WANTS} for code in "qd")
    for topic, message in messages:
        stamp = message.header.stamp
        stamps[topic].append(stamp.sec * 1_000_000_000 + stamp.nanosec)
        if topic == "/wrench":
            force = message.wrench.force
            numbers[topic].extend((force.x, force.y))
        else:
            place, turn = message.pose.pose.position, message.pose.pose.orientation
            numbers[topic].extend((place.x, place.y, turn.x, turn.y, turn.z, turn.w))
    return task_columns(
        *([np.array(stamps[topic]), *np.array(numbers[topic]).reshape(len(stamps[topic]), -1).T] for topic in WANTS)
    )


def task_columns(wrench: "Sequence[NDArray[Any]]", odometry: "Sequence[NDArray[Any]]") -> "Columns":
    """(t, fx, fy) and (t, x, y, yaw), each of shape (n,); t in ns, force in N, position in m, yaw in rad."""
    import numpy as np

    *place, qx, qy, qz, qw = odometry
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    names = [f"/wrench {name}" for name in ("t", "fx", "fy")] + [f"/odom {name}" for name in ("t", "x", "y", "yaw")]
    return dict(zip(names, (*wrench, *place, yaw), strict=True))


BOUND, KEPT, NAVIRL, WALK, SCAN = "bound", "bound, one buffer", "navirl", "navirl, cut file", "navirl's scan"
MCAP, ROSBAGS = "mcap-ros2-support", "rosbags"
FAST = {BOUND: bound, KEPT: partial(bound, kept=True), NAVIRL: navirl, WALK: navirl, SCAN: scanned}
SLOW = {MCAP: mcap_ros2, ROSBAGS: rosbags}
ZSTD, PLAIN, CHECKED = "zstd", "uncompressed", "zstd and CRCs"
#: Compression of the chunks, and whether they have CRCs.
VARIANTS = {ZSTD: ("zstd", False), PLAIN: ("", False), CHECKED: ("zstd", True)}


def bars(variant: str, found: Sequence[Measured], *, quick: bool) -> list[Row]:
    """Rows of one log."""
    runs = {reader: [one for one in found if one.reader == reader] for reader in (*FAST, *SLOW)}
    ours_s = statistics.median(one.work_s for one in runs[NAVIRL])
    ratios = [
        Row.at_most(f"{variant}: navirl / bound", over(runs[NAVIRL], runs[BOUND]), "", 1.8),
        Row(f"{variant}: navirl / bound with one buffer", over(runs[NAVIRL], runs[KEPT]), ""),
        Row(f"{variant}: navirl on the cut file / bound", over(runs[WALK], runs[BOUND]), ""),
        *(
            Row.at_least(f"{variant}: {reader} / navirl", runs[reader][0].work_s / ours_s, "", least)
            for reader, least in ((MCAP, 12), (ROSBAGS, 6))
            if runs[reader]
        ),
    ]
    # In the other logs the bound checks no CRCs, or copies bytes that a reader need not look at.
    unbarred = len(ratios) if quick else 0 if variant == ZSTD else 1
    ratios[:unbarred] = [replace(row, bar="", holds=True) for row in ratios[:unbarred]]
    peak_mb = max(one.peak_mb for reader in (NAVIRL, WALK) for one in runs[reader])
    return [
        *ratios,
        Row(f"{variant}: navirl's scan", 1e3 * statistics.median(one.work_s for one in runs[SCAN]), "ms"),
        Row.at_most(f"{variant}: navirl's peak memory, cut file or not", peak_mb, "MB", 150),
        *(same(variant, reader, runs[reader], runs[NAVIRL]) for reader in (WALK, MCAP, ROSBAGS) if runs[reader]),
    ]


def over(ours: Sequence[Measured], theirs: Sequence[Measured]) -> float:
    """Median over the turns of the ratio of two readers' times."""
    return statistics.median(one.work_s / other.work_s for one, other in zip(ours, theirs, strict=True))


def same(variant: str, reader: str, theirs: Sequence[Measured], ours: Sequence[Measured]) -> Row:
    """A row with the arrays of a reader that differ from those of navirl in any run."""
    runs = [one.digests for one in (*theirs, *ours)]
    differing = [name for name in runs[0] if len({digests[name] for digests in runs}) > 1]
    what = f"{variant}: arrays of {reader} that differ from navirl's" + "".join(f", {name}" for name in differing)
    return Row.at_most(what, len(differing), "", 0)


def print_tables(logs: Sequence[Log], runs: Sequence[Measured]) -> None:
    """Print a line for each log, then a line for each log and reader."""
    for log in logs:
        print(f"{log.variant + ':':<14} {log.size:>13,} bytes, {log.messages:,} messages, {log.chunks:,} chunks")
    print(f"\n{'log':<14} {'reader':<18} {'runs':>4} {'imports s':>10} {'work s':>8} {'peak MB':>8}")
    for variant, reader in dict.fromkeys((one.variant, one.reader) for one in runs):
        own = [one for one in runs if (one.variant, one.reader) == (variant, reader)]
        ready_s, work_s = (statistics.median(getattr(one, name) for one in own) for name in ("ready_s", "work_s"))
        print(f"{variant:<14} {reader:<18} {len(own):>4} {ready_s:>10.3f} {work_s:>8.3f}", end=" ")
        print(f"{max(one.peak_mb for one in own):>8.0f}")
    print()


if __name__ == "__main__":
    sys.exit(main())
