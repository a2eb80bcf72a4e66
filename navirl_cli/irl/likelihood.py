"""How likely the demonstrated steps are under a reward, with exact gradient and Hessian.

log p(a|s) = r(s, a) + V(s') - V(s), so that with the soft value's derivative Y_j(s) = dV(s)/dtheta_j, the expected sum
of f_j = dr/dtheta_j from s to the goal, the gradient of a step is f_j(s, a) + Y_j(s') - Y_j(s) (Eq. 6 step by step).
Over the steps of a path the values telescope to R - V(start). The Hessian needs the second derivative of V weighted by
the net flow w of the steps (out of a state minus into it), which is one solve with the transposed policy:

    sum_s w(s) d2V(s) = sum_s D_w(s) ( Cov_a[f_j + Y_j(s'), f_k + Y_k(s')] + E_a[d2r/dj dk] ),  D_w = (I - P^T)^-1 w.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import MOVES, FloatArray, IntArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, scenes_of
from navirl_cli.irl.terms.term import Jet
from navirl_cli.irl.values import Policy, solve


@dataclass(frozen=True)
class SceneEvidence:
    """All steps that were demonstrated in one scene."""

    scene: Scene
    #: (m,) state that each step leaves, and number of its move.
    state: IntArray
    move: IntArray
    #: (m,) number of the demonstration (in the whole list) that each step belongs to.
    owner: IntArray


@dataclass(frozen=True)
class Evidence:
    """Demonstrated steps, by scene."""

    scenes: tuple[SceneEvidence, ...]
    #: Number of demonstrations, and the participant of each.
    count: int
    participants: tuple[str, ...]

    @property
    def steps(self) -> int:
        """Number of steps; repeated steps count each time."""
        return sum(len(part.state) for part in self.scenes)

    def uniform_log_likelihood(self) -> float:
        """Log-likelihood of the same steps when every possible move is equally likely."""
        return -sum(float(np.log(part.scene.lattice.possible[part.state].sum(axis=1)).sum()) for part in self.scenes)


@dataclass(frozen=True)
class Likelihood:
    """Log-likelihood of evidence under a reward, with derivatives by parameter."""

    value: float
    #: (k,) gradient.
    gradient: FloatArray
    #: (k, k) Hessian.
    hessian: FloatArray
    #: (demonstrations, k) gradient of each demonstration's log-likelihood: rows sum to the gradient.
    scores: FloatArray


def evidence_of(demonstrations: Sequence[Demonstration]) -> Evidence:
    """Collect the steps of demonstrations by scene.

    Raises:
        SceneError: A demonstration's scene has no way from start to goal.
        DemonstrationError: A demonstration's path enters its goal before its end, or there is none.
    """
    if not demonstrations:
        raise DemonstrationError("no demonstration to learn from: check --condition, --cycle and --only-corrected")
    steps: dict[int, list[tuple[IntArray, IntArray, int]]] = {}
    scenes = scenes_of(demonstrations)
    for owner, (demonstration, scene) in enumerate(zip(demonstrations, scenes, strict=True)):
        states = scene.lattice.states_of(demonstration.cells)
        if (states[:-1] == scene.goal).any():
            raise DemonstrationError(
                f"demonstration {demonstration.id}: its path passes the goal's cell before it ends there; "
                "end the trial at the first arrival"
            )
        moves = moves_along(demonstration.cells)
        steps.setdefault(id(scene), []).append((states[:-1], moves, owner))
    parts = []
    for scene in {id(scene): scene for scene in scenes}.values():
        own = steps[id(scene)]
        owners = np.concatenate([np.full(len(states), owner) for states, _, owner in own])
        state, move = (np.concatenate([step[i] for step in own]) for i in (0, 1))
        parts.append(SceneEvidence(scene, state, move, owners))
    return Evidence(tuple(parts), len(demonstrations), tuple(d.participant for d in demonstrations))


def moves_along(cells: IntArray) -> IntArray:
    """Numbers of the moves (rows of MOVES) between successive (k, 2) cells."""
    difference = np.diff(cells, axis=0)
    number = np.full((3, 3), -1)
    number[MOVES[:, 0] + 1, MOVES[:, 1] + 1] = np.arange(8)
    moves: IntArray = number[difference[:, 0] + 1, difference[:, 1] + 1]
    return moves


def policy_of(reward: Reward, scene: Scene) -> Policy:
    """The soft-optimal policy of a reward in a scene.

    Raises:
        InfinitePartitionError: The partition function is infinite.
    """
    return solve(scene.lattice, scene.goal, reward.on(scene).value)


def log_likelihood(evidence: Evidence, reward: Reward) -> float:
    """Log-likelihood alone, without derivatives."""
    total = 0.0
    for part in evidence.scenes:
        jet = reward.on(part.scene)
        policy = solve(part.scene.lattice, part.scene.goal, jet.value)
        total += float(_step_log_likelihood(part, jet, policy).sum())
    return total


def likelihood(evidence: Evidence, reward: Reward) -> Likelihood:
    """Log-likelihood, gradient, Hessian and the demonstrations' scores.

    Args:
        evidence: Demonstrated steps.
        reward: The reward; k parameters.

    Raises:
        InfinitePartitionError: The partition function is infinite in one of the scenes.
    """
    k = len(reward.theta)
    value, hessian, scores = 0.0, np.zeros((k, k)), np.zeros((evidence.count, k))
    for part in evidence.scenes:
        jet = reward.on(part.scene)
        policy = solve(part.scene.lattice, part.scene.goal, jet.value)
        value += float(_step_log_likelihood(part, jet, policy).sum())
        slope = policy.expected_to_goal(_means(jet.first, policy))
        steps = _step_gradient(part, jet, slope)
        np.add.at(scores, part.owner, steps)
        hessian += _hessian(part, jet, policy, slope)
    return Likelihood(value, scores.sum(axis=0), hessian, scores)


def _step_log_likelihood(part: SceneEvidence, jet: Jet, policy: Policy) -> FloatArray:
    """(m,) log p(a|s) of every step."""
    target = part.scene.lattice.neighbours[part.state, part.move]
    logs: FloatArray = jet.value[part.state, part.move] + policy.value[target] - policy.value[part.state]
    return logs


def _means(features: Iterable[FloatArray], policy: Policy) -> FloatArray:
    """(n, k) expectation of step features over the moves in each state."""
    inside = policy.probability.sum(axis=1)
    return np.stack(
        [
            feature[:, 0] * inside if feature.shape[1] == 1 else (policy.probability * feature).sum(axis=1)
            for feature in features
        ],
        axis=1,
    )


def _step_gradient(part: SceneEvidence, jet: Jet, slope: FloatArray) -> FloatArray:
    """(m, k) gradient of every step's log-likelihood."""
    lattice = part.scene.lattice
    features = np.stack(
        [np.broadcast_to(first, (lattice.size, 8))[part.state, part.move] for first in jet.first], axis=1
    )
    gradient: FloatArray = features + slope[lattice.neighbours[part.state, part.move]] - slope[part.state]
    return gradient


