"""Driven paths of two groups compared by participant, metric by metric."""

from collections.abc import Sequence

import numpy as np

from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.compare import Driven
from navirl_cli.evaluation.metrics import Metric
from navirl_cli.evaluation.paired import Paired, paired


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
        metric.name: paired(_by_participant(rows, one, metric.name), _by_participant(rows, other, metric.name), rng)
        for metric in metrics
        if any(metric.name in row.values for row in rows)
    }
    return {name: result for name, result in found.items() if result.n}


def _by_participant(rows: Sequence[Driven], group: str, name: str) -> dict[str, float]:
    """Mean of a metric over each participant's finite values."""
    values: dict[str, list[float]] = {}
    for row in rows:
        if row.group == group and np.isfinite(row.values.get(name, np.nan)):
            values.setdefault(row.participant, []).append(row.values[name])
    return {participant: float(np.mean(own)) for participant, own in values.items()}
