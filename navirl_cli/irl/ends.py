"""Ends of profile-likelihood intervals (Venzon and Moolgavkar 1988, Applied Statistics 37:87)."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, sqrt

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import PAPER_L2, Fit
from navirl_cli.irl.newton import Effort, Maximum, Point, maximise, moved
from navirl_cli.irl.objective import Objective
from navirl_cli.irl.scan import Scan
from navirl_cli.irl.stretched import Stretched

#: Tolerance of the fall at an end, as a share of it, and the largest number of values tried for it.
END_TOLERANCE, END_TRIES = 0.01, 40
#: Largest number of steps of the climb at a value. Along a curved ridge a climb takes many for little.
MOST_STEPS = 40
#: Predicted gain at which a climb at a value ends, as a share of the fall: it shifts an end by half of this.
ENOUGH = 2e-3
#: Predicted gain at which the climb to the top ends, nats.
TOP = 1e-4
#: How far below the best a place on a profile may be, nats: the climbs there are coarse.
COARSE = 0.05
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
    """Ends of profile intervals; all places by the coordinates of :mod:`navirl_cli.irl.stretched`."""

    objective: Stretched
    top: Point
    free: NDArray[np.bool_]
    #: All places found so far: each shows how far an interval reaches at least.
    seen: list[Point]
    #: Places on the profiles over what enters non-linearly, by its number and ascending, by the plain parameters.
    along: dict[int, list[Point]]
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
        plain = Objective.of(evidence, found.reward, l2, found.prior)
        objective = Stretched.of(plain)
        top = estimate = objective.point(plain(plain.to_units(found.reward.theta)))

        def climbed(start: Point) -> Point:
            return maximise(objective, start, objective.bounds, free, effort=Effort(MOST_STEPS, TOP, strides=True)).best

        if l2 != found.l2:  # without the regulariser the maximum is a little elsewhere
            top = climbed(estimate)
        known = [_known(objective.place(top))]
        begun = _unregularised(found, Objective.of(evidence, found.reward, found.l2 - l2, found.prior))
        evaluated = {place.x.tobytes(): place for place in begun}

        def remembered(x: FloatArray) -> Point:
            return evaluated.get(x.tobytes()) or plain(x)

        along: dict[int, list[Point]] = {}
        for j, values in plain.scans():
            if free[j]:
                scan = Scan(remembered, plain.bounds, free, None, known, most, begun)
                scan.follow(j, values)
                along[j] = scan.places  # those that are not of interest too: others begin there
        seen = [top, estimate, *(objective.point(place) for places in along.values() for place in places)]
        best = max(seen, key=lambda point: point.value)
        if best is not top:  # it is on another branch, or much farther along a ridge
            best = climbed(best)
        return Profiler(objective, best, free, [best, *seen], along, ENOUGH * least)

    def ends(self, j: int, side: int, falls: list[float]) -> list[float | None]:
        """The ends on one side of the intervals of parameter j at several falls, in its unit; None where open."""
        scale = float(self.objective.objective.scale[j])
        ends: dict[float, float | None] = {}
        for fall in sorted(set(falls)):
            end = self._end(j, side, fall)
            ends[fall] = None if end is None else self._extrapolated(j, side, fall, end) * scale
        return [ends[fall] for fall in falls]

    def _extrapolated(self, j: int, side: int, fall: float, end: Point) -> float:
        """The plain end by one more step of the quadratic model, which needs no evaluation; never beyond the bound."""
        step, here = self._model_step(j, fall, end, side), self._plain(j, float(end.x[j]))
        low, high = (float(bound[j]) for bound in self.objective.bounds)
        if step is None or not low < end.x[j] + step < high:
            return here
        there = self._plain(j, float(end.x[j]) + step)
        return there if abs(there - here) <= EXTRAPOLATED * abs(here) else here

    def _plain(self, j: int, value: float) -> float:
        """The plain parameter j, in units of its scale."""
        return float(self.objective.plain(np.where(np.arange(len(self.free)) == j, value, self.top.x))[j])

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
        x = self.objective.plain(inside.x)
        return min(span, 0.5 * max(abs(float(x[j])), 0.1) / float(self.objective.slopes(x)[0][j]))

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
        left, enough = self._left(begin, fall), inf
        while enough > self.enough:
            enough = max(self.enough, min(SIDE * abs(left), 0.5 * enough))
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
        plain, place, higher = self.objective.objective, self.objective.place(end), 2 * END_TOLERANCE * fall
        found: list[Point] = []
        for i, values in plain.scans():
            near = self._promising(i, values, j, place) if others[i] else []
            if near:
                starts = [self._shifted(one, i, j, float(place.x[j])) for one in self.along[i]]
                search = Scan(plain, plain.bounds, others, None, [_known(place)], -higher, starts, inf)
                found += search.follow(i, near)
        best = max(found, key=lambda one: one.value, default=place)
        return self.objective.point(best) if best.value > place.value + higher else None

    def _shifted(self, place: Point, i: int, j: int, value: float) -> Point:
        """A place on the profile over variable i, and where the others are expected at a value of variable j."""
        others = self.free & ~np.isin(np.arange(len(place.x)), (i, j))
        x = moved(place, j, value - float(place.x[j]), self.objective.objective.bounds, others)
        return Point(x, place.value, place.gradient, place.hessian)

    def _promising(self, i: int, values: Sequence[float], j: int, end: Point) -> list[float]:
        """Values of variable i at which the likelihood may be higher at an end of variable j, and their neighbours.

        With variable i held the likelihood is concave in the others. From the best place there it falls by at least
        d - ln(1 + d) where its quadratic model falls by d^2/2 (Nesterov 2004, Thm. 4.1.7).
        """
        others = self.free & ~np.isin(np.arange(len(end.x)), (i, j))
        high = [
            float(place.x[i])
            for place in self.along[i]
            if place.value - _least_fall(place, j, float(end.x[j] - place.x[j]), others) > end.value - COARSE
        ]
        ascending = np.array(values)
        cells = np.searchsorted(ascending, [*high, float(end.x[i])])
        if len(set(cells.tolist())) < 2:
            return []  # a branch between the same two values as the end is none that a scan could find
        kept = np.zeros(len(values), dtype=bool)
        for value in high:
            low, up = int(np.searchsorted(ascending, value)), int(np.searchsorted(ascending, value, "right"))
            kept[max(low - 1, 0) : up + 1] = True
        near: list[float] = ascending[kept].tolist()
        return near

    def _within(self, place: Point, fall: float) -> bool:
        return self._left(place, fall) >= 0


def _least_fall(place: Point, j: int, step: float, others: NDArray[np.bool_]) -> float:
    """The least fall of a self-concordant function from its best place by others, at a step of variable j."""
    inverse = np.linalg.pinv(-place.hessian[np.ix_(others, others)], hermitian=True)
    information = -float(place.hessian[j, j]) - float(place.hessian[j, others] @ inverse @ place.hessian[others, j])
    d = abs(step) * sqrt(max(information, 0.0))
    return d - float(np.log1p(d)) + max(-float(place.gradient[j]) * step, 0.0)


def _known(point: Point) -> Maximum:
    return Maximum(point, True, False, point.x[None], np.array([point.value]))


def _unregularised(found: Fit, regularised: Objective) -> list[Point]:
    """The places of a fit's scan without the regulariser of an objective; this needs no evaluation."""
    scale, regulariser = regularised.scale, regularised.regulariser
    return [
        Point(
            place.x,
            place.value - regulariser.log_density(place.x * scale),
            place.gradient - regulariser.gradient(place.x * scale) * scale,
            place.hessian + regulariser.precision * np.outer(scale, scale),
        )
        for place in found.scanned
    ]
