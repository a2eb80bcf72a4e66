"""Rows of a benchmark's table: what was measured, the bar it is held to, and whether it holds."""

import json
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One figure beside its bar; a row without a bar is for information."""

    what: str
    value: float
    unit: str
    bar: str = ""
    holds: bool = True

    @staticmethod
    def at_most(what: str, value: float, unit: str, bar: float) -> "Row":
        """A row whose value must not exceed its bar."""
        return Row(what, value, unit, f"<= {bar:g} {unit}".rstrip(), value <= bar)

    @staticmethod
    def at_least(what: str, value: float, unit: str, bar: float) -> "Row":
        """A row whose value must reach its bar."""
        return Row(what, value, unit, f">= {bar:g} {unit}".rstrip(), value >= bar)


def shown(rows: Iterable[Row]) -> list[Row]:
    """Rows that take long, each named on standard error as soon as it is measured."""
    found = []
    for row in rows:
        found.append(row)
        print(f"{row.what}: {row.value:.4g} {row.unit}", file=sys.stderr, flush=True)
    return found


def report(rows: Sequence[Row], *, as_json: bool) -> int:
    """Print the rows and return the exit code: 0 only where every bar holds."""
    if as_json:
        print(json.dumps([vars(row) for row in rows]))
    else:
        width = max(len(row.what) for row in rows)
        for row in rows:
            verdict = f"bar {row.bar:<12} {'holds' if row.holds else 'MISSED'}" if row.bar else "no bar"
            print(f"{row.what:<{width}} {_number(row.value):>11} {row.unit:<4}  {verdict}")
    return 0 if all(row.holds for row in rows) else 1


def _number(value: float) -> str:
    """Four decimals, or four digits of small numbers."""
    return f"{value:.4g}" if abs(value) < 10 else f"{value:.4f}"


def median_seconds(work: Callable[[], object], runs: int, warm_up: int = 1) -> float:
    """Median wall time of a call after warm-up calls, s."""
    for _ in range(warm_up):
        work()
    times = []
    for _ in range(runs):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)
