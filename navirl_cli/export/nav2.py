"""What a Nav2 robot is given of a reward, and what of it costs cannot hold."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from navirl_cli.arrays import FloatArray
from navirl_cli.export.costs import MOST_MASK_COST, CostModel, Passing
from navirl_cli.export.fragments import Distro
from navirl_cli.planning.problem import Problem

#: Planner and policy agree up to this, m.
_APART_M: Final = 0.15


class Field(StrEnum):
    """What a static mask holds."""

    PEOPLE = "people"
    LINE = "line"
    BOTH = "both"


@dataclass(frozen=True, eq=False)
class Nav2Export:
    """What is exported."""

    passing: Passing
    distro: Distro
    robot_radius_m: float
    #: For static masks.
    problem: Problem | None = None
    field: Field = Field.PEOPLE
    #: Per cent of the full speed at people; None without a speed mask.
    slow_percent: float | None = None

    @property
    def model(self) -> CostModel:
        """The costs."""
        return self.passing.model

    @property
    def slows(self) -> bool:
        """Whether there is a speed mask."""
        return self.problem is not None and self.slow_percent is not None

    def costs(self, problem: Problem) -> FloatArray:
        """(rows, columns) costs of the static mask, before any cap."""
        return self.model.over(problem.scene, people=self.field is not Field.LINE, line=self.field is not Field.PEOPLE)


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
    apart = export.passing.planner_m - export.passing.policy_m
    if abs(apart) > _APART_M:
        found.append(
            f"the planner passes a person on its line at {export.passing.planner_m:.2f} m, paths of the policy at "
            f"{export.passing.policy_m:.2f} m"
        )
    problem = export.problem
    if problem is not None and (export.field is not Field.PEOPLE or len(problem.scene.people_m) > 1):
        highest = float(export.costs(problem)[~problem.scene.lattice.grid.occupied].max())
        if highest > MOST_MASK_COST:
            found.append(f"costs of the mask would reach {highest:.0f}: they are capped at {MOST_MASK_COST}")
    return found
