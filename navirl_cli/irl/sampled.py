"""People by nodes: what is known of each under any spread, by importance sampling, all people at once."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.spread import Factors, Posterior, Spread

#: A covariance corrected by the Gaussian stand-in is taken where its least variance is above this share of the smaller
#: one of the two uncorrected ones.
DEFINITE = 0.3


@dataclass(frozen=True, eq=False)
class Sampled:
    """People's likelihoods at places that do not depend on the spread.

    The error that the same places make with a Gaussian stand-in, whose moments are known, is subtracted (control
    variates). A Gaussian likelihood so has exact results, and a scatter much narrower than the nodes' distances does no
    harm: there the two errors are the same.
    """

    #: (n, d, v) places, (n, d) log-likelihoods there, and log densities from which the places were drawn.
    y: FloatArray
    value: FloatArray
    density: FloatArray
    #: Gaussian stand-ins for the likelihoods.
    factors: Factors

    def moments(self, spread: Spread) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(n, v) posterior means, (n, v, v) covariances, and (n,) log integrals."""
        return self._moments(spread)[:3]

    def posteriors(self, spread: Spread) -> list[Posterior]:
        """What is known of each person, with the effective number of nodes."""
        found = zip(*self._moments(spread), strict=True)
        return [
            Posterior(mean, covariance, float(log), float(effective), self.y.shape[1])
            for mean, covariance, log, effective in found
        ]

    def _moments(self, spread: Spread) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        prior = spread.log_density(self.y) - self.density
        mean, covariance, log, effective = _weighted(self.y, self.value + prior)
        drawn_mean, drawn, drawn_log, _ = _weighted(self.y, self._standing() + prior)
        known_mean, known, known_log = self.factors.moments(spread)
        better = covariance - drawn + known
        least = np.minimum(*(np.linalg.eigvalsh(one)[:, 0] for one in (covariance, known)))
        definite = np.linalg.eigvalsh(better)[:, 0] > DEFINITE * least
        return (
            mean - drawn_mean + known_mean,
            np.where(definite[:, None, None], better, known),
            log - drawn_log + known_log,
            effective,
        )

    def _standing(self) -> FloatArray:
        """(n, d) logarithms of the stand-ins."""
        bent = np.matmul(self.y, self.factors.a)
        found: FloatArray = ((self.factors.b[:, None] - 0.5 * bent) * self.y).sum(axis=2)
        return found


def _weighted(y: FloatArray, logs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """By person: mean and covariance of weighted places, log of the mean weight, and the effective number (Kish)."""
    top = logs.max(axis=1, keepdims=True)
    weight = np.exp(logs - top)
    total = weight.sum(axis=1, keepdims=True)
    share = weight / total
    mean = np.matmul(share[:, None], y)[:, 0]
    away = y - mean[:, None]
    covariance = np.matmul(np.swapaxes(away * share[:, :, None], 1, 2), away)
    return mean, covariance, top[:, 0] + np.log(total[:, 0] / y.shape[1]), 1.0 / (share**2).sum(axis=1)
