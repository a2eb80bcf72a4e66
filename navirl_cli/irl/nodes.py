"""What is known of one person under a spread: by the mode of the posterior (Laplace), and by importance sampling.

Nodes are drawn from Student's distribution around an approximation, and again around better ones. All of them count,
by the mixture of the densities. People who were in the same scenes share their nodes: one policy says how likely the
paths of each are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.newton import Effort, Point, maximise
from navirl_cli.irl.sampled import Sampled, Shared
from navirl_cli.irl.spread import Factors, Posterior, Spread

#: Pairs of nodes of a person in a draw, on either side of the mode. Degrees of freedom of their distribution, whose
#: tails are heavier than those of any posterior under a normal scatter.
PAIRS, FREEDOM = 64, 6.0
#: Even numbers keep away from 0 and 1 by this.
TINY = 1e-6
#: A mode is found where the next step is expected to gain less, nats.
NEAR = 1e-3
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


class Group(Protocol):
    """People of whom one evaluation gives all log-likelihoods."""

    @property
    def members(self) -> IntArray:
        """(k,) their numbers."""

    def values(self, y: FloatArray) -> FloatArray:
        """(k,) log-likelihoods at (v,) y."""


@dataclass(frozen=True, eq=False)
class Alone:
    """One person as a group."""

    person: Likely
    number: int = 0

    @property
    def members(self) -> IntArray:
        """(1,) the number."""
        return np.array([self.number])

    def values(self, y: FloatArray) -> FloatArray:
        """(1,) log-likelihood."""
        return np.array([self.person.value(y)])


@dataclass(frozen=True, eq=False)
class Nodes(ByContent):
    """Places with the log-likelihoods of a group."""

    #: (k,), (d, v) and (k, d).
    members: IntArray
    y: FloatArray
    value: FloatArray
    #: The approximations around which they were drawn, and how many from each.
    around: tuple[Posterior, ...]
    counts: tuple[int, ...]

    @property
    def density(self) -> FloatArray:
        """(d,) log density of a place, whichever approximation it was drawn around.

        So that a few draws around a bad approximation do no harm (Veach and Guibas 1995, Proc. SIGGRAPH, 419).
        """
        share = np.array(self.counts) / len(self.y)
        logs = np.array([_log_density(one, self.y) for one in self.around]) + np.log(share)[:, None]
        found: FloatArray = np.logaddexp.reduce(logs, axis=0)
        return found

    @staticmethod
    def together(some: Sequence["Nodes"]) -> "Nodes":
        """All nodes of one group."""
        return Nodes(
            some[0].members,
            np.concatenate([one.y for one in some]),
            np.concatenate([one.value for one in some], axis=1),
            tuple(around for one in some for around in one.around),
            tuple(count for one in some for count in one.counts),
        )


def sampled(groups: Sequence[Nodes], around: Sequence[Posterior], spread: Spread) -> Sampled:
    """All people by the nodes of their groups.

    Args:
        groups: Every person is in one.
        around: Approximations of everybody, for the Gaussian stand-ins.
        spread: Under which these hold.
    """
    blocks = tuple(Shared(one.members, one.y, one.value, one.density) for one in groups)
    return Sampled(blocks, Factors.of(around, spread))


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
    near = Effort(enough=NEAR)
    best = maximise(objective, first, person.bounds, np.ones(len(start), dtype=bool), effort=near).best
    size = spread.scatter
    values, basis = np.linalg.eigh(-best.hessian * np.outer(size, size))
    kept = np.maximum(values, WIDEST)  # the likelihood may be convex in a direction, the prior limits it
    covariance = (basis / kept) @ basis.T * np.outer(size, size)
    area = 0.5 * float(np.linalg.slogdet(2 * np.pi * covariance)[1])
    return Posterior(best.x, covariance, best.value + area, np.nan, 0)


def draw(group: Group, around: Posterior, pairs: int = PAIRS, number: int = 0) -> Nodes:
    """Nodes around an approximation of a posterior, with the log-likelihoods of a group.

    Args:
        group: The people.
        around: The approximation, for one of them.
        pairs: Of nodes.
        number: Of the draw, so that errors of several people or draws are independent.
    """
    y = scattered(around, pairs, number)[0]
    return Nodes(group.members, y, np.array([group.values(one) for one in y]).T, (around,), (len(y),))


def scattered(around: Posterior, pairs: int, number: int) -> tuple[FloatArray, FloatArray]:
    """(2 pairs, v) places of Student's distribution around a mode, and their (2 pairs,) log density.

    They are spread evenly by an additive recurrence, that of the generalised golden ratio (Roberts 2018), in opposite
    pairs.

    Args:
        around: Mean and covariance.
        pairs: How many.
        number: Seed of the recurrence's start.
    """
    from scipy.special import gammainccinv, ndtri

    v = len(around.mean)
    golden = 2.0
    for _ in range(60):
        golden = (1 + golden) ** (1 / (v + 2))
    shift = np.random.default_rng(number).random(v + 1)
    even = np.clip((shift + np.outer(np.arange(pairs), golden ** -np.arange(1.0, v + 2))) % 1.0, TINY, 1 - TINY)
    stretch = np.sqrt(FREEDOM / (2 * gammainccinv(FREEDOM / 2, even[:, -1])))
    normal = ndtri(even[:, :-1]) * stretch[:, None]
    y = around.mean + np.concatenate([normal, -normal]) @ np.linalg.cholesky(around.covariance).T
    return y, _log_density(around, y)


def _log_density(around: Posterior, y: FloatArray) -> FloatArray:
    """(d,) log density of Student's distribution around a mode at (d, v) y."""
    from scipy.special import gammaln

    v, root = len(around.mean), np.linalg.cholesky(around.covariance)
    unit = np.linalg.solve(root, (y - around.mean).T)
    constant = gammaln((FREEDOM + v) / 2) - gammaln(FREEDOM / 2) - 0.5 * v * np.log(FREEDOM * np.pi)
    constant -= np.log(np.diag(root)).sum()
    found: FloatArray = constant - 0.5 * (FREEDOM + v) * np.log1p((unit**2).sum(axis=0) / FREEDOM)
    return found
