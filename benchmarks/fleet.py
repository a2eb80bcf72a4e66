"""Measure the extraction of many logs: processes, a Dask cluster, overhead, memory, and bytes fetched from a store.

python benchmarks/fleet.py [--count N] [--json]. N logs (1,000 by default) are copies of the sample logs that differ in
a record, extracted into folders in three rounds of a third each, by one process, by two, and by two workers of a Dask
scheduler on loopback, each a process of one thread; of each the best round counts, in seconds a log. Rounds go the
other way round each time. What starts with each command or cluster (processes, imports of Dask's workers) is measured
by itself before. Memory is the resident set of the process that hands the logs out, at a tenth and at the end of all
logs, by two processes. The overhead is that of 1,000 tasks that do nothing. The store is an HTTP server on loopback
with two logs of 1 GB: one with camera data in chunks of their own, and one as rosbag2 writes it, where every chunk
holds every topic. Needs navirl[cluster,remote], and the tests beside it. Some 10 minutes on two idle cores, which
ratios need.
"""

import argparse
import json
import resource
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from read_log import write
from rows import Row, report, shown

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from dask_scheduler import scheduler
from fleet_logs import copies, loaded
from range_server import serving

from navirl_cli.artefacts.many import Folder
from navirl_cli.cluster import connected
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.logs.container.log_file import LogFile
from navirl_cli.logs.load import LoadOptions
from navirl_cli.logs.messages.reader import read
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import sources_of
from navirl_cli.parallel import Local, map_in_order
from navirl_cli.remote import path_of

ROUNDS = 3
#: Bursts of the log with the camera in chunks of its own, and seconds of the one like rosbag2's: 1 GB each.
BURSTS, SECONDS = 150, 1200


