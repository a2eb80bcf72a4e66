"""Groups of demonstrations: who belongs to which, and mean and spread over a group or over participants."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.subset import FIELDS
from navirl_cli.errors import DemonstrationError, unknown
from navirl_cli.evaluation.metric import Values

#: Of all intervals.
LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class GroupMetrics(ByContent):
    """Mean and spread of the paths of one type in one group of demonstrations."""

    group: str
    path_type: str
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
    #: Of other paths: number of participants.
    participants: int = 0
    #: By metric and reason: number of demonstrations whose value does not exist.
    missing: Mapping[str, Mapping[str, int]] = field(default_factory=dict)

    def count_of(self, name: str) -> int:
        """Number of demonstrations with a value of a metric."""
        return self.count - sum(self.missing.get(name, {}).values())

    def expected(self, name: str) -> float:
        """Mean of a metric, exact where visits give it; NaN where it does not exist."""
        return self.exact.get(name, self.mean.get(name, float("nan")))

    def monte_carlo_error(self, name: str) -> float:
        """Standard error of :meth:`expected` of paths that were drawn; 0 where it is exact."""
        return 0.0 if name in self.exact else self.error.get(name, float("nan"))


@dataclass(frozen=True, eq=False)
class Measured(ByContent):
    """What was measured of one demonstration's paths."""

    id: str
    participant: str
    group: str
    #: By type of path, then by metric.
    values: Mapping[str, Values]
    #: By type of path and metric: why the value does not exist.
    missing: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Trained:
    """What a reward was learnt from."""

    #: Ids of demonstrations, names of participants, and evidence groups.
    ids: frozenset[str]
    participants: frozenset[str]
    groups: frozenset[str]


def by_group(demonstrations: Iterable[Demonstration], fields: Collection[str] = ()) -> dict[str, list[Demonstration]]:
    """Demonstrations by group: force first, by cycle, then joystick, then autonomous; special sets after the rest."""
    order = list(Condition)
    groups: dict[str, list[Demonstration]] = {}
    for one in sorted(demonstrations, key=lambda one: (order.index(one.condition), one.set or "", one.cycle or 0)):
        groups.setdefault(group_of(one, fields), []).append(one)
    return groups


def groups_named(
    demonstrations: Iterable[Demonstration],
    names: Iterable[str],
    fields: Collection[str] = (),
    argument: str = "group",
) -> list[list[Demonstration]]:
    """The demonstrations of each of several groups.

    Args:
        demonstrations: Of all groups.
        names: Of groups.
        fields: By what they are grouped, as in :func:`by_group`.
        argument: That names the groups, for messages.

    Raises:
        DemonstrationError: A group does not exist.
    """
    known = by_group(demonstrations, fields)
    found = []
    for name in names:
        if name not in known:
            raise DemonstrationError(unknown(f"`{argument}`", name, known))
        found.append(known[name])
    return found


def group_of(demonstration: Demonstration, fields: Collection[str] = ()) -> str:
    """The group of a demonstration: condition, cycle and set where they are known, or the given names of FIELDS.

    Trials of a robot that drives by itself have the name of their set: "obstacle avoidance".
    """
    if fields:
        return ", ".join(of(demonstration) for name, of in FIELDS.items() if name in fields)
    alone = demonstration.condition is Condition.AUTONOMOUS and demonstration.set is not None
    condition = [] if alone else [demonstration.condition.value]
    cycle = [] if demonstration.cycle is None else [f"cycle {demonstration.cycle}"]
    return ", ".join([*condition, *cycle, *([] if demonstration.set is None else [demonstration.set])])


def evidence_group_of(demonstration: Demonstration) -> str:
    """The group of a demonstration as evidence: :func:`group_of`, and whether there are people in the scene."""
    return group_of(demonstration) + ("" if len(demonstration.people_m) else ", no people")


