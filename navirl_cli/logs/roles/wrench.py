"""The forces of a recording in the sensor's frame, and how that frame is mounted on the robot."""

from typing import Final

import numpy as np

from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.recording import Wrench
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context
from navirl_cli.logs.roles.plausible import FORCES

_FORCE: Final = ("fx", "fy", "fz")


def wrench_of(columns: Columns, context: Context, base: str, named: str | None) -> Wrench:
    """Forces in the sensor's frame, and the rotation of that frame.

    Args:
        columns: Messages with forces.
        context: Clock and frames.
        base: The robot's own frame.
        named: The frame of the forces where the user names it, in place of the messages'.

    Raises:
        FrameError: tf does not connect the frames.
        LogError: No force is plausible.
    """
    columns, own = context.in_one_frame(columns)
    columns = context.plausible(columns, FORCES, *_FORCE)
    if len(columns) == 0:
        raise LogError(f"{context.log}: topic {columns.topic}: expected forces, found none that are finite")
    frame = named or own
    if not frame:
        context.note(f"{columns.topic} names no frame; {base!r} is assumed; name another with `wrench_frame`")
        frame = base
    stamps, rows = context.ordered_times(columns)
    t_ns, force = stamps[rows], columns.stacked(*_FORCE)[rows]
    try:
        span = context.tree.span(base, frame)
        mounted = context.tree.lookup(base, frame, t_ns[:1] if span is None else np.clip(t_ns, *span))
    except FrameError as error:
        raise FrameError(
            f"{context.log}: the wrench is given in frame {frame!r}: {error}; or name a frame with "
            "parallel axes with `wrench_frame`"
        ) from error
    turns = mounted.matrices
    if span is not None:
        context.note(f"the wrench's frame {frame!r} moves on {base!r}; the handle's weight may not cancel out")
    return Wrench(t_ns, force, turns[0] if span is None else turns)
