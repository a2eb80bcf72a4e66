"""Two groups of paths compared within participants: difference, intervals, test and effect sizes."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import DemonstrationError, unknown
from navirl_cli.evaluation.compare import DRIVEN, Comparison, learnt_type, name_in
from navirl_cli.evaluation.groups import LEVEL, Measured, by_group, by_participant, mean_and_spread, student_half_width
from navirl_cli.evaluation.metric import Metric

RESAMPLES = 9999
#: Fewer pairs have no bootstrap interval: their resampled means take only a handful of values.
FEWEST = 4
#: Fewer pairs that differ are no test: by whatever sign of one difference, its p-value is 1.
TESTED = 2


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
    #: wilcoxon_p corrected for all tests of the same table of results; None for one test alone, NaN without a test.
    holm_p: float | None = None

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
        """Two-sided p-value of Wilcoxon's signed-rank test of the pairs that differ; NaN if fewer than two differ.

        Exact for up to 50 pairs without ties.
        """
        if len(self._differing) < TESTED:
            return float("nan")
        from scipy.stats import wilcoxon

        return float(wilcoxon(self._differing).pvalue)

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
    return _of_paths((groups[one], DRIVEN), (groups[other], DRIVEN), metrics, rng)


def _of_paths(
    one: tuple[Sequence[Measured], str],
    other: tuple[Sequence[Measured], str],
    metrics: Sequence[Metric],
    rng: np.random.Generator,
) -> dict[str, Paired]:
    """Compare rows' paths of one type with others, by metric."""
    found = {
        metric.name: paired(by_participant(*one, metric.name), by_participant(*other, metric.name), rng)
        for metric in metrics
    }
    return {name: result for name, result in found.items() if result.n}


def pairs_of_all(
    result: Comparison,
    asked: Sequence[tuple[str, str]],
    files: Mapping[str, Sequence[Demonstration]],
    rewards: Collection[str],
    metrics: Sequence[Metric],
    fields: Collection[str],
    rng: np.random.Generator,
) -> list[tuple[str, str, dict[str, Paired]]]:
    """All comparisons: those asked for; of several files, the same groups; of several rewards, their learnt paths.

    Args:
        result: What was measured.
        asked: Names of groups.
        files: Demonstrations by the name of their file.
        rewards: Their names.
        metrics: To compare.
        fields: That groups are by.
        rng: Source of randomness.

    Returns:
        One, other, and by metric one minus other, with p-values corrected for the number of all tests.

    Raises:
        DemonstrationError: A group does not exist.
    """
    found = [(one, other, pairs_of(result.rows, one, other, metrics, rng)) for one, other in asked]
    first, *later = files
    for name in later:
        both = [group for group in by_group(files[first], fields) if group in by_group(files[name], fields)]
        named = [(name_in(files, name, group), name_in(files, first, group)) for group in both]
        same = [(*pair, pairs_of(result.rows, *pair, metrics, rng)) for pair in named if pair not in asked]
        found += [pair for pair in same if pair[2]]
    if len(rewards) > 1:
        of_learnt = [metric for metric in metrics if metric.drive is None]
        one, *others = (learnt_type(name, rewards) for name in rewards)
        for group in dict.fromkeys(row.group for row in result.rows):
            rows = [row for row in result.rows if row.group == group]
            for other in others:
                own = _of_paths((rows, other), (rows, one), of_learnt, rng)
                found.append((f"{group}: {other}", one, own))
    return corrected(found)


def corrected(pairs: Sequence[tuple[str, str, dict[str, Paired]]]) -> list[tuple[str, str, dict[str, Paired]]]:
    """The same with p-values by Holm's method over all tests, where there are several.

    A comparison with fewer than TESTED differences is no test and does not count. That depends on the sizes of the
    differences alone, not on their signs, which are what Wilcoxon's test takes as random.
    """
    keys = [(number, name) for number, (_, _, own) in enumerate(pairs) for name in own]
    p_values = np.array([pairs[number][2][name].wilcoxon_p for number, name in keys])
    if np.isfinite(p_values).sum() < 2:
        return list(pairs)
    by_test = dict(zip(keys, holm(p_values), strict=True))
    return [
        (one, other, {name: replace(pair, holm_p=float(by_test[number, name])) for name, pair in own.items()})
        for number, (one, other, own) in enumerate(pairs)
    ]


def holm(p_values: FloatArray) -> FloatArray:
    """(k,) p-values corrected for their number (S. Holm, Scandinavian Journal of Statistics 6 (1979)).

    Args:
        p_values: (k,), NaN where there was no test, which then does not count.
    """
    adjusted = np.full(len(p_values), np.nan)
    known = np.flatnonzero(np.isfinite(p_values))
    order = known[np.argsort(p_values[known], kind="stable")]
    raised = np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1))
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted


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
