"""What a reader should know of a study's trials before believing its tables."""

from collections.abc import Iterable, Sequence

from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.study.learning import FIRST, SECOND
from navirl_cli.study.questionnaire import Answer


def remarks(demonstrations: Sequence[Demonstration], answers: Iterable[Answer]) -> list[str]:
    """Lines about all trials together.

    Args:
        demonstrations: Of the study.
        answers: To the questionnaire.
    """
    lines = []
    maps = {(one.grid.origin_m, one.grid.shape, one.grid.resolution_m) for one in demonstrations}
    if len(maps) > 1:
        lines.append(
            f"trials are on {len(maps)} maps: figures of paths lay them over each other, and that of the learnt policy "
            "shows the scene of the first second-cycle trial"
        )
    radii = sorted({one.robot_radius_m for one in demonstrations})
    if len(radii) > 1:
        listed = ", ".join(f"{radius:g}" for radius in radii)
        lines.append(f"robots of radii {listed} m are put together: distances from shells do not compare")
    pushed = [one for one in demonstrations if one.condition is Condition.FORCE]
    others = sorted({one.cycle for one in pushed if one.cycle is not None and one.cycle not in {FIRST, SECOND}})
    if others:
        lines.append(
            f"cycle {', '.join(map(str, others))}: shown, but nothing is fitted to it; fits are of cycles 1 and 2"
        )
    unsaid = sum(one.cycle is None and one.set is None for one in pushed)
    if unsaid:
        lines.append(f"{unsaid} trials of the condition force say neither cycle nor set: nothing is fitted to them")
    aside = sorted({one.set for one in pushed if one.set is not None and one.cycle is not None})
    if aside:
        lines.append(
            f"trials of the condition force in the sets {', '.join(aside)} are not fitted, though they say a cycle"
        )
    people = {one.participant for one in demonstrations}
    strangers = sorted({one.participant for one in answers} - people)
    if strangers:
        lines.append(f"the questionnaire holds answers of participants without a log: {', '.join(strangers)}")
    return lines
