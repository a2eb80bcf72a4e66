"""Many broken logs, one after the other, and what came of them."""

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

from mutations import Mutant, mutant
from small_logs import Base, bases
from verdicts import ForbiddenError, Truth, judge, plain_call, truth_of

#: Longest time for one call, s, and most memory beyond what the process has anyway, MB.
MOST_S, MOST_MB = 10.0, 400.0


@dataclass
class Tally:
    """What came of many broken logs."""

    kinds: Counter[str] = field(default_factory=Counter)
    #: Numbers of broken logs, and what came of them that never may.
    forbidden: dict[int, str] = field(default_factory=dict)
    #: The slowest call: s, and what and which it was.
    slowest: tuple[float, str] = (0.0, "")
    #: Largest memory of the process, MB.
    peak_mb: float = 0.0

    def add(self, other: "Tally") -> None:
        """Take up another one."""
        self.kinds += other.kinds
        self.forbidden |= other.forbidden
        self.slowest = max(self.slowest, other.slowest)
        self.peak_mb = max(self.peak_mb, other.peak_mb)


@cache
def sound_logs() -> tuple[Base, ...]:
    """The logs that are broken, once a process."""
    with tempfile.TemporaryDirectory() as folder:
        return tuple(bases(Path(folder)))


@cache
def truth(number: int) -> Truth:
    """What is in one of them."""
    with tempfile.TemporaryDirectory() as folder:
        return truth_of(sound_logs()[number], Path(folder))


def judged(numbers: Iterable[int], seed: int = 0, keep: Path | None = None) -> Tally:
    """Break logs and read them.

    Args:
        numbers: Which ones.
        seed: Another seed breaks them otherwise.
        keep: Folder for those of which something comes that never may.
    """
    tally = Tally()
    logs = list(sound_logs())
    gc.collect()  # what others left must not be freed while memory is measured
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            broken = mutant(number, logs, seed)
            words = _tried(broken, Path(folder) / "broken.mcap", tally)
            if words:
                tally.kinds["forbidden"] += 1
                tally.forbidden[number] = f"{broken.base.name} ({broken.what}): {words}"
                if keep is not None:
                    (keep / f"{seed}-{number}.mcap").write_bytes(broken.data)
    return tally


def _tried(broken: Mutant, path: Path, tally: Tally) -> str:
    """Judge one, and say what is wrong with what came of it."""
    sound, spilt = truth(broken.number % len(sound_logs())), []
    old, sys.unraisablehook = sys.unraisablehook, lambda one: spilt.append(repr(one.exc_value))
    before_mb = memory_mb("VmRSS")
    forget_peak()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            kind = judge(broken, sound, path, lambda name, work: _timed(name, work, broken.number, tally))
    except ForbiddenError as error:
        return str(error)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what is looked for
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
    tally.kinds[kind] += 1
    return f"not raised, but spilt: {spilt[0]}" if spilt else ""


def _timed(name: str, work: Callable[[], Any], number: int, tally: Tally) -> Any:
    """Call one function, and stop it where it takes twice as long as it may."""
    begun = time.perf_counter()
    with alarm(name):
        found = plain_call(name, work)
    taken = time.perf_counter() - begun
    tally.slowest = max(tally.slowest, (taken, f"{name} of {number}"))
    if taken > MOST_S:
        raise ForbiddenError(f"{name} takes {taken:.1f} s")
    return found


def memory_mb(name: str) -> float:
    """A line of the process's status: VmRSS now, VmHWM at most since the peak was forgotten."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    (line,) = [line for line in status.read_text().splitlines() if line.startswith(name)]
    return int(line.split()[1]) * 1024 / 1e6


def forget_peak() -> None:
    """Start the peak of memory anew, where Linux lets."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


@contextmanager
def alarm(what: str) -> Iterator[None]:
    """Stop what takes twice as long as anything may."""

    def ring(*_: object) -> None:
        raise ForbiddenError(f"{what} takes more than {2 * MOST_S:g} s")

    old = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, 2 * MOST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, old)
