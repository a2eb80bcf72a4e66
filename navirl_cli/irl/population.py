"""People differ: the typical reward, how much people differ from it, and the reward of each person.

Every parameter in which people may differ is, up to its sign, a typical magnitude times a factor by person whose
logarithm is normally distributed. One person's few demonstrations then say little about that person alone, but
together with those of others they say how people are scattered, and so how far each person's own can be believed.
"""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from navirl_cli.arrays import BoolArray, ByContent, FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit
from navirl_cli.irl.intervals import LEVEL, Ends, Errors, Intervals, Kind
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.log_scale import LogScale, Witness, companies
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.random_effects import RandomEffects, random_effects
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.spread import Posterior
from navirl_cli.irl.status import Status

#: Half the width of a 95 % interval of a normal variable, in standard deviations.
NORMAL = 1.959964
_TAIL = (1 - LEVEL) / 2


@dataclass(frozen=True, eq=False)
class Person(ByContent):
    """One participant's reward, drawn towards the typical one as far as the own demonstrations leave it open."""

    name: str
    reward: Reward
    #: (k,) ends of 95 % intervals, in the parameters' units; equal to the value where people do not differ.
    lower: FloatArray
    upper: FloatArray
    #: (k, k) in the parameters' units; zero where people do not differ.
    covariance: FloatArray
    #: Numbers of the own demonstrations, in the order of the evidence, and the number of own steps.
    owners: tuple[int, ...]
    steps: int
    #: Log-likelihood of the own steps, nats: under the own reward, the typical one, and equally likely moves.
    log_likelihood: float
    log_likelihood_typical: float
    log_likelihood_uniform: float
    #: Effective number of the nodes of importance sampling, and their number.
    effective: float
    drawn: int


@dataclass(frozen=True, eq=False)
class Population(ByContent):
    """What a fit with random effects over participants found."""

    scale: LogScale
    #: (v,) mean of the logarithms, and its (v, v) covariance.
    mean: FloatArray
    covariance: FloatArray
    #: (v,) ends of the 95 % intervals of the means.
    lower: FloatArray
    upper: FloatArray
    #: (v,) standard deviations of the logarithms between people (posterior medians), and ends of 95 % intervals.
    scatter: FloatArray
    scatter_lower: FloatArray
    scatter_upper: FloatArray
    #: (v,) mean squares of the same.
    scatter_squared: FloatArray
    #: (v,) whether it is excluded that all people are alike in the parameter.
    differ: BoolArray
    persons: tuple[Person, ...]
    #: Marginal log-likelihood, and the largest one of people who are alike, nats.
    log_likelihood: float
    log_likelihood_alike: float

    @property
    def count(self) -> int:
        """Number of people."""
        return len(self.persons)

    def prediction(self) -> FloatArray:
        """(v, v) covariance of the logarithms of a new person: the scatter between people and the mean's error."""
        found: FloatArray = np.diag(self.scatter_squared) + self.covariance
        return found


