"""The slow twin of irl.bias: bias, to first order, of a maximum-likelihood fit, from paths drawn from the policy.

D. R. Cox, E. J. Snell, A general definition of residuals, Journal of the Royal Statistical Society B 30 (1968), Sec. 3:

    bias_s = sum_ijk I^si I^jk (kappa_ijk / 2 + kappa_ij,k),

with kappa_ijk the mean third derivative of the log-likelihood and kappa_ij,k the mean of second derivative times
first. A path's log-likelihood is its reward less a function of the parameters, so that every kappa is a moment of the
reward's derivatives summed along paths, and Bartlett's identity gives kappa_ijk from the others. Paths drawn from the
policy give the moments.
"""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import moves_along
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene


@dataclass(frozen=True)
class PathMoments:
    """Moments of the derivatives of one path's log-likelihood, over the policy's paths."""

    #: (k, k) of first with first derivatives: the expected information of a path.
    information: FloatArray
    #: (k, k, k) of three first derivatives.
    skewness: FloatArray
    #: (k, k, k) of a second derivative (i, j) with a first one.
    mixed: FloatArray

    def bias(self, demonstrations: int) -> FloatArray:
        """(k,) bias of each parameter, in its unit, of a fit to so many demonstrations."""
        third = -self.skewness - sum(np.einsum(f"{way}->ijk", self.mixed) for way in ("ijk", "ikj", "jki"))
        inverse = np.linalg.inv(self.information)
        found: FloatArray = np.einsum("si,jk,ijk->s", inverse, inverse, third / 2 + self.mixed) / demonstrations
        return found

    def standard_errors(self, demonstrations: int) -> FloatArray:
        """(k,) standard error of each parameter, in its unit, of a fit to so many demonstrations."""
        errors: FloatArray = np.sqrt(np.diag(np.linalg.inv(self.information)) / demonstrations)
        return errors


def path_moments(reward: Reward, scene: Scene, paths: int, seed: int) -> PathMoments:
    """Moments from so many paths drawn from the reward's policy in a scene."""
    policy = policy_of(reward, scene)
    jet = reward.on(scene)
    drawn = sample_paths(policy, scene.start, paths, np.random.default_rng(seed))
    states = [drawn.path(number) for number in range(paths)]
    state = np.concatenate([path[:-1] for path in states])
    move = np.concatenate([moves_along(scene.lattice.cells[path]) for path in states])
    starts = np.concatenate([[0], np.cumsum(drawn.lengths - 1)[:-1]])

    def summed(feature: FloatArray) -> FloatArray:
        """(paths,) sums along the paths, less their mean."""
        sums = np.add.reduceat(np.broadcast_to(feature, (scene.lattice.size, 8))[state, move], starts)
        centred: FloatArray = sums - sums.mean()
        return centred

    first = np.stack([summed(feature) for feature in jet.first], axis=1)
    mixed = np.zeros((first.shape[1],) * 3)
    for (i, j), second in jet.second.items():
        mixed[i, j] = mixed[j, i] = summed(second) @ first / paths
    skewness = np.einsum("ni,nj,nk->ijk", first, first, first) / paths
    return PathMoments(first.T @ first / paths, skewness, mixed)
