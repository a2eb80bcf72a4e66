"""How people are scattered, and what is known of each: normal distributions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray


@dataclass(frozen=True, eq=False)
class Spread(ByContent):
    """How people are scattered: (v,) mean and standard deviation of y."""

    mean: FloatArray
    scatter: FloatArray

    @property
    def x(self) -> FloatArray:
        """(2v,) mean and logarithm of the scatter."""
        return np.concatenate([self.mean, np.log(self.scatter)])

    @staticmethod
    def at(x: FloatArray) -> "Spread":
        """From (2v,) x."""
        v = len(x) // 2
        return Spread(x[:v], np.exp(x[v:]))

    def wider(self, times: float) -> "Spread":
        """With so many times the scatter."""
        return Spread(self.mean, times * self.scatter)

    def near(self, other: "Spread", reach: tuple[float, float]) -> "Spread":
        """As near as possible to this one, within so many scatters and a difference of their logarithms of another."""
        away = reach[0] * other.scatter
        mean = np.clip(self.mean, other.mean - away, other.mean + away)
        return Spread(mean, other.scatter * np.exp(np.clip(np.log(self.scatter / other.scatter), -reach[1], reach[1])))

    def log_density(self, y: FloatArray) -> FloatArray:
        """(...) log density at (..., v) y."""
        away = (y - self.mean) / self.scatter
        found: FloatArray = -0.5 * (away**2).sum(axis=-1) - np.log(self.scatter * np.sqrt(2 * np.pi)).sum()
        return found


@dataclass(frozen=True, eq=False)
class Posterior(ByContent):
    """What is known of one person under a spread."""

    #: (v,) and (v, v) of y.
    mean: FloatArray
    covariance: FloatArray
    #: log of the integral of likelihood times density, nats.
    evidence: float
    #: Effective number of the drawn nodes (Kish), and their number.
    effective: float
    drawn: int


class Known(Protocol):
    """People of whom it is known what they are like under any spread."""

    def moments(self, spread: Spread) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, v) posterior means, (n, v, v) covariances, and (n,) log integrals of likelihood times density."""


@dataclass(frozen=True, eq=False)
class Factors:
    """Gaussian stand-ins for the people's likelihoods: exp(-y.A y/2 + b.y)."""

    #: (n, v, v) positive semidefinite, and (n, v).
    a: FloatArray
    b: FloatArray

    @staticmethod
    def of(posteriors: Sequence[Posterior], spread: Spread) -> "Factors":
        """Those with the same posterior means and covariances under a spread."""
        size = spread.scatter
        a = []
        for one in posteriors:
            # In units of the scatter the prior has precision 1: what exceeds it is the person's own.
            values, basis = np.linalg.eigh(one.covariance / np.outer(size, size))
            own = np.maximum(1.0 / np.maximum(values, 1e-12) - 1.0, 0.0)
            a.append((basis * own) @ basis.T / np.outer(size, size))
        means = np.array([one.mean for one in posteriors])
        stacked = np.array(a)
        b = np.einsum("nij,nj->ni", stacked, means) + (means - spread.mean) / size**2
        return Factors(stacked, b)

    def moments(self, spread: Spread) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, v) posterior means, (n, v, v) covariances, and (n,) log integrals."""
        precision = 1.0 / spread.scatter**2
        both = self.a + np.diag(precision)
        covariance = np.asarray(np.linalg.inv(both), dtype=float)
        pull = self.b + precision * spread.mean
        mean: FloatArray = np.einsum("nij,nj->ni", covariance, pull)
        logs: FloatArray = 0.5 * (mean * pull).sum(axis=1) - 0.5 * float(precision @ spread.mean**2)
        logs = logs - 0.5 * np.linalg.slogdet(both)[1] - np.log(spread.scatter).sum()
        return mean, covariance, logs