def by_evidence_group(demonstrations: Iterable[Demonstration]) -> dict[str, list[Demonstration]]:
    """Demonstrations by :func:`evidence_group_of`, in the order of :func:`by_group`."""
    groups: dict[str, list[Demonstration]] = {}
    for own in by_group(demonstrations).values():
        for one in own:
            groups.setdefault(evidence_group_of(one), []).append(one)
    return groups


def summary_of(group: str, path_type: str, rows: Iterable[Measured]) -> GroupMetrics:
    """Mean, standard deviation and interval over a group's paths of one type, those with a value each.

    Args:
        group: Its name.
        path_type: The type of path.
        rows: What was measured of the group; demonstrations without this type of path do not count.
    """
    paths = [row for row in rows if path_type in row.values]
    mean, std, half = {}, {}, {}
    missing: dict[str, dict[str, int]] = {}
    for name in dict.fromkeys(name for row in paths for name in row.values[path_type]):
        mean[name], std[name] = mean_and_spread(row.values[path_type][name] for row in paths)
        half[name] = student_half_width(by_participant(paths, path_type, name).values())
        for reason in (row.missing[path_type][name] for row in paths if name in row.missing.get(path_type, {})):
            own = missing.setdefault(name, {})
            own[reason] = own.get(reason, 0) + 1
    people = len({row.participant for row in paths})
    return GroupMetrics(
        group, path_type, len(paths), mean, std, half_interval=half, participants=people, missing=missing
    )


@dataclass(frozen=True, eq=False)
class Quantiles(ByContent):
    """Quantiles of the paths of one type in one group."""

    group: str
    path_type: str
    #: Number of demonstrations.
    count: int
    #: By share: a value by metric; NaN where no demonstration has one.
    values: Mapping[float, Values]


def quantiles_of(rows: Sequence[Measured], names: Sequence[str], shares: Sequence[float]) -> list[Quantiles]:
    """Quantiles over demonstrations, linear between their values; of learnt paths over their expected values.

    Args:
        rows: What was measured.
        names: Of metrics.
        shares: From 0 to 1.
    """
    found = []
    for group in dict.fromkeys(row.group for row in rows):
        own = [row for row in rows if row.group == group]
        for path_type in dict.fromkeys(path_type for row in own for path_type in row.values):
            there = [row.values[path_type] for row in own if path_type in row.values]
            values = {name: np.array([one[name] for one in there if name in one], dtype=float) for name in names}
            known = {name: one[np.isfinite(one)] for name, one in values.items() if len(one)}
            by_share = {share: {name: _quantile(one, share) for name, one in known.items()} for share in shares}
            found.append(Quantiles(group, path_type, len(there), by_share))
    return found


def _quantile(values: FloatArray, share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else float("nan")


def by_participant(rows: Iterable[Measured], path_type: str, name: str) -> dict[str, float]:
    """Mean of a metric over each participant's finite values; participants without one are left out.

    Args:
        rows: What was measured.
        path_type: The type of path.
        name: The metric.
    """
    values: dict[str, list[float]] = {}
    for row in rows:
        value = row.values.get(path_type, {}).get(name, np.nan)
        if np.isfinite(value):
            values.setdefault(row.participant, []).append(value)
    return {participant: float(np.mean(own)) for participant, own in values.items()}


def mean_and_spread(values: Iterable[float]) -> tuple[float, float]:
    """Mean and sample standard deviation (n - 1) of the finite values; NaN where there are too few."""
    known = np.array([value for value in values if np.isfinite(value)])
    mean = float(known.mean()) if len(known) else float("nan")
    return mean, float(known.std(ddof=1)) if len(known) > 1 else float("nan")


def student_half_width(values: Iterable[float]) -> float:
    """Half the width of Student's 95 % interval of the mean of finite values; NaN for fewer than two."""
    from scipy.special import stdtrit  # scipy.stats holds the same quantile behind an import of half a second

    known = [value for value in values if np.isfinite(value)]
    if len(known) < 2:
        return float("nan")
    _, std = mean_and_spread(known)
    return float(stdtrit(len(known) - 1, (1 + LEVEL) / 2) * std / np.sqrt(len(known)))
