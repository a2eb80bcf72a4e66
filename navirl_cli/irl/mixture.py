"""The posterior of scatters, mean and people together, by places of the scatters."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, ByContent, FloatArray
from navirl_cli.irl.nodes import scattered
from navirl_cli.irl.restricted import LEAST, MOST, Restricted, climbed
from navirl_cli.irl.spread import Posterior, Spread

#: Pairs of places of the scatters by round, and the effective number of places at which no further round is needed.
PLACES, ENOUGH = (60, 120, 120, 120), 60.0
#: A round with a smaller effective number only shows roughly where the next one has to look: its weights are flattened.
ROUGH = 25.0
#: Standard deviation of the first round's places, as a share of the root of a scatter, and the least scatter for it.
#: Later rounds are wider than the distribution that the last one found.
FIRST_WIDTH, FIRST_LEAST, WIDER = 0.2, 0.05, 1.1
#: Newton's steps to the best mean at given scatters, and the step that needs no other, in standard errors.
MEAN_STEPS, SMALL_STEP = 4, 0.02
#: Least share of the information of a mean that people's paths must leave; what is less is noise of the nodes.
LEAST_INFORMATION = 1e-3
#: Fall of the log-likelihood at the end of a 95 % interval, nats: half the quantile of chi-squared.
FALL: Final = 1.920729


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

    @staticmethod
    def of(objective: Restricted, start: Spread) -> "Mixture":
        """By importance sampling of the scatters, in rounds around what the last one found.

        The places are even in the roots of the scatters, by which their distribution is nearly normal where it reaches
        to zero.

        Args:
            objective: The restricted likelihood.
            start: Where the first round looks.
        """
        center = np.sqrt(start.scatter)
        covariance = np.diag((FIRST_WIDTH * np.sqrt(np.maximum(start.scatter, FIRST_LEAST))) ** 2)
        for number, pairs in enumerate(PLACES):
            roots, density = scattered(Posterior(center, covariance, 0.0, np.nan, 0), pairs, number)
            inside = ((roots > np.sqrt(LEAST)) & (roots < np.sqrt(MOST))).all(axis=1)
            roots, density = roots[inside], density[inside]
            places = [_best_mean(objective, Spread(start.mean, one**2)) for one in roots]
            # From a density of the logarithms of the scatters to one of their roots.
            logs = np.array([one.value for one in places]) - np.log(roots).sum(axis=1) - density
            weight = np.exp(logs - logs.max())
            effective = float(weight.sum() ** 2 / (weight**2).sum())
            if effective > ENOUGH and number > 0:
                break
            flat = np.sqrt(weight) if effective < ROUGH else weight
            center = flat @ roots / flat.sum()
            away = roots - center
            covariance = WIDER**2 * (away * flat[:, None]).T @ away / flat.sum() + LEAST**2 * np.eye(len(center))
        return Mixture._over(objective, [one for one, w in zip(places, weight, strict=True) if w > 0], weight)

    @staticmethod
    def _over(objective: Restricted, places: list["_Place"], weight: FloatArray) -> "Mixture":
        """Over places with weights, of which those that are zero have no place."""
        weight = weight[weight > 0] / weight.sum()
        means, within = [], []
        for one in places:
            own, covariance, _ = objective.people.moments(one.spread)
            carried = covariance / one.spread.scatter**2
            means.append(own)
            within.append(covariance + carried @ one.covariance @ np.swapaxes(carried, 1, 2))
        person_mean = np.einsum("h,hnv->nv", weight, np.array(means))
        away = np.array(means) - person_mean
        between = np.einsum("h,hni,hnj->nij", weight, away, away)
        return Mixture(
            weight,
            np.array([one.spread.scatter for one in places]),
            np.array([one.spread.mean for one in places]),
            np.array([one.covariance for one in places]),
            person_mean,
            np.einsum("h,hnij->nij", weight, np.array(within)) + between,
        )

    @property
    def effective(self) -> float:
        """Effective number of places (Kish)."""
        return 1.0 / float((self.weight**2).sum())

    @property
    def spread(self) -> Spread:
        """The mean, and the root of the mean square of each scatter."""
        return Spread(self.typical()[0], np.sqrt(self.weight @ self.scatter**2))

    @property
    def middle(self) -> Spread:
        """The mean, and the medians of the scatters."""
        numbers = range(self.scatter.shape[1])
        return Spread(self.typical()[0], np.array([self.scatter_quantile(j, 0.5) for j in numbers]))

    def away(self, other: "Mixture") -> float:
        """Largest difference from another of the mean of a variable or a scatter, in this one's standard deviations."""
        mean, covariance = self.typical()
        scatter = self.weight @ self.scatter
        error = np.sqrt(self.weight @ (self.scatter - scatter) ** 2)
        moved = np.abs(mean - other.typical()[0]) / np.sqrt(np.diag(covariance))
        return float(np.maximum(moved, np.abs(scatter - other.weight @ other.scatter) / error).max())

    def errors(self, noise: FloatArray) -> FloatArray:
        """(2v,) errors of the means and of the logarithms of the scatters, in their standard deviations.

        Args:
            noise: (2v, 2v) covariance of the error in the slope of the log-likelihood, by the same.
        """
        v = self.mean.shape[1]
        x = np.concatenate([self.mean, np.log(self.scatter)], axis=1)
        away = x - self.weight @ x
        covariance = (away * self.weight[:, None]).T @ away
        covariance[:v, :v] += np.einsum("h,hij->ij", self.weight, self.covariance)
        squared = np.diag(covariance @ noise @ covariance) / np.diag(covariance)
        return np.asarray(np.sqrt(squared))

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
class _Place:
    """Scatters with their best mean, its (v, v) covariance, and the restricted log-likelihood; -inf without a best."""

    spread: Spread
    covariance: FloatArray
    value: float


def _best_mean(objective: Restricted, start: Spread) -> _Place:
    """The place of scatters: Newton's steps to the best mean, of which Gaussian likelihoods need one."""
    spread, unit = start, np.outer(start.scatter, start.scatter)
    for _ in range(MEAN_STEPS):
        own, covariance, _ = objective.people.moments(spread)
        slope = objective.slope(own, spread)
        values, basis = np.linalg.eigh(objective.information(covariance, spread) * unit)
        if values[0] < LEAST_INFORMATION * len(own):
            return _Place(spread, np.zeros_like(unit), -np.inf)
        error = (basis / values) @ basis.T * unit
        step = error @ slope
        spread = Spread(spread.mean + step, spread.scatter)
        if step @ slope < SMALL_STEP**2:
            break
    return _Place(spread, error, objective.value(spread))


def excluded(objective: Restricted, start: Spread) -> BoolArray:
    """(v,) whether the restricted likelihood excludes that a scatter is zero, at 5 %."""
    v = len(start.mean)
    plain = replace(objective, jacobian=False)
    top = climbed(plain, start)
    found = np.zeros(v, dtype=bool)
    for j in range(v):
        x = top.x
        x[v + j] = np.log(LEAST)
        found[j] = plain.value(top) - plain.value(climbed(plain, Spread.at(x), fixed=v + j)) > FALL
    return found
