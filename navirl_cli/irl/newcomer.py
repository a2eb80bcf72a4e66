"""The reward of a new person, from few demonstrations and from how people are scattered."""

from dataclasses import dataclass, replace

import numpy as np

from navirl_cli.arrays import ByContent
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.intervals import LEVEL, Ends, Errors, Intervals, Kind
from navirl_cli.irl.log_scale import LogScale, Witness
from navirl_cli.irl.nodes import Alone, draw, laplace, sampled
from navirl_cli.irl.population import person_of
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.spread import Spread
from navirl_cli.irl.status import Status

#: Times that the nodes are drawn again around the posterior that the last ones found.
DRAWS = 2


@dataclass(frozen=True, eq=False)
class Others(ByContent):
    """What earlier people say about the next one."""

    #: The typical reward, and the parameters in which people differ.
    scale: LogScale
    #: Mean of the logarithms, and standard deviation of the next person's: the scatter and the mean's error together.
    spread: Spread

    def prior(self) -> Prior:
        """The same in the parameters' units, to first order; nothing on parameters that are the same for all."""
        theta, varying = np.array(self.scale.reward.theta), self.scale.varying
        errors = np.full(len(theta), np.nan)
        errors[varying] = self.spread.scatter * np.abs(theta[varying])
        return Prior.gaussian(theta, np.diag(errors**2))


def newcomer(evidence: Evidence, others: Others, name: str, plain: Fit | None = None) -> tuple[Fit, Intervals]:
    """The reward of a new person by this person's demonstrations and by the scatter between earlier people.

    Args:
        evidence: Demonstrations of this person alone.
        others: Earlier people.
        name: Of the person.
        plain: A fit to the demonstrations with the Gaussian prior of :meth:`Others.prior`, where there is one.

    Returns:
        The fit, whose errors are those of the person, and its intervals.

    Raises:
        RewardError: The typical reward has no policy in a scene of the person.
    """
    scale, spread = others.scale, others.spread
    if plain is None:
        plain = fit(evidence, scale.reward, prior=others.prior(), scan=False)
    prior = Prior.l2(scale.reward.parameters, 0.0)
    one = Witness(name, evidence, scale, prior)
    known = laplace(one, spread, spread.mean)
    for number in range(DRAWS):
        known = sampled([draw(Alone(one), known, number=number)], [known], spread).posteriors(spread)[0]
    person = person_of(one, known.mean, known.covariance, known, scale.reward)
    varying = scale.varying
    covariance = np.full_like(person.covariance, np.nan)
    covariance[np.ix_(varying, varying)] = person.covariance[np.ix_(varying, varying)]
    found = replace(
        plain,
        reward=person.reward,
        covariance=covariance,
        clustered=None,
        status=Status.CONVERGED,
        identified=varying,
        on_bound=np.zeros_like(varying),
        log_likelihood=person.log_likelihood,
        objective=known.evidence,
        path_theta=np.array([scale.reward.theta, person.reward.theta]),
        path_log_likelihood=np.array([person.log_likelihood_typical, person.log_likelihood]),
    )
    low, high = person.lower[varying].tolist(), person.upper[varying].tolist()
    ends = tuple(Ends(*one) for one in zip(scale.names, low, high, strict=True))
    return found, Intervals(Kind.POSTERIOR, Errors.MODEL, LEVEL, ends)
