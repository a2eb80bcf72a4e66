"""The posterior of scatters, mean and people together, by places of the scatters."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import BoolArray, ByContent, FloatArray
from navirl_cli.irl.nodes import scattered
from navirl_cli.irl.restricted import LEAST, Restricted, best_spread
from navirl_cli.irl.spread import Posterior, Spread

#: Pairs of places of the scatters, and the least curvature assumed for their distribution.
PLACES, FLATTEST = 200, 0.5
#: Fall of the log-likelihood at the end of a 95 % interval, nats: half the quantile of chi-squared.
FALL = 1.920729


@dataclass(frozen=True, eq=False)
class Mixture(ByContent):
    """The posterior of scatters, mean and people: at every place of the scatters the others are normal."""

    #: (h,) and (h, v).
    weight: FloatArray
    scatter: FloatArray
    #: (h, v) and (h, v, v).
    mean: FloatArray
    covariance: FloatArray
    #: (n, v) and (n, v, v) of the people, over all places.
    person_mean: FloatArray
    person_covariance: FloatArray
    #: (v,) whether a scatter of zero is excluded, by the restricted likelihood.
    differ: BoolArray

    @staticmethod
    def of(objective: Restricted, best: Spread) -> "Mixture":
        """By importance sampling of the scatters around the maximum."""
        v = len(best.mean)
        surface = _Scatters(objective, best)
        top = objective(best.x)
        # What is left of the curvature when the mean follows the scatters.
        block = -top.hessian
        curvature = block[v:, v:] - block[v:, :v] @ np.linalg.solve(block[:v, :v], block[:v, v:])
        values, basis = np.linalg.eigh(curvature)
        covariance = (basis / np.maximum(values, FLATTEST)) @ basis.T
        around = Posterior(np.log(best.scatter), covariance, 0.0, np.nan, 0)
        y, density = scattered(around, PLACES, 0)
        logs = np.array([surface.value(one) for one in y]) - density
        weight = np.exp(logs - logs.max())
        places = [surface.at(one) for one in y]
        mean, known = np.array([one.mean for one in places]), []
        errors = np.array([np.linalg.inv(objective.information_of_mean(one)) for one in places])
        weight = weight / weight.sum()
        for one, error in zip(places, errors, strict=True):
            own, within, _ = objective.factors.moments(one)
            carried = within / one.scatter**2
            known.append((own, within + carried @ error @ np.swapaxes(carried, 1, 2)))
        means, within = (np.array(part) for part in zip(*known, strict=True))
        person_mean = np.einsum("h,hnv->nv", weight, means)
        away = means - person_mean
        total = np.einsum("h,hnij->nij", weight, within) + np.einsum("h,hni,hnj->nij", weight, away, away)
        return Mixture(weight, np.exp(y), mean, errors, person_mean, total, _differ(objective, best))

    def typical(self) -> tuple[FloatArray, FloatArray]:
        """(v,) mean over people, and its (v, v) covariance."""
        mean = self.weight @ self.mean
        away = self.mean - mean
        return mean, np.einsum("h,hij->ij", self.weight, self.covariance) + (away * self.weight[:, None]).T @ away

    def interval(self, j: int, level: float) -> tuple[float, float]:
        """The interval of the mean of variable j."""
        from scipy.special import ndtr

        errors = np.sqrt(self.covariance[:, j, j])
        ends = []
        for share in ((1 - level) / 2, (1 + level) / 2):
            low, high = float((self.mean[:, j] - 40 * errors).min()), float((self.mean[:, j] + 40 * errors).max())
            for _ in range(60):
                middle = (low + high) / 2
                below = float(self.weight @ ndtr((middle - self.mean[:, j]) / errors)) < share
                low, high = (middle, high) if below else (low, middle)
            ends.append((low + high) / 2)
        return ends[0], ends[1]

    def scatter_quantile(self, j: int, share: float) -> float:
        """A quantile of scatter j."""
        order = np.argsort(self.scatter[:, j])
        reached = np.cumsum(self.weight[order]) - 0.5 * self.weight[order]
        return float(np.exp(np.interp(share, reached, np.log(self.scatter[order, j]))))


@dataclass(frozen=True, eq=False)
class _Scatters:
    """The restricted likelihood by the logarithms of the scatters, each with the best mean."""

    objective: Restricted
    best: Spread

    def at(self, y: FloatArray) -> Spread:
        """The scatters with their best mean, which solves a linear system."""
        spread = Spread(self.best.mean, np.exp(y))
        own, _, _ = self.objective.factors.moments(spread)
        slope = ((own - spread.mean) / spread.scatter**2).sum(axis=0)
        step = np.linalg.solve(self.objective.information_of_mean(spread), slope)
        return Spread(spread.mean + step, spread.scatter)

    def value(self, y: FloatArray) -> float:
        """Its logarithm."""
        return self.objective.value(self.at(y))


def _differ(objective: Restricted, best: Spread) -> BoolArray:
    """(v,) whether the restricted likelihood excludes that a scatter is zero, at 5 %."""
    v = len(best.mean)
    plain = Restricted(objective.factors, objective.width, jacobian=False)
    top = best_spread(plain, best).value
    found = np.zeros(v, dtype=bool)
    for j in range(v):
        x = best.x.copy()
        x[v + j] = np.log(LEAST)
        found[j] = top - best_spread(plain, Spread.at(x), fixed=v + j).value > FALL
    return found
