"""Read many broken logs, one after the other, and count what comes of them."""

import gc
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

from mutations import Mutant, mutant
from small_logs import IntactLog, intact_logs
from verdicts import ForbiddenError, Truth, judge, plain_call, truth_of

from navirl_cli.logs.container.raw import RawFile

#: Most memory of one log beyond what the process has anyway, MB.
MOST_MB = 400.0
#: Most bytes that one call may read for each byte of a log: a search behind damage must not start over and over.
MOST_READ = 100.0
#: A call that has not returned after this time hangs, s.
HANGS_S = 120.0


@dataclass
class Tally:
    """What came of many broken logs."""

    outcomes: Counter[str] = field(default_factory=Counter)
    #: By number of the broken log: what came of it that never may.
    forbidden: dict[int, str] = field(default_factory=dict)
    #: The slowest call: s, and which it was.
    slowest: tuple[float, str] = (0.0, "")
    #: The call that reads most: bytes read for each byte of the log, and which it was.
    most_read: tuple[float, str] = (0.0, "")
    #: Largest memory of the process, MB.
    peak_mb: float = 0.0

    def add(self, other: "Tally") -> None:
        """Add the counts of another one."""
        self.outcomes += other.outcomes
        self.forbidden |= other.forbidden
        self.slowest = max(self.slowest, other.slowest)
        self.most_read = max(self.most_read, other.most_read)
        self.peak_mb = max(self.peak_mb, other.peak_mb)


@cache
def logs() -> tuple[IntactLog, ...]:
    """The logs that are broken, made once in a process."""
    with tempfile.TemporaryDirectory() as folder:
        return tuple(intact_logs(Path(folder)))


@cache
def truth(number: int) -> Truth:
    """What is in one of them."""
    with tempfile.TemporaryDirectory() as folder:
        return truth_of(logs()[number], Path(folder))


def judge_logs(numbers: Iterable[int], seed: int = 0, keep: Path | None = None) -> Tally:
    """Break logs and read them.

    Args:
        numbers: Numbers of the broken logs.
        seed: Another seed breaks them otherwise.
        keep: Folder for those of which something comes that never may.
    """
    tally = Tally()
    gc.collect()  # what others left must not be freed while memory is measured
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            broken = mutant(number, logs(), seed)
            problem = _judge_one(broken, Path(folder) / "broken.mcap", tally)
            if problem:
                tally.outcomes["forbidden"] += 1
                tally.forbidden[number] = f"{broken.log.name} ({broken.what}): {problem}"
                if keep is not None:
                    (keep / f"{seed}-{number}.mcap").write_bytes(broken.data)
    return tally


def _judge_one(broken: Mutant, path: Path, tally: Tally) -> str:
    """Judge one broken log; return what is wrong with what came of it, or ""."""
    intact, unraised = truth(broken.number % len(logs())), []
    old, sys.unraisablehook = sys.unraisablehook, lambda event: unraised.append(repr(event.exc_value))
    before_mb = memory_mb("VmRSS")
    forget_peak()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            outcome = judge(broken, intact, path, lambda name, work: _watched(name, work, broken.number, tally))
    except ForbiddenError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001 - any exception but navirl's own is what is looked for
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        where = f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}" if trace else ""
        return f"{type(error).__name__}: {error} ({where})"
    finally:
        sys.unraisablehook = old
        peak_mb = memory_mb("VmHWM")
        tally.peak_mb = max(tally.peak_mb, peak_mb)
    if peak_mb - before_mb > MOST_MB:
        return f"{peak_mb - before_mb:.0f} MB of memory more than before"
    tally.outcomes[outcome] += 1
    return f"an exception that cannot be raised: {unraised[0]}" if unraised else ""


def _watched(name: str, work: Callable[[], Any], number: int, tally: Tally) -> Any:
    """Call one function, bound the bytes that it reads, and stop it where it hangs."""
    begun = time.perf_counter()
    with alarm(name), shares_read() as shares:
        found = plain_call(name, work)
    tally.slowest = max(tally.slowest, (time.perf_counter() - begun, f"{name} of {number}"))
    tally.most_read = max(tally.most_read, (sum(shares), f"{name} of {number}"))
    if sum(shares) > MOST_READ:
        raise ForbiddenError(f"{name} reads {sum(shares):.0f} times the log's bytes")
    return found


@contextmanager
def shares_read() -> Iterator[list[float]]:
    """Collect the share of the file that each reading takes."""
    shares: list[float] = []
    read = RawFile.read

    def counted(file: RawFile, start: int, stop: int) -> bytes:
        data = read(file, start, stop)
        shares.append(len(data) / file.size)
        return data

    with mock.patch.object(RawFile, "read", counted):
        yield shares


def memory_mb(name: str) -> float:
    """A line of the process's status: VmRSS is the memory now, VmHWM its peak since `forget_peak`."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    (line,) = [line for line in status.read_text().splitlines() if line.startswith(name)]
    return int(line.split()[1]) * 1024 / 1e6


def forget_peak() -> None:
    """Measure the peak of memory from here on, where Linux allows it."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


@contextmanager
def alarm(name: str) -> Iterator[None]:
    """Stop a call that hangs."""

    def ring(*_: object) -> None:
        raise ForbiddenError(f"{name} hangs: no answer after {HANGS_S:g} s")

    old = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, HANGS_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, old)
