"""Uncertainty of a fit by fits to participants drawn with replacement (Efron and Tibshirani 1993, Sec. 13.3)."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.irl.status import Status
from navirl_cli.parallel import map_in_order

#: Replicates that one process computes between two reports of progress.
BATCH = 5
#: With fewer participants, every replicate looks for other maxima.
SCANNED = 10


@dataclass(frozen=True, eq=False)
class Bootstrap(ByContent):
    """Fits of the same number of participants, drawn with replacement."""

    #: (replicates, k) parameters of the replicates that gave a fit; NaN where the drawn participants do not identify a
    #: parameter.
    theta: FloatArray
    #: Number of replicates without a fit, and of those whose search did not reach a maximum (their last values count).
    failed: int
    stopped_early: int
    seed: int
    #: (k,) the fit's parameters.
    estimate: FloatArray
    #: (participants, k) fits without one participant each, for the acceleration; NaN where there is none.
    without_one: FloatArray

    @property
    def identified_draws(self) -> IntArray:
        """(k,) number of replicates that identify each parameter."""
        return np.asarray(np.isfinite(self.theta).sum(axis=0))

    @property
    def accelerated(self) -> NDArray[np.bool_]:
        """(k,) whether every fit without one participant identifies the parameter: its acceleration is known."""
        return np.asarray(np.isfinite(self.without_one).all(axis=0))

    @property
    def standard_errors(self) -> FloatArray:
        """(k,) standard deviations over the replicates that identify the parameter; NaN where fewer than two do."""
        columns = [column[np.isfinite(column)] for column in self.theta.T]
        return np.array([column.std(ddof=1) if len(column) > 1 else np.nan for column in columns])

    def interval(self, level: float = 0.95) -> FloatArray:
        """(2, k) BCa interval over the replicates that identify the parameter; NaN where fewer than two do.

        Percentiles, corrected for the bias and the acceleration of the estimate (Efron 1987, J. Am. Stat. Assoc.
        82:171).
        """
        columns = [column[np.isfinite(column)] for column in self.theta.T]
        found = [
            np.percentile(column, _shares(column, value, _acceleration(own), level))
            if len(column) > 1
            else [np.nan] * 2
            for column, value, own in zip(columns, self.estimate, self.without_one.T, strict=True)
        ]
        return np.array(found).T


def _shares(column: FloatArray, estimate: float, acceleration: float, level: float) -> FloatArray:
    """(2,) percentages of the replicates below the ends of a BCa interval."""
    normal = NormalDist()
    below = float(np.mean(column < estimate) + np.mean(column == estimate) / 2)
    shift = normal.inv_cdf(min(max(below, 0.5 / len(column)), 1 - 0.5 / len(column)))
    ends = []
    for share in (0.5 - level / 2, 0.5 + level / 2):
        moved = shift + normal.inv_cdf(share)
        # A denominator at or below zero is beyond every replicate.
        tilt = 1 - acceleration * moved
        ends.append(100 * normal.cdf(shift + moved / tilt) if tilt > 0 else 100.0 * (moved > 0))
    return np.array(ends)


def _acceleration(without_one: FloatArray) -> float:
    """Skewness of the estimate by the fits without one participant each; 0 where one of them is missing."""
    away = without_one.mean() - without_one
    size = float((away**2).sum())
    if not np.isfinite(size) or size == 0:
        return 0.0
    return float((away**3).sum() / (6 * size**1.5))


def bootstrap(
    evidence: Evidence,
    found: Fit,
    count: int,
    seed: int,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, str], None] | None = None,
) -> Bootstrap:
    """Fit again to participants drawn with replacement; all demonstrations of a participant are drawn together.

    Args:
        evidence: The demonstrated steps of the fit.
        found: The fit. Every replicate starts there and has the same prior and regulariser.
        count: Number of replicates.
        seed: Seed of the draws.
        executor: Where to compute; by default local processes.
        progress: Called with the number of replicates done.

    Returns:
        The replicates.

    Raises:
        DemonstrationError: There is one participant only, or fewer than two replicates gave a fit.
    """
    names = evidence.several_people("bootstrap")
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), size=count)
    member = np.array([[name == participant for participant in evidence.participants] for name in names], dtype=int)
    batches = np.array_split(drawn @ member, max(1, -(-count // BATCH)))
    results: list[Fit | None] = []
    # few draws differ much from all together: their maximum may be another one
    refit = partial(_refit, evidence, found, len(names) < SCANNED)
    for batch in map_in_order(refit, batches, executor):
        results.extend(batch)
        if progress is not None:
            progress(len(results), "")
    alone = [
        result for batch in map_in_order(refit, np.array_split(1 - member, len(member)), executor) for result in batch
    ]
    fits = [result for result in results if result is not None]
    if len(fits) < 2:
        raise DemonstrationError(
            f"`bootstrap`: fewer than two of {count} draws of participants gave a fit; add demonstrations"
        )
    return Bootstrap(
        theta=np.array([_theta(again, len(found.reward.theta)) for again in fits]),
        failed=count - len(fits),
        stopped_early=sum(again.status in {Status.STOPPED_EARLY, Status.INFINITE} for again in fits),
        seed=seed,
        estimate=np.array(found.reward.theta),
        without_one=np.array([_theta(again, len(found.reward.theta)) for again in alone]),
    )


def _theta(again: Fit | None, count: int) -> FloatArray:
    """(count,) parameters of a fit, NaN where they are not identified."""
    if again is None:
        return np.full(count, np.nan)
    return np.where(again.identified, again.reward.theta, np.nan)


def _refit(evidence: Evidence, found: Fit, scan: bool, batch: IntArray) -> list[Fit | None]:
    """Fits for rows of counts by demonstration, with a search for other maxima or without."""
    results: list[Fit | None] = []
    for counts in batch:
        try:
            again = fit(
                evidence.repeated(counts),
                found.reward,
                found.l2,
                prior=found.prior,
                method=found.method,
                scan=scan,
            )
        except (InfinitePartitionError, DemonstrationError):
            results.append(None)
        else:
            results.append(again)
    return results
