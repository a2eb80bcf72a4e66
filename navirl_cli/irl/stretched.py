"""An objective by coordinates in which the ridges of a likelihood are nearly straight.

Few paths are explained as well by a person term of any strength, if its decay grows with the logarithm of the strength,
or for a wide term with its inverse. Newton's method follows such a curved ridge in short steps. The coordinates u are
linear near ordinary values, and logarithms where the ridge needs them:

    x = size sinh(u / size)               a parameter in which the reward is linear: a logarithm far from zero,
    x = size ln(1 + exp(u / size))        a positive one that is scanned, as a decay: a logarithm near zero.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.newton import Point
from navirl_cli.irl.objective import Objective

#: Size beyond which a parameter is followed by its logarithm, in units of its scale, and below which one that is
#: scanned is.
FAR, NEAR = 3.0, 0.5


@dataclass(frozen=True, eq=False)
class Stretched:
    """An objective by (k,) u in place of (k,) x, the parameters in units of their scales."""

    objective: Objective
    #: (k,) parameters that are scanned.
    scanned: NDArray[np.bool_]

    @staticmethod
    def of(objective: Objective) -> "Stretched":
        """The objective by u."""
        scanned = np.zeros(len(objective.scale), dtype=bool)
        scanned[[j for j, _ in objective.scans()]] = True
        return Stretched(objective, scanned)

    def __call__(self, u: FloatArray) -> Point:
        """Value, gradient and Hessian at (k,) u."""
        return self.point(self.objective(self.plain(u)), u)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """(k,) lower and upper u."""
        low, high = self.objective.bounds
        return self.stretched(low), self.stretched(high)

    def stretched(self, x: FloatArray) -> FloatArray:
        """(k,) u of (k,) x."""
        share = np.where(self.scanned, x / NEAR, 1.0)
        near = NEAR * (share + np.log(-np.expm1(-share)))
        u: FloatArray = np.where(self.scanned, near, FAR * np.arcsinh(x / FAR))
        return u

    def plain(self, u: FloatArray) -> FloatArray:
        """(k,) x of (k,) u; a bound is met exactly."""
        low, high = self.bounds
        near = NEAR * np.logaddexp(0.0, u / NEAR)
        x = np.where(self.scanned, near, FAR * np.sinh(np.where(self.scanned, 0.0, u / FAR)))
        x = np.where(u <= low, self.objective.bounds[0], x)
        inside: FloatArray = np.where(u >= high, self.objective.bounds[1], x)
        return inside

    def slopes(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(k,) first and second derivatives of x by u."""
        rest = np.exp(-np.where(self.scanned, x / NEAR, 0.0))
        first = np.where(self.scanned, 1 - rest, np.hypot(1.0, x / FAR))
        return first, np.where(self.scanned, first * rest / NEAR, x / FAR**2)

    def point(self, place: Point, u: FloatArray | None = None) -> Point:
        """The place by u, derivatives by the chain rule."""
        first, second = self.slopes(place.x)
        hessian = place.hessian * np.outer(first, first) + np.diag(place.gradient * second)
        return Point(self.stretched(place.x) if u is None else u, place.value, place.gradient * first, hessian)

    def place(self, point: Point) -> Point:
        """The place by x."""
        x = self.plain(point.x)
        first, second = self.slopes(x)
        gradient = point.gradient / first
        return Point(x, point.value, gradient, (point.hessian - np.diag(gradient * second)) / np.outer(first, first))
