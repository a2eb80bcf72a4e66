"""Likelihood of the demonstrated steps under a reward, with exact gradient and Hessian.

log p(a|s) = r(s, a) + V(s') - V(s). Let Y_j(s) = dV(s)/dtheta_j be the derivative of the soft value, which is the
expected sum of f_j = dr/dtheta_j from s to the goal. The gradient of a step is f_j(s, a) + Y_j(s') - Y_j(s) (Eq. 6 step
by step). Over the steps of a path the values telescope to R - V(start).
The Hessian needs the second derivative of V, weighted by the net flow w of the steps (out of a state minus into it).
This is one solve with the transposed policy:

    sum_s w(s) d2V(s) = sum_s D_w(s) ( Cov_a[f_j + Y_j(s'), f_k + Y_k(s')] + E_a[d2r/dj dk] ),  D_w = (I - P^T)^-1 w.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.irl.evidence import Block, Evidence, SceneEvidence
from navirl_cli.irl.graph import Graph
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet
from navirl_cli.irl.values import Policy, solve

#: States whose products are summed at once, so that large maps take little memory.
BLOCK = 1 << 16


@dataclass(frozen=True, eq=False)
class Likelihood(ByContent):
    """Log-likelihood of evidence under a reward, with derivatives by parameter."""

    value: float
    #: (k,) gradient.
    gradient: FloatArray
    #: (k, k) Hessian.
    hessian: FloatArray
    #: (demonstrations, k) gradient of each demonstration's log-likelihood: rows sum to the gradient.
    scores: FloatArray
    #: (k, k) covariance of the gradient if the reward were true (Fisher's information).
    information: FloatArray


@dataclass(frozen=True, eq=False)
class StepLikelihood(ByContent):
    """The likelihood step by step."""

    #: (m,) number of the demonstration that each step belongs to, and of the step on its path.
    demonstration: IntArray
    number: IntArray
    #: (m,) log p(a|s).
    value: FloatArray
    #: (m, k) gradient of each.
    gradient: FloatArray


def policy_of(reward: Reward, scene: Scene) -> Policy:
    """The soft-optimal policy of a reward in a scene.

    Raises:
        InfinitePartitionError: The partition function is infinite.
    """
    return solve(reward.ordering(scene), reward.on(scene).value)


def log_likelihood(evidence: Evidence, reward: Reward) -> float:
    """Log-likelihood alone, without derivatives."""
    return sum(evidence.by_block(_log_likelihood, reward))


def log_likelihoods(evidence: Evidence, reward: Reward) -> FloatArray:
    """(demonstrations,) log-likelihood of each alone, without derivatives."""
    return np.asarray(np.sum(evidence.by_block(_log_likelihoods, (reward, evidence.count)), axis=0))


def value_and_gradient(evidence: Evidence, reward: Reward) -> tuple[float, FloatArray]:
    """Log-likelihood and (k,) gradient at the lowest cost: one solve for the value and one for the visits.

    Raises:
        InfinitePartitionError: The partition function is infinite in one of the scenes.
    """
    value, gradient = 0.0, np.zeros(len(reward.theta))
    for one, slope in evidence.by_block(_value_and_gradient, reward):
        value += one
        gradient += slope
    return value, gradient


def likelihood(evidence: Evidence, reward: Reward) -> Likelihood:
    """Log-likelihood, gradient, Hessian and the demonstrations' scores.

    Args:
        evidence: Demonstrated steps.
        reward: The reward; k parameters.

    Raises:
        InfinitePartitionError: The partition function is infinite in one of the scenes.
    """
    k = len(reward.theta)
    value, hessian, scores, information = 0.0, np.zeros((k, k)), np.zeros((evidence.count, k)), np.zeros((k, k))
    for block in evidence.by_block(_likelihood, reward):
        value += block.value
        scores[block.owners] += block.scores
        information += block.information
        hessian += block.hessian
    return Likelihood(value, scores.sum(axis=0), hessian, scores, information)


def step_likelihood(evidence: Evidence, reward: Reward) -> StepLikelihood:
    """log p(a|s) of every step with its gradient f(s, a) + Y(s') - Y(s), in the order of the scenes.

    Raises:
        InfinitePartitionError: The partition function is infinite in one of the scenes.
    """
    values, gradients = zip(*evidence.by_block(_step_likelihood, reward), strict=True)
    owners, numbers = (
        np.concatenate([getattr(part, name) for part in evidence.scenes]) for name in ("owner", "number")
    )
    return StepLikelihood(owners, numbers, np.concatenate(values), np.concatenate(gradients))


def feature_sums(evidence: Evidence, reward: Reward) -> FloatArray:
    """(k,) sums of the features dr/dtheta over the demonstrated steps."""
    return np.asarray(np.sum(evidence.by_block(_feature_sums, reward), axis=0))


def path_covariance(evidence: Evidence, reward: Reward) -> tuple[FloatArray, list[tuple[int, int]]]:
    """Covariance of sums along whole paths, if the reward were true, summed over the demonstrations.

    Args:
        evidence: Gives the scenes and the number of paths from each start.
        reward: The reward; k parameters.

    Returns:
        (k + p, k + p) of the k first derivatives of the reward and the p second ones that are not zero everywhere; the
        pairs of parameters that these belong to.
    """
    pairs = sorted(set().union(*evidence.by_block(_bent_pairs, reward)))
    k = len(reward.theta)
    total = np.zeros((k + len(pairs), k + len(pairs)))
    for block in evidence.by_block(_path_covariance, (reward, pairs)):
        total += block
    return total, pairs


@dataclass(frozen=True, eq=False)
class _BlockLikelihood:
    """As :class:`Likelihood`, of a block; rows of scores belong to the demonstrations ``owners``."""

    value: float
    hessian: FloatArray
    owners: IntArray
    scores: FloatArray
    information: FloatArray


def _log_likelihood(block: Block, reward: Reward) -> float:
    """:func:`log_likelihood` of a block."""
    total = 0.0
    for part in block:
        jet, policy, steps = _solved(part, reward)
        total += float(steps.values(jet, policy).sum())
    return total


def _log_likelihoods(block: Block, asked: tuple[Reward, int]) -> FloatArray:
    """:func:`log_likelihoods` of a block, by reward and number of demonstrations."""
    reward, count = asked
    total = np.zeros(count)
    for part in block:
        jet, policy, steps = _solved(part, reward)
        total += np.bincount(part.owner, steps.values(jet, policy), minlength=count)
    return total


def _value_and_gradient(block: Block, reward: Reward) -> tuple[float, FloatArray]:
    """:func:`value_and_gradient` of a block."""
    value, gradient = 0.0, np.zeros(len(reward.theta))
    for part in block:
        jet, policy, steps = _solved(part, reward)
        value += float(steps.values(jet, policy).sum())
        gradient += steps.features(jet.first).sum(axis=0) - steps.flow(policy) @ _means(jet.first, policy)
    return value, gradient


def _likelihood(block: Block, reward: Reward) -> _BlockLikelihood:
    """:func:`likelihood` of a block."""
    k, owners = len(reward.theta), np.unique(np.concatenate([part.owner for part in block]))
    value, hessian, scores, information = 0.0, np.zeros((k, k)), np.zeros((len(owners), k)), np.zeros((k, k))
    for part in block:
        jet, policy, steps = _solved(part, reward)
        value += float(steps.values(jet, policy).sum())
        slope = policy.expected_to_goal(_means(jet.first, policy))
        rows = np.searchsorted(owners, part.owner)
        for j, one in enumerate(steps.gradients(jet, slope).T):
            scores[:, j] += np.bincount(rows, one, minlength=len(owners))
        expected, bend = _curvature(steps, jet, policy, slope)
        information += expected
        hessian += bend - expected
    return _BlockLikelihood(value, hessian, owners, scores, information)


def _step_likelihood(block: Block, reward: Reward) -> tuple[FloatArray, FloatArray]:
    """Values and gradients of :func:`step_likelihood` of a block."""
    values, gradients = [], []
    for part in block:
        jet, policy, steps = _solved(part, reward)
        values.append(steps.values(jet, policy))
        gradients.append(steps.gradients(jet, policy.expected_to_goal(_means(jet.first, policy))))
    return np.concatenate(values), np.concatenate(gradients)


def _feature_sums(block: Block, reward: Reward) -> FloatArray:
    """:func:`feature_sums` of a block."""
    sums = [
        _Steps.of(part, reward.ordering(part.scene).graph).features(reward.on(part.scene).first).sum(axis=0)
        for part in block
    ]
    return np.asarray(np.sum(sums, axis=0))


def _bent_pairs(block: Block, reward: Reward) -> set[tuple[int, int]]:
    """Pairs of parameters by which the reward has second derivatives somewhere in a block."""
    return {pair for part in block for pair in reward.on(part.scene).second}


def _path_covariance(block: Block, asked: tuple[Reward, Sequence[tuple[int, int]]]) -> FloatArray:
    """:func:`path_covariance` of a block, by reward and pairs of parameters."""
    reward, pairs = asked
    size = len(reward.theta) + len(pairs)
    total = np.zeros((size, size))
    for part in block:
        jet, policy, steps = _solved(part, reward)
        features = [*jet.first, *(jet.second.get(pair, np.zeros((1, 1))) for pair in pairs)]
        slope = policy.expected_to_goal(_means(features, policy))
        total += _covariance(features, policy, slope, policy.probability * steps.flow(policy)[:, None])
    return total


@dataclass(frozen=True, eq=False)
class _Steps:
    """Demonstrated steps on the states of a graph."""

    graph: Graph
    #: (m,) state that each step leaves, number of its move, and state that it leads to.
    state: IntArray
    move: IntArray
    target: IntArray

    @staticmethod
    def of(part: SceneEvidence, graph: Graph) -> "_Steps":
        """The steps of evidence."""
        state = part.states_in(graph)
        return _Steps(graph, state, part.move, graph.neighbours[state, part.move])

    def values(self, jet: Jet, policy: Policy) -> FloatArray:
        """(m,) log p(a|s) of every step."""
        logs: FloatArray = jet.value[self.state, self.move] + policy.value[self.target] - policy.value[self.state]
        return logs

    def features(self, features: Sequence[FloatArray]) -> FloatArray:
        """(m, k) features, each broadcastable to (n, 8), at the steps."""
        shape = self.graph.neighbours.shape
        return np.stack([np.broadcast_to(feature, shape)[self.state, self.move] for feature in features], axis=1)

    def gradients(self, jet: Jet, slope: FloatArray) -> FloatArray:
        """(m, k) gradient of every step's log-likelihood."""
        gradients: FloatArray = self.features(jet.first) + slope[self.target] - slope[self.state]
        return gradients

    def flow(self, policy: Policy) -> FloatArray:
        """(n,) visits D_w from the net flow w: a state is left w times more often than it is entered."""
        size = self.graph.size
        net = np.bincount(self.state, minlength=size) - np.bincount(self.target, minlength=size)
        net[policy.goal] = 0  # the goal's value is zero whatever the parameters
        return policy.visits(net.astype(float))


def _solved(part: SceneEvidence, reward: Reward) -> tuple[Jet, Policy, _Steps]:
    """Reward and policy in the evidence's scene, and the steps on its states."""
    jet, ordering = reward.on(part.scene), reward.ordering(part.scene)
    return jet, solve(ordering, jet.value), _Steps.of(part, ordering.graph)


def _means(features: Sequence[FloatArray], policy: Policy) -> FloatArray:
    """(n, k) expectation of step features over the moves in each state."""
    return np.stack(
        [
            # Features by cell have a zero in the goal's row.
            feature[:, 0] if feature.shape[1] == 1 else (policy.probability * feature).sum(axis=1)
            for feature in features
        ],
        axis=1,
    )


def _curvature(steps: _Steps, jet: Jet, policy: Policy, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k, k) covariance of the steps' gradient, and the part of the Hessian from the terms' second derivatives."""
    weight = policy.probability * steps.flow(policy)[:, None]
    expected = _covariance(jet.first, policy, slope, weight)
    bend = np.zeros_like(expected)
    for (i, j), second in jet.second.items():
        demonstrated = steps.features([second]).sum()
        bend[i, j] = bend[j, i] = demonstrated - float((weight * second).sum())
    return expected, bend


def _covariance(features: Sequence[FloatArray], policy: Policy, slope: FloatArray, weight: FloatArray) -> FloatArray:
    """(k, k) weighted sum, over states and moves, of products of a move's changes of the expected feature sums.

    Args:
        features: k arrays, each broadcastable to (n, 8).
        policy: The policy.
        slope: (n, k) expected sums Y of the features from every state to the goal.
        weight: (n, 8) expected number of times that each step is taken.
    """
    k, slopes = len(features), np.ascontiguousarray(slope.T)
    sums = np.zeros((k, k))
    for low in range(0, len(weight), BLOCK):
        block = slice(low, low + BLOCK)
        weights, neighbours = weight[block], policy.graph.neighbours[block]
        gains = np.empty((k, *weights.shape))
        for j, (feature, one) in enumerate(zip(features, slopes, strict=True)):
            np.take(one, neighbours, out=gains[j], mode="clip")  # impossible moves have weight 0, whatever stands here
            gains[j] -= one[block, None]
            gains[j] += feature if len(feature) == 1 else feature[block]
        flat, weighted = gains.reshape(k, -1), (gains * weights).reshape(k, -1)
        # A few long sums of products: the threads of a linear algebra library would make them slower.
        for i in range(k):
            for j in range(i + 1):
                sums[i, j] += np.einsum("i,i->", flat[i], weighted[j])
    return sums + np.tril(sums, -1).T
