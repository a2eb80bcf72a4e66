"""Confidence intervals of all parameters of a fit: from the profile likelihood, or from standard errors.

A profile interval holds the values at which the best log-likelihood of the other parameters has not fallen by more than
half a quantile (Wilks 1938; Venzon and Moolgavkar 1988, Applied Statistics 37:87). Data of several participants are not
independent: the fall that counts is then that of Student's quantile, times the ratio of the variance by participant to
that of the model (Rotnitzky and Jewell 1990, Biometrika 77:485).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from math import inf, isfinite, isnan, sqrt
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import PAPER_L2, Fit
from navirl_cli.irl.newton import Effort, Maximum, Point, maximise, moved
from navirl_cli.irl.objective import Objective
from navirl_cli.irl.scan import Scan
from navirl_cli.irl.terms.term import Parameter

#: With fewer demonstrations the likelihood is too far from a parabola for standard errors.
FEW_DEMONSTRATIONS = 10
LEVEL = 0.95
#: Tolerance of the fall at an end, as a share of it, and the largest number of values tried for it.
END_TOLERANCE, END_TRIES = 0.01, 40
#: Largest number of steps of the climb at a value. Along a curved ridge a climb takes many for little.
MOST_STEPS = 40
#: Predicted gain at which a climb at a value ends, as a share of the fall: it shifts an end by half of this.
ENOUGH = 2e-3
#: With fewer participants the scatter between them says too little for an interval: Student's quantile is 4.3 and more.
FEWEST_PARTICIPANTS = 4
#: How often an end is moved on because another branch of the other parameters reaches farther.
BRANCHES = 5


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
    """Profiles where there are few demonstrations or where a standard error leaves the admissible range.

    With states of turns a profile takes minutes, so that standard errors stand there; their ends beyond a
    bound are open.
    """
    if found.reward.about_turns:
        return Kind.WALD
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
    profiler = _Profiler.of(evidence, found, max(_fall(found, one, j) for one in errors for j in _numbers(found)))
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
    """By participant first, where there are enough of them."""
    few = found.clustered is None or found.participants < FEWEST_PARTICIPANTS
    return [Errors.MODEL] if few else [Errors.PARTICIPANT, Errors.MODEL]


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


@dataclass(eq=False)
class _Profiler:
    """Ends of profile intervals, in units of the parameters' scales."""

    objective: Objective
    top: Point
    free: NDArray[np.bool_]
    #: All places found so far: each shows how far an interval reaches at least.
    seen: list[Point]
    #: Whether the profile over what enters non-linearly has several peaks, between which the others may jump.
    branched: bool
    #: Predicted gain at which a climb ends, nats.
    enough: float

    @staticmethod
    def of(evidence: Evidence, found: Fit, fall: float) -> "_Profiler":
        """The likelihood around its maximum, and its profiles over what enters non-linearly."""
        l2 = 0.0 if found.l2 <= PAPER_L2 else found.l2
        free = found.identified
        objective = Objective.of(evidence, found.reward, l2, found.prior)
        top = estimate = objective(objective.to_units(found.reward.theta))
        if l2 != found.l2:  # without the regulariser the maximum is a little elsewhere; the scan below finds others
            top = maximise(objective, estimate, objective.bounds, free, effort=Effort(MOST_STEPS)).best
        scans = [(j, values) for j, values in objective.scans() if free[j]]
        seen = [top, estimate]
        branched = len(scans) > 1
        for j, values in scans:
            along = Scan(objective, objective.bounds, free, None, [_known(top)], fall).follow(j, values)
            seen += along
            branched |= _has_several_peaks(along, j)
        best_seen = max(seen, key=lambda point: point.value)
        smallest = NormalDist().inv_cdf(0.5 + LEVEL / 2) ** 2 / 2
        return _Profiler(objective, best_seen, free, seen, branched, ENOUGH * smallest)

    def ends(self, j: int, side: int, falls: list[float]) -> list[float | None]:
        """The ends on one side of the intervals of parameter j at several falls, in its unit; None where open."""
        scale = float(self.objective.scale[j])
        ends = {fall: self._end(j, side, fall) for fall in sorted(set(falls))}
        return [None if end is None else float(end.x[j]) * scale for end in map(ends.__getitem__, falls)]

    def _end(self, j: int, side: int, fall: float) -> Point | None:
        """The last place on the profile, to one side, that has not fallen by more than a given amount."""
        inside = max((one for one in self.seen if self._within(one, fall)), key=lambda one: side * float(one.x[j]))
        for _ in range(BRANCHES):
            outside = self._outside(j, side, fall, inside)
            if outside is None:
                return None
            inside = self._crossing(j, fall, *outside)
            farther = self._other_branch(j, fall, inside)
            if farther is None:
                break
            inside = farther
        return inside

    def _outside(self, j: int, side: int, fall: float, inside: Point) -> tuple[Point, Point] | None:
        """Neighbouring places inside and outside the interval, with growing strides; None up to the bound."""
        bound = float(self.objective.bounds[0 if side < 0 else 1][j])
        stride = self._stride(j, fall, inside)
        while inside.x[j] != bound:
            value = float(inside.x[j]) + side * stride
            value = bound if side * (value - bound) >= 0 else value
            there = self._best(j, value, inside)
            if not self._within(there, fall):
                return inside, there
            inside, stride = there, 2 * stride
        return None

    def _stride(self, j: int, fall: float, inside: Point) -> float:
        """About the distance of the end from the maximum, by the curvature there, or half of the present value."""
        block = np.ix_(self.free, self.free)
        variance = float(np.linalg.pinv(-self.top.hessian[block])[np.flatnonzero(self.free).tolist().index(j)].max())
        span = sqrt(2 * fall * variance) if variance > 0 else inf
        return min(span, 0.5 * max(abs(float(inside.x[j])), 0.1))

    def _best(self, j: int, value: float, guess: Point) -> Point:
        """The best of the other parameters at a value of parameter j, from a guess; value -inf without a policy."""
        others = self.free & (np.arange(len(guess.x)) != j)
        begin = self.objective(moved(guess, j, value - float(guess.x[j]), self.objective.bounds, others))
        if not isfinite(begin.value):
            begin = self.objective(np.where(np.arange(len(guess.x)) == j, value, guess.x))
        if not isfinite(begin.value):
            return begin
        climb = maximise(self.objective, begin, self.objective.bounds, others, effort=Effort(MOST_STEPS, self.enough))
        self.seen.append(climb.best)
        return self.seen[-1]

    def _crossing(self, j: int, fall: float, inside: Point, outside: Point) -> Point:
        """The place at which the likelihood has fallen by a given amount, between two on either side of it."""
        for number in range(END_TRIES):
            # The root of the fall is nearly linear in the parameter, but not near a jump: every third trial bisects.
            low, high = (sqrt(max(self.top.value - one.value, 0.0)) for one in (inside, outside))
            share = 0.5 if number % 3 == 2 or not isfinite(high) else (sqrt(fall) - low) / (high - low)
            value = float(inside.x[j] + (outside.x[j] - inside.x[j]) * share)
            if value in {float(inside.x[j]), float(outside.x[j])}:
                break
            there = self._best(j, value, inside)
            if abs(self.top.value - there.value - fall) < END_TOLERANCE * fall:
                return there
            inside, outside = (there, outside) if self._within(there, fall) else (inside, there)
        return inside

    def _other_branch(self, j: int, fall: float, end: Point) -> Point | None:
        """A place at the end's value that lies well inside, with other values of what enters non-linearly."""
        others = self.free & (np.arange(len(end.x)) != j)
        scans = [(i, values) for i, values in self.objective.scans() if others[i]]
        if not scans or not self.branched:
            return None
        search = Scan(self.objective, self.objective.bounds, others, None, [_known(end)])
        best = max((place for i, values in scans for place in search.follow(i, values)), key=lambda one: one.value)
        return best if best.value > self.top.value - fall * (1 - 2 * END_TOLERANCE) else None

    def _within(self, place: Point, fall: float) -> bool:
        return place.value >= self.top.value - fall


def _has_several_peaks(along: list[Point], j: int) -> bool:
    """Whether the values along a profile fall and rise again."""
    values = [point.value for point in sorted(along, key=lambda point: float(point.x[j]))]
    steps = [later - earlier for earlier, later in pairwise(values) if abs(later - earlier) > END_TOLERANCE]
    return any(before < 0 < after for before, after in pairwise(steps))


def _known(point: Point) -> Maximum:
    return Maximum(point, True, False, point.x[None], np.array([point.value]))
