"""What counts as evidence, in words: the reach of people, and trials that start elsewhere."""

from collections.abc import Mapping, Sequence
from typing import Any

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.reach import reach_unknown
from navirl_cli.demos.starts import starts_aside_m
from navirl_cli.documents.document import Block, Paragraph
from navirl_cli.errors import Number, counted

#: Difference of least distances beyond which the reach of people matters, m.
REACH_MATTERS_M = 0.05


def reach_line(content: Mapping[str, Any]) -> list[Block]:
    """How far people reached, and the least distances with and without the steps out of reach. Empty if unknown.

    Args:
        content: Of the reward file.
    """
    found = content.get("reach")
    if found is None:
        return []
    text = (
        f"Reach of people {found['reach_m']:.2f} m between centres ({_seen(found)}); in contact or within reach: "
        f"{found['steps_reachable']} of {found['steps_all']} steps"
    )
    both = found["min_distance_all_m"], found["min_distance_reachable_m"]
    if None not in both:
        text += (
            f". Mean least distance of the policy, from the robot's shell to a person's centre: {both[0]:.2f} m learnt "
            f"from all steps, {both[1]:.2f} m from these"
        )
    return [Paragraph(f"{text}.")]


def reach_warnings(content: Mapping[str, Any]) -> list[str]:
    """That steps out of reach change the least distance of the policy.

    Args:
        content: Of the reward file.
    """
    found = content.get("reach")
    if found is None:
        return []
    whole, reachable = found["min_distance_all_m"], found["min_distance_reachable_m"]
    if whole is None or reachable is None:
        lacking = "all steps" if whole is None else "steps within reach"
        return [f"the influence of the reach is unknown: a fit to {lacking} has no policy in a scene"]
    if abs(whole - reachable) <= REACH_MATTERS_M:
        return []
    line = (
        f"the policy passes people at {whole:.2f} m if it is learnt from all steps, and at {reachable:.2f} m if it is "
        f"learnt from steps in contact or within reach ({found['reach_m']:.2f} m between centres, {_seen(found)}): "
        "where people do not reach, the robot's own path counts as their wish; learn with `steps` reachable, or from "
        "trials along learnt paths"
    )
    return [line]


def _seen(found: Mapping[str, Any]) -> str:
    """Where the reach comes from."""
    return "as stated" if found["seen_in"] is None else f"the farthest push, in {found['seen_in']}"


def reach_unused(content: Mapping[str, Any], reach_m: float | None) -> list[str]:
    """That a stated reach changed nothing.

    Args:
        content: Of the reward file.
        reach_m: As stated; None where it was not.
    """
    if reach_m is None or content.get("reach") is not None or content["learnt_from"] == "reachable":
        return []
    return [
        "`reach` has no effect: contact is unknown, nobody is in the scenes, or no step is in contact or within reach"
    ]


def evidence_remarks(chosen: Sequence[Demonstration], everyone: Sequence[Demonstration]) -> list[str]:
    """Where the demonstrations are poor evidence of what people want.

    Args:
        chosen: From which the reward was learnt.
        everyone: Demonstrations of the file.
    """
    lines = []
    blind = reach_unknown([one for one in chosen if len(one.people_m)])
    if blind:
        lines.append(
            f"{len(blind)} of {counted(len(chosen), 'demonstration')} {Number(len(blind)):has|have} no "
            "wrench: where people pushed by hand, the learnt "
            "distances may be too small, because paths out of reach count as accepted"
        )
    aside = starts_aside_m(chosen, everyone)
    if aside is not None:
        number = len(chosen)
        who = (
            "the only demonstration is of cycle 1 and starts"
            if number == 1
            else (f"all {number} demonstrations are of cycle 1 and start")
        )
        lines.append(
            f"{who} {aside:.2f} m or more aside of where the robot starts otherwise: "
            "from there the learnt policy may pass people much too close; learn from cycle 2 as well"
        )
    return lines
