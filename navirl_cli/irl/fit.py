"""Maximum-entropy inverse reinforcement learning: the parameters under which the demonstrations are most likely."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray
from navirl_cli.errors import RewardError, unknown
from navirl_cli.irl import uncertainty
from navirl_cli.irl.adam import ascend
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.newton import Maximum, Point, maximise
from navirl_cli.irl.objective import Objective
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scan import Scan
from navirl_cli.irl.status import Status

#: The paper's small regulariser: its code subtracts 0.001 theta per gradient step, in cell units.
PAPER_L2 = 1e-3


class Method(StrEnum):
    """Search method."""

    NEWTON = "newton"
    ADAM = "adam"


@dataclass(frozen=True, eq=False)
class Fit(ByContent):
    """A learnt reward and its uncertainty."""

    reward: Reward
    #: (k, k) inverse of the observed information, in the parameters' units; NaN where the data do not identify a
    #: parameter.
    covariance: FloatArray
    #: (k, k) sandwich covariance clustered by participant; None for a single participant.
    clustered: FloatArray | None
    status: Status
    #: (k,) whether the data identify the parameter, and whether it ended on a bound.
    identified: NDArray[np.bool_]
    on_bound: NDArray[np.bool_]
    #: Log-likelihoods in nats: of the fit, of the start, and of equally likely moves.
    log_likelihood: float
    #: The maximised objective: log-likelihood plus regulariser and log prior density.
    objective: float
    log_likelihood_initial: float
    log_likelihood_uniform: float
    initial: Reward
    method: Method
    l2: float
    prior: Prior | None
    demonstrations: int
    participants: int
    steps: int
    #: How often the likelihood was computed, from all starts.
    evaluations: int
    #: Accepted points of the search that found the maximum: (iterations, k) parameters, (iterations,) log-likelihood.
    path_theta: FloatArray
    path_log_likelihood: FloatArray
    #: (k,) bias that was subtracted, in the parameters' units; None without a correction.
    bias: FloatArray | None = None
    #: Places on the profiles that the search for other maxima followed, in units of the parameters' scales.
    scanned: tuple[Point, ...] = ()

    @property
    def standard_errors(self) -> FloatArray:
        """(k,) square roots of the covariance's diagonal, in the parameters' units."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def clustered_errors(self) -> FloatArray | None:
        """(k,) the same of the clustered covariance."""
        return None if self.clustered is None else np.sqrt(np.diag(self.clustered))

    @property
    def correlation(self) -> FloatArray:
        """(k, k) correlations of the estimates, NaN where there is no covariance."""
        return uncertainty.correlation(self.covariance)

    @property
    def condition_number(self) -> float:
        """Of the correlations."""
        return uncertainty.condition_number(self.covariance)

    @property
    def iterations(self) -> int:
        """Accepted steps of the search."""
        return len(self.path_log_likelihood) - 1


