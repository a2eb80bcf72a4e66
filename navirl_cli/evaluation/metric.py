"""What a metric is: a number that describes a path, what it needs, and how it is computed."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.lines import Lines
from navirl_cli.evaluation.motion import Drive
from navirl_cli.evaluation.policy_paths import Nearness, Visits

#: Values of one path by metric; NaN where one does not exist.
Values = Mapping[str, float]


class Need(StrEnum):
    """What a metric needs of a demonstration, beside its path."""

    PEOPLE = "people"
    TIMES = "measured times"
    WRENCH = "a wrench"

    @property
    def missing(self) -> str:
        """The reason for a value that does not exist for want of this."""
        return _MISSING[self]


_MISSING = {
    Need.PEOPLE: "no people in the scene",
    Need.TIMES: "times not measured",
    Need.WRENCH: "no wrench in the log",
}


#: The reason for metrics of learnt paths where no reward is given.
NO_REWARD = "no learnt reward given"


def missing_of(demonstration: Demonstration) -> frozenset[Need]:
    """What a demonstration lacks."""
    found = {
        Need.PEOPLE: len(demonstration.people_m) > 0,
        Need.TIMES: demonstration.timed,
        Need.WRENCH: demonstration.contacts is not None and demonstration.force_n is not None,
    }
    return frozenset(need for need, there in found.items() if not there)


@dataclass(frozen=True, eq=False)
class Metric:
    """A number that describes a path, and how it is computed: by exactly one of ``lines``, ``drive`` and ``near``.

    Raises:
        ValueError: There are two functions, or none.
    """

    #: As in options, files and CSV: lower case, with the unit.
    name: str
    #: For tables, without the unit; "1" for none.
    label: str
    unit: str
    definition: str
    source: str = ""
    needs: tuple[Need, ...] = ()
    #: (m,) values of the paths of any type: driven, on the grid, learnt, nominal, avoidance.
    lines: Callable[[Lines], FloatArray] | None = None
    #: Value of a demonstration as it was driven, for what a line does not contain.
    drive: Callable[[Drive], float] | None = None
    #: (m,) values of learnt paths beside a demonstrated one.
    near: Callable[[Nearness], FloatArray] | None = None
    #: Exact expected value under a policy, where visits give it; without it the mean of drawn paths counts.
    exact: Callable[[Visits], float] | None = None
    #: When a value does not exist although everything that the metric needs is there.
    undefined: str = "not defined for this path"

    def __post_init__(self) -> None:
        """Check that there is one function."""
        if sum(function is not None for function in (self.lines, self.drive, self.near)) != 1:
            raise ValueError(f"metric {self.name}: needs exactly one of lines, drive and near")

    def __reduce__(self) -> str | tuple[Any, ...]:
        """Pickle a metric of METRICS by its name: functions without a name do not cross processes."""
        from navirl_cli.evaluation.metrics import BY_NAME, metric_named

        if BY_NAME.get(self.name) is self:
            return metric_named, (self.name,)
        return super().__reduce__()

    @property
    def heading(self) -> str:
        """Label and unit, where it has one."""
        return self.label if self.unit == "1" else f"{self.label} {self.unit}"

    @property
    def paths(self) -> str:
        """The types of paths that have it, in a word."""
        return "all" if self.lines is not None else "driven" if self.drive is not None else "learnt"

    def reason(self, missing: Collection[Need]) -> str | None:
        """Why it does not exist where these are missing; None where all that it needs is there."""
        return next((need.missing for need in self.needs if need in missing), None)


def measure(
    metrics: Sequence[Metric], lines: Lines, missing: Collection[Need], drive: Drive | None = None
) -> tuple[dict[str, float], dict[str, str]]:
    """Values of one path.

    Args:
        metrics: To compute; those that this type of path does not have are left out.
        lines: The path, one line.
        missing: What its demonstration lacks.
        drive: The demonstration, of the path as it was driven.

    Returns:
        By metric: value, NaN where it does not exist, and for those the reason.
    """
    values: dict[str, float] = {}
    reasons: dict[str, str] = {}
    for metric in metrics:
        if metric.near is not None or (metric.drive is not None and drive is None):
            continue
        reason = metric.reason(missing)
        value = float("nan")
        if reason is None and metric.lines is not None:
            value = float(metric.lines(lines)[0])
        elif reason is None and metric.drive is not None and drive is not None:
            value = metric.drive(drive)
        values[metric.name] = value
        if not np.isfinite(value):
            reasons[metric.name] = reason or metric.undefined
    return values, reasons
