"""Parameters of a reward by the logarithms of their magnitudes, on which people are scattered."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.likelihood import likelihood, log_likelihood, log_likelihoods
from navirl_cli.irl.newton import Point
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.series import InfinitePartitionError


@dataclass(frozen=True, eq=False)
class LogScale(ByContent):
    """y = log |theta| of the parameters in which people may differ; the others and all signs are those of a reward."""

    reward: Reward
    #: (k,) parameters in which people may differ; none of them is zero.
    varying: NDArray[np.bool_]

    @property
    def names(self) -> list[str]:
        """Names of the varying parameters."""
        return [p.name for p, one in zip(self.reward.parameters, self.varying, strict=True) if one]

    @property
    def signs(self) -> FloatArray:
        """(v,) signs of the varying parameters."""
        signs: FloatArray = np.sign(np.array(self.reward.theta)[self.varying])
        return signs

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """(v,) lower and upper bounds of y; infinite where a magnitude may be zero or has no bound."""
        ends = np.array([[p.lower, p.upper] for p in self.reward.parameters])[self.varying] * self.signs[:, None]
        with np.errstate(divide="ignore"):
            low, high = np.log(np.maximum(np.sort(ends, axis=1), 0.0)).T
        return low, high

    def of(self, reward: Reward) -> FloatArray:
        """(v,) y of a reward with the same terms and signs."""
        logs: FloatArray = np.log(np.abs(np.array(reward.theta)[self.varying]))
        return logs

    def values(self, y: FloatArray) -> FloatArray:
        """(..., v) values of the varying parameters at (..., v) y, in their units."""
        found: FloatArray = self.signs * np.exp(y)
        return found

    def at(self, y: FloatArray) -> Reward:
        """The reward at (v,) y within the bounds."""
        theta = np.array(self.reward.theta)
        low, high = np.array([[p.lower, p.upper] for p in self.reward.parameters]).T
        theta[self.varying] = self.values(y)
        return Reward(tuple(np.clip(theta, low, high).tolist()), self.reward.terms)


@dataclass(frozen=True, eq=False)
class Witness:
    """What the demonstrations of one person say: their log-likelihood, and a prior, by y."""

    name: str
    evidence: Evidence
    scale: LogScale
    #: Of the parameters in their units: this person's share of the regulariser.
    prior: Prior

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """(v,) lower and upper bounds of y."""
        return self.scale.bounds

    def __call__(self, y: FloatArray) -> Point:
        """Value, gradient and Hessian at (v,) y; -inf where there is no policy."""
        reward = self.scale.at(y)
        try:
            found = likelihood(self.evidence, reward)
        except InfinitePartitionError:
            return Point(y, -np.inf, np.zeros(len(y)), np.zeros((len(y), len(y))))
        theta, own = np.array(reward.theta), self.scale.varying
        # Chain rule: d theta / dy = theta, and the same for the second derivative.
        slope = ((found.gradient + self.prior.gradient(theta)) * theta)[own]
        bend = ((found.hessian - self.prior.precision) * np.outer(theta, theta))[np.ix_(own, own)]
        return Point(y, found.value + self.prior.log_density(theta), slope, bend + np.diag(slope))

    def value(self, y: FloatArray) -> float:
        """The value alone; -inf outside of the bounds."""
        low, high = self.bounds
        if (y < low).any() or (y > high).any():
            return -np.inf
        reward = self.scale.at(y)
        try:
            return log_likelihood(self.evidence, reward) + self.prior.log_density(np.array(reward.theta))
        except InfinitePartitionError:
            return -np.inf


@dataclass(frozen=True, eq=False)
class Company:
    """What the demonstrations of several people in the same scenes say: one policy a scene serves all."""

    #: (k,) numbers of the people, and of (demonstrations,) each the person, as a place among these; -1 for others.
    members: IntArray
    whose: IntArray
    #: Of these people.
    evidence: Evidence
    scale: LogScale
    #: Of each of them, as of a :class:`Witness`.
    prior: Prior

    def values(self, y: FloatArray) -> FloatArray:
        """(k,) log-likelihoods as of each :class:`Witness` alone."""
        low, high = self.scale.bounds
        if (y < low).any() or (y > high).any():
            return np.full(len(self.members), -np.inf)
        reward = self.scale.at(y)
        try:
            every = log_likelihoods(self.evidence, reward)
        except InfinitePartitionError:
            return np.full(len(self.members), -np.inf)
        own = np.bincount(self.whose + 1, every, minlength=len(self.members) + 1)[1:]
        return np.asarray(own + self.prior.log_density(np.array(reward.theta)), dtype=float)


def companies(evidence: Evidence, witnesses: Sequence[Witness]) -> list[Company]:
    """People by the scenes in which they demonstrated; all have the same scale and prior.

    Args:
        evidence: Of all of them.
        witnesses: Each of them.
    """
    together: dict[frozenset[int], list[int]] = {}
    for number, one in enumerate(witnesses):
        together.setdefault(frozenset(id(part.scene) for part in one.evidence.scenes), []).append(number)
    found = []
    for numbers in together.values():
        place = {witnesses[number].name: k for k, number in enumerate(numbers)}
        whose = np.array([place.get(name, -1) for name in evidence.participants])
        own = evidence.repeated((whose >= 0).astype(int))
        found.append(Company(np.array(numbers), whose, own, witnesses[0].scale, witnesses[0].prior))
    return found
