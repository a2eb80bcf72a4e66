"""Maximum-entropy inverse reinforcement learning: the parameters under which the demonstrations are most likely."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from navirl_cli.demos.grid import FloatArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.likelihood import Evidence, likelihood, log_likelihood
from navirl_cli.irl.newton import Maximum, Point, maximise
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.values import InfinitePartitionError

#: The paper's small regulariser: its code decays theta by 0.001 theta a gradient, in cell units.
PAPER_L2 = 1e-3
#: Information, in squared units of a parameter's scale, below which the data say nothing: an error of 1000 scales.
NO_INFORMATION = 1e-6


class Status(StrEnum):
    """How a fit ended."""

    CONVERGED = "converged"
    STOPPED_EARLY = "stopped early"
    ON_BOUND = "on bound"
    NOT_IDENTIFIED = "not identified"

    @property
    def advice(self) -> str:
        """What it means and what to do."""
        return _ADVICE[self]


_ADVICE = {
    Status.CONVERGED: "no step raises the likelihood any more",
    Status.STOPPED_EARLY: (
        "the likelihood still rises, so that these numbers are not the optimum: it may lie at infinity; "
        "add demonstrations or a larger --l2, or go on with --init"
    ),
    Status.ON_BOUND: "a parameter ended on its bound, where it has no standard error; more demonstrations may free it",
    Status.NOT_IDENTIFIED: (
        "the demonstrations do not tell every parameter: the numbers marked so mean nothing by themselves; "
        "add demonstrations that tell them (people near the path, detours from the nominal path)"
    ),
}


@dataclass(frozen=True)
class Fit:
    """A learnt reward and how sure it is."""

    reward: Reward
    #: (k, k) inverse of the observed information, in the parameters' units; NaN where there is none.
    covariance: FloatArray
    status: Status
    #: (k,) whether the data identify the parameter, and whether it ended on a bound.
    identified: NDArray[np.bool_]
    on_bound: NDArray[np.bool_]
    #: Log-likelihoods in nats: of the fit, of the start, and of equally likely moves.
    log_likelihood: float
    log_likelihood_initial: float
    log_likelihood_uniform: float
    initial: Reward
    l2: float
    demonstrations: int
    steps: int
    evaluations: int
    #: Accepted points of the search that found the maximum: (iterations, k) parameters, (iterations,) log-likelihood.
    path_theta: FloatArray
    path_log_likelihood: FloatArray

    @property
    def standard_errors(self) -> FloatArray:
        """(k,) square roots of the covariance's diagonal, in the parameters' units."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def iterations(self) -> int:
        """Accepted steps of the search."""
        return len(self.path_log_likelihood) - 1