def resident_mb() -> float:
    """Resident set of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def timed(work: Callable[[], Any]) -> float:
    """Seconds of a work."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def extraction(logs: list[Path], folder: Path, executor: Executor) -> tuple[float, float]:
    """Seconds of an extraction, and the memory at its end over that at a tenth."""
    seen: list[float] = []
    settings, options = ExtractSettings(), LoadOptions()
    own = Folder(folder, settings, options, {})
    seconds = timed(lambda: own.extract(logs, executor=executor, progress=lambda *_: seen.append(resident_mb())))
    return seconds, seen[-1] / seen[len(seen) // 10]


def alone(logs: list[Path], folder: Path) -> Iterator[Row]:
    """CPU of a log in one process, and the share of its main thread: others decompress."""
    whole, main = time.process_time(), time.thread_time()
    extraction(logs, folder / "alone", Local(1))
    whole, main = time.process_time() - whole, time.thread_time() - main
    yield Row("CPU of a log, one process", whole / len(logs), "s")
    yield Row("CPU of its main thread over that of the process", main / whole, "")


def cpu_of_children() -> float:
    """CPU of processes that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def overhead_ms(executor: Executor) -> float:
    """Time of a task without work, ms."""
    return timed(lambda: list(map_in_order(abs, list(range(1000)), executor)))


def start_s(executor: Executor) -> float:
    """Seconds until two workers have imported what an extraction needs."""
    return timed(lambda: list(map_in_order(loaded, [0, 1], executor)))


@contextmanager
def cluster(workers: int) -> Iterator[Executor]:
    """A Dask cluster on loopback with all its workers."""
    path = str(Path(__file__).parent)
    with scheduler(workers, folders=[path]) as (address, _), connected(address) as executor:
        executor._client.wait_for_workers(workers)  # type: ignore[attr-defined]
        yield executor


def camera_log(path: Path, bursts: int) -> None:
    """A log of bursts of a wanted topic, 0.8 MB each, between 6 MB of camera data."""
    import numpy as np
    from mcap.writer import CompressionType, Writer

    rng = np.random.default_rng(0)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=800_000, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("S", "jsonschema", b"{}")
        small, camera = (writer.register_channel(topic, "json", schema) for topic in ("/wrench", "/camera"))
        for second in range(bursts):
            for n in range(200):
                t_ns = second * 10**9 + n
                writer.add_message(small, t_ns, json.dumps({"x": n, "s": rng.bytes(2000).hex()}).encode(), t_ns)
            for n in range(200, 220):
                t_ns = second * 10**9 + n
                writer.add_message(camera, t_ns, rng.bytes(300_000), t_ns)
        writer.finish()


def fetched(path: Path, wanted: Mapping[str, Sequence[str]], what: str) -> Iterator[Row]:
    """What is fetched of a log with its wanted topics and their fields."""
    with LogFile(path) as log:
        chunks = log.summary.chunks.values() if log.summary else ()
        numbers = {one.id for one in log.channels if one.topic in wanted}
        size = sum(one.stop - one.start for one in chunks if numbers & set(one.message_indexes))
    with serving(**{path.name: path.read_bytes()}) as store:
        address = f"{store.url}/{path.name}"
        overview(sources_of([path_of(address)])[0], {}, None)
        yield Row.at_most(f"{what}: requests of inspect", len(store.asked), "", 19)
        store.asked.clear()
        store.sent = 0
        seconds = timed(lambda: read(path_of(f"{address}?again"), wanted))
        yield Row.at_most(f"{what}: bytes fetched over wanted chunks", store.sent / size, "", 1.3)
        yield Row(f"{what}: bytes fetched over the log", store.sent / path.stat().st_size, "")
        yield Row(f"{what}: requests", len(store.asked), "")
        yield Row(f"{what}: read", seconds, "s")


def rounds(logs: list[Path], folder: Path, executors: Mapping[str, Executor]) -> dict[str, float]:
    """Seconds a log of the best of three rounds, by the name of the executor."""
    best = dict.fromkeys(executors, inf)
    for number in range(ROUNDS):
        own = logs[number::ROUNDS]
        for name in list(executors) if number % 2 == 0 else list(executors)[::-1]:
            seconds, _ = extraction(own, folder / f"{name}{number}", executors[name])
            best[name] = min(best[name], seconds / len(own))
    return best


def same(folder: Path, names: Iterable[str]) -> bool:
    """Whether all executors wrote the same files."""
    return all(
        (folder / f"one{number}" / path.name).read_bytes() == (folder / f"{name}{number}" / path.name).read_bytes()
        for number in range(ROUNDS)
        for path in (folder / f"one{number}").glob("log*.json")
        for name in names
    )


def rows(count: int) -> Iterator[Row]:
    """All measurements."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "logs").mkdir()
        logs = copies(folder / "logs", count)
        yield from alone(logs[: max(count // 10, 3)], folder)
        yield Row("start of two local processes", start_s(Local(2)), "s")
        with cluster(2) as executor:
            yield Row("imports of two workers of Dask", start_s(executor), "s")
            best = rounds(logs, folder, {"one": Local(1), "two": Local(2), "dask": executor})
            task = overhead_ms(executor)
        yield Row("one log, one process", best["one"], "s")
        yield Row.at_least("one process over two", best["one"] / best["two"], "", 1.7)
        yield Row.at_least("two local processes over two workers of Dask", best["two"] / best["dask"], "", 0.85)
        yield Row.at_least("files of all three are the same", float(same(folder, ("two", "dask"))), "", 1)
        yield Row("a task without work: Dask", task, "ms")
        yield Row("a task without work: two local processes", overhead_ms(Local(2)), "ms")
        own, others = time.process_time(), cpu_of_children()
        seconds, growth = extraction(logs, folder / "all", Local(2))
        own, others = time.process_time() - own, cpu_of_children() - others
        yield Row("CPU of the process that hands out, over all", own / (own + others), "")
        yield Row(f"{count} logs, two processes", seconds, "s")
        yield Row.at_most("memory at the end over that at a tenth", growth, "", 1.2)
    with TemporaryDirectory() as name:
        path = Path(name) / "camera.mcap"
        camera_log(path, BURSTS)
        yield from fetched(path, {"/wrench": ("x",)}, "camera in chunks of its own")
        mixed = Path(name) / "mixed.mcap"
        write(mixed, SECONDS, compression="", crc=False)
        topics = {"/wrench": ("wrench.force.x",), "/odom": ("pose.pose.position.x",)}
        yield from fetched(mixed, topics, "all topics in each chunk")


def main() -> int:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000, help="number of logs")
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse_args()
    return report(shown(rows(given.count)), as_json=given.json)


if __name__ == "__main__":
    sys.exit(main())
