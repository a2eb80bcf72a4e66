"""Maxima that a climb misses: the profile of the objective over each parameter that enters non-linearly.

Given these parameters the reward is linear in the others, and log p = R - log Z is concave in them, because log Z is
convex. A climb with one of them held therefore ends at the best of the others. The profile's values and slopes show
between which of the declared values it has a maximum; the objective is climbed from there with all parameters free.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.newton import Maximum, Point, maximise, moved

#: Between two values the profile is taken to stay below the cubic through its values and slopes plus this, in nats, and
#: plus this share of the cubic's rise above the lower value.
WITHIN, SHARE = 0.3, 0.5
#: A place so far below what is of interest need not be computed again under an objective that differs a little, nats.
FAR = 10.0
#: Rounds over several parameters: a better maximum by one may open another by the next.
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class _Place:
    """A place on the profile of one variable, and the slope there by the variable's logarithm."""

    point: Point
    slope: float


@dataclass(eq=False)
class Scan:
    """The search for maxima beside a known one."""

    #: Value, gradient and Hessian at (k,) variables; value -inf where it does not exist.
    objective: Callable[[FloatArray], Point]
    #: (k,) lower and upper ones.
    bounds: tuple[FloatArray, FloatArray]
    #: (k,) variables that may move.
    free: NDArray[np.bool_]
    progress: Callable[[float], None] | None
    #: Maxima found so far.
    found: list[Maximum]
    #: How far below the best place a value of the profile is still of interest, nats.
    fall: float = 0.0
    #: Places on the profile of nearly the same objective: where to begin, or what to take where nothing is of interest.
    starts: Sequence[Point] = ()
    #: So far below what is of interest such a place is taken, nats; inf to begin there at least.
    far: float = FAR
    #: Places found on profiles.
    visited: list[Point] = field(default_factory=list, init=False)
    _seen: dict[float, _Place] = field(default_factory=dict, init=False)

    @property
    def top(self) -> Point:
        """The best place known."""
        return max((one.best for one in self.found), key=lambda point: point.value)

    def over(self, scans: Sequence[tuple[int, Sequence[float]]]) -> None:
        """Look for maxima along the profiles of some variables, and add them to those found.

        Args:
            scans: Numbers of variables, each with its positive values, ascending.
        """
        for _ in range(ROUNDS if len(scans) > 1 else 1):
            before = self.top
            for j, values in scans:
                self.follow(j, values)
                self._climb(j)
            if self.top is before:
                break

    def follow(self, j: int, values: Sequence[float]) -> list[Point]:
        """Follow the profile from the best place to both sides: every second value, and those between where needed.

        Returns:
            The places on the profile that are of interest, by the variable, ascending.
        """
        here = float(self.top.x[j])
        self._seen = {here: _Place(self.top, 0.0)}
        above, below = [v for v in values if v > here], [v for v in values if v < here][::-1]
        for side in (above, below):
            # The bound and every second value before it.
            for value in side[:1] + side[1:][::-2][::-1]:
                self._visit(j, value)
        for value in (*above, *below):
            # Where there is no policy, a value has no neighbour on one side.
            low = max((v for v in self._seen if v <= value), default=here)
            high = min((v for v in self._seen if v >= value), default=here)
            near = here in {low, high} or self._peak(low, high) > self.top.value - self.fall
            if value not in self._seen and near:
                self._visit(j, value)
        return [point for point in self.places if point.value >= self.top.value - self.fall]

    @property
    def places(self) -> list[Point]:
        """All places on the profile that was followed last, by the variable, ascending."""
        return [one.point for _, one in sorted(self._seen.items())]

    def _visit(self, j: int, value: float) -> None:
        """The best of the other variables at a value of this one; nothing where there is no policy."""
        known = next((one for one in self.starts if np.isclose(one.x[j], value, rtol=1e-12)), None)
        if known is not None and known.value < self.top.value - self.fall - self.far:
            self._seen[value] = _Place(known, float(known.gradient[j]) * value)
            return
        last = self._seen[min(self._seen, key=lambda other: abs(np.log(other / value)))].point
        others = self.free & (np.arange(len(last.x)) != j)
        # Along the logarithm of the variable the best of the others moves more evenly.
        x = moved(last, j, float(last.x[j] * np.log(value / last.x[j])), self.bounds, others)
        x = x if known is None else known.x
        begin = self.objective(np.where(np.arange(len(x)) == j, value, x))
        if not np.isfinite(begin.value):
            begin = self.objective(np.where(np.arange(len(x)) == j, value, last.x))
        if np.isfinite(begin.value):
            point = maximise(self.objective, begin, self.bounds, others, hope=self.top.value - self.fall).best
            self.visited.append(point)
            self._seen[value] = _Place(point, float(point.gradient[j]) * value)

    def _climb(self, j: int) -> None:
        """Climb with all variables from where the profile may have a higher maximum."""
        places = dict(sorted(self._seen.items()))
        here, starts = float(self.top.x[j]), [one.point for one in places.values() if one.point is not self.top]
        starts = [point for point in starts if point.value > self.top.value]
        for (low, left), (high, right) in pairwise(places.items()):
            inside = here not in {low, high} and left.slope > 0 > right.slope
            if inside and self._peak(low, high) > self.top.value:
                starts.append(max(left.point, right.point, key=lambda point: point.value))
        for start in sorted(starts, key=lambda point: -point.value):
            known = [one.best for one in self.found if one.converged]
            climb = maximise(self.objective, start, self.bounds, self.free, self.progress, known)
            if climb.best.value > self.top.value and not climb.converged:
                climb = maximise(self.objective, climb.best, self.bounds, self.free, self.progress)
            self.found.append(climb)

    def _peak(self, low: float, high: float) -> float:
        """Estimate of the highest value of the profile between two values, on the high side."""
        left, right, width = self._seen[low], self._seen[high], np.log(high / low)
        t = np.linspace(0, 1, 33)
        cubic = (
            left.point.value * (1 + 2 * t) * (1 - t) ** 2
            + right.point.value * t**2 * (3 - 2 * t)
            + left.slope * width * t * (1 - t) ** 2
            - right.slope * width * t**2 * (1 - t)
        )
        peak = float(cubic.max())
        return peak + WITHIN + SHARE * (peak - min(left.point.value, right.point.value))
