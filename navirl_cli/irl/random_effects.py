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

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.irl.mixture import FLATTEST, Mixture
from navirl_cli.irl.nodes import MOST_PAIRS, Likely, Nodes, draw, laplace
from navirl_cli.irl.restricted import WIDTH, Restricted, best_spread
from navirl_cli.irl.spread import Factors, Posterior, Spread
from navirl_cli.parallel import map_in_order

#: Scatter at which the search starts.
FIRST = 0.2
#: Pairs of nodes of all people together, and the least number of a person.
PAIRS, FEWEST_PAIRS = 800, 48
#: Largest numbers of rounds with modes, of draws of nodes, and of rounds with the same nodes.
MODE_ROUNDS, DRAWS, NODE_ROUNDS = 8, 5, 12
#: Largest move of a round: of the mean in scatters, of the logarithm of a scatter. Farther away the Gaussian stand-ins
#: say nothing about the likelihoods.
REACH = 1.0, 0.7
#: A round moves the spread by less than so many standard errors: at the end of the modes, with the same nodes, and with
#: new ones, whose draw has an error of its own.
SMALL, SMALLEST, AGREES = 0.2, 0.02, 0.3
#: Nodes are drawn again where, for a person, fewer than this share of them count.
WORN = 0.25


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
            self.converged = fresh and max(first, moved) < AGREES
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


def _drawn(job: tuple[Likely, Posterior, Spread, int, int]) -> Nodes:
    """Nodes around a mode; importable by name, to run in another process."""
    return draw(*job)
