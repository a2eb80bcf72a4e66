"""The paper's evaluation from demonstrations to numbers."""

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.errors import DemonstrationError, counted
from navirl_cli.evaluation.groups import GroupMetrics, Measured
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.likelihood import log_likelihood
from navirl_cli.irl.reward import PAPER_TERMS, Reward
from navirl_cli.irl.terms.term import Term
from navirl_cli.parallel import map_in_order
from navirl_cli.study.claims import Claim, claims_of
from navirl_cli.study.learning import SECOND, Learnt, is_of_cycle, jobs_of, learn
from navirl_cli.study.measures import groups_of, rows_of

#: What the paper's authors learnt from the second cycles of their 13 participants, in SI units. Source: their published
#: parameters c0 = -5.412586, a_g = -0.873514, a_p = -4.907188 and a width of 5.456288 cells, per cell of 0.1 m.
PUBLISHED_THETA = {
    "c0": -54.12585735321045,
    "a_g": -0.8735144734382628,
    "a_p": -4.90718793869,
    "sigma_p": 1.679498831347,
}
PUBLISHED_PARTICIPANTS, PUBLISHED_DEMONSTRATIONS = 13, 26


@dataclass(frozen=True, eq=False)
class Study:
    """Everything that the report of a study contains."""

    demonstrations: tuple[Demonstration, ...]
    rows: tuple[Measured, ...]
    #: Of the trials with people: by group, as driven and on the grid.
    groups: tuple[GroupMetrics, ...]
    #: By participant, in order of their logs.
    participants: tuple[Learnt, ...]
    pooled: Learnt
    #: Log-likelihood of the second cycles of all under the published parameters, nats; None of another study.
    published_log_likelihood: float | None
    claims: tuple[Claim, ...]
    #: Times in which the obstacle course was completed, s, by modality and participant.
    completion_s: Mapping[str, Mapping[str, tuple[float, ...]]]
    #: Of the learnt rewards.
    terms: tuple[Term, ...] = PAPER_TERMS

    @property
    def seconds(self) -> list[Demonstration]:
        """The demonstrations of all second cycles."""
        return [one for one in self.demonstrations if is_of_cycle(one, SECOND)]


def study_of(
    demonstrations: Sequence[Demonstration],
    completion_s: Mapping[str, Mapping[str, tuple[float, ...]]],
    samples: int,
    seed: int,
    *,
    terms: tuple[Term, ...] = PAPER_TERMS,
    published: Collection[str] = (),
    progress: Callable[[int, str], None] | None = None,
    executor: Executor | None = None,
) -> Study:
    """Evaluate a study.

    Args:
        demonstrations: Of all participants; those of the force condition need their cycle.
        completion_s: Times in which the obstacle course was completed, s, by modality and participant.
        samples: Paths to sample from every learnt policy in every scene.
        seed: Of the sampling; the same seed gives the same numbers, whatever the number of processes.
        terms: Of the rewards.
        published: Participants of the published study, with whom its parameters can be compared.
        progress: Called with the number of fits done and whose was the last.
        executor: Where to run; by default local processes.

    Raises:
        DemonstrationError: There is no second cycle to learn from.
        SceneError: A demonstration's scene has no path from start to goal.
    """
    if not any(is_of_cycle(one, SECOND) for one in demonstrations):
        raise _refusal(demonstrations)
    # Before other processes begin, so that these need not import again what it imports.
    rows, known = tuple(rows_of(demonstrations)), _published_log_likelihood(demonstrations, published)
    learnt: list[Learnt] = []
    for one in map_in_order(learn, jobs_of(demonstrations, samples, seed, terms), executor):
        learnt.append(one)
        if progress is not None:
            progress(len(learnt), one.participant or "all")
    participants, pooled = tuple(learnt[:-1]), learnt[-1]
    return Study(
        demonstrations=tuple(demonstrations),
        rows=rows,
        groups=tuple(groups_of(demonstrations, rows)),
        participants=participants,
        pooled=pooled,
        published_log_likelihood=known,
        claims=tuple(claims_of(rows, participants)),
        completion_s=completion_s,
        terms=terms,
    )


def _published_log_likelihood(demonstrations: Sequence[Demonstration], published: Collection[str]) -> float | None:
    """Of the second cycles of all under the published parameters, nats; None unless all are of the published study."""
    seconds = [one for one in demonstrations if is_of_cycle(one, SECOND)]
    if not all(one.participant in published for one in seconds):
        return None
    return log_likelihood(evidence_of(seconds), Reward.named(PUBLISHED_THETA))


def _refusal(demonstrations: Sequence[Demonstration]) -> DemonstrationError:
    """What is missing for a study, and what is there."""
    pushed = [one for one in demonstrations if one.condition is Condition.FORCE]
    found = sorted(
        {f"{'no cycle' if one.cycle is None else f'cycle {one.cycle}'}, {one.set or 'no set'}" for one in pushed}
    )
    there = f"{counted(len(pushed), 'trial')} of it ({'; '.join(found)})" if pushed else "no trial of that condition"
    return DemonstrationError(
        f"a study needs trials of the condition force in cycle {SECOND} and without a set, found {there}; "
        "describe the trials in the logs' metadata record navirl.session (see the documentation of session records)"
    )
