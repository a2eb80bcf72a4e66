"""Measure the time of one gradient of one demonstration's likelihood, on maps of a thousand to a million cells.

python benchmarks/scale.py [--quick] [--json] [--plot FILE]. Three series: an open hall at c0 = -54 /m (as in the study)
and at c0 = -25 /m (near an infinite partition function), and an office floor at -54 /m. Every line is measured in its
own process. The peak memory includes the interpreter and the scene: lattice, shortest paths, nominal cells. The time to
build the scene has its own column. Time is the median of a few gradients after a first one. The bar on growth compares
each size of a series with each smaller one: t / (n ln n) may be at most twice as large. Everything runs on one thread.
--quick stops at 1e5 cells. --plot draws the series with a line of n ln n.
"""

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import combinations
from math import log, log10
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded, and for the processes begun here

from rows import Row, median_seconds, report
from scenes import PUBLISHED, office, open_hall, shown

from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import policy_of, value_and_gradient
from navirl_cli.irl.reward import Reward

SIZES = (1_000, 3_162, 10_000, 31_623, 100_000, 316_228, 1_000_000)
#: Smaller than this a floor has no rooms.
SMALLEST_OFFICE, LARGEST_QUICK = 10_000, 100_000
STUDY_C0, LOW_C0 = PUBLISHED.theta[0], -25.0
#: Largest growth of t / (n ln n).
FACTOR = 2.0
#: Approximate time of measurement for each size, s.
PATIENCE_S = 5.0


@dataclass(frozen=True)
class Series:
    """Maps of one type at one cost of path length c0."""

    kind: str
    c0: float

    @property
    def label(self) -> str:
        """Type and cost."""
        return f"{self.kind}, c0 {self.c0:.0f} /m"


@dataclass(frozen=True)
class Measured:
    """One map."""

    label: str
    cells: int
    #: Building the scene, the first gradient, and the median of the others.
    scene_s: float
    first_s: float
    gradient_s: float
    peak_mb: float
    sweeps: int

    @property
    def ns_per_n_log_n(self) -> float:
        """t / (n ln n), ns."""
        return 1e9 * self.gradient_s / (self.cells * log(self.cells))


SERIES = (Series("open hall", STUDY_C0), Series("open hall", LOW_C0), Series("office", STUDY_C0))


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="up to 1e5 cells")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw time over cells: .pdf, .png or .svg")
    options = parser.parse_args()
    largest = LARGEST_QUICK if options.quick else SIZES[-1]
    found = [
        measured_apart(series, cells)
        for series in SERIES
        for cells in SIZES
        if cells <= largest and (series.kind != "office" or cells >= SMALLEST_OFFICE)
    ]
    if not options.json:
        print_table(found)
    if options.plot:
        plot(found, options.plot)
    rows = [row for series in SERIES for row in bars([one for one in found if one.label == series.label])]
    if options.json:
        print(json.dumps({"sizes": [asdict(one) for one in found], "bars": [vars(row) for row in rows]}))
        return 0 if all(row.holds for row in rows) else 1
    return report(rows, as_json=False)


def measured_apart(series: Series, cells: int) -> Measured:
    """Measure in a fresh process, so that its peak memory is that of this size."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measure, series, cells).result()


def measure(series: Series, cells: int) -> Measured:
    """Build a scene and take gradients along its shortest path that keeps nearest to the straight line."""
    import resource

    one = shown(open_hall(cells) if series.kind == "open hall" else office(cells))
    reward = Reward((series.c0, *PUBLISHED.theta[1:]))
    begun = time.perf_counter()
    evidence = evidence_of([one])
    scene = evidence.scenes[0].scene
    reward.on(scene)  # computes shortest paths and distances, which the scene keeps
    scene_s = time.perf_counter() - begun
    first_s = median_seconds(lambda: value_and_gradient(evidence, reward), 1, warm_up=0)
    runs = min(max(int(PATIENCE_S / first_s), 1), 15)
    gradient_s = median_seconds(lambda: value_and_gradient(evidence, reward), runs, warm_up=0)
    unit = 1 if sys.platform == "darwin" else 1024
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6
    sweeps = policy_of(reward, scene).sweeps
    return Measured(series.label, scene.lattice.size, scene_s, first_s, gradient_s, peak_mb, sweeps)


def bars(series: Sequence[Measured]) -> list[Row]:
    """Rows of one series: growth, and the largest map's time and memory where they have bars."""
    last = series[-1]
    growth, small, large = max(
        (large.ns_per_n_log_n / small.ns_per_n_log_n, small.cells, large.cells)
        for small, large in combinations(series, 2)
    )
    rows = [Row.at_most(f"{last.label}: growth / n ln n, largest from {small} to {large}", growth, "", FACTOR)]
    if last.label.startswith("office") or last.cells < LARGEST_QUICK * 2:
        return rows
    limit_s = 8.0 if last.label == SERIES[0].label else 30.0
    rows.append(Row.at_most(f"{last.label}: gradient on {last.cells} cells", last.gradient_s, "s", limit_s))
    if last.label == SERIES[0].label:
        rows.append(Row.at_most(f"{last.label}: peak memory", last.peak_mb, "MB", 2000))
    return rows


def print_table(found: Sequence[Measured]) -> None:
    """Print one line for each map."""
    width = max(len(one.label) for one in found)
    print(f"{'map':<{width}} {'cells':>8} {'scene s':>8} {'first s':>8} {'gradient s':>10}", end=" ")
    print(f"{'t/(n ln n) ns':>14} {'peak MB':>8} {'sweeps':>7}")
    for one in found:
        print(f"{one.label:<{width}} {one.cells:>8} {one.scene_s:>8.3f} {one.first_s:>8.3f}", end=" ")
        print(f"{one.gradient_s:>10.4f} {one.ns_per_n_log_n:>14.1f} {one.peak_mb:>8.0f} {one.sweeps:>7}")
    print()


def plot(found: Sequence[Measured], path: Path) -> None:
    """Draw time over cells, one line for each series."""
    import matplotlib.pyplot as plt
    import numpy as np

    from navirl_cli.figures.style import COLUMN_IN, house_style

    colours, marks = ("#0072B2", "#D55E00", "#009E73"), "osD"
    with house_style():
        figure, axes = plt.subplots(figsize=(COLUMN_IN, 2.6), layout="constrained")
        for series, colour, mark in zip(SERIES, colours, marks, strict=True):
            own = [one for one in found if one.label == series.label]
            cells, seconds = np.array([(one.cells, one.gradient_s) for one in own]).T
            name = f"{series.kind}, c0 = \N{MINUS SIGN}{-series.c0:.0f} /m"
            axes.loglog(cells, seconds, color=colour, marker=mark, markersize=3, linewidth=1, label=name)
        first = found[0]
        cells = np.geomspace(first.cells, max(one.cells for one in found), 50)
        reference = cells * np.log(cells) * np.median([one.ns_per_n_log_n for one in found]) * 1e-9
        axes.loglog(cells, reference, color="#7A7A7A", linestyle="--", linewidth=0.8, label="n ln n", zorder=1)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(lambda value, _: power_of_ten(value))
        axes.set_xlabel("free cells n")
        axes.set_ylabel("time of one gradient (s)")
        axes.grid(visible=True, which="major", color="#E6E6E6", linewidth=0.5)
        axes.legend(loc="lower right")
        figure.savefig(path)
        plt.close(figure)


def power_of_ten(value: float) -> str:
    """A power of ten as text."""
    return "10" + str(round(log10(value))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


if __name__ == "__main__":
    sys.exit(main())