def fit(
    evidence: Evidence,
    initial: Reward,
    l2: float = PAPER_L2,
    *,
    prior: Prior | None = None,
    method: Method = Method.NEWTON,
    fixed: Collection[str] = (),
    scan: bool = True,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Maximise log-likelihood - l2/2 sum_j (theta_j / scale_j)^2 + log prior density.

    Args:
        evidence: Demonstrated steps.
        initial: Where to start.
        l2: Weight of the regulariser, nats per squared scale (the scales: 10 /m for c0, 1 for the others); it acts on
            the parameters that the prior does not contain.
        prior: Gaussian prior, in the parameters' units.
        method: Trust-region Newton, or the study's gradient ascent.
        fixed: Names of parameters that keep their initial values.
        scan: Whether Newton's method looks for other maxima along the profiles of the parameters that enter
            non-linearly.
        progress: Called with the number of accepted steps so far and the objective.

    Returns:
        The fit.

    Raises:
        InfinitePartitionError: The partition function is infinite at the initial parameters.
        RewardError: l2 is negative, the prior is of other parameters, or a fixed parameter is unknown.
    """
    objective = Objective.of(evidence, initial, l2, prior)
    first = objective(objective.to_units(initial.theta))
    if not np.isfinite(first.value):
        log_likelihood(evidence, initial)  # raises with the reason
    names = [parameter.name for parameter in initial.parameters]
    for name in fixed:
        if name not in names:
            raise RewardError(unknown("fixed parameter", name, names))
    held = np.array([name in fixed for name in names])
    influential = objective.identified(first)
    if scan and not influential.all():
        # A distant person matters for a small sigma_p alone.
        influential = np.any([influential, *map(objective.identified, objective.scan_ends(first))], axis=0)
    steps = 0

    def count(value: float) -> None:
        nonlocal steps
        steps += 1
        if progress is not None:
            progress(steps, value)

    free = influential & ~held
    scanned: list[Point] = []
    if method is Method.ADAM:
        found = _by_adam(objective, first, free, count)
    else:
        found, scanned = _by_newton(objective, first, free, scan, count)
    ended = _as_fit(objective, found, first, influential, held, (method, l2, prior))
    return replace(ended, scanned=tuple(scanned))


def _as_fit(
    objective: Objective,
    found: Maximum,
    first: Point,
    influential: NDArray[np.bool_],
    held: NDArray[np.bool_],
    settings: tuple[Method, float, Prior | None],
) -> Fit:
    """Uncertainty and status at a maximum.

    Args:
        objective: The maximised objective.
        found: Where the search ended.
        first: The objective at the given start.
        influential: (k,) parameters that change the objective.
        held: (k,) fixed parameters.
        settings: Method, regulariser and prior of the fit.
    """
    method, l2, prior = settings
    evidence = objective.evidence
    best, scale = found.best, objective.scale
    on_bound = ((best.x <= objective.bounds[0]) | (best.x >= objective.bounds[1])) & ~held
    covariance, blind = uncertainty.observed(*objective.information(best), influential & ~on_bound & ~held)
    covariance *= np.outer(scale, scale)
    reward, identified = objective.reward(best.x), influential & ~blind
    owners = evidence.owners
    known = None if prior is None else prior.precision
    participants = [evidence.participants[owner] for owner in owners]
    return Fit(
        reward=reward,
        covariance=covariance,
        clustered=uncertainty.clustered(covariance, objective.scores(best.x)[owners], participants, known),
        status=_status(found, identified, on_bound),
        identified=identified,
        on_bound=on_bound,
        log_likelihood=objective.log_likelihood(best.x, best.value),
        objective=best.value,
        log_likelihood_initial=objective.log_likelihood(first.x, first.value),
        log_likelihood_uniform=evidence.uniform_log_likelihood(),
        initial=objective.initial,
        method=method,
        l2=l2,
        prior=prior,
        demonstrations=len(owners),
        participants=len(set(participants)),
        steps=evidence.steps,
        evaluations=objective.evaluations,
        path_theta=found.path * scale,
        path_log_likelihood=np.array(
            [objective.log_likelihood(*place) for place in zip(found.path, found.path_value, strict=True)]
        ),
    )


def _by_newton(
    objective: Objective, first: Point, free: NDArray[np.bool_], scan: bool, count: Callable[[float], None]
) -> tuple[Maximum, list[Point]]:
    """The highest maximum found from the start and along the profiles of the parameters that enter non-linearly.

    Returns:
        The maximum, and the places on the profiles.
    """
    search = Scan(objective, objective.bounds, free, count, [maximise(objective, first, objective.bounds, free, count)])
    if scan:
        search.over([(j, values) for j, values in objective.scans() if free[j]])
    # Of maxima that differ by rounding only, take that of the given start.
    top = search.top.value
    return next(maximum for maximum in search.found if maximum.best.value >= top - 1e-9), search.visited


def _by_adam(objective: Objective, first: Point, free: NDArray[np.bool_], count: Callable[[float], None]) -> Maximum:
    """Where the study's gradient ascent ends."""
    places, values, ended = ascend(objective.slope, first.x, objective.bounds, free, count)
    return Maximum(objective(places[-1]), ended, False, places, values)


def _status(found: Maximum, identified: NDArray[np.bool_], on_bound: NDArray[np.bool_]) -> Status:
    """The worst status that applies."""
    if not found.converged:
        return Status.INFINITE if found.blocked else Status.STOPPED_EARLY
    if not identified.all():
        return Status.NOT_IDENTIFIED
    return Status.ON_BOUND if on_bound.any() else Status.CONVERGED
