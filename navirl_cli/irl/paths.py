"""Paths drawn from a policy, all at once."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.values import Policy

#: A sampled path this many times longer (in steps) than expected is practically impossible.
PATIENCE = 1000


@dataclass(frozen=True, eq=False)
class SampledPaths(ByContent):
    """Paths of a policy from a start into the goal."""

    #: (paths, longest) cells of the lattice; after its arrival a path stays in the goal.
    states: IntArray
    #: (paths,) number of states up to and with the goal.
    lengths: IntArray

    def __len__(self) -> int:
        """Number of paths."""
        return len(self.lengths)

    def path(self, number: int) -> IntArray:
        """(k,) cells of one path, start and goal included."""
        return self.states[number, : self.lengths[number]]

    def joined(self, others: "SampledPaths", goal: int) -> "SampledPaths":
        """These paths and others of the same policy into the same goal."""
        longest = max(self.states.shape[1], others.states.shape[1])
        both = (
            np.pad(one.states, ((0, 0), (0, longest - one.states.shape[1])), constant_values=goal)
            for one in (self, others)
        )
        return SampledPaths(np.concatenate(list(both)), np.concatenate([self.lengths, others.lengths]))


def sample_paths(policy: Policy, start: int, count: int, rng: np.random.Generator) -> SampledPaths:
    """Draw paths from a policy.

    Args:
        policy: The policy.
        start: Cell of the lattice in which every path starts.
        count: Number of paths.
        rng: Source of randomness.

    Returns:
        The paths.

    Raises:
        RewardError: A path does not arrive within a thousand times the expected number of steps.
    """
    ones = np.ones(policy.graph.size)
    ones[policy.goal] = 0.0
    begin = policy.graph.beginning_in(start)
    limit = int(PATIENCE * policy.expected_to_goal(ones)[begin]) + 100
    # Rounding may leave the last sum below 1; no draw may exceed it.
    threshold = np.cumsum(policy.probability, axis=1)
    threshold /= np.maximum(threshold[:, -1:], 1e-300)
    here = np.full(count, begin)
    columns = [here]
    for _ in range(limit):
        driving = np.flatnonzero(here != policy.goal)
        if len(driving) == 0:
            break
        move = (rng.random(len(driving))[:, None] >= threshold[here[driving]]).sum(axis=1)
        here = here.copy()
        here[driving] = policy.graph.neighbours[here[driving], move]
        columns.append(here)
    else:
        raise RewardError(
            f"a sampled path did not reach the goal within {limit} steps: the cost of path length is too low; "
            "choose a more negative c0"
        )
    states = np.stack(columns, axis=1)
    return SampledPaths(policy.graph.cells_of(states), (states != policy.goal).sum(axis=1) + 1)


def sampled_lines_m(policy: Policy, paths: SampledPaths) -> list[FloatArray]:
    """Every path as a (k, 2) line through the centres of its cells, m, map frame."""
    return [policy.lattice.xy_m[paths.path(number)] for number in range(len(paths))]
