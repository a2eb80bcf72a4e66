"""Ends of profile-likelihood intervals (Venzon and Moolgavkar 1988, Applied Statistics 37:87)."""

from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite, sqrt

import numpy as np
from numpy.typing import NDArray

from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import PAPER_L2, Fit
from navirl_cli.irl.newton import Effort, Maximum, Point, maximise, moved
from navirl_cli.irl.objective import Objective
from navirl_cli.irl.scan import Scan

#: Tolerance of the fall at an end, as a share of it, and the largest number of values tried for it.
END_TOLERANCE, END_TRIES = 0.01, 40
#: Largest number of steps of the climb at a value. Along a curved ridge a climb takes many for little.
MOST_STEPS = 40
#: Predicted gain at which a climb at a value ends, as a share of the fall: it shifts an end by half of this.
ENOUGH = 2e-3
#: Predicted gain at which the climb to the top ends, nats.
TOP = 1e-4
#: How often an end is moved on because another branch of the other parameters reaches farther.
BRANCHES = 5
#: A climb far from an end ends where it promises less than this share of the distance, in nats.
SIDE = 0.1
#: Largest step from the last place evaluated to an end, as a share of the value there.
EXTRAPOLATED = 0.1
#: Without an end ahead the next stride is so many times as long.
GROWTH = 4.0


