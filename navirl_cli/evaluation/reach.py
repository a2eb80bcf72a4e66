"""What the reach of people does to a fit: the same fit to all steps and to those within reach."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.reach import Reach, reach_of, reach_unknown
from navirl_cli.errors import NavirlError
from navirl_cli.evaluation.lines import Lines
from navirl_cli.irl.evidence import Evidence
from navirl_cli.irl.fit import Fit, fit
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, scenes_of
from navirl_cli.irl.selection import Steps, with_steps

#: Paths drawn from each policy in all scenes together, and scenes in which they are drawn.
SAMPLES, MOST_SCENES = 1000, 20
_SEED = 0


@dataclass(frozen=True)
class ReachEffect:
    """A fit to all steps beside a fit to the steps in contact or within reach."""

    reach: Reach
    #: Number of steps in contact or within reach, and of all steps.
    steps_reachable: int
    steps_all: int
    #: Mean least distance between the robot's shell and people's centres on paths of both policies, m; None where a fit
    #: or a policy does not exist.
    min_distance_all_m: float | None
    min_distance_reachable_m: float | None


def reach_effect(
    demonstrations: Sequence[Demonstration],
    found: Fit,
    steps: Steps,
    reach_m: float | None = None,
    evidence: Evidence | None = None,
    executor: Executor | None = None,
) -> ReachEffect | None:
    """Fit again to all steps, and to those in contact or within reach, whichever was not done, and compare.

    The other fits start at the given one and do not look for other maxima.

    Args:
        demonstrations: From which the reward was learnt.
        found: The fit to them, without a bias correction.
        steps: Of this fit.
        reach_m: The person's reach; None for that of the contacts.
        evidence: Of the fit; its scenes are not built again.
        executor: Where to sum over many scenes; by default this process.

    Returns:
        The comparison; None where contacts are unknown, nobody is there to push, or nobody pushed and no reach is
        stated.
    """
    people = [one for one in demonstrations if len(one.people_m)]
    reach = reach_of(demonstrations) if reach_m is None else Reach(reach_m)
    if reach is None or not people or reach_unknown(demonstrations):
        return None
    scenes = [] if evidence is None else [part.scene for part in evidence.scenes]
    rewards: dict[Steps, Reward | None] = {}
    counts: dict[Steps, int] = {}
    for which in (Steps.ALL, Steps.REACHABLE):
        try:
            selected = with_steps(demonstrations, which, reach.reach_m, scenes)
        except NavirlError:  # no step is within reach
            return None
        counts[which] = selected.evidence.steps
        same = which is steps or counts[which] == counts[Steps.ALL] == found.steps
        try:
            rewards[which] = found.reward if same else _again(selected.evidence, found, executor)
        except NavirlError:
            rewards[which] = None
    known = {reward: _least_distance_m(people, reward) for reward in rewards.values() if reward is not None}
    both = [None if reward is None else known[reward] for reward in rewards.values()]
    return ReachEffect(reach, counts[Steps.REACHABLE], counts[Steps.ALL], both[0], both[1])


def _again(evidence: Evidence, found: Fit, executor: Executor | None) -> Reward:
    """The reward of a fit to other steps, which starts at a given one."""
    with evidence.kept_by(executor) as kept:
        return fit(kept, found.reward, found.l2, prior=found.prior, scan=False).reward


def _least_distance_m(people: Sequence[Demonstration], reward: Reward) -> float | None:
    """Mean over paths drawn from a policy in the scenes of demonstrations; None where a scene has no policy."""
    places: dict[tuple[Scene, float], None] = {}
    for one, scene in zip(people, scenes_of(people), strict=True):
        places[scene, one.robot_radius_m] = None
    chosen = list(places)
    if len(chosen) > MOST_SCENES:
        chosen = [chosen[k] for k in np.linspace(0, len(chosen) - 1, MOST_SCENES).round().astype(int)]
    rng, least = np.random.default_rng(_SEED), []
    for scene, radius_m in chosen:
        try:
            policy = policy_of(reward, scene)
            paths = sample_paths(policy, scene.start, max(1, SAMPLES // len(chosen)), rng)
        except NavirlError:
            return None
        lines = scene.lattice.xy_m[paths.states]
        least.append(float(Lines(lines, lines[0], scene.people_m, radius_m).min_distance_m.mean()))
    return float(np.mean(least))
