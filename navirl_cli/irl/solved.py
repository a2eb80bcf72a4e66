"""A scene solved under a reward."""

from dataclasses import dataclass

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene


@dataclass(frozen=True, eq=False)
class SolvedScene:
    """Visits and reward by state of a solved scene. Unlike a policy it can be passed between processes."""

    scene: Scene
    #: (n,) expected visits of every state by a path from the scene's start.
    visits: FloatArray
    #: (n,) dimensionless reward of a step in every state, without the cost of path length.
    reward_by_cell: FloatArray


def solved(reward: Reward, scene: Scene) -> SolvedScene:
    """Solve a scene under a reward.

    Raises:
        InfinitePartitionError: The reward has no policy in the scene.
    """
    return SolvedScene(scene, policy_of(reward, scene).visits_by_cell(scene.start), reward.by_cell(scene))