@dataclass(eq=False)
class Profiler:
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
    def of(evidence: Evidence, found: Fit, least: float, most: float) -> "Profiler":
        """The likelihood around its maximum, and its profiles over what enters non-linearly.

        Args:
            evidence: The demonstrated steps of the fit.
            found: The fit.
            least: The smallest fall of the likelihood at an end, nats.
            most: The largest one.
        """
        l2 = 0.0 if found.l2 <= PAPER_L2 else found.l2
        free = found.identified
        objective = Objective.of(evidence, found.reward, l2, found.prior)
        top = estimate = objective(objective.to_units(found.reward.theta))
        if l2 != found.l2:  # without the regulariser the maximum is a little elsewhere; the scan below finds others
            top = maximise(
                objective, estimate, objective.bounds, free, effort=Effort(MOST_STEPS, TOP, strides=True)
            ).best
        scans = [(j, values) for j, values in objective.scans() if free[j]]
        seen = [top, estimate]
        branched = len(scans) > 1
        for j, values in scans:
            along = Scan(objective, objective.bounds, free, None, [_known(top)], most, found.scanned).follow(j, values)
            seen += along
            branched |= _has_several_peaks(along, j)
        best_seen = max(seen, key=lambda point: point.value)
        return Profiler(objective, best_seen, free, seen, branched, ENOUGH * least)

    def ends(self, j: int, side: int, falls: list[float]) -> list[float | None]:
        """The ends on one side of the intervals of parameter j at several falls, in its unit; None where open."""
        scale = float(self.objective.scale[j])
        ends: dict[float, float | None] = {}
        for fall in sorted(set(falls)):
            end = self._end(j, side, fall)
            ends[fall] = None if end is None else self._extrapolated(j, side, fall, end) * scale
        return [ends[fall] for fall in falls]

    def _extrapolated(self, j: int, side: int, fall: float, end: Point) -> float:
        """The end by one more step of the quadratic model, which needs no evaluation; never beyond the bound."""
        step, here = self._model_step(j, fall, end, side), float(end.x[j])
        low, high = (float(bound[j]) for bound in self.objective.bounds)
        if step is None or abs(step) > EXTRAPOLATED * abs(here) or not low < here + step < high:
            return here
        return here + step

    def _end(self, j: int, side: int, fall: float) -> Point | None:
        """The last place on the profile, to one side, that has not fallen by more than a given amount."""
        inside = max((one for one in self.seen if self._within(one, fall)), key=lambda one: side * float(one.x[j]))
        for _ in range(BRANCHES):
            end = self._last_within(j, side, fall, inside)
            farther = None if end is None else self._other_branch(j, fall, end)
            if end is None or farther is None:
                return end
            inside = farther
        return inside

    def _last_within(self, j: int, side: int, fall: float, inside: Point) -> Point | None:
        """Where the profile has fallen by a given amount, beyond a place inside; None up to the bound.

        The value tried next is where the quadratic model of the whole likelihood puts the end (Venzon and Moolgavkar
        1988), kept between the farthest place inside and the nearest outside.
        """
        bound = float(self.objective.bounds[0 if side < 0 else 1][j])
        here, outside, stride = inside, None, self._stride(j, fall, inside)
        for number in range(END_TRIES):
            if inside.x[j] == bound:
                return None
            ahead = side * stride if outside is None else float(outside.x[j] - inside.x[j])
            share = self._share(j, fall, inside, here, outside, ahead)
            if outside is not None and number % 3 == 2:
                share = 0.5  # the model says little near a jump
            value = float(inside.x[j]) + share * ahead
            value = bound if side * (value - bound) >= 0 else value
            if outside is not None and value in {float(inside.x[j]), float(outside.x[j])}:
                break
            there = self._best(j, value, fall, here)
            if abs(self._left(there, fall)) < END_TOLERANCE * fall and value != bound:
                return there
            if self._left(there, fall) >= 0:
                inside, stride = there, GROWTH * stride
            else:
                outside = there
            here = there if isfinite(there.value) else inside
        return inside

    def _stride(self, j: int, fall: float, inside: Point) -> float:
        """About the distance of the end from the maximum, by the curvature there, or half of the present value."""
        block = np.ix_(self.free, self.free)
        variance = float(np.linalg.pinv(-self.top.hessian[block])[np.flatnonzero(self.free).tolist().index(j)].max())
        span = sqrt(2 * fall * variance) if variance > 0 else inf
        return min(span, 0.5 * max(abs(float(inside.x[j])), 0.1))

    def _share(self, j: int, fall: float, inside: Point, here: Point, outside: Point | None, ahead: float) -> float:
        """Where the end is expected, as a share of the way ahead from the place inside."""
        for place in (here, inside) if here is not inside else (here,):
            step = self._model_step(j, fall, place, 1 if ahead > 0 else -1)
            share = 0.0 if step is None else (float(place.x[j]) + step - float(inside.x[j])) / ahead
            if 0 < share < 1:
                return share
        if outside is None:
            return 1.0
        # The root of the fall is nearly linear in the parameter.
        low, high = (sqrt(max(fall - self._left(one, fall), 0.0)) for one in (inside, outside))
        return (sqrt(fall) - low) / (high - low) if isfinite(high) else 0.5

    def _model_step(self, j: int, fall: float, here: Point, side: int) -> float | None:
        """Step of parameter j to the end of the quadratic model's profile on a side; None where it has none there."""
        low, high = self.objective.bounds
        others = self.free & (np.arange(len(here.x)) != j) & (here.x > low) & (here.x < high)
        information, across = -here.hessian[np.ix_(others, others)], here.hessian[j, others]
        if others.any() and float(np.linalg.eigvalsh(information)[0]) <= 0:
            return None
        pull, turn = (np.linalg.solve(information, one) for one in (here.gradient[others], across))
        left = self._left(here, fall) + 0.5 * float(here.gradient[others] @ pull)
        slope = side * float(here.gradient[j] + across @ pull)
        curvature = -float(here.hessian[j, j] + across @ turn)
        root = slope**2 + 2 * curvature * left
        return side * (slope + sqrt(root)) / curvature if curvature > 0 and root >= 0 else None

    def _best(self, j: int, value: float, fall: float, guess: Point) -> Point:
        """The best of the other parameters at a value of parameter j, from a guess; value -inf without a policy.

        The climb ends early where it is certain on which side of the end the place is.
        """
        others = self.free & (np.arange(len(guess.x)) != j)
        begin = self.objective(moved(guess, j, value - float(guess.x[j]), self.objective.bounds, others))
        if not isfinite(begin.value):
            begin = self.objective(np.where(np.arange(len(guess.x)) == j, value, guess.x))
        if not isfinite(begin.value):
            return begin
        away = abs(self._left(begin, fall))
        for enough in (max(self.enough, SIDE * away), self.enough):
            effort = Effort(MOST_STEPS, enough, strides=True)
            begin = maximise(self.objective, begin, self.objective.bounds, others, effort=effort).best
            left = self._left(begin, fall)
            if abs(left) > END_TOLERANCE * fall and (left > 0 or -left > enough / SIDE):
                break
        self.seen.append(begin)
        return begin

    def _left(self, place: Point, fall: float) -> float:
        """How much farther the likelihood may fall inside the interval, nats; negative outside."""
        return place.value - self.top.value + fall

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
        return self._left(place, fall) >= 0


def _has_several_peaks(along: list[Point], j: int) -> bool:
    """Whether the values along a profile fall and rise again."""
    values = [point.value for point in sorted(along, key=lambda point: float(point.x[j]))]
    steps = [later - earlier for earlier, later in pairwise(values) if abs(later - earlier) > END_TOLERANCE]
    return any(before < 0 < after for before, after in pairwise(steps))


def _known(point: Point) -> Maximum:
    return Maximum(point, True, False, point.x[None], np.array([point.value]))
