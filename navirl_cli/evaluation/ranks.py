"""How well a learnt policy explains each path: the rank of its log-likelihood among those of the policy's own paths.

If demonstrations came from the policy, ranks would be uniform between 0 and 1 (A. P. Dawid, Statistical theory: the
prequential approach, Journal of the Royal Statistical Society A 147 (1984); S. Talts et al., Validating Bayesian
inference algorithms with simulation-based calibration, 2018). Paths that the policy hardly takes have ranks near 0.
Many ranks near 1 belong to demonstrations that are more typical than the policy's own paths.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import moves_along
from navirl_cli.evaluation.groups import group_of
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import SampledPaths, sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, scenes_of
from navirl_cli.irl.values import Policy


@dataclass(frozen=True)
class Rank:
    """The rank of one demonstration."""

    id: str
    group: str
    #: Of the demonstrated path under the policy, nats.
    log_likelihood: float
    #: Share of the policy's paths that are less likely, in [0, 1]; ties are broken at random.
    rank: float


def ranks_of(
    demonstrations: Sequence[Demonstration],
    reward: Reward,
    samples: int,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> list[Rank]:
    """Rank demonstrations among paths drawn from a policy in their scenes.

    Args:
        demonstrations: Preferably such as the reward was not learnt from.
        reward: What was learnt.
        samples: Paths to draw in each scene.
        rng: Source of randomness.
        progress: Called with demonstrations done and in all.

    Raises:
        SceneError: A demonstration's scene has no path from start to goal.
        InfinitePartitionError: The reward has no policy in a scene.
    """
    drawn: dict[Scene, tuple[Policy, FloatArray]] = {}
    found = []
    for number, (one, scene) in enumerate(zip(demonstrations, scenes_of(demonstrations), strict=True)):
        if scene not in drawn:
            policy = policy_of(reward, scene)
            drawn[scene] = policy, sampled_log_likelihoods(policy, sample_paths(policy, scene.start, samples, rng))
        policy, among = drawn[scene]
        own = path_log_likelihood(policy, scene.lattice.states_of(one.cells), moves_along(one.cells))
        # Sums in another order differ in their last digits.
        below, equal = (among < own - 1e-9).sum(), (np.abs(among - own) <= 1e-9).sum()
        rank = (below + rng.uniform() * (equal + 1)) / (samples + 1)
        found.append(Rank(one.id, group_of(one), own, float(rank)))
        if progress is not None:
            progress(number + 1, len(demonstrations))
    return found


def path_log_likelihood(policy: Policy, states: IntArray, moves: IntArray) -> float:
    """Log-probability of a (k,) path's k - 1 moves, nats; -inf where the policy never makes one."""
    return float(policy.log_likelihoods(states, moves).sum())


def sampled_log_likelihoods(policy: Policy, paths: SampledPaths) -> FloatArray:
    """(paths,) log-probabilities of paths drawn from the policy, nats."""
    moves = moves_along(policy.lattice.cells[paths.states])
    total: FloatArray = policy.log_likelihoods(paths.states, moves).sum(axis=1)
    return total


def uniformity(ranks: Sequence[Rank]) -> tuple[float, float]:
    """Kolmogorov and Smirnov's distance of ranks from the uniform, and its exact p-value."""
    from scipy.stats import kstest

    found = kstest([one.rank for one in ranks], "uniform")
    return float(found.statistic), float(found.pvalue)
