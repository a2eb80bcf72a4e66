"""What ``navirl fit`` remarks: what the demonstrations cannot show, and what to know before trusting the numbers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import Number, counted
from navirl_cli.irl.status import Status
from navirl_cli.irl.uncertainty import correlation
from navirl_cli.reports.evidence import evidence_remarks, reach_warnings
from navirl_cli.reports.persons import ended, person_warnings
from navirl_cli.reports.repeated import repeated

#: With fewer participants, their scatter is a rough estimate (Cameron and Miller 2015, J. Human Resources 50:317).
FEW = 10


#: Correlation beyond which two parameters are to be read together.
TIED = 0.95


#: Expected bias, in standard errors, beyond which a correction is recommended, and beyond which it is not valid.
BIASED, TOO_BIASED = 0.3, 1.0


def cannot_learn(chosen: Sequence[Demonstration]) -> list[str]:
    """What the demonstrations cannot show, which is known before the fit starts."""
    if any(len(demonstration.people_m) for demonstration in chosen):
        return []
    line = (
        f"none of {counted(len(chosen), 'demonstration')} has people, so that the personal space "
        "(a_p, sigma_p) cannot be learnt from them; extract them again with a people "
        "topic, or give places with `person` x,y"
    )
    return [line]


def remarks(
    chosen: Sequence[Demonstration],
    earlier: LearntReward | None,
    *,
    chosen_by: tuple[str, ...],
    everyone: Sequence[Demonstration] = (),
) -> list[str]:
    """Choices that the user may not have intended, what extraction found unusual, and what is not evidence.

    Args:
        chosen: From which the reward was learnt.
        earlier: The prior.
        chosen_by: Conditions that the user named.
        everyone: Demonstrations of the file.
    """
    lines = repeated(chosen)
    alone = sum(demonstration.corrected is False for demonstration in chosen)
    if alone and not chosen_by:
        lines.append(
            f"{alone} of {counted(len(chosen), 'demonstration')} {Number(alone):shows|show} no intervention: "
            "the reward also learns what the robot does by itself; leave "
            "them out with `only_corrected`, or choose with `condition`"
        )
    twice = [] if earlier is None else sorted({d.id for d in chosen} & set(earlier.demonstrations))
    if twice:
        lines.append(f"the prior was learnt from {', '.join(twice)} too: these demonstrations count twice")
    return [*lines, *evidence_remarks(chosen, everyone)]


def warnings(content: Mapping[str, Any], *, status: bool = True) -> list[str]:
    """What a user should know before trusting the numbers.

    Args:
        content: Of the reward file.
        status: Whether a status that asks for something is among it.
    """
    parameters = content["parameters"]
    names = [one["name"] for one in parameters]
    matrix = correlation(np.array(content["covariance"], dtype=float))
    lines = [
        f"{names[i]} and {names[j]} are strongly correlated ({matrix[i, j]:.3f}): the data barely separate them; read "
        "them together; people at other distances, or more detours, would separate them"
        for j in range(len(names))
        for i in range(j)
        if abs(matrix[i, j]) > TIED
    ]
    if not content.get("intervals"):
        lines += [
            f"{one['name']} is uncertain: its standard error exceeds half of its value"
            for one in parameters
            if one["standard_error"] is not None and one["standard_error"] > abs(one["value"]) / 2
        ]
    lines += _bias_warnings(parameters)
    lines += _outside_warnings(content)
    lines += reach_warnings(content)
    lines += person_warnings(content)
    count = len(content["participants"])
    if 1 < count < FEW:
        lines.append(
            f"errors and intervals by participant rest on {count} participants: they are rough with fewer than {FEW}"
        )
    if status and content["status"] != Status.CONVERGED.value:
        lines.append(f"{content['status']}: {ended(content)}")
    return lines


def _bias_warnings(parameters: Sequence[Mapping[str, Any]]) -> list[str]:
    """The parameters that maximum likelihood exaggerates, and what to do."""
    biased = {
        one["name"]: one["bias_expected"] / one["standard_error"]
        for one in parameters
        if one.get("bias_expected") is not None and one["standard_error"]
    }
    large = {name: share for name, share in biased.items() if abs(share) > BIASED}
    if not large:
        return []
    words = " and ".join(f"{name} ({share:+.1f} standard errors)" for name, share in large.items())
    if max(map(abs, large.values())) > TOO_BIASED:
        remedy = "too few demonstrations to correct it: read the intervals, not the values"
    else:
        remedy = "subtract it with `correct_bias`"
    return [f"maximum likelihood is expected to be off in {words}; {remedy}"]


def _outside_warnings(content: Mapping[str, Any]) -> list[str]:
    """The values that do not lie in their own interval, because the interval leaves the regulariser out."""
    values = {one["name"]: one["value"] for one in content["parameters"]}
    outside = dict.fromkeys(
        one["name"]
        for found in content.get("intervals") or ()
        for one in found["parameters"]
        if (one["lower"] is not None and values[one["name"]] < one["lower"])
        or (one["upper"] is not None and values[one["name"]] > one["upper"])
    )
    if not outside or not content["l2"]:
        return []
    count, words = Number(len(outside)), " and ".join(outside)
    line = (
        f"the {count:value|values} of {words} {count:lies|lie} outside the interval: the regulariser decides "
        f"{count:it|them}, because the demonstrations say so little; read the intervals, not the values"
    )
    return [line]
