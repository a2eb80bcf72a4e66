"""Recover known parameters from simulated demonstrations.

python benchmarks/recovery.py [--quick] [--json]. Each row ends with its bar; exit 0 only where every bar holds.

First from cells: 600 data sets of 26 paths, sampled from the policy of the study's published parameters. The 95 %
intervals must cover the truth in 90 to 98 % of the data sets. The bias of the fit must be below 0.2 standard errors
(from the expected information at the truth). Two more rows compare it with theory: the first-order bias of maximum
likelihood, and the bias that remains when each fit is corrected by its own first-order bias (--correct-bias).

Then the printed intervals (covered.py): 200 data sets each of 2, 6 and 26 demonstrations, of people alike and of people
who differ by 20 %. Intervals that do not call themselves approximate must cover 92 to 98 %.

Then from driven lines (driven.py), rasterised by every rule: the bias that each rule adds, and the rule that should be
the default. --quick takes 20 and 4 data sets, and widens the bars by two Monte Carlo errors.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded: the processes are many enough

import numpy as np

ROOT = Path(__file__).parent.parent
sys.path.append(str(ROOT / "tests"))
import covered  # noqa: E402
import factories as make  # noqa: E402 scenes and demonstrations made to measure
from driven import RULES, Refits, World, best_rule, overall, refits, resampled  # noqa: E402
from rows import Row, report  # noqa: E402
from scenes import PUBLISHED, hallway  # noqa: E402

from navirl_cli.demos.extract import ExtractSettings  # noqa: E402
from navirl_cli.demos.grid import FloatArray  # noqa: E402
from navirl_cli.irl.bias import corrected, first_order_bias  # noqa: E402
from navirl_cli.irl.evidence import evidence_of  # noqa: E402
from navirl_cli.irl.fit import PAPER_L2, fit  # noqa: E402
from navirl_cli.irl.likelihood import likelihood  # noqa: E402
from navirl_cli.irl.reward import Reward  # noqa: E402
from navirl_cli.irl.scene import Scene  # noqa: E402
from navirl_cli.parallel import map_in_order  # noqa: E402

SEED = 2020
DEMONSTRATIONS = 26
#: With 200 data sets the covered share has a Monte Carlo error of 1.5 points, so valid intervals sometimes miss the
#: bar.
DATA_SETS, QUICK_DATA_SETS = 600, 20
INTERVAL_SETS, QUICK_INTERVAL_SETS = 200, 4
#: 95 % of a normal distribution lie within so many standard errors.
WITHIN = 1.959964
COVERAGE, MOST_BIAS = (0.90, 0.98), 0.2
#: A robot at 0.4 m/s with a delay of 0.3 s turns about as the study's poses do over 0.1 to 0.4 m.
WORLDS = (
    (World("grid off by part of a cell", 0.12, 0.01, shifted=True), 40),
    (World("grid as drawn", 0.12, 0.01, shifted=False), 24),
    (World("off, poses without noise", 0.12, 0.0, shifted=True), 24),
    (World("off, rounder lines", 0.25, 0.01, shifted=True), 24),
    (World("off, sharper lines", 0.06, 0.01, shifted=True), 24),
)


@cache
def passing_scene() -> Scene:
    """The passing task in a hallway of the study's size: the person stands on the middle of the nominal path."""
    grid = hallway().lattice.grid
    return Scene.on(grid, np.array([18, 26]), np.array([81, 26]), grid.centres_of(np.array([[50, 26]])))


@dataclass(frozen=True)
class Recovered:
    """One data set's fit."""

    #: (k,) parameters and their reported standard errors, without a regulariser.
    theta: FloatArray
    errors: FloatArray
    #: (k,) parameters of the corrected fit.
    corrected: FloatArray
    #: (k,) parameters with the default regulariser.
    regularised: FloatArray


def recovered(number: int) -> Recovered:
    """Draw a data set and fit it."""
    scene = passing_scene()
    evidence = evidence_of(make.drawn(scene, PUBLISHED, DEMONSTRATIONS, SEED + number))
    plain = fit(evidence, Reward.named({}), l2=0.0)
    held = fit(evidence, plain.reward, l2=PAPER_L2, scan=False)
    theta = np.array(plain.reward.theta)
    return Recovered(
        theta, plain.standard_errors, np.array(corrected(evidence, plain).reward.theta), np.array(held.reward.theta)
    )


def theory() -> tuple[FloatArray, FloatArray]:
    """(k,) standard errors and (k,) first-order bias of a fit to 26 demonstrations at the truth."""
    evidence = evidence_of(make.drawn(passing_scene(), PUBLISHED, DEMONSTRATIONS, SEED))
    information = likelihood(evidence, PUBLISHED).information
    everything = np.ones(len(information), dtype=bool)
    return np.sqrt(np.diag(np.linalg.inv(information))), first_order_bias(evidence, PUBLISHED, everything)


def coverage(fits: Sequence[Recovered]) -> FloatArray:
    """(k,) share of the fits whose 95 % interval covers the truth."""
    inside = [np.abs(one.theta - PUBLISHED.theta) <= WITHIN * one.errors for one in fits]
    share: FloatArray = np.mean(inside, axis=0)
    return share


