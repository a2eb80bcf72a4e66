"""Confidence intervals of all parameters of a fit: from the profile likelihood, or from standard errors.

A profile interval holds the values at which the best log-likelihood of the other parameters has not fallen by more than
half a quantile (Wilks 1938; Venzon and Moolgavkar 1988, Applied Statistics 37:87). Data of several participants are not
independent: the fall that counts is then that of Student's quantile, times the ratio of the variance by participant to
that of the model (Rotnitzky and Jewell 1990, Biometrika 77:485).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from math import isfinite, isnan
from statistics import NormalDist

import numpy as np

from navirl_cli.irl.ends import Profiler
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.terms.term import Parameter

#: With fewer demonstrations the likelihood is too far from a parabola for standard errors.
FEW_DEMONSTRATIONS = 10
LEVEL = 0.95


class Kind(StrEnum):
    """How intervals are computed."""

    PROFILE = "profile"
    WALD = "wald"
    NONE = "none"
    #: Of a fit with random effects over participants, which has its own.
    POSTERIOR = "posterior"


#: Those that can be asked of a fit.
ASKED = (Kind.PROFILE, Kind.WALD, Kind.NONE)


class Errors(StrEnum):
    """Which scatter they are computed from."""

    #: Between participants.
    PARTICIPANT = "participant"
    #: Between the paths of one policy.
    MODEL = "model"


@dataclass(frozen=True)
class Ends:
    """The interval of one parameter, in its unit."""

    parameter: str
    #: None where the interval is open: no admissible value on that side is excluded.
    lower: float | None
    upper: float | None

    def moved(self, parameter: Parameter, bias: float) -> "Ends":
        """The interval minus a bias."""
        lower, upper = (None if end is None else end - bias for end in (self.lower, self.upper))
        return Ends(
            self.parameter,
            None if lower is None or lower <= parameter.lower else lower,
            None if upper is None or upper >= parameter.upper else upper,
        )

    @property
    def is_open(self) -> bool:
        """Whether an end is missing."""
        return self.lower is None or self.upper is None


@dataclass(frozen=True)
class Intervals:
    """Intervals of the parameters that the data identify."""

    kind: Kind
    errors: Errors
    level: float
    ends: tuple[Ends, ...]

    def moved(self, found: Fit) -> "Intervals":
        """The intervals of an uncorrected fit after its bias was subtracted; ends beyond a bound become open."""
        if found.bias is None:
            return self
        of = {p.name: (p, float(b)) for p, b in zip(found.reward.parameters, found.bias, strict=True)}
        return replace(self, ends=tuple(one.moved(*of[one.parameter]) for one in self.ends))

    @property
    def is_open(self) -> bool:
        """Whether an interval is open."""
        return any(one.is_open for one in self.ends)


def default_kind(found: Fit) -> Kind:
    """Profiles where there are few demonstrations or where a standard error leaves the admissible range."""
    beyond = any(one.is_open for errors in _errors(found) for one in _wald(found, errors).ends)
    few = found.demonstrations < FEW_DEMONSTRATIONS
    return Kind.PROFILE if few or beyond or found.on_bound.any() else Kind.WALD


def intervals(
    evidence: Evidence, found: Fit, kind: Kind, progress: Callable[[int, str], None] | None = None
) -> tuple[Intervals, ...]:
    """95 % intervals of the identified parameters; those by participant first, where there are several.

    Profiles are of the likelihood and the prior. The default regulariser is left out, because it is not data; a larger
    one is kept.

    Args:
        evidence: The demonstrated steps of the fit.
        found: The fit.
        kind: Profile or Wald.
        progress: Called with the number of parameters done, and the name of the last.

    Returns:
        None, one or two sets of intervals.
    """
    errors = _errors(found)
    if kind is Kind.NONE or not found.identified.any():
        return ()
    if kind is Kind.WALD:
        return tuple(_wald(found, one) for one in errors)
    every = [_fall(found, one, j) for one in errors for j in _numbers(found)]
    profiler = Profiler.of(evidence, found, min(every), max(every))
    ends: dict[Errors, list[Ends]] = {one: [] for one in errors}
    for done, j in enumerate(_numbers(found), start=1):
        falls = [_fall(found, one, j) for one in errors]
        lower, upper = (profiler.ends(j, side, falls) for side in (-1, 1))
        for one, low, high in zip(errors, lower, upper, strict=True):
            ends[one].append(Ends(found.reward.parameters[j].name, low, high))
        if progress is not None:
            progress(done, found.reward.parameters[j].name)
    return tuple(Intervals(Kind.PROFILE, one, LEVEL, tuple(ends[one])) for one in errors)


def quantile(found: Fit, errors: Errors) -> float:
    """Half the width of an interval in standard errors: Student's quantile by participants, else the normal one."""
    if errors is Errors.MODEL:
        return NormalDist().inv_cdf(0.5 + LEVEL / 2)
    from scipy.special import stdtrit

    return float(stdtrit(found.participants - 1, 0.5 + LEVEL / 2))


def _errors(found: Fit) -> list[Errors]:
    """By participant first, where there are several."""
    return [Errors.MODEL] if found.clustered is None else [Errors.PARTICIPANT, Errors.MODEL]


def _numbers(found: Fit) -> list[int]:
    return np.flatnonzero(found.identified).tolist()


def _wald(found: Fit, errors: Errors) -> Intervals:
    """Estimate plus and minus a multiple of the standard error. An end beyond the parameter's bound is open."""
    robust = found.clustered_errors
    spread = found.standard_errors if errors is Errors.MODEL or robust is None else robust
    ends = []
    for j in _numbers(found):
        parameter, value, error = found.reward.parameters[j], found.reward.theta[j], float(spread[j])
        if not isnan(error):
            low, high = (value + side * quantile(found, errors) * error for side in (-1, 1))
            ends.append(
                Ends(
                    parameter.name,
                    low if low > parameter.lower else None,
                    high if high < parameter.upper else None,
                )
            )
    return Intervals(Kind.WALD, errors, LEVEL, tuple(ends))


def _fall(found: Fit, errors: Errors, j: int) -> float:
    """Fall of the log-likelihood at the ends of the interval of parameter j, nats."""
    half = quantile(found, errors) ** 2 / 2
    if errors is Errors.MODEL or found.clustered is None:
        return half
    ratio = float(found.clustered[j, j] / found.covariance[j, j])
    # A few participants give too small a scatter in some direction.
    return half * max(1.0, ratio) if isfinite(ratio) else half
