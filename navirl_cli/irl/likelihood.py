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
from navirl_cli.irl.evidence import Evidence, SceneEvidence
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet
from navirl_cli.irl.values import Policy, solve


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
    return solve(scene.ordering, reward.on(scene).value)


def log_likelihood(evidence: Evidence, reward: Reward) -> float:
    """Log-likelihood alone, without derivatives."""
    total = 0.0
    for part in evidence.scenes:
        jet, policy = _solved(part, reward)
        total += float(_step_values(part, jet, policy).sum())
    return total


def value_and_gradient(evidence: Evidence, reward: Reward) -> tuple[float, FloatArray]:
    """Log-likelihood and (k,) gradient at the lowest cost: one solve for the value and one for the visits.

    Raises:
        InfinitePartitionError: The partition function is infinite in one of the scenes.
    """
    value, gradient = 0.0, np.zeros(len(reward.theta))
    for part in evidence.scenes:
        jet, policy = _solved(part, reward)
        value += float(_step_values(part, jet, policy).sum())
        gradient += _at_steps(jet.first, part).sum(axis=0) - _flow(part, policy) @ _means(jet.first, policy)
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
    for part in evidence.scenes:
        jet, policy = _solved(part, reward)
        value += float(_step_values(part, jet, policy).sum())
        slope = policy.expected_to_goal(_means(jet.first, policy))
        for j, one in enumerate(_step_gradients(part, jet, slope).T):
            scores[:, j] += np.bincount(part.owner, one, minlength=evidence.count)
        expected, bend = _curvature(part, jet, policy, slope)
        information += expected
        hessian += bend - expected
    return Likelihood(value, scores.sum(axis=0), hessian, scores, information)


def step_likelihood(evidence: Evidence, reward: Reward) -> StepLikelihood:
    """log p(a|s) of every step with its gradient f(s, a) + Y(s') - Y(s), in the order of the scenes.

    Raises:
        InfinitePartitionError: The partition function is infinite in one of the scenes.
    """
    values, gradients = [], []
    for part in evidence.scenes:
        jet, policy = _solved(part, reward)
        values.append(_step_values(part, jet, policy))
        gradients.append(_step_gradients(part, jet, policy.expected_to_goal(_means(jet.first, policy))))
    owners, numbers = (
        np.concatenate([getattr(part, name) for part in evidence.scenes]) for name in ("owner", "number")
    )
    return StepLikelihood(owners, numbers, np.concatenate(values), np.concatenate(gradients))


def feature_sums(evidence: Evidence, reward: Reward) -> FloatArray:
    """(k,) sums of the features dr/dtheta over the demonstrated steps."""
    sums = [_at_steps(reward.on(part.scene).first, part).sum(axis=0) for part in evidence.scenes]
    return np.asarray(np.sum(sums, axis=0))


def path_covariance(evidence: Evidence, reward: Reward) -> tuple[FloatArray, list[tuple[int, int]]]:
    """Covariance of sums along whole paths, if the reward were true, summed over the demonstrations.

    Args:
        evidence: Gives the scenes and the number of paths from each start.
        reward: The reward; k parameters.

    Returns:
        (k + p, k + p) of the k first derivatives of the reward and the p second ones that are not zero everywhere; the
        pairs of parameters that these belong to.
    """
    pairs = sorted({pair for part in evidence.scenes for pair in reward.on(part.scene).second})
    k = len(reward.theta)
    total = np.zeros((k + len(pairs), k + len(pairs)))
    for part in evidence.scenes:
        jet, policy = _solved(part, reward)
        features = [*jet.first, *(jet.second.get(pair, np.zeros((1, 1))) for pair in pairs)]
        slope = policy.expected_to_goal(_means(features, policy))
        total += _covariance(features, policy, slope, policy.probability * _flow(part, policy)[:, None])
    return total, pairs


def _solved(part: SceneEvidence, reward: Reward) -> tuple[Jet, Policy]:
    """Reward and policy in the evidence's scene."""
    jet = reward.on(part.scene)
    return jet, solve(part.scene.ordering, jet.value)


def _step_values(part: SceneEvidence, jet: Jet, policy: Policy) -> FloatArray:
    """(m,) log p(a|s) of every step."""
    logs: FloatArray = jet.value[part.state, part.move] + policy.value[part.target] - policy.value[part.state]
    return logs


def _at_steps(features: Sequence[FloatArray], part: SceneEvidence) -> FloatArray:
    """(m, k) features, each broadcastable to (n, 8), at the demonstrated steps."""
    shape = part.scene.lattice.neighbours.shape
    return np.stack([np.broadcast_to(feature, shape)[part.state, part.move] for feature in features], axis=1)


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


def _step_gradients(part: SceneEvidence, jet: Jet, slope: FloatArray) -> FloatArray:
    """(m, k) gradient of every step's log-likelihood."""
    gradients: FloatArray = _at_steps(jet.first, part) + slope[part.target] - slope[part.state]
    return gradients


def _flow(part: SceneEvidence, policy: Policy) -> FloatArray:
    """(n,) visits D_w from the net flow w: a state is left w times more often than it is entered."""
    size = part.scene.lattice.size
    net = np.bincount(part.state, minlength=size) - np.bincount(part.target, minlength=size)
    net[part.scene.goal] = 0  # the goal's value is zero whatever the parameters
    return policy.visits(net.astype(float))


def _curvature(part: SceneEvidence, jet: Jet, policy: Policy, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k, k) covariance of the steps' gradient, and the part of the Hessian from the terms' second derivatives."""
    weight = policy.probability * _flow(part, policy)[:, None]
    expected = _covariance(jet.first, policy, slope, weight)
    bend = np.zeros_like(expected)
    for (i, j), second in jet.second.items():
        demonstrated = _at_steps([second], part).sum()
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
    neighbours, k = policy.lattice.neighbours, len(features)
    gains = np.empty((k, *weight.shape))
    for j, (feature, one) in enumerate(zip(features, np.ascontiguousarray(slope.T), strict=True)):
        np.take(one, neighbours, out=gains[j], mode="clip")  # impossible moves have weight 0, whatever stands here
        gains[j] -= one[:, None]
        gains[j] += feature
    flat, weighted = gains.reshape(k, -1), (gains * weight).reshape(k, -1)
    # A few long sums of products: the threads of a linear algebra library would make them slower.
    sums = np.zeros((k, k))
    for i in range(k):
        for j in range(i + 1):
            sums[i, j] = sums[j, i] = np.einsum("i,i->", flat[i], weighted[j])
    return sums
