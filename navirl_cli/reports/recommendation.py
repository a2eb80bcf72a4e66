"""How to drive by a learnt reward, in plain sentences."""

from math import isfinite
from typing import Final

import numpy as np

from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.documents.document import Block, Bullets, Heading, Paragraph
from navirl_cli.evaluation.meaning import drawn_rewards
from navirl_cli.planning.problem import Problem
from navirl_cli.planning.recommendation import Quantity, Recommendation, recommended, straight_passage

#: Rewards drawn from the estimate for intervals.
DRAWS: Final = 40
_PASSAGE = "On open ground, past a person who stands on the robot's straight line:"
_SCENE = "In this scene:"


def recommendation_text(learnt: LearntReward, problem: Problem, seed: int = 0) -> str:
    """The recommendation for a straight passage, and for a scene with people.

    Args:
        learnt: The reward with its errors.
        problem: The scene.
        seed: Of the draws for intervals.
    """
    parts = _parts(learnt, problem, _SCENE, seed)
    return "\n\n".join("\n".join([title, *(f"- {line}" for line in lines)]) for title, lines in parts)


def recommendation_blocks(learnt: LearntReward, problem: Problem, name: str, seed: int) -> list[Block]:
    """The same as a section of a page.

    Args:
        learnt: The reward with its errors.
        problem: The scene.
        name: Of the scene.
        seed: Of the draws for intervals.
    """
    blocks: list[Block] = [Heading("How to pass people by this reward")]
    for title, lines in _parts(learnt, problem, f"In the scene of {name}:", seed):
        blocks += [Paragraph(title), Bullets(tuple(lines))]
    return blocks


def _parts(learnt: LearntReward, problem: Problem, title: str, seed: int) -> list[tuple[str, list[str]]]:
    """Titles with their sentences."""
    front = learnt.intervals[0] if learnt.intervals else None
    rng = np.random.default_rng(seed)
    draws = drawn_rewards(learnt.reward, learnt.covariance, front, DRAWS, rng)
    passage = straight_passage(problem.robot_radius_m, learnt.resolution_m)
    scenes = [(_PASSAGE, passage), *([(title, problem)] if len(problem.scene.people_m) else [])]
    return [(name, sentences(recommended(one, learnt.reward, draws))) for name, one in scenes]


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
    if not found.draws:
        lines.append("No intervals: a parameter has none, or an open one; more demonstrations would close it.")
    elif found.lost:
        lines.append(
            f"The intervals leave out {found.lost} of {found.draws + found.lost} draws from the fit, which have no "
            "policy in this scene."
        )
    return lines


def _shown(one: Quantity) -> str:
    interval = f" (95 % interval {one.lower:z.2f} to {one.upper:z.2f} m)" if isfinite(one.lower) else ""
    return f"{one.value:z.2f} m{interval}"
