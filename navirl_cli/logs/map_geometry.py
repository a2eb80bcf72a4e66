"""Where the cells of a map lie: the limits that hold for maps in messages and in files alike."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from navirl_cli.errors import LogError
from navirl_cli.logs.tf.rotations import are_rotations, faults, normalised, roll_pitch_yaw

#: Sides of the cells of a map, m.
LEAST_M: Final = 0.001
MOST_M: Final = 100.0
#: No map's corner is farther from the origin of its frame, m.
FARTHEST_M: Final = 1e6
#: A turn by less is a matter of rounding, rad.
_TURN: Final = 2e-6
_ZERO: Final = 1e-6


def is_resolution(value: float) -> bool:
    """Whether a number can be the side of a map's cells, m."""
    return bool(LEAST_M <= value <= MOST_M)


def is_place(value: float) -> bool:
    """Whether a number can be a coordinate of a map's corner, m."""
    return bool(abs(value) <= FARTHEST_M)


def check_geometry(where: str, resolution_m: float, origin_m: Sequence[float], yaw_rad: float, remedy: str) -> None:
    """Refuse a map whose cells have no size or place, or do not run along its frame's axes.

    Args:
        where: File and field, or log and topic, for messages.
        resolution_m: Side of the cells.
        origin_m: (x, y) of the lower left corner.
        yaw_rad: Turn of the cells about that corner.
        remedy: What to do.

    Raises:
        LogError: As said.
    """
    if not is_resolution(resolution_m):
        raise LogError(f"{where}: expected cells of {LEAST_M:g} to {MOST_M:g} m, found {resolution_m:g} m; {remedy}")
    if not all(map(is_place, origin_m)):
        x, y = origin_m
        raise LogError(f"{where}: expected a finite origin within {FARTHEST_M:g} m, found ({x:g}, {y:g}) m; {remedy}")
    if not abs(np.sin(yaw_rad / 2)) <= _TURN / 2:
        raise LogError(
            f"{where}: expected a map whose cells run along its frame's axes, found one rotated by "
            f"{degrees(yaw_rad)} degrees; save the map with an origin of yaw 0"
        )


def yaw_of(where: str, quaternion: Sequence[float], remedy: str) -> float:
    """The turn of a map by its origin's quaternion x, y, z, w, rad; one of zeros, which some tools leave, is no turn.

    Raises:
        LogError: The quaternion is no rotation, or turns the map out of the plane.
    """
    turn = np.array([quaternion], dtype=np.float64)
    if is_empty(quaternion):
        return 0.0
    if not are_rotations(turn).all():
        raise LogError(f"{where}: expected an origin with a rotation, found one {next(iter(faults(turn)))}; {remedy}")
    roll, pitch, yaw = (roll_pitch_yaw(normalised(turn))[0] + 0.0).tolist()
    if max(abs(roll), abs(pitch)) > _TURN:
        raise LogError(
            f"{where}: expected a map in the plane of its frame, found one tilted by roll {degrees(roll)} and "
            f"pitch {degrees(pitch)} degrees; {remedy}"
        )
    return float(yaw)


def degrees(angle_rad: float) -> str:
    """An angle as a message shows it."""
    return f"{round(float(np.degrees(angle_rad)), 1) + 0.0:.1f}"


def is_empty(quaternion: Sequence[float]) -> bool:
    """Whether a quaternion was left empty: all zeros."""
    return all(abs(value) < _ZERO for value in quaternion)
