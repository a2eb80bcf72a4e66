"""People by nodes: what is known of each under any spread, by importance sampling, all people at once."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.irl.spread import Factors, Posterior, Spread

#: A covariance corrected by the Gaussian stand-in is taken where its least variance is above this share of the smaller
#: one of the two uncorrected ones.
DEFINITE = 0.3
#: Least sum of weights: below it all nodes are too far away to say anything, and so they are with the stand-in.
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Shared:
    """Places with the likelihoods of all people whose paths one policy explains."""

    #: (k,) numbers of the people.
    members: IntArray
    #: (d, v) places, (k, d) log-likelihoods there, and (d,) log density from which the places were drawn.
    y: FloatArray
    value: FloatArray
    density: FloatArray


@dataclass(frozen=True, eq=False)
class Sampled:
    """People's likelihoods at places that do not depend on the spread.

    The error that the same places make with a Gaussian stand-in, whose moments are known, is subtracted (control
    variates). A Gaussian likelihood so has exact results, and a scatter much narrower than the nodes' distances does no
    harm: there the two errors are the same.
    """

    #: Every person is in one of them.
    blocks: tuple[Shared, ...]
    #: Gaussian stand-ins for the likelihoods.
    factors: Factors
    #: Scatter below which too few nodes are near each other: the errors of the stand-ins are those at this scatter, and
    #: their influence falls with the prior's variance.
    least: float | FloatArray = 0.0

    def moments(self, spread: Spread) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, v) posterior means, (n, v, v) covariances, and (n,) log integrals."""
        known_mean, known, known_log = self.factors.moments(spread)
        (n, v), asked = known_mean.shape, spread
        spread = Spread(asked.mean, np.maximum(asked.scatter, self.least))
        scatter, smaller = spread.scatter, (asked.scatter / spread.scatter) ** 2
        mean, covariance, log = np.empty((2, n, v)), np.empty((2, n, v, v)), np.empty((2, n))
        for block, weight, top, prior, high, unit in self._under(spread):
            # All moments are one product of matrices: the prior is the same for all members.
            square = (unit[:, :, None] * unit[:, None]).reshape(-1, v * v)
            powers = np.concatenate([np.ones((len(unit), 1)), unit, square], axis=1)
            sums = (weight.reshape(-1, len(unit)) @ (prior[:, None] * powers)).reshape(*weight.shape[:2], -1)
            total = np.maximum(sums[:, :, 0], TINY)
            first = sums[:, :, 1 : 1 + v] / total[:, :, None]
            second = sums[:, :, 1 + v :].reshape(*first.shape, v) / total[:, :, None, None]
            mean[:, block.members] = scatter * first
            covariance[:, block.members] = (second - first[..., None] * first[..., None, :]) * np.outer(
                scatter, scatter
            )
            log[:, block.members] = top + high + np.log(total / len(unit))
        better = (covariance[0] - covariance[1]) * np.outer(smaller, smaller) + known
        least = np.minimum(*(np.linalg.eigvalsh(one)[:, 0] for one in (covariance[0], known)))
        definite = np.linalg.eigvalsh(better)[:, 0] > DEFINITE * least
        return (
            (mean[0] - mean[1]) * smaller + known_mean,
            np.where(definite[:, None, None], better, known),
            log[0] - log[1] + known_log,
        )

    def posteriors(self, spread: Spread) -> list[Posterior]:
        """What is known of each person, with the effective number of nodes (Kish) and their number."""
        numbers = np.empty((2, len(self.factors.b)))
        for block, weight, _, prior, _, _ in self._under(spread):
            share = _shares(weight, prior)[0]
            numbers[:, block.members] = np.array([1.0 / (share**2).sum(axis=1), np.full(len(share), len(prior))])
        return [
            Posterior(mean, covariance, float(log), float(effective), int(drawn))
            for mean, covariance, log, effective, drawn in zip(*self.moments(spread), *numbers, strict=True)
        ]

    def noise(self, spread: Spread) -> FloatArray:
        """(2v, 2v) covariance of the error that the nodes make in the slope of the marginal log-likelihood.

        The slope is by the mean and the logarithms of the scatters. The error is that of ratios of sums over
        independent nodes, to first order, and too large rather than too small: the nodes are spread evenly.
        """
        v = len(spread.mean)
        total = np.zeros((2 * v, 2 * v))
        for _, weight, _, prior, _, unit in self._under(spread):
            share = _shares(weight, prior)
            slope = np.concatenate([unit / spread.scatter, unit**2 - 1.0], axis=1)
            # A node's part is the same in the slopes of all members, whose errors are therefore added first.
            parts = share.sum(axis=1)[:, :, None] * slope - np.swapaxes(share, 1, 2) @ (share @ slope)
            total += (parts[0] - parts[1]).T @ (parts[0] - parts[1])
        return total

    def _under(self, spread: Spread) -> Iterator[tuple[Shared, FloatArray, FloatArray, FloatArray, float, FloatArray]]:
        """By block: :attr:`_weights`, prior and its logarithm at the largest, and (d, v) places in scatters."""
        for block, (weight, top) in zip(self.blocks, self._weights, strict=True):
            logs = spread.log_density(block.y)
            high = float(logs.max())
            yield block, weight, top, np.exp(logs - high), high, (block.y - spread.mean) / spread.scatter

    @cached_property
    def _weights(self) -> list[tuple[FloatArray, FloatArray]]:
        """By block: (2, k, d) likelihoods and stand-ins over density, in units of the largest; (2, k) its logarithm."""
        found = []
        for block in self.blocks:
            a, b = self.factors.a[block.members], self.factors.b[block.members]
            standing = ((b[:, None] - 0.5 * np.matmul(block.y, a)) * block.y).sum(axis=2)
            logs = np.array([block.value, standing]) - block.density
            top = logs.max(axis=2)
            found.append((np.exp(logs - top[:, :, None]), top))
        return found


def _shares(weight: FloatArray, prior: FloatArray) -> FloatArray:
    """(2, k, d) shares of the nodes in a person's posterior and in the stand-in's."""
    both = weight * prior
    found: FloatArray = both / np.maximum(both.sum(axis=2, keepdims=True), TINY)
    return found
