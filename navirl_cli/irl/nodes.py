"""What is known of one person under a spread: by the mode of the posterior (Laplace), and by importance sampling.

Nodes are drawn from Student's distribution around an approximation. What the same nodes get wrong with the Gaussian
stand-in for the likelihood, whose moments are known, is subtracted.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.newton import Point, maximise
from navirl_cli.irl.spread import Factors, Posterior, Spread

#: Largest number of pairs of nodes of a person, on either side of the mode. Degrees of freedom of their distribution,
#: whose tails are heavier than those of any posterior under a normal scatter.
MOST_PAIRS, FREEDOM = 64, 6.0
#: Even numbers keep away from 0 and 1 by this.
TINY = 1e-6
#: Least curvature of a posterior at its mode, as a share of that of the prior.
WIDEST = 0.3


class Likely(Protocol):
    """A person's log-likelihood."""

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """(v,) lower and upper ones."""

    def __call__(self, y: FloatArray) -> Point:
        """Value, gradient and Hessian at (v,) y."""

    def value(self, y: FloatArray) -> float:
        """The value alone."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Places around a person's mode, with the person's log-likelihood and the log density that they were drawn from."""

    #: (n, v), (n,), (n,).
    y: FloatArray
    value: FloatArray
    density: FloatArray
    #: The Gaussian stand-in for the likelihood at the mode.
    factor: Factors

    def under(self, spread: Spread) -> Posterior:
        """The posterior under a spread, by importance sampling.

        The error that the same nodes make with the Gaussian stand-in, whose moments are known, is subtracted (control
        variates), so that a Gaussian likelihood has exact results.
        """
        prior = spread.log_density(self.y) - self.density
        mean, covariance, evidence, effective = _moments(self.y, self.value + prior)
        standing = -0.5 * np.einsum("ni,ij,nj->n", self.y, self.factor.a[0], self.y) + self.y @ self.factor.b[0]
        drawn = _moments(self.y, standing + prior)
        known = tuple(one[0] for one in self.factor.moments(spread))
        better = covariance - drawn[1] + known[1]
        if np.linalg.eigvalsh(better)[0] > 0.5 * min(np.linalg.eigvalsh(one)[0] for one in (covariance, known[1])):
            mean, covariance = mean - drawn[0] + known[0], better
        return Posterior(mean, covariance, evidence - drawn[2] + float(known[2]), effective, len(self.y))


def _moments(y: FloatArray, logs: FloatArray) -> tuple[FloatArray, FloatArray, float, float]:
    """Mean and covariance of weighted places, log of the mean weight, and the effective number (Kish)."""
    top = float(logs.max())
    weight = np.exp(logs - top)
    share = weight / weight.sum()
    mean = share @ y
    away = y - mean
    covariance = (away * share[:, None]).T @ away
    return mean, covariance, top + float(np.log(weight.mean())), 1.0 / float((share**2).sum())


def laplace(person: Likely, spread: Spread, start: FloatArray) -> Posterior:
    """The posterior by its mode and the curvature there."""
    precision = 1.0 / spread.scatter**2

    def objective(y: FloatArray) -> Point:
        own = person(y)
        return Point(
            y,
            own.value + float(spread.log_density(y)),
            own.gradient - precision * (y - spread.mean),
            own.hessian - np.diag(precision),
        )

    low, high = person.bounds
    first = objective(np.clip(start, low, high))
    if not np.isfinite(first.value):
        raise RewardError("`pool`: expected a policy for every person at the pooled reward, found none for one of them")
    best = maximise(objective, first, person.bounds, np.ones(len(start), dtype=bool)).best
    size = spread.scatter
    values, basis = np.linalg.eigh(-best.hessian * np.outer(size, size))
    kept = np.maximum(values, WIDEST)  # the likelihood may be convex in a direction, the prior limits it
    covariance = (basis / kept) @ basis.T * np.outer(size, size)
    area = 0.5 * float(np.linalg.slogdet(2 * np.pi * covariance)[1])
    return Posterior(best.x, covariance, best.value + area, np.nan, 0)


def draw(person: Likely, around: Posterior, spread: Spread, pairs: int = MOST_PAIRS, number: int = 0) -> Nodes:
    """Nodes around a posterior, with the person's log-likelihood.

    Args:
        person: The log-likelihood.
        around: An approximation of the posterior under a spread.
        spread: That spread.
        pairs: Of nodes.
        number: Of the person, so that errors of several people are independent.
    """
    y, density = scattered(around, pairs, number)
    return Nodes(y, np.array([person.value(one) for one in y]), density, Factors.of([around], spread))


def scattered(around: Posterior, pairs: int, number: int) -> tuple[FloatArray, FloatArray]:
    """(2 pairs, v) places of Student's distribution around a mode, and their (2 pairs,) log density.

    They are spread evenly by an additive recurrence, that of the generalised golden ratio (Roberts 2018), in opposite
    pairs.

    Args:
        around: Mean and covariance.
        pairs: How many.
        number: Seed of the recurrence's start.
    """
    from scipy.special import gammainccinv, gammaln, ndtri

    v = len(around.mean)
    golden = 2.0
    for _ in range(60):
        golden = (1 + golden) ** (1 / (v + 2))
    shift = np.random.default_rng(number).random(v + 1)
    even = np.clip((shift + np.outer(np.arange(pairs), golden ** -np.arange(1.0, v + 2))) % 1.0, TINY, 1 - TINY)
    stretch = np.sqrt(FREEDOM / (2 * gammainccinv(FREEDOM / 2, even[:, -1])))
    normal = ndtri(even[:, :-1]) * stretch[:, None]
    unit = np.concatenate([normal, -normal])
    root = np.linalg.cholesky(around.covariance)
    constant = gammaln((FREEDOM + v) / 2) - gammaln(FREEDOM / 2) - 0.5 * v * np.log(FREEDOM * np.pi)
    constant -= np.log(np.diag(root)).sum()
    density: FloatArray = constant - 0.5 * (FREEDOM + v) * np.log1p((unit**2).sum(axis=1) / FREEDOM)
    return around.mean + unit @ root.T, density
