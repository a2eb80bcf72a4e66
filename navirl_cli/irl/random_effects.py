"""Random effects by empirical Bayes: people are scattered normally, and each is known by a likelihood.

y_i ~ N(m, diag(s^2)) for person i, and L_i(y_i) is the likelihood of what this person showed. First come rounds with
Gaussian stand-ins for L_i: each person's posterior under m and s has a mode and a curvature (Laplace), a Gaussian
factor with the same mean and covariance stands for L_i, and the marginal likelihood of m and s has a closed form. Far
from that m and s it is wrong: the likelihood of few paths is skewed, and a larger scatter gives its long side more
room. So L_i is computed at nodes that are drawn under a spread wider than the one found. They give the marginal
likelihood at any m and s by importance sampling. Scatters are integrated over by their restricted likelihood (Patterson
and Thompson 1971, Biometrika 58:545), which takes into account that m is estimated too.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import BoolArray, ByContent, FloatArray
from navirl_cli.irl.mixture import Mixture, excluded
from navirl_cli.irl.nodes import MOST_PAIRS, Likely, Nodes, draw, laplace, sampled
from navirl_cli.irl.restricted import REACH, WIDTH, Restricted, best_spread
from navirl_cli.irl.sampled import Sampled
from navirl_cli.irl.spread import Factors, Posterior, Spread
from navirl_cli.parallel import map_in_order

#: Scatter at which the search starts.
FIRST = 0.2
#: Pairs of nodes of all people together, and the least number of a person, in a draw.
PAIRS, FEWEST_PAIRS = 600, 48
#: Largest numbers of rounds with modes, and of draws of nodes.
MODE_ROUNDS, DRAWS = 8, 4
#: Least curvature assumed for the distribution of the logarithms of scatters.
FLATTEST = 0.5
#: A round with modes that moves the spread by less, in standard errors, is the last one.
SMALL = 0.2
#: Nodes are drawn for a scatter so much wider than the one found, because the true one may be.
WIDER = 1.5
#: The search has converged where another draw of nodes moves means and scatters by less than so many standard
#: deviations, and at least so many places of the scatters count.
AGREES, FEWEST_PLACES = 0.3, 20.0


@dataclass(frozen=True, eq=False)
class RandomEffects(ByContent):
    """How people are scattered, and each of them."""

    #: Places of the scatters, with weights: the posterior of all that is unknown.
    mixture: Mixture
    #: The mean, and the medians of the scatters.
    spread: Spread
    #: The people under this spread.
    people: tuple[Posterior, ...]
    #: (v,) whether a scatter of zero is excluded, by the restricted likelihood.
    differ: BoolArray
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
    return search.by_nodes()


@dataclass(eq=False)
class _Search:
    """Rounds of modes, and of draws of nodes."""

    people: Sequence[Likely]
    spread: Spread
    width: float
    executor: Executor | None
    progress: Callable[[int, float], None] | None

    def __post_init__(self) -> None:
        self.modes = [self.spread.mean for _ in self.people]
        self.places: list[tuple[FloatArray, float]] = []
        #: Number of draws of nodes, and the spread under which the last one was.
        self.drawn, self.under = 0, self.spread

    def by_modes(self) -> None:
        """Rounds with Laplace's approximation, to come near."""
        for _ in range(MODE_ROUNDS):
            posteriors = self._laplace(self.spread)
            self.factors = Factors.of(posteriors, self.spread)
            top = best_spread(Restricted(self.factors, self.width), self.spread, reach=REACH)
            values, basis = np.linalg.eigh(-top.hessian)
            errors = np.sqrt((basis**2 / np.maximum(values, FLATTEST)).sum(axis=1))
            moved = float(np.abs((top.x - self.spread.x) / errors).max())
            self.spread = Spread.at(top.x)
            self._note(self.spread.mean, posteriors)
            if moved < SMALL:
                break

    def by_nodes(self) -> RandomEffects:
        """Draws of nodes until one more changes little."""
        mixture, nodes = Mixture.of(Restricted(self.factors, self.width), self.spread), list[Nodes]()
        for number in range(DRAWS):
            before, wide = mixture, mixture.spread.wider(WIDER)
            nodes, known = self._more(nodes, wide)
            mixture = Mixture.of(Restricted(known, self.width), before.spread)
            self.spread = mixture.middle
            posteriors = known.posteriors(self.spread)
            self._note(self.spread.mean, posteriors)
            converged = number > 0 and mixture.away(before) < AGREES and mixture.effective > FEWEST_PLACES
            if converged:
                break
        return RandomEffects(
            mixture=mixture,
            spread=self.spread,
            people=tuple(posteriors),
            differ=excluded(Restricted(known, self.width), self.spread),
            path=np.array([place for place, _ in self.places]),
            path_log_likelihood=np.array([value for _, value in self.places]),
            converged=converged,
        )

    def _more(self, nodes: list[Nodes], spread: Spread) -> tuple[list[Nodes], Sampled]:
        """Everybody's nodes and new ones, drawn under a spread; and people by them."""
        around = sampled(nodes, self.under).posteriors(spread) if nodes else self._laplace(spread)
        count = len(self.people)
        pairs = min(max(PAIRS // count, FEWEST_PAIRS), MOST_PAIRS)
        start = self.drawn * count
        jobs = [(*one, pairs, start + k) for k, one in enumerate(zip(self.people, around, strict=True))]
        drawn = list(map_in_order(_draw, jobs, self.executor))
        self.drawn, self.under = self.drawn + 1, spread
        every = [one.and_also(new) for one, new in zip(nodes, drawn, strict=True)] if nodes else drawn
        return every, sampled(every, spread)

    def _laplace(self, spread: Spread) -> list[Posterior]:
        found = [laplace(one, spread, mode) for one, mode in zip(self.people, self.modes, strict=True)]
        self.modes = [one.mean for one in found]
        return found

    def _note(self, mean: FloatArray, posteriors: Sequence[Posterior]) -> None:
        """Remember a round, and report it."""
        self.places.append((mean, sum(one.evidence for one in posteriors)))
        if self.progress is not None:
            self.progress(len(self.places), self.places[-1][1])


def _draw(job: tuple[Likely, Posterior, int, int]) -> Nodes:
    """Nodes around an approximation; importable by name, to run in another process."""
    return draw(*job)
