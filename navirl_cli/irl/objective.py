"""The objective of a fit: log-likelihood plus log prior density, by parameters in units of their scales."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.likelihood import likelihood, value_and_gradient
from navirl_cli.irl.newton import Point
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError
from navirl_cli.irl.uncertainty import NO_INFORMATION


@dataclass(eq=False)
class Objective:
    """Log-likelihood plus log prior density; -inf where the partition function is infinite."""

    evidence: Evidence
    #: Gives the terms; its parameters are the first start.
    initial: Reward
    #: The prior including the regulariser, and the regulariser alone.
    prior: Prior
    regulariser: Prior
    #: Number of calls so far.
    evaluations: int = field(default=0, init=False)
    #: Scores by demonstration at every place where it was called.
    _scores: dict[bytes, FloatArray] = field(default_factory=dict, init=False)

    @staticmethod
    def of(evidence: Evidence, initial: Reward, l2: float, prior: Prior | None) -> "Objective":
        """The objective of a fit; arguments as of :func:`navirl_cli.irl.fit.fit`.

        Raises:
            RewardError: l2 is negative, or the prior is of other parameters.
        """
        regulariser = Prior.l2(initial.parameters, l2)
        if prior is None:
            return Objective(evidence, initial, regulariser, regulariser)
        if len(prior.shift) != len(initial.theta):
            names = ", ".join(parameter.name for parameter in initial.parameters)
            raise RewardError(f"`prior`: expected one of {names}, found one of {len(prior.shift)} parameters")
        regulariser = regulariser.where(~prior.known)
        return Objective(evidence, initial, regulariser + prior, regulariser)

    @property
    def scale(self) -> FloatArray:
        """(k,) scales of the parameters."""
        return np.array([parameter.scale for parameter in self.initial.parameters])

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """(k,) lower and upper ones."""
        low, high = (self.to_units([getattr(p, side) for p in self.initial.parameters]) for side in ("lower", "upper"))
        return low, high

    def to_units(self, theta: Sequence[float]) -> FloatArray:
        """(k,) parameters divided by their scales."""
        return np.asarray(theta, dtype=float) / self.scale

    def reward(self, x: FloatArray) -> Reward:
        """The reward at (k,) variables."""
        # Division and multiplication by the scale may cross a bound by a rounding error.
        theta = (
            min(max(value, p.lower), p.upper)
            for value, p in zip((x * self.scale).tolist(), self.initial.parameters, strict=True)
        )
        return Reward(tuple(theta), self.initial.terms)

    def __call__(self, x: FloatArray) -> Point:
        """Value, gradient and Hessian at (k,) variables."""
        self.evaluations += 1
        theta = x * self.scale
        try:
            found = likelihood(self.evidence, self.reward(x))
        except InfinitePartitionError:
            return Point(x, -np.inf, np.zeros_like(x), np.zeros((len(x), len(x))))
        self._scores[x.tobytes()] = found.scores
        return Point(
            x,
            found.value + self.prior.log_density(theta),
            (found.gradient + self.prior.gradient(theta)) * self.scale,
            (found.hessian - self.prior.precision) * np.outer(self.scale, self.scale),
        )

    def scores(self, x: FloatArray) -> FloatArray:
        """(demonstrations, k) gradients of the demonstrations' log-likelihoods, in parameters, where it was called."""
        return self._scores[x.tobytes()]

    def slope(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Value and gradient alone."""
        self.evaluations += 1
        theta = x * self.scale
        try:
            value, gradient = value_and_gradient(self.evidence, self.reward(x))
        except InfinitePartitionError:
            return -np.inf, np.zeros_like(x)
        return value + self.prior.log_density(theta), (gradient + self.prior.gradient(theta)) * self.scale

    def log_likelihood(self, x: FloatArray, value: float) -> float:
        """The log-likelihood in a value at (k,) variables."""
        return value - self.prior.log_density(x * self.scale)

    def information(self, point: Point) -> tuple[FloatArray, FloatArray]:
        """(k, k) observed information at a point, and the regulariser's part of it."""
        return -point.hessian, self.regulariser.precision * np.outer(self.scale, self.scale)

    def identified(self, point: Point) -> NDArray[np.bool_]:
        """(k,) parameters that change the value without the regulariser: their slope or a curvature is not zero.

        Mixed curvatures count, because at a_p = 0 only they identify sigma_p.
        """
        information, regulariser = self.information(point)
        slope = np.abs(point.gradient - self.regulariser.gradient(point.x * self.scale) * self.scale)
        curvature = np.abs(information - regulariser).max(axis=1)
        identified: NDArray[np.bool_] = (slope > NO_INFORMATION) | (curvature > NO_INFORMATION)
        return identified

    def scans(self) -> list[tuple[int, tuple[float, ...]]]:
        """Numbers of the parameters that enter non-linearly, each with the values to scan, in units of its scale."""
        return [
            (j, tuple(value / one.scale for value in one.scan))
            for j, one in enumerate(self.initial.parameters)
            if one.scan
        ]

    def scan_ends(self, first: Point) -> list[Point]:
        """The first place with a scanned parameter at the ends of its scan, where there is a policy."""
        ends = [
            self(np.where(np.arange(len(first.x)) == j, value, first.x))
            for j, values in self.scans()
            for value in (values[0], values[-1])
        ]
        return [point for point in ends if np.isfinite(point.value)]
