"""Paths drawn from a learnt policy in a scene, as many as a precision asks for, and what they are like."""

from dataclasses import dataclass
from math import ceil
from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.evaluation.policy_paths import Steps
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import SampledPaths, sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene

#: However small an error is asked for, no more paths are drawn in a scene.
MOST: Final = 100_000


@dataclass(frozen=True)
class Precision:
    """How many paths to draw from a policy in each scene."""

    samples: int = 100
    #: Largest Monte Carlo standard error of an expected value, as a share of that value or of the paths' standard
    #: deviation, whichever is larger; None to draw `samples` and no more.
    error: float | None = None


@dataclass(frozen=True, eq=False)
class Drawn:
    """A policy's paths in a scene."""

    paths: SampledPaths
    #: (paths,) each, by metric.
    values: dict[str, FloatArray]
    #: Exact expected values, where visits give them.
    exact: dict[str, float]


def draw(
    reward: Reward,
    scene: Scene,
    nominal_m: FloatArray,
    robot_radius_m: float,
    precision: Precision,
    rng: np.random.Generator,
) -> Drawn:
    """Draw and measure paths.

    Args:
        reward: What was learnt.
        scene: Where.
        nominal_m: (k, 2) m, for the area under the path.
        robot_radius_m: Taken off distances, m.
        precision: How many paths.
        rng: Source of randomness.

    Raises:
        InfinitePartitionError: The reward has no policy in the scene.
    """
    policy = policy_of(reward, scene)
    steps = Steps.of(scene.lattice, scene.people_m, robot_radius_m)
    paths = sample_paths(policy, scene.start, precision.samples, rng)
    values = steps.measured(paths, nominal_m)
    if precision.error is not None:
        more = _needed(values, precision.error) - len(paths)
        if more > 0:
            paths = paths.joined(sample_paths(policy, scene.start, more, rng), policy.goal)
            values = steps.measured(paths, nominal_m)
    return Drawn(paths, values, steps.expected(policy, scene.start))


def _needed(values: dict[str, FloatArray], error: float) -> int:
    """How many paths a precision takes, as the first paths tell."""
    needed = 0
    for own in values.values():
        spread = float(own.std(ddof=1)) if len(own) > 1 else 0.0
        if np.isfinite(spread) and spread > 0:
            allowed = error * max(abs(float(own.mean())), spread)
            needed = max(needed, ceil((spread / allowed) ** 2))
    return min(needed, MOST)
