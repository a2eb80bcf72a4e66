"""The forces of a recording in the sensor's frame, and how that frame is mounted on the robot."""

from typing import Final

import numpy as np

from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.recording import Wrench
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context, in_one_frame, plausible
from navirl_cli.logs.roles.plausible import FORCES
from navirl_cli.logs.roles.times import without_repeats

_FORCE: Final = ("fx", "fy", "fz")


#: An axis that the mounting turns by less than this share into the robot's plane does not count there.
_OUT_OF_PLANE: Final = 0.01


def wrench_of(
    columns: Columns, context: Context, base: str, named: str | None, scale: float = 1.0
) -> tuple[Wrench, Findings]:
    """Forces in the sensor's frame, and the rotation of that frame.

    Args:
        columns: Messages with forces, in order of time.
        context: The frames.
        base: The robot's own frame.
        named: The frame of the forces where the user names it, in place of the messages'.
        scale: N for the unit of the messages.

    Returns:
        The forces in N, and what was found out. An axis that is never finite is 0.

    Raises:
        FrameError: tf does not connect the frames.
        LogError: No force is plausible, or one without which the forces in the robot's plane are unknown is missing.
    """
    columns, own, others = in_one_frame(columns)
    missing = [name for name in _FORCE if len(columns) and not np.isfinite(columns[name]).any()]
    if len(missing) < len(_FORCE):
        columns = columns.at(columns.t_ns, **{name: np.zeros(len(columns)) for name in missing})
    columns = columns.at(columns.t_ns, **{name: columns[name] * scale for name in _FORCE})
    columns, implausible = plausible(columns, FORCES, *_FORCE)
    if len(columns) == 0:
        raise LogError(f"{context.log}: topic {columns.topic}: expected forces, found none that are finite")
    columns, repeated = without_repeats(columns)
    findings = [*others, *implausible, *repeated]
    frame = named or own
    if not frame:
        findings.append(Finding(Kind.NO_WRENCH_FRAME, columns.topic, detail=base))
        frame = base
    t_ns, force = columns.t_ns, columns.stacked(*_FORCE)
    try:
        span, constant = context.tree.span(base, frame), context.tree.is_constant(base, frame)
        times = t_ns if span is None else np.clip(t_ns, *span)
        mounted = context.tree.lookup(base, frame, times[:1] if constant else times)
    except FrameError as error:
        raise FrameError(
            f"{context.log}: the wrench is given in frame {frame!r}: {error}; or name a frame with "
            "parallel axes with `wrench_frame`"
        ) from error
    turns = mounted.matrices
    for name in missing:
        share = float(np.abs(turns[:, :2, _FORCE.index(name)]).max())
        if share > _OUT_OF_PLANE:
            raise LogError(
                f"{context.log}: topic {columns.topic}: force {name[1]} is never finite, and the sensor's mounting "
                f"{frame!r} on {base!r} turns {share:.0%} of it into the robot's plane; record all axes"
            )
        findings.append(Finding(Kind.MISSING_AXIS, columns.topic, detail=name[1]))
    if span is not None:
        findings.append(Finding(Kind.WRENCH_MOVES, frame, detail=base))
    return Wrench(t_ns, force, turns[0] if constant else turns), tuple(findings)
