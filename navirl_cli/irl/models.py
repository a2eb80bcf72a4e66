"""Models of what people want, judged by how well each predicts participants from whom it did not learn."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.errors import NavirlError
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.reward import PAPER_TERMS, Reward, parameters_of
from navirl_cli.irl.status import Status
from navirl_cli.irl.terms import TERMS
from navirl_cli.irl.terms.term import Term
from navirl_cli.parallel import map_in_order

#: Sums of terms that are compared; the paper's is the one that the others are compared with.
MODELS: tuple[tuple[Term, ...], ...] = tuple(
    PAPER_TERMS if names is None else tuple(TERMS[name] for name in names)
    for names in (
        ("length",),
        ("length", "personal-space"),
        None,
        ("length", "deviation", "length-space"),
        ("length", "deviation", "anisotropic-space"),
        ("length", "deviation", "personal-space", "turn"),
        ("length", "saturating-deviation", "personal-space"),
        ("length", "saturating-deviation", "personal-space", "turn"),
        ("length", "saturating-deviation", "anisotropic-space", "turn"),
    )
)


@dataclass(frozen=True, eq=False)
class Model(ByContent):
    """One sum of terms."""

    terms: tuple[Term, ...]
    #: The fit to everyone; None where it failed.
    fit: Fit | None
    #: (p,) held-out log-likelihood of each left-out participant, nats; NaN where the fit to the others failed.
    held_out: FloatArray
    #: Why a fit failed, and how those ended that did not converge, by the participant left out; "" for the fit to all.
    problems: Mapping[str, str]

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(parameters_of(self.terms))


@dataclass(frozen=True)
class Difference:
    """How much better a model predicts left-out participants than another, nats a step."""

    mean: float
    #: From the differences by participant.
    standard_error: float
    #: Participants whom it predicts better.
    in_favour: int


@dataclass(frozen=True, eq=False)
class Models(ByContent):
    """Models fitted to the same evidence."""

    participants: tuple[str, ...]
    #: (p,) steps of each.
    steps: IntArray
    models: tuple[Model, ...]

    def per_step(self, model: Model) -> float:
        """Held-out log-likelihood a step over all participants, nats."""
        return float(model.held_out.sum() / self.steps.sum())

    def difference(self, model: Model, other: Model) -> Difference:
        """One model minus another: a ratio of sums over participants, with its standard error.

        Cochran, Sampling Techniques (1977), Sec. 6.4: the participants' steps are not equally many.
        """
        gain, count = model.held_out - other.held_out, len(self.steps)
        mean = float(gain.sum() / self.steps.sum())
        spread = float(((gain - mean * self.steps) ** 2).sum())
        error = float(np.sqrt(spread * count / (count - 1)) / self.steps.sum())
        return Difference(mean, error, int((gain > 0).sum()))

    @property
    def paper(self) -> Model:
        """The paper's model."""
        return next(model for model in self.models if model.terms == PAPER_TERMS)


def with_paper(models: Sequence[tuple[Term, ...]]) -> list[tuple[Term, ...]]:
    """Models, each once, and the paper's, to which the others are compared."""
    return list(dict.fromkeys([*models, *([] if PAPER_TERMS in models else [PAPER_TERMS])]))


def compare_models(
    evidence: Evidence,
    models: Sequence[tuple[Term, ...]],
    l2: float,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, str], None] | None = None,
) -> Models:
    """Fit every model to all participants, and to all but each.

    Args:
        evidence: Demonstrations of at least two participants.
        models: Sums of terms. The paper's is added where it is missing.
        l2: Regulariser of the fits.
        executor: Where to compute; by default local processes.
        progress: Called with the number of fits done, and the model of the last one.

    Raises:
        DemonstrationError: There is one participant only.
    """
    names = evidence.several_people("models")
    chosen = with_paper(models)
    jobs = [(terms, name) for terms in chosen for name in ("", *names)]
    results: list[_Result] = []
    for result in map_in_order(partial(_learn, evidence, l2), jobs, executor):
        results.append(result)
        if progress is not None:
            progress(len(results), ", ".join(term.name for term in jobs[len(results) - 1][0]))
    rows = [results[at : at + len(names) + 1] for at in range(0, len(results), len(names) + 1)]
    return Models(
        tuple(names),
        np.array([evidence.apart(name)[1].steps for name in names]),
        tuple(
            Model(
                terms,
                row[0].fit,
                np.array([one.held_out for one in row[1:]]),
                {name: one.problem for name, one in zip(("", *names), row, strict=True) if one.problem},
            )
            for terms, row in zip(chosen, rows, strict=True)
        ),
    )


@dataclass(frozen=True, eq=False)
class _Result:
    """A fit to all participants, or to all but one."""

    fit: Fit | None
    held_out: float
    problem: str


def _learn(evidence: Evidence, l2: float, job: tuple[tuple[Term, ...], str]) -> _Result:
    """Fit a model without one participant and evaluate it on that participant; or fit it to all."""
    terms, name = job
    start = Reward.named({}, terms)
    learning, held_out = evidence.apart(name) if name else (evidence, evidence)
    try:
        found = fit(learning, start, l2)
        value = log_likelihood(held_out, found.reward)
    except NavirlError as error:
        return _Result(None, np.nan, str(error))
    return _Result(None if name else found, value, "" if found.status is Status.CONVERGED else found.status.value)
