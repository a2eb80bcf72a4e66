"""The restricted likelihood of mean and scatter (Patterson and Thompson 1971, Biometrika 58:545).

It takes into account that the mean is estimated too: the plain likelihood finds people too much alike.
"""

from dataclasses import dataclass, replace

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.newton import Point, maximise
from navirl_cli.irl.spread import Factors, Known, Posterior, Spread

#: A scatter (standard deviation of a logarithm) is weakly held by half a normal distribution of this width: that most
#: people differ by more than a factor of three in a parameter is not expected. A mean is held by a normal distribution
#: so many times as wide around where the search starts: it stays finite where no path shows that it is above zero.
WIDTH, MEAN_TIMES = 0.5, 3.0
#: Bounds of a scatter. At the lower one it counts as zero.
LEAST, MOST = 0.01, 3.0
#: Largest move of a round: of the mean in scatters, of the logarithm of a scatter. Farther away the Gaussian stand-ins
#: say nothing about the likelihoods. Number of rounds.
REACH, ROUNDS = (1.0, 0.7), 5
#: Difference of logarithms for a derivative.
DELTA = 1e-4


@dataclass(frozen=True, eq=False)
class Restricted:
    """The restricted log-likelihood of mean and log scatters, with the weak priors of both.

    Value and information hold for all people whose moments are known, the derivatives for Gaussian likelihoods.
    """

    people: Known
    #: (v,) where means are expected.
    center: FloatArray
    width: float = WIDTH
    #: As a density of the logarithms of the scatters, or of the scatters.
    jacobian: bool = True

    def value(self, spread: Spread) -> float:
        """The value alone; -inf where the mean has no positive information."""
        _, covariance, logs = self.people.moments(spread)
        sign, size = np.linalg.slogdet(self.information(covariance, spread))
        return float(logs.sum()) - 0.5 * float(size) + self._prior(spread) if sign > 0 else -np.inf

    @property
    def firmness(self) -> float:
        """Precision with which a mean is held."""
        return (MEAN_TIMES * self.width) ** -2

    def slope(self, mean: FloatArray, spread: Spread) -> FloatArray:
        """(v,) gradient by the mean, by the people's (n, v) posterior means."""
        pull = ((mean - spread.mean) / spread.scatter**2).sum(axis=0)
        found: FloatArray = pull - self.firmness * (spread.mean - self.center)
        return found

    def _prior(self, spread: Spread) -> float:
        """Log density of mean and scatters, up to a constant."""
        held = -0.5 * float(((spread.scatter / self.width) ** 2).sum())
        held -= 0.5 * self.firmness * float(((spread.mean - self.center) ** 2).sum())
        return held + (float(np.log(spread.scatter).sum()) if self.jacobian else 0.0)

    def information(self, covariance: FloatArray, spread: Spread) -> FloatArray:
        """(v, v) observed information of the mean at given scatters, by the people's (n, v, v) covariances."""
        precision = 1.0 / spread.scatter**2
        lost = np.outer(precision, precision) * covariance.sum(axis=0)
        found: FloatArray = np.diag(len(covariance) * precision + self.firmness) - lost
        return found

    def __call__(self, x: FloatArray) -> Point:
        """Value, gradient and Hessian at (2v,) mean and log scatter."""
        spread = Spread.at(x)
        value, gradient, hessian = self._marginal(spread)
        v = len(spread.mean)
        lost, slope = self._lost(x)
        bend = np.zeros_like(hessian)
        for j in range(v, 2 * v):
            step = np.zeros(2 * v)
            step[j] = DELTA
            bend[v:, j] = (self._lost(x + step)[1] - self._lost(x - step)[1])[v:] / (2 * DELTA)
        squared = (spread.scatter / self.width) ** 2
        gradient[v:] += self.jacobian - squared
        hessian[v:, v:] -= np.diag(2 * squared)
        gradient[:v] -= self.firmness * (spread.mean - self.center)
        hessian[:v, :v] -= self.firmness * np.eye(v)
        return Point(
            x,
            value - lost + self._prior(spread),
            gradient - slope,
            hessian - 0.5 * (bend + bend.T),
        )

    def _marginal(self, spread: Spread) -> tuple[float, FloatArray, FloatArray]:
        """The marginal log-likelihood with its derivatives, by the identities of Fisher and Louis (1982)."""
        mean, covariance, logs = self.people.moments(spread)
        p = 1.0 / spread.scatter**2
        away, spreads = mean - spread.mean, np.einsum("njj->nj", covariance)
        scaled = covariance * np.outer(p, p)
        squares = (away**2 + spreads) * p
        gradient = np.concatenate([(away * p).sum(axis=0), (squares - 1).sum(axis=0)])
        first = scaled.sum(axis=0) - np.diag(len(mean) * p)
        mixed = 2 * np.einsum("njk,nk->jk", scaled, away) - np.diag(2 * (away * p).sum(axis=0))
        last = np.einsum("njk->jk", 2 * covariance * scaled + 4 * scaled * away[:, :, None] * away[:, None, :])
        last = last - np.diag(2 * squares.sum(axis=0))
        return float(logs.sum()), gradient, np.block([[first, mixed], [mixed.T, last]])

    def _lost(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Half the log determinant of the mean's information, and its (2v,) gradient."""
        spread = Spread.at(x)
        v = len(spread.mean)
        _, covariance, _ = self.people.moments(spread)
        information = self.information(covariance, spread)
        # What a posterior mean does not follow of a shift of the mean over people.
        gained = np.eye(v) - covariance / spread.scatter**2
        variance = np.linalg.inv(information)
        freed = np.einsum("nij,jk,nik->i", gained, variance, gained) / spread.scatter**2
        return 0.5 * float(np.linalg.slogdet(information)[1]), np.concatenate([np.zeros(v), -freed])


def best_spread(
    objective: Restricted, start: Spread, fixed: int | None = None, reach: tuple[float, float] | None = None
) -> Point:
    """The maximum of the restricted likelihood.

    Args:
        objective: The restricted likelihood.
        start: Where the search starts.
        fixed: A variable that is held, by number.
        reach: How far the mean may move, in scatters, and the logarithm of a scatter; anywhere by default.
    """
    free = np.ones(len(start.x), dtype=bool)
    if fixed is not None:
        free[fixed] = False
    v = len(start.mean)
    wide = np.full(2 * v, np.inf)
    if reach is not None:
        wide = np.concatenate([reach[0] * start.scatter, np.full(v, reach[1])])
    ends = np.full(v, np.inf)
    low = np.maximum(start.x - wide, np.concatenate([-ends, np.full(v, np.log(LEAST))]))
    high = np.minimum(start.x + wide, np.concatenate([ends, np.full(v, np.log(MOST))]))
    return maximise(objective, objective(start.x), (low, high), free).best


def climbed(objective: Restricted, start: Spread, fixed: int | None = None) -> Spread:
    """About the maximum for people whose likelihoods are not Gaussian: rounds with Gaussian stand-ins.

    Args:
        objective: The restricted likelihood.
        start: Where the search starts.
        fixed: A variable that is held, by number.
    """
    best = start
    for _ in range(ROUNDS):
        mean, covariance, log = objective.people.moments(start)
        factors = Factors.of([Posterior(*one, np.nan, 0) for one in zip(mean, covariance, log, strict=True)], start)
        standing = replace(objective, people=factors)
        start = Spread.at(best_spread(standing, start, fixed, REACH).x)
        best = max(best, start, key=objective.value)
    return best
