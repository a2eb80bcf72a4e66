"""A reward as costs of Nav2's planners.

A planner pays for length and for the cost of the cells that it enters. Only the ratio of the two decides its path. So
the reward of a cell is divided by the reward c0 h of a cell's side, and multiplied by what the planner pays for a cell
without cost (facts in nav2_navfn_planner and nav2_smac_planner of ros-navigation/navigation2):

    NavFn          50 + 0.8 c for each cell of length
    SmacPlanner2D  length (1 + m c / 252), with cost_travel_multiplier m

The planners drive the one path of least cost, while a policy weighs all paths by exp(reward). The least costly path
passes people nearer than paths of the policy do, or leads through them: many longer paths together are more probable.
:func:`matched` therefore scales the people's part until the planner passes where the policy's paths pass on average.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.errors import RewardError
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.planning.paths import Planner, measured
from navirl_cli.planning.problem import Problem
from navirl_cli.planning.recommendation import straight_passage

#: The most that a free cell may cost; 253 and 254 are obstacles.
MOST_COST: Final = 252
#: What a mask's occupancy of 99 becomes: 100 is an obstacle.
MOST_MASK_COST: Final = 251
#: Terms about people, one of which a reward needs, and the others that it may have.
SPACES, LINE = frozenset({"personal-space", "length-space"}), frozenset({"length", "deviation"})
#: Factors of the people's part that are tried, from the reward's own on.
_FACTORS: Final = np.geomspace(1.0, 8.0, 43)
#: Largest cost_travel_multiplier that is written.
_MOST_MULTIPLIER: Final = 8.0


@dataclass(frozen=True)
class PlannerCosts:
    """What a planner pays."""

    #: "navfn" or "smac2d".
    planner: str
    #: Of a cell's side without cost.
    neutral: float
    #: Of a cell's side for each unit of cost.
    per_cost: float
    #: SmacPlanner2D's cost_travel_multiplier; 1 for NavFn, which has none.
    multiplier: float = 1.0

    @property
    def amplitude(self) -> float:
        """Cost of a cell that is as bad as one more cell's side of length."""
        return self.neutral / self.per_cost

    def path(self, scene: Scene, cost: FloatArray) -> IntArray:
        """The path of least cost on 8-connected cells.

        Args:
            scene: The scene.
            cost: (n,) cost of every state, 0 to 252.

        Returns:
            (k,) states from start to goal.
        """
        lattice = scene.lattice
        paid = (self.neutral + self.per_cost * cost)[lattice.neighbours]
        return lattice.descend(scene.start, scene.goal, paid * lattice.step_m / lattice.grid.resolution_m)


def navfn() -> PlannerCosts:
    """NavFn: 50 + 0.8 cost."""
    return PlannerCosts("navfn", 50.0, 0.8)


def smac2d(multiplier: float = 1.0) -> PlannerCosts:
    """SmacPlanner2D: length (1 + multiplier cost / 252)."""
    return PlannerCosts("smac2d", 1.0, multiplier / MOST_COST, multiplier)


