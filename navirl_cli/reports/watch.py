"""The line that ``navirl watch`` prints when something is learnt."""

from math import isfinite, isnan
from typing import Final

from navirl_cli.errors import counted
from navirl_cli.planning.certainty import Certainty

#: A change of the passing distance that matters, m.
MATTERS_M: Final = 0.05


def learnt_line(sure: Certainty, before_m: float, demonstrations: int, recordings: int) -> str:
    """What is learnt, how it changed, how sure it is, and whether another pass would change it.

    Args:
        sure: Of the fit.
        before_m: The distance at which the reward before passed people, m; NaN where there was none.
        demonstrations: From which the reward is learnt.
        recordings: That count.
    """
    count = f"{counted(demonstrations, 'demonstration')} of {counted(recordings, 'recording')}"
    if isnan(sure.passing_m.value):
        return f"{count}: the reward has no paths past a person on open ground; another pass is needed"
    passing = f"pass people at {sure.passing_m.value:z.2f} m"
    changed = "" if isnan(before_m) else f", {sure.passing_m.value - before_m:+z.2f} m"
    return f"{count}: {passing}{changed}; {_how_sure(sure)}"


def _how_sure(sure: Certainty) -> str:
    if not isfinite(sure.passing_m.lower) or isnan(sure.another_m):
        return "how sure is unknown, because a parameter has no standard error; another pass is needed"
    interval = f"95 % interval {sure.passing_m.lower:z.2f} to {sure.passing_m.upper:z.2f} m"
    change = f"another pass would change it by about {sure.another_m:.3f} m"
    verdict = "go on" if sure.another_m > MATTERS_M else "enough"
    return f"{interval}; {change}: {verdict}"
