"""Random effects by empirical Bayes: people are scattered normally, and each is known by a likelihood.

y_i ~ N(m, diag(s^2)) for person i, and L_i(y_i) is the likelihood of what this person showed. Under given m and s each
person's posterior has a mean and a covariance. They come from the mode (Laplace) and, in the end, from importance
sampling around it. A Gaussian factor with the same posterior mean and covariance stands for L_i; then the marginal
likelihood of m and s has a closed form. It has the right slope wherever the moments are right (Fisher's identity), so
that repeating both steps leads to the maximum of the marginal likelihood. Scatters are estimated by restricted
likelihood (Patterson and Thompson 1971, Biometrika 58:545), which takes into account that m is estimated too.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from navirl_cli.arrays import BoolArray, ByContent, FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.newton import Point, maximise
from navirl_cli.parallel import map_in_order

#: A scatter (standard deviation of a logarithm) is weakly held by half a normal distribution of this width: that most
#: people differ by more than a factor of ten in a parameter is not expected.
WIDTH = 0.5
#: Bounds of a scatter, and where the search starts. A scatter at the lower one counts as zero.
LEAST, MOST, FIRST = 0.01, 3.0, 0.2
#: Nodes: pairs on either side of a person's mode, of all people together, and the least and largest number of a person.
#: Degrees of freedom of their distribution, whose tails are heavier than those of any posterior under a normal scatter.
PAIRS, FEWEST_PAIRS, MOST_PAIRS, FREEDOM = 600, 24, 128, 6.0
#: Largest numbers of rounds with modes, of draws of nodes, and of rounds with the same nodes.
MODE_ROUNDS, DRAWS, NODE_ROUNDS = 8, 5, 12
#: Largest move of a round: of the mean in scatters, of the logarithm of a scatter. Farther away the Gaussian stand-ins
#: say nothing about the likelihoods.
REACH = 1.0, 0.7
#: A round moves the spread by less than so many standard errors at the end of the modes, and with the same nodes.
SMALL, SMALLEST = 0.2, 0.02
#: Nodes are drawn again where, for a person, fewer than this share of them count.
WORN = 0.25
#: Even numbers keep away from 0 and 1 by this.
TINY = 1e-6
#: Pairs of places of the scatters, and the least curvature assumed for their distribution.
PLACES, FLATTEST = 400, 0.5
#: Least curvature of a posterior at its mode, as a share of that of the prior.
WIDEST = 0.3
#: Fall of the log-likelihood at the end of a 95 % interval, nats (half the quantile of chi-squared), and the tolerance
#: of the logarithm of an end. Difference of logarithms for a derivative.
FALL, END, DELTA = 1.920729, 2e-3, 1e-4


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


@dataclass(frozen=True, eq=False)
class Restricted:
    """The restricted log-likelihood of mean and log scatters, with the weak prior of the scatters."""

    factors: Factors
    width: float = WIDTH
    #: As a density of the logarithms of the scatters, or of the scatters.
    jacobian: bool = True

    def value(self, spread: Spread) -> float:
        """The value alone."""
        _, _, logs = self.factors.moments(spread)
        lost = 0.5 * float(np.linalg.slogdet(self.information_of_mean(spread))[1])
        return float(logs.sum()) - lost + self._prior(spread)

    def _prior(self, spread: Spread) -> float:
        """Log density of the scatters, up to a constant."""
        held = -0.5 * float(((spread.scatter / self.width) ** 2).sum())
        return held + (float(np.log(spread.scatter).sum()) if self.jacobian else 0.0)

    def information_of_mean(self, spread: Spread) -> FloatArray:
        """(v, v) observed information of the mean at given scatters."""
        _, covariance, _ = self.factors.moments(spread)
        precision = 1.0 / spread.scatter**2
        found: FloatArray = len(covariance) * np.diag(precision) - np.outer(precision, precision) * covariance.sum(
            axis=0
        )
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
        return Point(
            x,
            value - lost + self._prior(spread),
            gradient - slope,
            hessian - 0.5 * (bend + bend.T),
        )

    def _marginal(self, spread: Spread) -> tuple[float, FloatArray, FloatArray]:
        """The marginal log-likelihood with its derivatives, by the identities of Fisher and Louis (1982)."""
        mean, covariance, logs = self.factors.moments(spread)
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
        information = self.information_of_mean(spread)
        _, covariance, _ = self.factors.moments(spread)
        gained = np.einsum("nij,njk->nik", covariance, self.factors.a)  # minus what the mean leaves of a shift of it
        variance = np.linalg.inv(information)
        freed = np.einsum("nij,jk,nik->i", gained, variance, gained) / spread.scatter**2
        return 0.5 * float(np.linalg.slogdet(information)[1]), np.concatenate([np.zeros(v), -freed])


@dataclass(frozen=True, eq=False)
class RandomEffects(ByContent):
    """How people are scattered, and each of them."""

    #: Where the search ended.
    spread: Spread
    #: Places of the scatters, with weights: together with the factors the posterior of all that is unknown.
    mixture: "Mixture"
    #: The people under the spread at which the search ended.
    people: tuple[Posterior, ...]
    #: (r, v) means and (r,) marginal log-likelihoods by round.
    path: FloatArray
    path_log_likelihood: FloatArray
    converged: bool

    @property
    def log_likelihood(self) -> float:
        """Marginal log-likelihood of all people, nats."""
        return sum(one.evidence for one in self.people)


def random_effects(
    people: Sequence[Likely],
    start: FloatArray,
    *,
    width: float = WIDTH,
    executor: Executor | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> RandomEffects:
    """Estimate mean and scatter of people, and each person.

    Args:
        people: Their log-likelihoods; at least two.
        start: (v,) where the search starts.
        width: Of the weak prior of the scatters.
        executor: Where to compute; by default local processes.
        progress: Called with the number of rounds and the marginal log-likelihood.
    """
    search = _Search(people, Spread(start, np.full(len(start), FIRST)), width, executor, progress)
    search.by_modes()
    search.by_nodes()
    return search.result()


@dataclass(eq=False)
class _Search:
    """Rounds of posteriors under a spread, and of the best spread for their factors."""

    people: Sequence[Likely]
    spread: Spread
    width: float
    executor: Executor | None
    progress: Callable[[int, float], None] | None
    converged: bool = False

    def __post_init__(self) -> None:
        self.modes = [self.spread.mean for _ in self.people]
        self.posteriors: list[Posterior] = []
        self.places: list[tuple[FloatArray, float]] = []

    def by_modes(self) -> None:
        """Rounds with Laplace's approximation, to come near."""
        for _ in range(MODE_ROUNDS):
            if self._round(self._laplace()) < SMALL:
                break

    def by_nodes(self) -> None:
        """Rounds with importance sampling."""
        pairs = min(max(PAIRS // len(self.people), FEWEST_PAIRS), MOST_PAIRS)
        around, self.around = self._laplace(), self.spread
        for _ in range(DRAWS):
            jobs = [(*one, self.around, pairs, k) for k, one in enumerate(zip(self.people, around, strict=True))]
            nodes = list(map_in_order(_drawn, jobs, self.executor))
            first = 0.0
            for _ in range(NODE_ROUNDS):
                under = self.spread
                moved = self._round([one.under(under) for one in nodes])
                first = first or moved
                fresh = min(one.effective for one in self.posteriors) > WORN * 2 * pairs
                if moved < SMALLEST or not fresh:
                    break
            self.converged = fresh and max(first, moved) < SMALL
            around, self.around = (self.posteriors, under) if fresh else (self._laplace(), self.spread)
            if self.converged:
                break

    def _round(self, posteriors: Sequence[Posterior]) -> float:
        """Take the best spread for posteriors; how far it moved, in standard errors."""
        self.posteriors = list(posteriors)
        self.factors = Factors.of(posteriors, self.spread)
        objective = Restricted(self.factors, self.width)
        top = best_spread(objective, self.spread, reach=REACH)
        values, basis = np.linalg.eigh(-top.hessian)
        errors = np.sqrt((basis**2 / np.maximum(values, FLATTEST)).sum(axis=1))
        moved = float(np.abs((top.x - self.spread.x) / errors).max())
        self.spread = Spread.at(top.x)
        self.places.append((self.spread.mean, sum(one.evidence for one in posteriors)))
        if self.progress is not None:
            self.progress(len(self.places), self.places[-1][1])
        return moved

    def _laplace(self) -> list[Posterior]:
        found = [laplace(one, self.spread, mode) for one, mode in zip(self.people, self.modes, strict=True)]
        self.modes = [one.mean for one in found]
        return found

    def result(self) -> RandomEffects:
        """All that was found."""
        return RandomEffects(
            spread=self.spread,
            mixture=Mixture.of(Restricted(self.factors, self.width), self.spread),
            people=tuple(self.posteriors),
            path=np.array([place for place, _ in self.places]),
            path_log_likelihood=np.array([value for _, value in self.places]),
            converged=self.converged,
        )


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


def _drawn(job: tuple[Likely, Posterior, Spread, int, int]) -> Nodes:
    """Nodes around a mode; importable by name, to run in another process."""
    return draw(*job)


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
