"""Fits of one participant or of all together, and how near the learnt policy's paths come to the demonstrated ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.grid import FloatArray
from navirl_cli.errors import NavirlError
from navirl_cli.evaluation.compare import ON_GRID, GroupMetrics, summary_of
from navirl_cli.evaluation.metrics import PathMetrics, path_metrics
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import length_moments, sample_paths, sampled_lines_m
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import scenes_of
from navirl_cli.study.measures import nominal_of

FIRST, SECOND = 1, 2


@dataclass(frozen=True)
class Closeness:
    """Properties of a learnt policy's paths beside those of the demonstrations in the same scenes."""

    #: Of the demonstrated paths through the centres of their cells, as the policy's paths go.
    demonstrated: PathMetrics
    demonstrated_spread: PathMetrics
    #: Under the policy: expected value and standard deviation of one path.
    expected: PathMetrics
    spread: PathMetrics
    #: Monte Carlo standard error of the expected value; 0 of the length, which is exact.
    error: PathMetrics
    demonstrations: int


@dataclass(frozen=True)
class CycleFit:
    """What was learnt from one cycle."""

    fit: Fit
    #: Its policy's paths beside those of the second cycle; None where there is none.
    near: Closeness | None


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
    trouble: tuple[str, ...] = ()


@dataclass(frozen=True)
class Job:
    """The demonstrations to learn from."""

    participant: str | None
    demonstrations: tuple[Demonstration, ...]
    samples: int
    #: Seed of the sampled paths.
    seed: tuple[int, ...]

    def of_cycle(self, cycle: int) -> list[Demonstration]:
        """The demonstrations of one force cycle."""
        return [one for one in self.demonstrations if is_of_cycle(one, cycle)]


def is_of_cycle(demonstration: Demonstration, cycle: int) -> bool:
    """Whether a trial belongs to a force cycle of the passing task."""
    return demonstration.condition is Condition.FORCE and demonstration.cycle == cycle and demonstration.set is None


def jobs_of(demonstrations: Sequence[Demonstration], samples: int, seed: int) -> list[Job]:
    """One job a participant, and last one for the second cycles of all."""
    taught = [one for one in demonstrations if is_of_cycle(one, FIRST) or is_of_cycle(one, SECOND)]
    people = list(dict.fromkeys(one.participant for one in taught))
    own = [
        Job(name, tuple(one for one in taught if one.participant == name), samples, (seed, number))
        for number, name in enumerate(people)
    ]
    seconds = tuple(one for one in taught if is_of_cycle(one, SECOND))
    return [*own, Job(None, seconds, samples, (seed, len(people)))]


def learn(job: Job) -> Learnt:
    """Fit the first cycle from the study's initial parameters, the second warm-started from it, and compare paths."""
    rng = np.random.default_rng(job.seed)
    seconds = job.of_cycle(SECOND)
    reward = Reward.named({})
    found: dict[int, CycleFit] = {}
    trouble = []
    for cycle in (FIRST, SECOND):
        shown = job.of_cycle(cycle)
        try:
            if shown:
                fitted = fit(evidence_of(shown), reward)
                reward = fitted.reward
                found[cycle] = CycleFit(fitted, closeness(reward, seconds, job.samples, rng) if seconds else None)
        except NavirlError as error:
            trouble.append(f"{job.participant or 'all'}, cycle {cycle}: {error}")
    return Learnt(job.participant, found.get(FIRST), found.get(SECOND), tuple(trouble))


def closeness(
    reward: Reward, demonstrations: Sequence[Demonstration], samples: int, rng: np.random.Generator
) -> Closeness:
    """Expected properties of a policy's paths in the scenes of demonstrations.

    The expected length and its spread are exact; distance and area are means over sampled paths. Scenes count by their
    number of demonstrations, and the spread holds the differences between scenes.

    Args:
        reward: What was learnt.
        demonstrations: What was demonstrated.
        samples: Paths to sample in each scene.
        rng: Source of randomness.

    Raises:
        RewardError: The reward has no policy in a scene.
    """
    scenes = scenes_of(demonstrations)
    shown, drawn, weights = [], [], []
    for scene in {id(scene): scene for scene in scenes}.values():
        members = [one for one, its in zip(demonstrations, scenes, strict=True) if its is scene]
        nominal = nominal_of(members[0], scene)
        shown += [_on_grid(one.grid.centres_of(one.cells), one, nominal) for one in members]
        policy = policy_of(reward, scene)
        lines = sampled_lines_m(policy, sample_paths(policy, scene.start, samples, rng))
        sampled = summary_of("", ON_GRID, [_on_grid(line, members[0], nominal) for line in lines])
        drawn.append(_expected(sampled, length_moments(policy, scene.start)))
        weights.append(len(members) / len(demonstrations))
    demonstrated = summary_of("", ON_GRID, shown)
    means, variances, errors = np.moveaxis(np.array(drawn), 1, 0)
    share = np.array(weights)
    expected = share @ means
    return Closeness(
        demonstrated=demonstrated.mean,
        demonstrated_spread=demonstrated.std,
        expected=PathMetrics(*expected.tolist()),
        # the law of total variance
        spread=PathMetrics(*np.sqrt(share @ (variances + (means - expected) ** 2)).tolist()),
        error=PathMetrics(*np.sqrt(share**2 @ errors**2).tolist()),
        demonstrations=len(demonstrations),
    )


def _on_grid(line_m: FloatArray, one: Demonstration, nominal_m: FloatArray) -> PathMetrics:
    """Properties of a line in the scene of a demonstration."""
    return path_metrics(line_m, nominal_m, one.people_m, one.robot_radius_m)


def _expected(sampled: GroupMetrics, length: tuple[float, float]) -> FloatArray:
    """(3, 3): mean, variance and Monte Carlo error of length (known exactly), distance and area in one scene."""
    mean, std = sampled.mean, sampled.std
    exact_mean, exact_variance = length
    error = np.array([0.0, std.min_distance_m, std.area_m2]) / np.sqrt(sampled.count)
    return np.array(
        [
            [exact_mean, mean.min_distance_m, mean.area_m2],
            [exact_variance, std.min_distance_m**2, std.area_m2**2],
            error,
        ]
    )