def population(
    evidence: Evidence,
    pooled: Fit,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[Fit, Population, Intervals]:
    """Fit random effects over participants.

    Args:
        evidence: Demonstrations of at least two participants.
        pooled: The fit to the same evidence as if all were alike. Parameters that it does not identify, or that are
            on a bound, are the same for all people.
        executor: Where to compute; by default local processes.
        progress: Called with the number of rounds and the marginal log-likelihood.

    Returns:
        The fit with the typical reward in place of the pooled one, the population, and the intervals of the typical
        reward.

    Raises:
        DemonstrationError: There is only one participant.
        RewardError: The pooled fit leaves no parameter in which people could differ.
    """
    names = evidence.several_people("pool")
    varying = pooled.identified & ~pooled.on_bound & (np.array(pooled.reward.theta) != 0)
    if not varying.any():
        raise RewardError("`pool`: expected a parameter that the demonstrations identify, found none; fit without it")
    scale = LogScale(pooled.reward, varying)
    # Everybody has a share of the regulariser, so that together they have all of it.
    share = Prior.l2(pooled.reward.parameters, pooled.l2 / len(names))
    people = [Witness(name, _of(evidence, name), scale, share) for name in names]
    groups = companies(evidence, people)
    found = random_effects(people, scale.of(pooled.reward), groups=groups, executor=executor, progress=progress)
    known = found.mixture
    mean, covariance = known.typical()
    persons = [
        person_of(one, own, total, posterior, scale.at(mean))
        for one, own, total, posterior in zip(
            people, known.person_mean, known.person_covariance, found.people, strict=True
        )
    ]
    numbers = range(len(mean))
    quantiles = np.array([[known.scatter_quantile(j, share) for j in numbers] for share in (_TAIL, 0.5, 1 - _TAIL)])
    lower, upper = np.array([known.interval(j, LEVEL) for j in numbers]).T
    result = Population(
        scale=scale,
        mean=mean,
        covariance=covariance,
        lower=lower,
        upper=upper,
        scatter=quantiles[1],
        scatter_lower=quantiles[0],
        scatter_upper=quantiles[2],
        scatter_squared=known.weight @ known.scatter**2,
        differ=found.differ,
        persons=tuple(persons),
        log_likelihood=found.log_likelihood,
        log_likelihood_alike=pooled.objective,
    )
    return _typical(evidence, pooled, found, result), result, _intervals(result)


def _of(evidence: Evidence, name: str) -> Evidence:
    """The steps of one participant."""
    return evidence.repeated(np.array([one == name for one in evidence.participants], dtype=int))


def person_of(one: Witness, mean: FloatArray, total: FloatArray, known: Posterior, typical: Reward) -> Person:
    """A person by the posterior of the logarithms.

    Args:
        one: The person's demonstrations.
        mean: (v,) of the logarithms.
        total: (v, v) their covariance.
        known: The posterior under one spread, which says how well it was sampled.
        typical: The typical reward.
    """
    reward = one.scale.at(mean)
    theta, varying = np.array(reward.theta), one.scale.varying
    errors = np.sqrt(np.diag(total))
    ends = np.sort([one.scale.values(mean + side * NORMAL * errors) for side in (-1, 1)], axis=0)
    lower, upper, covariance = theta.copy(), theta.copy(), np.zeros((len(theta), len(theta)))
    lower[varying], upper[varying] = ends
    covariance[np.ix_(varying, varying)] = total * np.outer(theta[varying], theta[varying])
    return Person(
        name=one.name,
        reward=reward,
        lower=lower,
        upper=upper,
        covariance=covariance,
        owners=tuple(one.evidence.owners.tolist()),
        steps=one.evidence.steps,
        log_likelihood=log_likelihood(one.evidence, reward),
        log_likelihood_typical=log_likelihood(one.evidence, typical),
        log_likelihood_uniform=one.evidence.uniform_log_likelihood(),
        effective=known.effective,
        drawn=known.drawn,
    )


def _typical(evidence: Evidence, pooled: Fit, found: RandomEffects, result: Population) -> Fit:
    """The fit with the typical reward: errors are those of the mean over people."""
    scale = result.scale
    reward = scale.at(result.mean)
    theta, varying = np.array(reward.theta), scale.varying
    covariance = np.full_like(pooled.covariance, np.nan)
    covariance[np.ix_(varying, varying)] = result.covariance * np.outer(theta[varying], theta[varying])
    value = log_likelihood(evidence, reward)
    prior = Prior.l2(reward.parameters, pooled.l2)
    status = pooled.status
    if status in {Status.CONVERGED, Status.OPEN_INTERVAL}:
        status = Status.CONVERGED if found.converged else Status.STOPPED_EARLY
    return replace(
        pooled,
        reward=reward,
        covariance=covariance,
        clustered=None,
        status=status,
        log_likelihood=value,
        objective=value + prior.log_density(theta),
        path_theta=np.array([scale.at(place).theta for place in found.path]),
        path_log_likelihood=found.path_log_likelihood,
    )


def _intervals(found: Population) -> Intervals:
    """Of the typical reward."""
    low, high = np.sort([found.scale.values(end) for end in (found.lower, found.upper)], axis=0).tolist()
    ends = tuple(Ends(*one) for one in zip(found.scale.names, low, high, strict=True))
    return Intervals(Kind.POSTERIOR, Errors.PARTICIPANT, LEVEL, ends)
