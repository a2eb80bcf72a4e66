"""The map of a recording, in its fixed frame."""

from collections.abc import Sequence

import numpy as np

from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.recording import Occupancy
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context


def map_in(log: str, topics: Sequence[Columns]) -> tuple[Occupancy, str]:
    """The last map of a log, and its frame.

    Raises:
        LogError: Its cells do not run along its frame's axes, or its numbers contradict each other.
    """
    (columns,) = topics
    last = {name: column[-1] for name, column in columns.by_field.items() if name != "data"}
    yaw = float(2 * np.arctan2(last["qz"], last["qw"]))
    if abs(np.sin(yaw / 2)) > 1e-6:
        raise LogError(
            f"{log}: expected a map whose cells run along its frame's axes, found one rotated by "
            f"{np.degrees(yaw):.1f} degrees; save the map with an origin of yaw 0"
        )
    origin = (float(last["px"]), float(last["py"]))
    if not (0 < last["resolution"] < np.inf and np.isfinite(origin).all()):
        found = f"{float(last['resolution'])} m and {origin}"
        raise LogError(
            f"{log}: expected a map with a positive resolution and a finite origin, found {found}; record the map "
            "again, or give it with `map`"
        )
    height, width, size = int(last["height"]), int(last["width"]), int(columns.owner_counts[-1])
    if size != height * width or size == 0:
        raise LogError(f"{log}: expected a map of {height} x {width} cells, found {size}; record the map again")
    data = columns["data"][-size:].astype(np.int8)
    # a float32 of 0.1 is 0.10000000149 as a double: the shortest decimal was meant
    resolution = float(str(np.float32(last["resolution"])))
    return Occupancy(data.reshape(height, width), resolution, origin), str(last["frame"])


def occupancy_of(map_and_frame: tuple[Occupancy, str], context: Context) -> Occupancy:
    """A map in the fixed frame, which must not be rotated against the map's frame.

    Args:
        map_and_frame: The map and its frame; "" for one that is in the fixed frame.
        context: Clock and frames.

    Raises:
        LogError: The fixed frame is rotated against the map's, or moves.
        FrameError: tf does not connect the frames.
    """
    occupancy, frame = map_and_frame
    if not frame or context.is_fixed(frame):
        return occupancy
    try:
        span = context.tree.span(context.fixed, frame)
        into = context.tree.lookup(context.fixed, frame, np.zeros(1, dtype=np.int64) if span is None else span)
    except FrameError as error:
        raise FrameError(f"{context.log}: the map is given in frame {frame!r}: {error}") from error
    moved, yaw = into.translation_m[:, :2], into.yaw_rad
    if np.abs(yaw).max() > 1e-3 or np.abs(moved - moved[0]).max() > occupancy.resolution_m / 10:
        raise LogError(
            f"{context.log}: the map's frame {frame!r} is rotated against {context.fixed!r} or moves in it, so that "
            f"its cells cannot be kept; choose `frame` {frame}, or give a map in {context.fixed!r} with `map`"
        )
    x, y = occupancy.origin_m
    return Occupancy(occupancy.data, occupancy.resolution_m, (x + float(moved[0, 0]), y + float(moved[0, 1])))
