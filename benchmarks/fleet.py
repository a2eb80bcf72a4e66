"""Measure the extraction of many logs: processes, a Dask cluster, overhead, memory, and bytes fetched from a store.

python benchmarks/fleet.py [--count N] [--json]. N logs (1,000 by default) are copies of the sample logs that differ in
a record, extracted into a folder by one process, by two, and by two workers of a Dask scheduler on loopback, each a
process of one thread. Memory is the resident set of the process that hands the logs out, at a tenth of them and at the
end. The overhead is that of 1,000 tasks that do nothing. The store is an HTTP server on loopback; of its camera log
the wrench is wanted. Needs navirl[cluster,remote], and the tests beside it. Ratios need idle cores.
"""

import argparse
import json
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rows import Row, report

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from dask_scheduler import scheduler
from fleet_logs import copies
from range_server import serving

from navirl_cli.artefacts.many import Folder
from navirl_cli.cluster import connected
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.logs.container.log_file import LogFile
from navirl_cli.logs.load import LoadOptions
from navirl_cli.logs.messages.reader import read
from navirl_cli.parallel import Local, map_in_order
from navirl_cli.remote import path_of


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


def overhead_ms(executor: Executor) -> float:
    """Time of a task without work, ms."""
    return timed(lambda: list(map_in_order(abs, list(range(1000)), executor)))


@contextmanager
def cluster(workers: int) -> Iterator[Executor]:
    """A Dask cluster on loopback with all its workers."""
    path = str(Path(__file__).parent)
    with scheduler(workers, folders=[path]) as (address, _), connected(address) as executor:
        executor._client.wait_for_workers(workers)  # type: ignore[attr-defined]
        yield executor


def camera_log(path: Path) -> None:
    """A log of bursts of a wanted topic, 0.8 MB each, between 6 MB of camera data."""
    import numpy as np
    from mcap.writer import CompressionType, Writer

    rng = np.random.default_rng(0)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=800_000, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("S", "jsonschema", b"{}")
        small, camera = (writer.register_channel(topic, "json", schema) for topic in ("/wrench", "/camera"))
        for second in range(20):
            for n in range(200):
                t_ns = second * 10**9 + n
                writer.add_message(small, t_ns, json.dumps({"x": n, "s": rng.bytes(2000).hex()}).encode(), t_ns)
            for n in range(200, 220):
                t_ns = second * 10**9 + n
                writer.add_message(camera, t_ns, rng.bytes(300_000), t_ns)
        writer.finish()


def fetched(folder: Path) -> tuple[float, float, int]:
    """Bytes fetched over those of the chunks that hold the topic, and over the log's, and the number of requests."""
    path = folder / "camera.mcap"
    camera_log(path)
    with LogFile(path) as log:
        chunks = log.summary.chunks.values() if log.summary else ()
        number = next(one.id for one in log.channels if one.topic == "/wrench")
        wanted = sum(one.stop - one.start for one in chunks if number in one.message_indexes)
    with serving(**{path.name: path.read_bytes()}) as store:
        read(path_of(f"{store.url}/{path.name}"), {"/wrench": ("x",)})
        return store.sent / wanted, store.sent / path.stat().st_size, len(store.asked)


def rows(count: int) -> Iterator[Row]:
    """All measurements."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "logs").mkdir()
        logs = copies(folder / "logs", count)
        one, _ = extraction(logs, folder / "one", Local(1))
        two, growth = extraction(logs, folder / "two", Local(2))
        yield Row(f"one process, {count} logs", one, "s")
        yield Row.at_least("one process over two", one / two, "", 1.7)
        yield Row.at_most("memory at the end over that at a tenth", growth, "", 1.2)
        with cluster(2) as executor:
            dask, _ = extraction(logs, folder / "dask", executor)
            task = overhead_ms(executor)
        same = all(
            (folder / "one" / path.name).read_bytes() == (folder / other / path.name).read_bytes()
            for path in (folder / "one").glob("log*.json")
            for other in ("two", "dask")
        )
        yield Row.at_least("two local processes over two workers of Dask", two / dask, "", 0.85)
        yield Row.at_least("files of all three are the same", float(same), "", 1)
        yield Row("a task without work: Dask", task, "ms")
        yield Row("a task without work: two local processes", overhead_ms(Local(2)), "ms")
        share, whole, requests = fetched(folder)
        yield Row.at_most("bytes fetched over wanted chunks", share, "", 1.3)
        yield Row("bytes fetched over the log", whole, "")
        yield Row("requests", requests, "")


def main() -> int:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000, help="number of logs")
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse_args()
    return report(list(rows(given.count)), as_json=given.json)


if __name__ == "__main__":
    sys.exit(main())
