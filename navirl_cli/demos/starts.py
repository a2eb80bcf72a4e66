"""Whether demonstrations start where a robot will: the first cycle of the study starts aside on purpose."""

from collections.abc import Sequence

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Demonstration

#: Starts that are farther aside than this are elsewhere, m: two cells.
ASIDE_M = 0.2
#: Trials whose goals are nearer to each other than this have one task, m.
_ONE_GOAL_M = 0.5
#: The cycle that starts aside of the nominal path (Sec. IV-C).
_FIRST = 1


def starts_aside_m(chosen: Sequence[Demonstration], everyone: Sequence[Demonstration]) -> float | None:
    """How far all demonstrations of a first cycle start aside of where other trials start.

    Args:
        chosen: From which a reward is learnt.
        everyone: Of the file. Their starts count where the goal is the same; without them the middle of the chosen
            starts.

    Returns:
        The distance from these places to the nearest of the chosen starts, perpendicular to the line from the place to
        its goal, m, the median over the places; None where the chosen ones are not of a first cycle only, or where it
        is at most ASIDE_M.
    """
    if not chosen or any(one.cycle != _FIRST for one in chosen):
        return None
    starts = np.array([one.xy_m[0] for one in chosen])
    goals = np.array([one.xy_m[-1] for one in chosen])
    ids = {one.id for one in chosen}
    others = [one for one in everyone if one.id not in ids and _near(one.xy_m[-1], goals).any()]
    places = [(one.xy_m[0], one.xy_m[-1]) for one in others]
    if not places:
        places = [(starts[own].mean(axis=0), goals[own].mean(axis=0)) for own in (_near(goal, goals) for goal in goals)]
    aside = [_aside_m(place, goal, starts[_near(goal, goals)]) for place, goal in places]
    middle = float(np.median(aside))
    return middle if middle > ASIDE_M else None


def _near(goal_m: FloatArray, goals_m: FloatArray) -> np.ndarray:
    """(n,) which goals are the same as one."""
    near: np.ndarray = np.hypot(*(goals_m - goal_m).T) < _ONE_GOAL_M
    return near


def _aside_m(place_m: FloatArray, goal_m: FloatArray, starts_m: FloatArray) -> float:
    """Least distance of starts from the line from a place to its goal, m."""
    if not len(starts_m):
        return 0.0
    way = goal_m - place_m
    length = max(float(np.hypot(*way)), 1e-9)
    away = starts_m - place_m
    return float(np.abs(way[0] * away[:, 1] - way[1] * away[:, 0]).min() / length)
