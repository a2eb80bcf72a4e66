"""How to drive by a learnt reward, in plain sentences."""

from math import isfinite

from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.planning.problem import Problem
from navirl_cli.planning.recommendation import Quantity, Recommendation, recommended, straight_passage

#: Rewards drawn from the estimate for intervals.
DRAWS = 40


def recommendation_text(learnt: LearntReward, problem: Problem) -> str:
    """The recommendation for a straight passage, and for a scene with people.

    Args:
        learnt: The reward with its errors.
        problem: The scene.
    """
    passage = straight_passage(problem.robot_radius_m, learnt.resolution_m)
    parts = [_section("On open ground, past a person who stands on the robot's straight line:", learnt, passage)]
    if len(problem.scene.people_m):
        parts.append(_section("In this scene:", learnt, problem))
    return "\n\n".join(parts)


def _section(title: str, learnt: LearntReward, problem: Problem) -> str:
    return "\n".join([title, *(f"- {line}" for line in sentences(recommended(problem, learnt.reward)))])


def sentences(found: Recommendation) -> list[str]:
    """A recommendation as sentences, each of one number with its interval."""
    lines = [
        f"Pass the person at {_shown(found.passing_m)} between the robot's shell and the person's centre.",
        f"Keep at least {_shown(found.least_m)}: 95 of 100 paths of the policy do.",
    ]
    if isfinite(found.onset_m.value):
        lines.append(f"Begin to leave the line {_shown(found.onset_m)} before the person.")
    lines += [
        f"Expect a path that is {_shown(found.detour_m)} longer.",
        f"Staying on the line would cost the people as much as {_shown(found.worth_m)} of additional path.",
    ]
    return lines


def _shown(one: Quantity) -> str:
    interval = f" (95 % interval {one.lower:.2f} to {one.upper:.2f} m)" if isfinite(one.lower) else ""
    return f"{one.value:.2f} m{interval}"