def _hessian(part: SceneEvidence, jet: Jet, policy: Policy, slope: FloatArray) -> FloatArray:
    """(k, k) Hessian of the log-likelihood of one scene's steps."""
    lattice = part.scene.lattice
    target = lattice.neighbours[part.state, part.move]
    net = np.bincount(part.state, minlength=lattice.size) - np.bincount(target, minlength=lattice.size)
    net[part.scene.goal] = 0  # the goal's value is zero whatever the parameters
    flow = policy.visits(net.astype(float))
    k = len(jet.first)
    result = np.zeros((k, k))
    # What a move changes of the expected sum of features, around its mean Y(s) in the state.
    gains = [
        np.broadcast_to(first, (lattice.size, 8)) + slope[lattice.neighbours, j] - slope[:, j, None]
        for j, first in enumerate(jet.first)
    ]
    weight = policy.probability * flow[:, None]
    for j in range(k):
        weighted = weight * gains[j]
        for i in range(j + 1):
            result[i, j] = result[j, i] = -float((weighted * gains[i]).sum())
    for (i, j), second in jet.second.items():
        demonstrated = float(np.broadcast_to(second, (lattice.size, 8))[part.state, part.move].sum())
        expected = float((weight * second).sum())
        result[i, j] += demonstrated - expected
        if i != j:
            result[j, i] = result[i, j]
    return result
