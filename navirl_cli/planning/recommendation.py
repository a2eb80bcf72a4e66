"""How a robot should drive by a reward, in metres: where to pass, when to leave the line, which detour to take."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import Grid
from navirl_cli.demos.lines import path_length_m
from navirl_cli.errors import RewardError
from navirl_cli.evaluation.policy_paths import PolicyLines, Steps
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.paths import Mode, Planner, rewards_of_people
from navirl_cli.planning.problem import Problem, problem_on
from navirl_cli.planning.smooth import Limits, smoothed

#: A straight passage: the robot drives this far past a person who stands in the middle of its line, on open ground that
#: reaches this far to both sides, m.
PASSAGE_M, ASIDE_M = 8.0, 3.0
#: Paths drawn from a policy.
SAMPLES: Final = 300
#: Level of the intervals.
LEVEL: Final = 0.95


@dataclass(frozen=True)
class Quantity:
    """A number with its interval over draws from the estimate; NaN bounds without draws."""

    value: float
    lower: float = float("nan")
    upper: float = float("nan")


@dataclass(frozen=True)
class Recommendation:
    """What paths of the policy do in one scene, on average."""

    #: Least distance between the robot's shell and the nearest person's centre, m.
    passing_m: Quantity
    #: Where paths leave the nominal line, m before the person.
    onset_m: Quantity
    #: Length of the smooth path along the ridge of the visits - length of the nominal line, m.
    detour_m: Quantity
    #: What staying on the nominal line would cost the people more, as metres of path length of the same cost.
    worth_m: Quantity
    #: 95 of 100 paths keep at least this distance between the robot's shell and a person's centre, m.
    least_m: Quantity
    #: Draws from the estimate that have a policy in the scene, and those that have none.
    draws: int = 0
    lost: int = 0


def straight_passage(robot_radius_m: float, resolution_m: float) -> Problem:
    """The scene of a robot whose straight line leads through a person on open ground."""
    columns, rows = round((PASSAGE_M + 1) / resolution_m), 2 * round(ASIDE_M / resolution_m) + 1
    grid = Grid(
        np.zeros((rows, columns), dtype=bool), resolution_m, (-columns * resolution_m / 2, -rows * resolution_m / 2)
    )
    # the line runs through the centres of a row of cells
    return problem_on(grid, (-PASSAGE_M / 2, 0.0), (PASSAGE_M / 2, 0.0), [(0.0, 0.0)], robot_radius_m)


def recommended(problem: Problem, reward: Reward, draws: Sequence[Reward] = ()) -> Recommendation:
    """What paths of a reward do in a scene with people.

    Args:
        problem: The scene.
        reward: The estimate.
        draws: Rewards drawn from its distribution, for the intervals; those without a policy are left out.

    Raises:
        InfinitePartitionError: The reward has no policy in the scene.
    """
    value = _means(problem, reward)
    spread = []
    for one in draws:
        try:
            spread.append(_means(problem, one))
        except RewardError:
            continue
    edges = np.full((2, len(value)), np.nan)
    if spread:
        edges = np.nanquantile(np.array(spread), [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
    passing, onset, detour, worth, least = (Quantity(*map(float, one)) for one in zip(value, *edges, strict=True))
    return Recommendation(passing, onset, detour, worth, least, len(spread), len(draws) - len(spread))


def _means(problem: Problem, reward: Reward) -> FloatArray:
    """(5,) the quantities of a recommendation, over paths drawn with the same seed for every reward."""
    planner = Planner(problem, reward)
    scene = problem.scene
    drawn = sample_paths(planner.policy, scene.start, SAMPLES, np.random.default_rng(0))
    steps = Steps(scene.lattice, scene.people_m, problem.robot_radius_m)
    lines = PolicyLines.of(steps, drawn, problem.nominal_m)
    onset = lines.onset_m
    nominal = problem.nominal_states
    # drawn paths are jagged, so that their lengths say little
    ridge = planner.plan(Mode.EXPECTED)[0].line_m
    typical = smoothed(problem, ridge, scene.lattice.grid.resolution_m, Limits())
    people = rewards_of_people(problem, reward, [nominal, *(drawn.path(number) for number in range(len(drawn)))])
    saved = float(people[1:].mean() - people[0])
    names = [parameter.name for parameter in reward.parameters]
    # Without a cost of path length no detour costs as much.
    per_metre = -reward.theta[names.index("c0")] if "c0" in names else np.nan
    return np.array(
        [
            lines.min_distance_m.mean(),
            np.nanmean(onset) if np.isfinite(onset).any() else np.nan,
            path_length_m(typical.xy_m) - path_length_m(problem.nominal_m),
            saved / per_metre,
            np.quantile(lines.min_distance_m, 1 - LEVEL),
        ]
    )
