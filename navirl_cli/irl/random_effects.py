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
from dataclasses import dataclass, replace
from math import cbrt, ceil

import numpy as np

from navirl_cli.arrays import BoolArray, ByContent, FloatArray
from navirl_cli.irl.mixture import Mixture, excluded
from navirl_cli.irl.nodes import PAIRS, Alone, Group, Likely, Nodes, draw, laplace, sampled
from navirl_cli.irl.restricted import REACH, WIDTH, Restricted, best_spread
from navirl_cli.irl.spread import Factors, Known, Posterior, Spread
from navirl_cli.parallel import map_in_order

#: Scatter at which the search starts.
FIRST = 0.2
#: Largest numbers of rounds with modes, and of draws of nodes.
MODE_ROUNDS, DRAWS = 8, 6
#: The first two draws are of PAIRS; a later one is as large as the error that is left asks for, within these multiples.
SMALLEST, LARGEST = 0.5, 2.0
#: Least curvature assumed for the distribution of the logarithms of scatters.
FLATTEST = 0.5
#: A round with modes that moves the spread by less, in standard errors, is the last one.
SMALL = 0.2
#: Nodes are drawn for a scatter so much wider than the one found, because the true one may be.
WIDER = 1.5
#: Share of a scatter below which nodes are too far from each other to say what a scatter of zero would.
DENSE = 0.5
#: The search has converged where another draw of nodes moves means and scatters by less than so many standard
#: deviations, the nodes leave an error of less than so many, and at least so many places of the scatters count.
AGREES, PRECISE, FEWEST_PLACES = 0.3, 0.1, 20.0


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
    groups: Sequence[Group] | None = None,
    width: float = WIDTH,
    executor: Executor | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> RandomEffects:
    """Estimate mean and scatter of people, and each person.

    Args:
        people: Their log-likelihoods; at least two.
        start: (v,) where the search starts, and the mean is expected.
        groups: The same people, each in one group of those who share nodes; by default everybody alone.
        width: Of the weak priors.
        executor: Where to compute; by default local processes.
        progress: Called with the number of rounds and the marginal log-likelihood.
    """
    if groups is None:
        groups = [Alone(one, number) for number, one in enumerate(people)]
    search = _Search(people, groups, Spread(start, np.full(len(start), FIRST)), width, executor, progress)
    search.by_modes()
    return search.by_nodes()


@dataclass(eq=False)
class _Search:
    """Rounds of modes, and of draws of nodes."""

    people: Sequence[Likely]
    groups: Sequence[Group]
    spread: Spread
    width: float
    executor: Executor | None
    progress: Callable[[int, float], None] | None

    def __post_init__(self) -> None:
        self.start = self.spread.mean
        self.modes = [self.start for _ in self.people]
        self.places: list[tuple[FloatArray, float]] = []

    def by_modes(self) -> None:
        """Rounds with Laplace's approximation, to come near."""
        for _ in range(MODE_ROUNDS):
            posteriors = self._laplace(self.spread)
            self.factors = Factors.of(posteriors, self.spread)
            top = best_spread(self._over(self.factors), self.spread, reach=REACH)
            values, basis = np.linalg.eigh(-top.hessian)
            errors = np.sqrt((basis**2 / np.maximum(values, FLATTEST)).sum(axis=1))
            moved = float(np.abs((top.x - self.spread.x) / errors).max())
            self.spread = Spread.at(top.x)
            self._note(self.spread.mean, posteriors)
            if moved < SMALL:
                break

    def by_nodes(self) -> RandomEffects:
        """Draws of nodes until they leave little error, and one more changes little."""
        mixture = Mixture.of(self._over(self.factors), self.spread)
        # Nodes say nothing far from where they were drawn, so that the spread of the next ones must be near.
        center, nodes = mixture.spread.near(self.spread, REACH), list[list[Nodes]]()
        around, size, total = self._laplace(center.wider(WIDER)), 1.0, 0.0
        for number in range(DRAWS):
            before = mixture
            nodes.append(self._drawn(around, number, size))
            known = sampled([Nodes.together(own) for own in zip(*nodes, strict=True)], around, center.wider(WIDER))
            mixture = Mixture.of(self._over(known), center)
            self.spread = mixture.middle
            posteriors = known.posteriors(self.spread)
            self._note(self.spread.mean, posteriors)
            error = float(mixture.errors(known.noise(self.spread)).max()) / PRECISE
            converged = number > 0 and error < 1 and mixture.away(before) < AGREES and mixture.effective > FEWEST_PLACES
            if converged:
                break
            center = mixture.spread.near(center, REACH)
            around, total = known.posteriors(center.wider(WIDER)), total + size
            # Errors fall with the root of the number; after one draw the error itself is not known.
            size = min(max(total * (error**2 - 1), SMALLEST), LARGEST) if number > 0 else 1.0
        return RandomEffects(
            mixture=mixture,
            spread=self.spread,
            people=tuple(posteriors),
            differ=excluded(self._over(replace(known, least=DENSE * self.spread.scatter)), self.spread),
            path=np.array([place for place, _ in self.places]),
            path_log_likelihood=np.array([value for _, value in self.places]),
            converged=converged,
        )

    def _drawn(self, around: Sequence[Posterior], number: int, size: float) -> list[Nodes]:
        """New nodes of every group, around the approximations of its members."""
        jobs, count = [], len(self.people)
        for group in self.groups:
            # Nodes around one member serve the others.
            each = ceil(size * PAIRS / cbrt(len(group.members)))
            jobs += [(group, around[one], each, number * count + int(one)) for one in group.members]
        drawn = map_in_order(_draw, jobs, self.executor)
        return [Nodes.together([next(drawn) for _ in group.members]) for group in self.groups]

    def _over(self, people: Known) -> Restricted:
        """The restricted likelihood of people."""
        return Restricted(people, self.start, self.width)

    def _laplace(self, spread: Spread) -> list[Posterior]:
        found = [laplace(one, spread, mode) for one, mode in zip(self.people, self.modes, strict=True)]
        self.modes = [one.mean for one in found]
        return found

    def _note(self, mean: FloatArray, posteriors: Sequence[Posterior]) -> None:
        """Remember a round, and report it."""
        self.places.append((mean, sum(one.evidence for one in posteriors)))
        if self.progress is not None:
            self.progress(len(self.places), self.places[-1][1])


def _draw(job: tuple[Group, Posterior, int, int]) -> Nodes:
    """Nodes around an approximation; importable by name, to run in another process."""
    return draw(*job)
