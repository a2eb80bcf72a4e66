"""Uncertainty of a fit by fits to participants drawn with replacement (Efron and Tibshirani 1993, Sec. 13.3)."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.irl.status import Status
from navirl_cli.parallel import map_in_order

#: Replicates that one process computes between two reports of progress.
BATCH = 5


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

    @property
    def identified_draws(self) -> IntArray:
        """(k,) number of replicates that identify each parameter."""
        return np.asarray(np.isfinite(self.theta).sum(axis=0))

    @property
    def standard_errors(self) -> FloatArray:
        """(k,) standard deviations over the replicates that identify the parameter; NaN where fewer than two do."""
        columns = [column[np.isfinite(column)] for column in self.theta.T]
        return np.array([column.std(ddof=1) if len(column) > 1 else np.nan for column in columns])

    def interval(self, level: float = 0.95) -> FloatArray:
        """(2, k) percentile interval over the replicates that identify the parameter; NaN where fewer than two do."""
        ends = 50 * (1 - level), 50 * (1 + level)
        columns = [column[np.isfinite(column)] for column in self.theta.T]
        return np.array([np.percentile(c, ends) if len(c) > 1 else (np.nan, np.nan) for c in columns]).T


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
    for batch in map_in_order(partial(_refit, evidence, found), batches, executor):
        results.extend(batch)
        if progress is not None:
            progress(len(results), "")
    fits = [result for result in results if result is not None]
    if len(fits) < 2:
        raise DemonstrationError(
            f"`bootstrap`: fewer than two of {count} draws of participants gave a fit; add demonstrations"
        )
    return Bootstrap(
        theta=np.array([np.where(again.identified, again.reward.theta, np.nan) for again in fits]),
        failed=count - len(fits),
        stopped_early=sum(again.status in {Status.STOPPED_EARLY, Status.INFINITE} for again in fits),
        seed=seed,
    )


def _refit(evidence: Evidence, found: Fit, batch: IntArray) -> list[Fit | None]:
    """Fits for rows of counts by demonstration."""
    results: list[Fit | None] = []
    for counts in batch:
        try:
            again = fit(
                evidence.repeated(counts),
                found.reward,
                found.l2,
                prior=found.prior,
                method=found.method,
                scan=False,
            )
        except (InfinitePartitionError, DemonstrationError):
            results.append(None)
        else:
            results.append(again)
    return results
