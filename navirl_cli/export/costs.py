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
from navirl_cli.demos.cells import distances_to
from navirl_cli.errors import RewardError
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.planning.paths import Planner, measured
from navirl_cli.planning.problem import Problem
from navirl_cli.planning.recommendation import straight_passage

#: The most that a free cell may cost; 253 and 254 are obstacles.
MOST_COST: Final = 252
#: KeepoutFilter makes 2.54 of one per cent of a mask's occupancy; 100 per cent is an obstacle.
COST_PER_PERCENT, MOST_PERCENT = 2.54, 99
#: What 99 per cent becomes.
MOST_MASK_COST: Final = 251
#: Terms about people, one of which a reward needs, and the others that it may have.
SPACES, LINE = frozenset({"personal-space", "length-space"}), frozenset({"length", "deviation"})
#: Factors of the people's part that are tried.
_FACTORS: Final = np.geomspace(0.1, 8.0, 77)
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
    def peak(self) -> float:
        """Cost that is most that one person causes, as far as a mask holds it."""
        return min(max(self.amplitude, 0.0), MOST_MASK_COST)

    def person_m(self, share: float) -> float:
        """Distance at which a person's cost has fallen to a share of that at the person's place, m."""
        return float(np.sqrt(-2 * self.covariance_m2 * np.log(share)))

    @property
    def flat_within_m(self) -> float:
        """Distance from a person within which all costs are the cap, m; 0 where none is."""
        return self.person_m(MOST_MASK_COST / self.amplitude) if self.amplitude > MOST_MASK_COST else 0.0

    @property
    def line_flat_beyond_m(self) -> float:
        """Distance from the nominal path from which on all costs are the cap, m; infinite without such a term."""
        per_square = float(self.off_the_line(np.array(1.0)))
        return float(np.sqrt(MOST_MASK_COST / per_square)) if per_square > 0 else float("inf")

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

    def over(self, scene: Scene, *, people: bool = True, line: bool = True) -> FloatArray:
        """(rows, columns) costs of all cells of a scene's map, before any cap; row 0 has the lowest y.

        Args:
            scene: The scene.
            people: Whether people count.
            line: Whether the distance from the nominal path counts.
        """
        costs = np.zeros(scene.lattice.grid.shape)
        if people:
            costs += np.maximum(self.near_people(away_from_people_m(scene)), 0.0)
        if line:
            nominal = np.zeros(costs.shape, dtype=bool)
            columns, rows = scene.lattice.cells.T
            nominal[rows, columns] = scene.nominal
            costs += self.off_the_line(distances_to(nominal) * scene.lattice.grid.resolution_m)
        return costs

    def on(self, scene: Scene, *, people: bool = True, line: bool = True) -> FloatArray:
        """(n,) the same by state."""
        columns, rows = scene.lattice.cells.T
        costs: FloatArray = self.over(scene, people=people, line=line)[rows, columns]
        return costs


def percent_of(costs: FloatArray) -> FloatArray:
    """(...) the occupancies of a mask whose costs are nearest, whole per cent, capped below an obstacle."""
    percent: FloatArray = np.clip(np.round(costs / COST_PER_PERCENT), 0, MOST_PERCENT)
    return percent


def mask_costs(costs: FloatArray) -> FloatArray:
    """(...) what KeepoutFilter makes of costs that went through a mask."""
    rounded: FloatArray = np.round(COST_PER_PERCENT * percent_of(costs))
    return rounded


def away_from_people_m(scene: Scene) -> FloatArray:
    """(rows, columns, p) distance of every cell's centre from each person, m."""
    grid = scene.lattice.grid
    rows, columns = np.indices(grid.shape)
    centres = grid.centres_of(np.stack([columns, rows], axis=-1))
    away: FloatArray = np.hypot(*np.moveaxis(centres[..., None, :] - scene.people_m, -1, 0))
    return away


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


@dataclass(frozen=True, eq=False)
class Passing:
    """How a planner passes a person who stands on the robot's straight line, on open ground."""

    model: CostModel
    #: Mean over paths of the policy, between the robot's shell and the person's centre, m.
    policy_m: float
    #: The planner's path, m.
    planner_m: float


def matched(
    name: str,
    reward: Reward,
    resolution_m: float,
    robot_radius_m: float,
    factor: float | None = None,
    *,
    line: bool = False,
    costs: PlannerCosts | None = None,
) -> Passing:
    """Costs with which a planner passes a person as far away as paths of the policy do on average, or a little farther.

    The person is no obstacle here: the costs alone keep the planner away. With the cost off the line it passes at any
    distance; without, the path of least cost leads through the person or passes at a distance of its own.

    Args:
        name: "navfn" or "smac2d".
        reward: To be driven.
        resolution_m: Of its cells, m.
        robot_radius_m: Of the robot, m.
        factor: Of the costs near people, in place of the one that matches best.
        line: Whether the planner also pays for the distance from the nominal path.
        costs: What the planner pays, if that is chosen already.

    Raises:
        RewardError: Costs cannot hold the reward, or it has no policy.
    """
    factors = _FACTORS.tolist() if factor is None else [factor]
    models = [
        CostModel(reward, costs or planner_for(name, reward, resolution_m, one), resolution_m, one) for one in factors
    ]
    problem = straight_passage(robot_radius_m, resolution_m)
    wanted, _ = Planner(problem, reward).passing_m
    found = [Passing(one, wanted, passing_m(one, problem, line=line)) for one in models]
    # a path past people before any that leads through them
    return min(found, key=lambda one: (one.planner_m <= 0, abs(one.planner_m - wanted)))


def passing_m(model: CostModel, problem: Problem, *, line: bool) -> float:
    """Least distance between shell and people of a planner's path in a scene, m."""
    scene = problem.scene
    path = model.planner.path(scene, mask_costs(model.on(scene, line=line)))
    return float(measured(problem, scene.lattice.xy_m[path]).min_distance_m[0])
