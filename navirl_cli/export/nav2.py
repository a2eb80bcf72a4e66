"""What a Nav2 robot is given of a reward, and what of it costs cannot hold."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Required, TypedDict, Unpack

from navirl_cli.arrays import FloatArray
from navirl_cli.export.costs import MOST_MASK_COST, CostModel, Passing, matched
from navirl_cli.export.fragments import Distro
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.problem import Problem

#: Planner and policy agree up to this, m.
_APART_M: Final = 0.15


class Field(StrEnum):
    """What a static mask holds."""

    PEOPLE = "people"
    LINE = "line"
    BOTH = "both"


class Options(TypedDict, total=False):
    """Fields of :class:`Nav2Export` that a user chooses."""

    distro: Required[Distro]
    problem: Problem | None
    field: Field
    slow_percent: float | None


@dataclass(frozen=True, eq=False)
class Nav2Export:
    """What is exported."""

    #: Costs of people alone: of the live mask, and of static ones without the nominal line.
    passing: Passing
    distro: Distro
    robot_radius_m: float
    #: For static masks.
    problem: Problem | None = None
    field: Field = Field.PEOPLE
    #: Per cent of the full speed at people; None without a speed mask.
    slow_percent: float | None = None
    #: Costs of people beside those off the nominal line; None without such a mask.
    beside_line: Passing | None = None

    @property
    def model(self) -> CostModel:
        """The costs of people alone."""
        return self.passing.model

    @property
    def mask_model(self) -> CostModel:
        """The costs of the static mask."""
        return self.model if self.beside_line is None else self.beside_line.model

    @property
    def passings(self) -> list[tuple[str, Passing]]:
        """How the planner passes a person, by what it pays for."""
        beside = [] if self.beside_line is None else [("people and line", self.beside_line)]
        return [("people", self.passing), *beside]

    @property
    def slows(self) -> bool:
        """Whether there is a speed mask."""
        return self.problem is not None and self.slow_percent is not None

    def costs(self, problem: Problem) -> FloatArray:
        """(rows, columns) costs of the static mask, before any cap."""
        return self.mask_model.over(
            problem.scene, people=self.field is not Field.LINE, line=self.field is not Field.PEOPLE
        )


def nav2_export(
    reward: Reward,
    resolution_m: float,
    robot_radius_m: float,
    planner: str = "navfn",
    factor: float | None = None,
    **more: Unpack[Options],
) -> Nav2Export:
    """Costs for a planner, matched to the policy for what the masks hold.

    Args:
        reward: The reward.
        resolution_m: Of the cells on which it was learnt, m.
        robot_radius_m: Of the robot, m.
        planner: "navfn" or "smac2d".
        factor: Of the costs of people, in place of those that match best.
        more: As in :class:`Nav2Export`.

    Raises:
        RewardError: Costs cannot hold the reward, or it has no policy.
    """
    beside = None
    if more.get("problem") is not None and more.get("field") is Field.BOTH:
        beside = matched(planner, reward, resolution_m, robot_radius_m, factor, line=True)
    # one planner drives by either mask
    costs = None if beside is None else beside.model.planner
    alone = matched(planner, reward, resolution_m, robot_radius_m, factor, costs=costs)
    return Nav2Export(alone, robot_radius_m=robot_radius_m, beside_line=beside, **more)


def lost(export: Nav2Export) -> list[str]:
    """What of the reward these costs cannot hold, one sentence each; the worst first."""
    model, found = export.model, []
    if model.amplitude <= 0:
        found.append("the reward does not repel from people, and no cost can attract: people cost nothing")
    if (flat := model.flat_within_m) > 0:
        found.append(
            f"a person's cost would reach {model.amplitude:.0f}, above the {model.peak:.0f} that a free cell may have: "
            f"it is capped, and flat within {flat:.2f} m of the person"
        )
    alone = ": by these alone its path of least cost has a distance of its own"
    for what, one in export.passings:
        if abs(one.planner_m - one.policy_m) > _APART_M:
            found.append(
                f"with costs of {what} the planner passes a person on its line at {one.planner_m:.2f} m, paths of the "
                f"policy at {one.policy_m:.2f} m{alone if what == 'people' else ''}"
            )
    problem = export.problem
    if problem is not None and (export.field is not Field.PEOPLE or len(problem.scene.people_m) > 1):
        highest = float(export.costs(problem)[~problem.scene.lattice.grid.occupied].max())
        if highest > MOST_MASK_COST:
            found.append(f"costs of the mask would reach {highest:.0f}: they are capped at {MOST_MASK_COST}")
    return found
