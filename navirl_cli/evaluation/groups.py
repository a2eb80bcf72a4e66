"""Groups of demonstrations: who belongs to which, and mean and spread over a group or over participants."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from navirl_cli.arrays import ByContent
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.evaluation.metrics import METRICS, Values

#: By what demonstrations can be grouped.
FIELDS: Mapping[str, Callable[[Demonstration], str]] = {
    "condition": lambda one: one.condition.value,
    "cycle": lambda one: "no cycle" if one.cycle is None else f"cycle {one.cycle}",
    "set": lambda one: one.set or "main task",
    "participant": lambda one: one.participant,
}


@dataclass(frozen=True, eq=False)
class GroupMetrics(ByContent):
    """Mean and spread of the paths of one kind in one group of demonstrations."""

    group: str
    kind: str
    #: Number of demonstrations.
    count: int
    mean: Values
    #: Sample standard deviation (n - 1) over demonstrations, or of one path under the policy; NaN for one path.
    std: Values
    #: Of learnt paths: Monte Carlo standard error of the mean.
    error: Values = field(default_factory=dict)
    #: Of learnt paths: exact expected values, where visits give them.
    exact: Values = field(default_factory=dict)
    #: Of other paths: half the 95 % interval of the mean, participants counting with their own means (Student); NaN
    #: for one participant.
    half_interval: Values = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Driven(ByContent):
    """What was measured of one demonstration as driven."""

    id: str
    participant: str
    group: str
    values: Values


def by_group(demonstrations: Iterable[Demonstration], fields: Collection[str] = ()) -> dict[str, list[Demonstration]]:
    """Demonstrations by group: force first, by cycle, then joystick, then autonomous; special sets after the rest."""
    order = list(Condition)
    groups: dict[str, list[Demonstration]] = {}
    for one in sorted(demonstrations, key=lambda one: (order.index(one.condition), one.set or "", one.cycle or 0)):
        groups.setdefault(group_of(one, fields), []).append(one)
    return groups


def group_of(demonstration: Demonstration, fields: Collection[str] = ()) -> str:
    """The group of a demonstration: its condition, its cycle and its set where known, or what fields of FIELDS say.

    A robot that drives by itself is what its set says: "obstacle avoidance".
    """
    if fields:
        return ", ".join(of(demonstration) for name, of in FIELDS.items() if name in fields)
    alone = demonstration.condition is Condition.AUTONOMOUS and demonstration.set is not None
    condition = [] if alone else [demonstration.condition.value]
    cycle = [] if demonstration.cycle is None else [f"cycle {demonstration.cycle}"]
    return ", ".join([*condition, *cycle, *([] if demonstration.set is None else [demonstration.set])])


def summary_of(group: str, kind: str, measured: Iterable[Values]) -> GroupMetrics:
    """Mean and standard deviation over the paths that have a value (distance to people needs people)."""
    mean, spread = {}, {}
    paths = list(measured)
    for metric in METRICS:
        values = np.array([one[metric.name] for one in paths if metric.name in one])
        values = values[np.isfinite(values)]
        if any(metric.name in one for one in paths):
            mean[metric.name] = float(values.mean()) if len(values) else float("nan")
            spread[metric.name] = float(values.std(ddof=1)) if len(values) > 1 else float("nan")
    return GroupMetrics(group, kind, len(paths), mean, spread)


def mean_and_spread(values: Iterable[float]) -> tuple[float, float]:
    """Mean and sample standard deviation of the finite values; NaN where they are too few."""
    known = np.array([value for value in values if np.isfinite(value)])
    mean = float(known.mean()) if len(known) else float("nan")
    return mean, float(known.std(ddof=1)) if len(known) > 1 else float("nan")


def by_participant(rows: Sequence[Driven], group: str, name: str) -> dict[str, float]:
    """Mean of a metric over each participant's finite values."""
    values: dict[str, list[float]] = {}
    for row in rows:
        if row.group == group and np.isfinite(row.values.get(name, np.nan)):
            values.setdefault(row.participant, []).append(row.values[name])
    return {participant: float(np.mean(own)) for participant, own in values.items()}
