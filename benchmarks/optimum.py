"""Compare the maxima that the fit reports with those of an independent optimiser from many random starts.

python benchmarks/optimum.py [--quick] [--json]. 300 random data sets: maps with obstacles, 1 to 20 demonstrations, up
to three people, every third truth with a wide personal space (sigma_p 0.001 to 0.05). Each is fitted by navirl, and by
scipy's L-BFGS-B from 50 random starts on the same objective. A fit that says converged, on bound or not identified must
not be more than 1e-4 nats below the best of the 50. --quick takes 12 data sets and 8 starts.

What a fit holds because the data do not identify it counts in neither objective: the regulariser alone would move it.
"""

import argparse
import os
import sys
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded: the processes are many enough

import numpy as np

sys.path.append(str(Path(__file__).parent.parent / "tests"))
import factories as make
from rows import Row, report

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.evidence import Evidence, evidence_of
from navirl_cli.irl.fit import PAPER_L2, Fit, fit
from navirl_cli.irl.likelihood import value_and_gradient
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.irl.status import Status
from navirl_cli.parallel import map_in_order

SEED = 1400
DATA_SETS, STARTS, QUICK_DATA_SETS, QUICK_STARTS = 300, 50, 12, 8
MOST_NATS = 1e-4
START = Reward.named({})
#: Statuses that claim a maximum.
CLAIMS = (Status.CONVERGED, Status.ON_BOUND, Status.NOT_IDENTIFIED)
#: Stands for an infinite partition function in an optimiser that needs finite numbers.
FAR = 1e6


@dataclass(frozen=True)
class Compared:
    """One data set."""

    status: Status
    evaluations: int
    #: The best of the random starts minus the fit, and the best of all minus a climb from the start alone, nats.
    short: float
    short_of_climb: float
    #: Decay of the fit and of the best random start, 1/m^2.
    sigma: float
    best_sigma: float


def data_set(number: int) -> Evidence:
    """Demonstrations of a random truth on a random map; every third has a wide space."""
    rng = np.random.default_rng((SEED, number))
    while True:
        columns, rows = int(rng.integers(16, 40)), int(rng.integers(10, 24))
        scene = make.random_scene(rng, columns, rows, rng.uniform(0, 0.25), int(rng.integers(1, 4)))
        wide = number % 3 == 0
        sigma = 10 ** (rng.uniform(-3, -1.3) if wide else rng.uniform(-1.3, 1.5))
        truth = (-rng.uniform(25, 70), -rng.exponential(0.7), rng.uniform(-8, 3) * (3 if wide else 1), sigma)
        try:
            return evidence_of(make.drawn(scene, Reward(truth), int(rng.integers(1, 21)), seed=number))
        except InfinitePartitionError:
            continue


def objective(evidence: Evidence, held: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
    """Minus log-likelihood plus the default regulariser, and its gradient.

    Args:
        evidence: The data.
        held: (k,) 1 where the regulariser counts.
        y: (k,) parameters by their scales, the decay by its logarithm.
    """
    units = np.array([p.scale for p in START.parameters])
    theta = units * np.append(y[:-1], np.exp(y[-1]))
    low, high = (np.array([getattr(p, end) for p in START.parameters]) for end in ("lower", "upper"))
    try:
        value, gradient = value_and_gradient(evidence, Reward(tuple(np.clip(theta, low, high).tolist())))
    except InfinitePartitionError:
        return FAR, np.zeros_like(y)
    penalty = PAPER_L2 * held * theta / units
    slope = gradient * units - penalty
    slope[-1] *= np.exp(y[-1])
    return -(value - 0.5 * float(penalty @ (theta / units))), -slope


def best_of(evidence: Evidence, counts: FloatArray, starts: int, seed: int) -> tuple[float, FloatArray]:
    """The highest objective of L-BFGS-B from random starts, and its place."""
    from scipy.optimize import minimize

    rng = np.random.default_rng((SEED, seed, 1))
    bounds = [(p.lower / p.scale, p.upper / p.scale) for p in START.parameters]
    bounds[-1] = (np.log(START.parameters[-1].lower), np.log(START.parameters[-1].upper))
    best, place = -np.inf, np.zeros(len(bounds))
    for _ in range(starts):
        y = np.array([-rng.uniform(3, 8), -rng.exponential(1), rng.uniform(-15, 8), rng.uniform(*bounds[-1])])
        found = minimize(
            partial(objective, evidence, counts), y, jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": 500, "ftol": 1e-13, "gtol": 1e-7},
        )  # fmt: skip
        if -found.fun > best:
            best, place = float(-found.fun), found.x
    return best, place


def compared(number: int, starts: int) -> Compared:
    """The fit of one data set against the independent optimiser."""
    evidence = data_set(number)
    found = fit(evidence, START)
    counts = counted(found)
    best, place = best_of(evidence, counts, starts, number)
    climb = fit(evidence, START, scan=False)
    own, alone = (-objective(evidence, counts, _place(one))[0] for one in (found, climb))
    sigma, best_sigma = found.reward.theta[-1], float(np.exp(place[-1]))
    return Compared(found.status, found.evaluations, best - own, max(best, own) - alone, sigma, best_sigma)


def counted(found: Fit) -> FloatArray:
    """(k,) 0 for parameters that the fit left at their initial values because nothing depends on them."""
    kept = ~found.identified & (np.array(found.reward.theta) == found.initial.theta)
    return np.where(kept, 0.0, 1.0)


def _place(found: Fit) -> FloatArray:
    theta = np.array(found.reward.theta) / [p.scale for p in START.parameters]
    theta[-1] = np.log(theta[-1])
    return theta


def main() -> int:
    """Measure, print, compare with the bars."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few data sets and starts")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    options = parser.parse_args()
    sets, starts = (QUICK_DATA_SETS, QUICK_STARTS) if options.quick else (DATA_SETS, STARTS)
    done = list(map_in_order(partial(compared, starts=starts), range(sets)))
    claimed = [one for one in done if one.status in CLAIMS]
    kinds = Counter(one.status.value for one in done)
    rows = [Row(f"fits that ended with: {status}", count, "") for status, count in sorted(kinds.items())]
    rows += [
        Row("evaluations of a fit, median", float(np.median([one.evaluations for one in done])), ""),
        Row("evaluations of a fit, most", max(one.evaluations for one in done), ""),
        Row("fits better than every random start by 1e-4 nats", sum(one.short < -MOST_NATS for one in done), ""),
        Row("maxima that a climb from the start alone misses", sum(one.short_of_climb > MOST_NATS for one in done), ""),
        Row("the same, by at most", max(one.short_of_climb for one in done), "nats"),
        Row.at_most("fits that claim a maximum and miss it", sum(one.short > MOST_NATS for one in claimed), "", 0),
        Row.at_most("largest shortfall", max(one.short for one in claimed), "nats", MOST_NATS),
    ]
    return report(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
