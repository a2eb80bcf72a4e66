"""Fits of one participant or of all together, and how near the learnt policy's paths come to the demonstrated ones."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from navirl_cli.arrays import ByContent
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.errors import NavirlError
from navirl_cli.evaluation.compare import LEARNT, ON_GRID, compare
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.irl.analyses import Questions, answers
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.intervals import Intervals
from navirl_cli.irl.reward import PAPER_TERMS, Reward
from navirl_cli.irl.terms.term import Term

FIRST, SECOND = 1, 2


@dataclass(frozen=True, eq=False)
class Closeness(ByContent):
    """Properties of a learnt policy's paths beside those of the demonstrations in the same scenes."""

    #: Of the demonstrated paths through the centres of their cells, as the policy's paths go.
    demonstrated: GroupMetrics
    #: Of the policy's paths.
    learnt: GroupMetrics


@dataclass(frozen=True)
class CycleFit:
    """What was learnt from one cycle."""

    fit: Fit
    #: Its policy's paths beside those of the second cycle; None where there is none.
    near: Closeness | None
    #: Of the parameters, by participant first where there are several.
    intervals: tuple[Intervals, ...] = ()


@dataclass(frozen=True)
class Learnt:
    """What was learnt from one participant, or from all."""

    #: None of the fit of all.
    participant: str | None
    #: From the first cycle, from the study's start; None where there is no such demonstration.
    first: CycleFit | None
    #: From the second cycle, warm-started from the first.
    second: CycleFit | None
    #: What could not be done, and why.
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Job:
    """The demonstrations to learn from."""

    participant: str | None
    demonstrations: tuple[Demonstration, ...]
    samples: int
    #: Seed of the sampled paths.
    seed: tuple[int, ...]
    #: Of the reward.
    terms: tuple[Term, ...] = PAPER_TERMS

    def of_cycle(self, cycle: int) -> list[Demonstration]:
        """The demonstrations of one force cycle."""
        return [one for one in self.demonstrations if is_of_cycle(one, cycle)]


def is_of_cycle(demonstration: Demonstration, cycle: int) -> bool:
    """Whether a trial belongs to a force cycle of the passing task."""
    return demonstration.condition is Condition.FORCE and demonstration.cycle == cycle and demonstration.set is None


def people_of(demonstrations: Sequence[Demonstration]) -> list[str]:
    """Participants from whom there is something to learn, in order."""
    return list(
        dict.fromkeys(one.participant for one in demonstrations if is_of_cycle(one, FIRST) or is_of_cycle(one, SECOND))
    )


def jobs_of(
    demonstrations: Sequence[Demonstration], samples: int, seed: int, terms: tuple[Term, ...] = PAPER_TERMS
) -> list[Job]:
    """One job a participant, and last one for the second cycles of all."""
    taught = [one for one in demonstrations if is_of_cycle(one, FIRST) or is_of_cycle(one, SECOND)]
    people = people_of(taught)
    own = [
        Job(name, tuple(one for one in taught if one.participant == name), samples, (seed, number), terms)
        for number, name in enumerate(people)
    ]
    seconds = tuple(one for one in taught if is_of_cycle(one, SECOND))
    return [*own, Job(None, seconds, samples, (seed, len(people)), terms)]


def learn(job: Job) -> Learnt:
    """Fit the first cycle from the initial parameters, the second warm-started from it, and compare paths."""
    rng = np.random.default_rng(job.seed)
    seconds = job.of_cycle(SECOND)
    reward = Reward.named({}, job.terms)
    found: dict[int, CycleFit] = {}
    problems = []
    for cycle in (FIRST, SECOND):
        shown = job.of_cycle(cycle)
        try:
            if shown:
                found[cycle] = _cycle_fit(shown, reward)
                reward = found[cycle].fit.reward
            if shown and seconds:
                near = closeness(reward, seconds, job.samples, rng)
                found[cycle] = replace(found[cycle], near=near)
        except NavirlError as error:
            problems.append(f"{job.participant or 'all'}, cycle {cycle}: {error}")
    return Learnt(job.participant, found.get(FIRST), found.get(SECOND), tuple(problems))


def _cycle_fit(shown: Sequence[Demonstration], start: Reward) -> CycleFit:
    """The fit of some demonstrations with its intervals."""
    evidence = evidence_of(shown)
    # The study does not show the fit's bias, which is computed for whole paths only.
    found, analyses, _ = answers(evidence, fit(evidence, start), Questions(), whole_paths=False)
    return CycleFit(found, None, analyses.intervals)


def closeness(
    reward: Reward, demonstrations: Sequence[Demonstration], samples: int, rng: np.random.Generator
) -> Closeness:
    """Expected properties of a policy's paths in the scenes of demonstrations.

    The expected length is exact; what else there is are means over sampled paths. Scenes count by their number of
    demonstrations, and the spread holds the differences between scenes.

    Args:
        reward: What was learnt.
        demonstrations: What was demonstrated, of one group.
        samples: Paths to sample in each scene.
        rng: Source of randomness.

    Raises:
        RewardError: The reward has no policy in a scene.
    """
    found = compare(demonstrations, {LEARNT: reward}, Precision(samples), rng).groups
    shown, learnt = (next(row for row in found if row.path_type == path_type) for path_type in (ON_GRID, LEARNT))
    return Closeness(shown, learnt)