def fit(
    evidence: Evidence,
    initial: Reward,
    l2: float = PAPER_L2,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Maximise log-likelihood - l2/2 sum_j (theta_j / scale_j)^2 from several starts.

    Args:
        evidence: Demonstrated steps.
        initial: Where to start.
        l2: Weight of the regulariser, nats per squared scale (the scales: 10 /m for c0, 1 for the others).
        progress: Called with the number of accepted steps so far and the log-likelihood.

    Returns:
        The fit.

    Raises:
        InfinitePartitionError: The partition function is infinite at the initial parameters.
        RewardError: l2 is negative.
    """
    if not l2 >= 0:
        raise RewardError(f"the regulariser must not be negative, found --l2 {l2:g}")
    problem = _Problem(evidence, initial, l2)
    at_start = problem(problem.to_units(initial.theta))
    if not np.isfinite(at_start.value):
        log_likelihood(evidence, initial)  # raises with the reason
    starts = problem.starts(at_start)
    # A parameter that tells nothing here may tell something there: a person at a distance, seen with another sigma_p.
    identified = np.any([problem.identified(at_start), *(problem.identified(problem(x)) for x in starts[1:])], axis=0)
    lower, upper = (problem.to_units([getattr(p, side) for p in initial.parameters]) for side in ("lower", "upper"))
    steps = 0

    def count(point: Point) -> None:
        nonlocal steps
        steps += 1
        if progress is not None:
            progress(steps, point.value)

    # What the data do not tell stays where it was given: elsewhere the regulariser alone would choose.
    found = [
        maximise(problem, np.where(identified, start, at_start.x), lower, upper, identified, count) for start in starts
    ]
    # Of maxima that differ by rounding the first: that of the given start.
    top = max(maximum.best.value for maximum in found)
    best = next(maximum for maximum in found if maximum.best.value >= top - 1e-9)
    evaluations = len(starts) + sum(maximum.evaluations for maximum in found)
    return problem.result(best, identified, (lower, upper), at_start, evaluations)


@dataclass(frozen=True)
class _Problem:
    """The penalised log-likelihood in parameters divided by their scales."""

    evidence: Evidence
    initial: Reward
    l2: float

    @property
    def scale(self) -> FloatArray:
        """(k,) scales of the parameters."""
        return np.array([parameter.scale for parameter in self.initial.parameters])

    def to_units(self, theta: Sequence[float]) -> FloatArray:
        """(k,) parameters divided by their scales."""
        return np.asarray(theta, dtype=float) / self.scale

    def __call__(self, x: FloatArray) -> Point:
        reward = self._reward(x)
        try:
            found = likelihood(self.evidence, reward)
        except InfinitePartitionError:
            return Point(x, -np.inf, np.zeros_like(x), np.zeros((len(x), len(x))))
        return Point(
            x,
            found.value - 0.5 * self.l2 * float(x @ x),
            found.gradient * self.scale - self.l2 * x,
            found.hessian * np.outer(self.scale, self.scale) - self.l2 * np.eye(len(x)),
        )

    def _reward(self, x: FloatArray) -> Reward:
        # Dividing and multiplying by the scale may leave a bound by a rounding.
        theta = (
            min(max(value, p.lower), p.upper)
            for value, p in zip((x * self.scale).tolist(), self.initial.parameters, strict=True)
        )
        return Reward(tuple(theta), self.initial.terms)

    def identified(self, point: Point) -> NDArray[np.bool_]:
        """Which parameters change the likelihood at all: slope and curvatures, mixed ones too, of the others vanish.

        Mixed, because at a_p = 0 it is the only one that tells sigma_p.
        """
        slope = np.abs(point.gradient + self.l2 * point.x)
        curvature = np.abs(point.hessian + self.l2 * np.eye(len(point.x))).max(axis=1)
        told: NDArray[np.bool_] = (slope > NO_INFORMATION) | (curvature > NO_INFORMATION)
        return told

    def starts(self, first: Point) -> list[FloatArray]:
        """The given start, and others with the restarts of those parameters that have some."""
        starts = [first.x]
        for number in range(max(len(parameter.restarts) for parameter in self.initial.parameters)):
            x = first.x.copy()
            for j, parameter in enumerate(self.initial.parameters):
                if number < len(parameter.restarts):
                    x[j] = parameter.restarts[number] / parameter.scale
            if (x != first.x).any():
                starts.append(x)
        return starts

    def result(
        self,
        found: Maximum,
        identified: NDArray[np.bool_],
        bounds: tuple[FloatArray, FloatArray],
        at_start: Point,
        evaluations: int,
    ) -> Fit:
        """Covariance and status at the maximum."""
        best, l2 = found.best, self.l2
        on_bound = (best.x <= bounds[0]) | (best.x >= bounds[1])
        covariance, blind = _uncertainty(best, l2, identified & ~on_bound)
        identified = identified & ~blind
        if not found.converged:
            status = Status.STOPPED_EARLY
        elif not identified.all():
            status = Status.NOT_IDENTIFIED
        else:
            status = Status.ON_BOUND if on_bound.any() else Status.CONVERGED

        def plain(point: Point) -> float:
            return point.value + 0.5 * l2 * float(point.x @ point.x)

        return Fit(
            reward=self._reward(best.x),
            covariance=covariance * np.outer(self.scale, self.scale),
            status=status,
            identified=identified,
            on_bound=on_bound,
            log_likelihood=plain(best),
            log_likelihood_initial=plain(at_start),
            log_likelihood_uniform=self.evidence.uniform_log_likelihood(),
            initial=self.initial,
            l2=l2,
            demonstrations=self.evidence.count,
            steps=self.evidence.steps,
            evaluations=evaluations,
            path_theta=np.array([point.x * self.scale for point in found.path]),
            path_log_likelihood=np.array([plain(point) for point in found.path]),
        )


def _uncertainty(best: Point, l2: float, told: NDArray[np.bool_]) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Covariance at the maximum, and which parameters take part in a direction that the data do not tell.

    Whether the data tell a direction is asked of their own information, without what the regulariser adds.

    Args:
        best: The maximum, in units.
        l2: The regulariser's weight.
        told: (k,) parameters that are inside their bounds and change the likelihood.

    Returns:
        (k, k) inverse of the observed information where there is any, else NaN; (k,) blind parameters.
    """
    covariance = np.full((len(told), len(told)), np.nan)
    blind = np.zeros_like(told)
    if told.any():
        values, directions = np.linalg.eigh(-best.hessian[np.ix_(told, told)])
        seen = values - l2 > NO_INFORMATION
        blind[told] = np.abs(directions[:, ~seen]).max(axis=1, initial=0.0) > 0.1
        inverse = (directions[:, seen] / values[seen]) @ directions[:, seen].T
        covariance[np.ix_(told, told)] = inverse
        covariance[blind] = covariance[:, blind] = np.nan
    return covariance, blind
