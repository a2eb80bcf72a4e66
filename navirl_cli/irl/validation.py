"""Leave-one-out cross-validation: the steps of each participant are predicted from the other participants."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import feature_sums, likelihood, log_likelihood
from navirl_cli.irl.reward import PAPER_TERMS, Reward
from navirl_cli.irl.status import Status
from navirl_cli.irl.terms.term import Parameter, Term
from navirl_cli.parallel import map_in_order


@dataclass(frozen=True, eq=False)
class Validation(ByContent):
    """Held-out log-likelihoods, and features demonstrated and expected, of p left-out participants."""

    participants: tuple[str, ...]
    #: (p,) steps of each.
    steps: IntArray
    #: By model, the learnt one first and equally likely moves last: (p,) held-out log-likelihood, nats.
    log_likelihoods: dict[str, FloatArray]
    #: By model: number of parameters.
    sizes: dict[str, int]
    #: The learnt model's k parameters.
    parameters: tuple[Parameter, ...]
    #: (p, k) sums of dr/dtheta over the left-out steps: demonstrated, and expected from the fit to the others; and the
    #: standard error of their difference, from the variance of the paths and of the fit.
    demonstrated: FloatArray
    expected: FloatArray
    deviation: FloatArray
    #: (p, k) whether the others identify the parameter. If not, it kept its initial value.
    identified: NDArray[np.bool_]
    #: (p,) how the learnt model's fit to the others ended.
    statuses: tuple[Status, ...]

    def per_step(self, model: str) -> float:
        """Held-out log-likelihood per step over all participants."""
        return float(self.log_likelihoods[model].sum() / self.steps.sum())

    def gain(self, model: str) -> FloatArray:
        """(p,) held-out log-likelihood per step of the learnt model minus that of another, by participant."""
        learnt = next(iter(self.log_likelihoods.values()))
        return np.asarray((learnt - self.log_likelihoods[model]) / self.steps)

    @property
    def mismatch(self) -> FloatArray:
        """(p, k) |f_demo - E f| in standard errors: about 1 where participants differ as little as paths of one do."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(np.abs(self.demonstrated - self.expected) / self.deviation)


@dataclass(frozen=True, eq=False)
class _LeftOut:
    """Results for one left-out participant."""

    steps: int
    log_likelihoods: dict[str, float]
    demonstrated: FloatArray
    expected: FloatArray
    deviation: FloatArray
    identified: NDArray[np.bool_]
    status: Status


def cross_validate(
    evidence: Evidence,
    initial: Reward,
    l2: float,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, str], None] | None = None,
) -> Validation:
    """Fit to all participants but one and compute the likelihood of that one's steps, for each participant in turn.

    The reward is compared with the cost of path length alone (the shortest path with noise), path length and personal
    space, the paper's reward where it is another, the same reward without the person, and equally likely moves.

    Args:
        evidence: Demonstrations of at least two participants.
        initial: Terms, and where the fits start.
        l2: Regulariser of the fits.
        executor: Where to compute; by default local processes.
        progress: Called with the number of participants done.

    Returns:
        The held-out results.

    Raises:
        DemonstrationError: There is one participant only.
        InfinitePartitionError: A learnt reward has no policy in a left-out scene.
    """
    names = evidence.several_people("cross_validate")
    models = _models(initial)
    results = []
    for result in map_in_order(partial(_leave_out, evidence, models, l2), names, executor):
        results.append(result)
        if progress is not None:
            progress(len(results), names[len(results) - 1])
    return Validation(
        participants=tuple(names),
        steps=np.array([one.steps for one in results]),
        log_likelihoods={
            model: np.array([one.log_likelihoods[model] for one in results]) for model in results[0].log_likelihoods
        },
        sizes={**{model: len(reward.theta) for model, reward in models.items()}, "uniform": 0},
        parameters=initial.parameters,
        demonstrated=np.array([one.demonstrated for one in results]),
        expected=np.array([one.expected for one in results]),
        deviation=np.array([one.deviation for one in results]),
        identified=np.array([one.identified for one in results]),
        statuses=tuple(one.status for one in results),
    )


def _models(initial: Reward) -> dict[str, Reward]:
    """The reward and the models it is compared with, by name; the first is the reward. No two have the same terms."""
    step, _, space = PAPER_TERMS
    without = tuple(term for term in initial.terms if not term.about_people)
    wanted = {
        "learnt": initial.terms,
        "paper": PAPER_TERMS,
        "length + personal space": (step, space),
        "no person": without,
        "length only": (step,),
    }
    models: dict[str, Reward] = {}
    for name, terms in wanted.items():
        if terms and all(terms != other.terms for other in models.values()):
            models[name] = _started(initial, terms)
    return models


def _started(initial: Reward, terms: tuple[Term, ...]) -> Reward:
    """A reward of some terms that starts at the initial values of the terms that it shares with another."""
    names = {parameter.name for term in initial.terms if term in terms for parameter in term.parameters}
    values = {p.name: value for p, value in zip(initial.parameters, initial.theta, strict=True) if p.name in names}
    return Reward.named(values, terms)


def _leave_out(evidence: Evidence, models: dict[str, Reward], l2: float, name: str) -> _LeftOut:
    """Fit every model without one participant and evaluate it on that participant."""
    learning, held_out = evidence.apart(name)
    fits = {model: fit(learning, initial, l2) for model, initial in models.items()}
    values = {model: log_likelihood(held_out, found.reward) for model, found in fits.items()}
    values["uniform"] = held_out.uniform_log_likelihood()
    learnt = next(iter(fits.values()))
    found, demonstrated = likelihood(held_out, learnt.reward), feature_sums(held_out, learnt.reward)
    # The gradient is the difference of the sums. It varies with the paths and, by its derivative, with the fit.
    covariance = np.nan_to_num(learnt.covariance)
    spread = found.information + found.information @ covariance @ found.information
    # A parameter that the others do not identify gives no prediction.
    deviation = np.where(learnt.identified, np.sqrt(np.diag(spread)), np.nan)
    return _LeftOut(
        steps=held_out.steps,
        log_likelihoods=values,
        demonstrated=demonstrated,
        expected=demonstrated - found.gradient,
        deviation=deviation,
        identified=learnt.identified,
        status=learnt.status,
    )