def bias(theta: Sequence[FloatArray], errors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k,) mean distance of parameters from the truth in standard errors, and its Monte Carlo error."""
    away = (np.array(theta) - PUBLISHED.theta) / errors
    return away.mean(axis=0), away.std(axis=0, ddof=1) / np.sqrt(len(away))


def cell_rows(count: int, *, quick: bool) -> list[Row]:
    """Coverage and bias of fits to cells."""
    fits = list(map_in_order(recovered, range(count)))
    errors, expected = theory()
    expected = expected / errors
    rows = []
    names = [parameter.name for parameter in PUBLISHED.parameters]
    slack = 2 * np.sqrt(0.05 * 0.95 / count) if quick else 0.0
    low, high = 100 * (COVERAGE[0] - slack), 100 * min(1.0, COVERAGE[1] + slack)
    for name, share in zip(names, 100 * coverage(fits), strict=True):
        bar = f"{low:.3g} to {high:.3g} %"
        rows.append(Row(f"{name}: coverage of 95 % intervals", float(share), "%", bar, bool(low <= share <= high)))
    kinds = {
        "bias": [one.theta for one in fits],
        "bias with --l2 at its default": [one.regularised for one in fits],
        "bias after first-order correction": [one.corrected for one in fits],
    }
    for kind, theta in kinds.items():
        for name, mean, error in zip(names, *bias(theta, errors), strict=True):
            what = f"{name}: {kind} (Monte Carlo error {error:.2f})"
            most = MOST_BIAS + (2 * error if quick else 0.0)
            held = kind != "bias with --l2 at its default"
            rows.append(Row(what, mean, "s.e.", f"< {most:.2g}" if held else "", bool(abs(mean) < most) or not held))
    rows += [Row(f"{name}: first-order bias by theory", x, "s.e.") for name, x in zip(names, expected, strict=True)]
    return rows


def line_rows(*, quick: bool) -> list[Row]:
    """The bias that every rule adds, and whether the default is the least biased rule."""
    rows, worlds = [], []
    for world, count in WORLDS[:1] if quick else WORLDS:
        several = range(count // 10 if quick else count)
        done = list(map_in_order(partial(_refits, world=world), several))
        worlds.append(np.array([(one.by_rule - one.theta) / one.errors for one in done]))
        rows += _world_rows(world, done, worlds[-1])
    sizes, spread = overall(worlds), resampled(worlds).std(axis=0)
    for rule, size, error in zip(RULES, sizes, spread, strict=True):
        rows.append(Row(f"all worlds, {rule}: overall bias (Monte Carlo error {error:.2f})", float(size), "s.e."))
    best, default = best_rule(worlds), ExtractSettings().rasterizer
    what = f"bias of the default ({default}) minus the least bias"
    excess = float(sizes[RULES.index(default)] - sizes.min())
    # A few data sets in one world are not enough to decide.
    rows.append(Row(what, excess, "s.e.", "" if quick else f"is {best}", quick or best == default))
    return rows


def _refits(number: int, world: World) -> Refits:
    return refits(passing_scene(), PUBLISHED, DEMONSTRATIONS, (SEED, number), world)


def _world_rows(world: World, done: Sequence[Refits], away: FloatArray) -> list[Row]:
    """Rows of one driving model: away are (n, rules, k) differences in standard errors."""
    rows = []
    spread = resampled([away]).std(axis=0)
    for i, rule in enumerate(RULES):
        head = f"{world.name}, {rule}"
        for j, parameter in enumerate(PUBLISHED.parameters):
            error = away[:, i, j].std(ddof=1) / np.sqrt(len(away))
            what = f"{head}: bias of {parameter.name} (Monte Carlo error {error:.2f})"
            rows.append(Row(what, float(away[:, i, j].mean()), "s.e."))
        what = f"{head}: overall bias (Monte Carlo error {spread[i]:.2f})"
        rows.append(Row(what, float(overall([away])[i]), "s.e."))
        rows.append(Row(f"{head}: share of cells as drawn", float(np.mean([one.shared[i] for one in done])), ""))
        rows.append(Row(f"{head}: diagonal steps per path", float(np.mean([one.diagonal[i] for one in done])), ""))
    drawn = float(np.mean([one.drawn_diagonal for one in done]))
    return [*rows, Row(f"{world.name}, as drawn: diagonal steps per path", drawn, "")]


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few data sets, with wider bars")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    parser.add_argument("--part", choices=("cells", "intervals", "lines"), help="only one of the three")
    options = parser.parse_args()
    rows = []
    if options.part in {None, "cells"}:
        rows += cell_rows(QUICK_DATA_SETS if options.quick else DATA_SETS, quick=options.quick)
    if options.part in {None, "intervals"}:
        rows += covered.rows(QUICK_INTERVAL_SETS if options.quick else INTERVAL_SETS)
    if options.part in {None, "lines"}:
        rows += line_rows(quick=options.quick)
    return report(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
