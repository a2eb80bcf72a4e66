"""Two groups of paths compared within participants: difference, interval, test and effect size."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.groups import Driven, by_participant
from navirl_cli.evaluation.metrics import Metric

LEVEL = 0.95
RESAMPLES = 9999
#: Fewer pairs have no interval of resampled means: all that they can say are a handful of values.
FEWEST = 4


@dataclass(frozen=True)
class Paired:
    """One group's values less another's, over the participants who have both."""

    #: By participant.
    differences: Mapping[str, float]
    mean: float
    #: 95 % bootstrap interval of the mean (bias-corrected and accelerated); NaN below FEWEST pairs.
    lower: float
    upper: float
    #: Two-sided p-value of Wilcoxon's signed-rank test, exact for few pairs without ties; NaN where none differs.
    p_value: float
    #: Cohen's d_z: mean over standard deviation of the differences; NaN for one pair or none that differs.
    cohen_dz: float
    #: Matched-pairs rank-biserial correlation in [-1, 1]: favourable less unfavourable share of the ranks.
    rank_biserial: float

    @property
    def n(self) -> int:
        """Number of pairs."""
        return len(self.differences)


def paired(one: Mapping[str, float], other: Mapping[str, float], rng: np.random.Generator) -> Paired:
    """Compare two groups by participant.

    Args:
        one: A value by participant.
        other: The same in the other group.
        rng: Source of randomness of the bootstrap.

    Returns:
        one less other; participants without a finite value in both do not count.
    """
    both = {
        name: float(one[name] - other[name])
        for name in one
        if name in other and np.isfinite(one[name]) and np.isfinite(other[name])
    }
    values = np.array(list(both.values()))
    mean = float(values.mean()) if len(values) else float("nan")
    spread = float(values.std(ddof=1)) if len(values) > 1 else float("nan")
    lower, upper = _interval(values, rng)
    p_value, biserial = _signed_ranks(values)
    dz = mean / spread if spread > 0 else float("nan")
    return Paired(both, mean, lower, upper, p_value, dz, biserial)


def pairs_of(
    rows: Sequence[Driven], one: str, other: str, metrics: Sequence[Metric], rng: np.random.Generator
) -> dict[str, Paired]:
    """Compare two groups; a participant counts with the mean over their demonstrations of a group.

    Args:
        rows: What was measured.
        one: Name of a group.
        other: Name of another.
        metrics: To compare.
        rng: Source of randomness.

    Returns:
        By metric: one less other. Metrics of which no participant has values in both groups are not in it.

    Raises:
        DemonstrationError: A group does not exist.
    """
    known = list(dict.fromkeys(row.group for row in rows))
    for name in (one, other):
        if name not in known:
            raise DemonstrationError(f"--pair: no group is called {name!r}; there are {', '.join(map(repr, known))}")
    found = {
        metric.name: paired(by_participant(rows, one, metric.name), by_participant(rows, other, metric.name), rng)
        for metric in metrics
        if any(metric.name in row.values for row in rows)
    }
    return {name: result for name, result in found.items() if result.n}


def _interval(values: FloatArray, rng: np.random.Generator) -> tuple[float, float]:
    """Bootstrap interval of a mean."""
    if len(values) < FEWEST:
        return float("nan"), float("nan")
    if np.ptp(values) == 0:
        return float(values[0]), float(values[0])
    from scipy.stats import bootstrap

    found = bootstrap(
        (values,), np.mean, n_resamples=RESAMPLES, confidence_level=LEVEL, method="BCa", rng=rng, vectorized=True
    ).confidence_interval
    return float(found.low), float(found.high)


def _signed_ranks(values: FloatArray) -> tuple[float, float]:
    """p-value and rank-biserial correlation; pairs that do not differ are left out (Wilcoxon's way)."""
    from scipy.stats import rankdata, wilcoxon

    differing = values[values != 0]
    if len(differing) == 0:
        return float("nan"), float("nan")
    ranks = rankdata(np.abs(differing))
    biserial = float((ranks * np.sign(differing)).sum() / ranks.sum())
    return float(wilcoxon(differing).pvalue), biserial
