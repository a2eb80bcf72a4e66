"""A scene under a reward as viewers show it: fields over the map, lines, people, pushes, and when all this was."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.paths import Planner
from navirl_cli.planning.problem import Problem

#: Frame of the robot in logs that have none of their own.
ROBOT_FRAME = "base_link"


@dataclass(frozen=True, eq=False)
class Push:
    """A contact as an arrow."""

    #: ns, on the clock of the scene's log.
    t_ns: int
    #: (2,) m, where it began.
    place_m: FloatArray
    #: (2,) N, the mean force over the contact.
    force_n: FloatArray


@dataclass(frozen=True, eq=False)
class SceneView:
    """What is shown. Fields are (rows, columns), row 0 with the lowest y, NaN where the robot cannot be."""

    problem: Problem
    #: Reward of a step by cell, nats, without the cost of path length.
    reward: FloatArray
    #: Expected visits of a path of the policy.
    visits: FloatArray
    #: Lines by name, each (k, 2) m: the nominal one first, then drawn ones.
    lines: dict[str, FloatArray]
    #: The trial whose scene it is; None for another scene.
    demonstration: Demonstration | None

    @property
    def pushes(self) -> list[Push]:
        """The contacts of the demonstration; none where they are unknown."""
        trial = self.demonstration
        if trial is None:
            return []
        starts = [(one, int(np.searchsorted(trial.t_s, one.start_s))) for one in trial.contacts or ()]
        return [
            Push(
                trial.start_ns + round(one.start_s * 1e9),
                trial.xy_m[min(row, len(trial.t_s) - 1)],
                np.array(one.impulse_n_s) / max(one.duration_s, 1e-3),
            )
            for one, row in starts
        ]

    def poses(self, most_hz: float = 20.0) -> tuple[IntArray, FloatArray, FloatArray]:
        """Times in ns, places (k, 2) m and yaws (k,) rad of the demonstration, thinned; empty without one."""
        trial = self.demonstration
        if trial is None:
            return np.empty(0, dtype=np.int64), np.empty((0, 2)), np.empty(0)
        _, rows = np.unique(np.floor(trial.t_s * most_hz), return_index=True)
        return trial.start_ns + np.round(trial.t_s[rows] * 1e9).astype(np.int64), trial.xy_m[rows], trial.yaw_rad[rows]


def view_of(problem: Problem, reward: Reward, trial: Demonstration | None, count: int, seed: int) -> SceneView:
    """Solve a scene and draw paths of its policy.

    Args:
        problem: The scene.
        reward: The reward.
        trial: The demonstration whose scene it is.
        count: Number of drawn paths.
        seed: Of these.

    Raises:
        InfinitePartitionError: The reward has no policy in the scene.
    """
    planner, scene = Planner(problem, reward), problem.scene
    lines = {"nominal": problem.nominal_m}
    if trial is not None:
        lines["demonstrated"] = trial.xy_m
    if count:
        drawn = sample_paths(planner.policy, scene.start, count, np.random.default_rng(seed))
        for number in range(count):
            lines[f"sampled_{number + 1}"] = planner.path(drawn.path(number)).line_m
    return SceneView(
        problem, _over_map(problem, reward.by_cell(scene)), _over_map(problem, planner.visits), lines, trial
    )


def _over_map(problem: Problem, by_state: FloatArray) -> FloatArray:
    """(rows, columns) values of the states, NaN elsewhere."""
    lattice = problem.scene.lattice
    over = np.full(lattice.grid.shape, np.nan)
    columns, rows = lattice.cells.T
    over[rows, columns] = by_state
    return over