@dataclass(frozen=True, eq=False)
class CostModel:
    """A reward as costs of a planner."""

    reward: Reward
    planner: PlannerCosts
    #: Of the cells that the reward was learnt on, m.
    resolution_m: float
    #: By which the costs near people exceed those of the reward itself.
    people_factor: float = 1.0

    def __post_init__(self) -> None:
        """Refuse a reward that no planner can drive."""
        names = [term.name for term in self.reward.terms]
        if not (SPACES & set(names) and set(names) <= SPACES | LINE):
            raise RewardError(
                f"expected a reward of length, {' or '.join(sorted(SPACES))} and at most deviation, which are what a "
                f"planner's costs can hold, found {', '.join(names)}; fit one with such `terms`"
            )
        if self._theta.get("c0", 0.0) >= 0:
            raise RewardError(
                "expected a reward with a cost of path length (c0 below 0), to which a planner's costs are relative, "
                f"found c0 = {self._theta.get('c0', 0.0):g}"
            )

    @property
    def _theta(self) -> Mapping[str, float]:
        return {p.name: value for p, value in zip(self.reward.parameters, self.reward.theta, strict=True)}

    @property
    def _space(self) -> tuple[float, float]:
        """Reward of a straight step at a person's place, nats, and its decay, 1/m^2."""
        theta = self._theta
        if "a_p" in theta:
            return theta["a_p"], theta["sigma_p"]
        return theta["a_l"] * self.resolution_m, theta["sigma_l"]

    @property
    def cell_reward(self) -> float:
        """Reward of a cell's side of length, nats."""
        return self._theta["c0"] * self.resolution_m

    @property
    def amplitude(self) -> float:
        """Cost at a person's place, before any cap."""
        return self.people_factor * self.planner.amplitude * self._space[0] / self.cell_reward

    @property
    def covariance_m2(self) -> float:
        """Of the Gaussian around a person: sigma_p d^2 = d^2 / (2 covariance)."""
        return 1 / (2 * self._space[1])

    def near_people(self, away_m: FloatArray) -> FloatArray:
        """Costs of people at distances, before any cap.

        Args:
            away_m: (..., p) m, from each of p people.

        Returns:
            (...) costs; those of several people add up.
        """
        bumps: FloatArray = np.exp(-self._space[1] * away_m**2)
        costs: FloatArray = self.amplitude * bumps.sum(axis=-1)
        return costs

    def off_the_line(self, deviation_m: FloatArray) -> FloatArray:
        """Costs of distances from the nominal path, before any cap; 0 without such a term."""
        a_g = self._theta.get("a_g", 0.0)
        costs: FloatArray = self.planner.amplitude * a_g * deviation_m**2 / self.cell_reward
        return np.maximum(costs, 0.0)

    def on(self, scene: Scene, *, deviation: bool) -> FloatArray:
        """(n,) costs of the states of a scene, before any cap.

        Args:
            scene: The scene.
            deviation: Whether the distance from the nominal path counts.
        """
        away = np.hypot(*np.moveaxis(scene.lattice.xy_m[:, None] - scene.people_m[None], -1, 0))
        costs = np.maximum(self.near_people(away), 0.0)
        return costs + self.off_the_line(scene.deviation_m) if deviation else costs


def planner_for(name: str, reward: Reward, resolution_m: float, people_factor: float = 1.0) -> PlannerCosts:
    """The planner's costs, with the smallest multiplier at which the people's costs stay within their range.

    Args:
        name: "navfn" or "smac2d".
        reward: To be driven.
        resolution_m: Of its cells, m.
        people_factor: Of the costs near people.
    """
    if name == "navfn":
        return navfn()
    amplitude = CostModel(reward, smac2d(), resolution_m, people_factor).amplitude
    return smac2d(float(np.clip(np.ceil(2 * amplitude / MOST_MASK_COST) / 2, 1.0, _MOST_MULTIPLIER)))


def matched(name: str, reward: Reward, resolution_m: float, robot_radius_m: float) -> CostModel:
    """Costs with which a planner passes a person as far away as paths of the policy do on average.

    The factor is found in the scene of a person who stands on the robot's straight line, on open ground.

    Args:
        name: "navfn" or "smac2d".
        reward: To be driven.
        resolution_m: Of its cells, m.
        robot_radius_m: Of the robot, m.

    Raises:
        InfinitePartitionError: The reward has no policy there.
    """
    problem = straight_passage(robot_radius_m, resolution_m)
    wanted, _ = Planner(problem, reward).passing_m
    models = [CostModel(reward, planner_for(name, reward, resolution_m, f), resolution_m, f) for f in _FACTORS.tolist()]
    apart = [abs(passing_m(one, problem) - wanted) for one in models]
    return models[int(np.argmin(apart))]


def passing_m(model: CostModel, problem: Problem) -> float:
    """Least distance between shell and people of a planner's path in a scene, m."""
    scene = problem.scene
    costs = np.minimum(model.on(scene, deviation=True), MOST_COST)
    path = model.planner.path(scene, costs)
    return float(measured(problem, scene.lattice.xy_m[path]).min_distance_m[0])
