"""Two groups of paths compared within participants: difference, intervals, test and effect sizes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.errors import DemonstrationError, unknown
from navirl_cli.evaluation.compare import DRIVEN
from navirl_cli.evaluation.groups import LEVEL, Measured, by_participant, mean_and_spread, student_half_width
from navirl_cli.evaluation.metrics import Metric

RESAMPLES = 9999
#: Fewer pairs have no bootstrap interval: their resampled means take only a handful of values.
FEWEST = 4


class Interval(NamedTuple):
    """A 95 % interval; NaN where it does not exist."""

    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class Paired(ByContent):
    """One group's values minus another's, over the participants who have both.

    scipy.stats takes half a second to import, as long as the work of most commands. Bootstrap and Wilcoxon's test
    import it when they are asked for; Student's interval does not need it.
    """

    #: By participant.
    differences: Mapping[str, float]
    #: Bootstrap interval of the mean (bias-corrected and accelerated); NaN below FEWEST pairs, None where it was not
    #: asked for.
    bootstrap: Interval | None = None

    @property
    def n(self) -> int:
        """Number of pairs."""
        return len(self.differences)

    @property
    def mean(self) -> float:
        """Mean difference; NaN for no pair."""
        return mean_and_spread(self.differences.values())[0]

    @property
    def student(self) -> Interval:
        """Student's interval of the mean; NaN for fewer than two pairs."""
        half = student_half_width(self.differences.values())
        return Interval(self.mean - half, self.mean + half)

    @property
    def cohen_dz(self) -> float:
        """Cohen's d_z: mean over standard deviation of the differences; NaN for one pair and for equal differences."""
        mean, std = mean_and_spread(self.differences.values())
        return mean / std if std > 0 else float("nan")

    @cached_property
    def wilcoxon_p(self) -> float:
        """Two-sided p-value of Wilcoxon's signed-rank test of the pairs that differ; NaN if none differs.

        Exact for up to 50 pairs without ties.
        """
        from scipy.stats import wilcoxon

        return float(wilcoxon(self._differing).pvalue) if len(self._differing) else float("nan")

    @cached_property
    def rank_biserial(self) -> float:
        """Matched-pairs rank-biserial correlation in [-1, 1]: share of the ranks of positive minus negative pairs."""
        from scipy.stats import rankdata

        if len(self._differing) == 0:
            return float("nan")
        ranks = rankdata(np.abs(self._differing))
        return float((ranks * np.sign(self._differing)).sum() / ranks.sum())

    @property
    def _differing(self) -> FloatArray:
        """The differences that are not zero."""
        values: FloatArray = np.array([value for value in self.differences.values() if value != 0])
        return values


def paired(one: Mapping[str, float], other: Mapping[str, float], rng: np.random.Generator | None = None) -> Paired:
    """Compare two groups by participant.

    Args:
        one: A value by participant.
        other: The same in the other group.
        rng: Source of randomness of the bootstrap; None to leave the bootstrap out.

    Returns:
        one minus other; participants without a finite value in both do not count.
    """
    both = {
        name: float(one[name] - other[name])
        for name in one
        if name in other and np.isfinite(one[name]) and np.isfinite(other[name])
    }
    return Paired(both, None if rng is None else _bootstrap(np.array(list(both.values())), rng))


def pairs_of(
    rows: Iterable[Measured], one: str, other: str, metrics: Sequence[Metric], rng: np.random.Generator
) -> dict[str, Paired]:
    """Compare the driven paths of two groups, each participant counting with the mean over their own in a group.

    Args:
        rows: What was measured.
        one: Name of a group.
        other: Name of another.
        metrics: To compare.
        rng: Source of randomness.

    Returns:
        By metric: one minus other. Metrics of which no participant has values in both groups are not in it.

    Raises:
        DemonstrationError: A group does not exist.
    """
    groups: dict[str, list[Measured]] = {}
    for row in rows:
        groups.setdefault(row.group, []).append(row)
    for name in (one, other):
        if name not in groups:
            raise DemonstrationError(unknown("`pair`", name, groups))
    found = {
        metric.name: paired(
            by_participant(groups[one], DRIVEN, metric.name), by_participant(groups[other], DRIVEN, metric.name), rng
        )
        for metric in metrics
    }
    return {name: result for name, result in found.items() if result.n}


def _bootstrap(values: FloatArray, rng: np.random.Generator) -> Interval:
    """Bootstrap interval of a mean (B. Efron, JASA 82 (1987): bias-corrected and accelerated)."""
    if len(values) < FEWEST:
        return Interval(float("nan"), float("nan"))
    if np.ptp(values) == 0:
        return Interval(float(values[0]), float(values[0]))
    from scipy.stats import bootstrap

    found = bootstrap(
        (values,), np.mean, n_resamples=RESAMPLES, confidence_level=LEVEL, method="BCa", rng=rng, vectorized=True
    ).confidence_interval
    return Interval(float(found.low), float(found.high))
