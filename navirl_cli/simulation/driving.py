"""The robot: it follows a path and gives way to pushes (Eqs. 1 and 2)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray

#: Length of a time step, s: that of the wrench's rate.
STEP_S = 0.01
FORWARD_M_S = 0.4
SIDEWAYS_M_S = 0.2
#: Sideways velocity by distance from the path, 1/s.
PULL_PER_S = 0.5
#: k of Eq. 2, s/kg.
GAIN_S_KG = 0.015
#: The robot stops this near to the end of its path, m.
STOP_M = 0.04
#: A drive that takes longer is stuck, s.
LIMIT_S = 90.0

#: The person: from time (s), robot position (2,) and velocity (2,) to the velocity v_com that they add (2,), m/s.
Steering = Callable[[float, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Path:
    """A line with its length along it."""

    #: (n, 2) m, map frame, evenly spaced.
    xy_m: FloatArray
    #: (n, 2) unit vectors along it.
    tangent: FloatArray

    @staticmethod
    def along(line_m: FloatArray, smoothing_m: float = 0.0, spacing_m: float = 0.05) -> "Path":
        """A path along the corners of a line.

        Args:
            line_m: (k, 2) m.
            smoothing_m: Standard deviation of a Gaussian along the line that rounds its corners, m; ends stay.
            spacing_m: Distance between the path's points, m.
        """
        from scipy.ndimage import gaussian_filter1d

        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line_m, axis=0).T))])
        count = max(2, round(length[-1] / spacing_m) + 1)
        at = np.linspace(0.0, length[-1], count)
        xy = np.stack([np.interp(at, length, axis) for axis in line_m.T], axis=1)
        if smoothing_m > 0:
            # reflected through its ends, the line keeps them
            pad = min(count - 1, round(4 * smoothing_m / spacing_m))
            before, after = 2 * xy[0] - xy[pad:0:-1], 2 * xy[-1] - xy[-2 : -pad - 2 : -1]
            long = np.concatenate([before, xy, after])
            xy = gaussian_filter1d(long, smoothing_m / spacing_m, axis=0)[pad : pad + count]
        tangent = np.gradient(xy, axis=0)
        return Path(xy, tangent / np.hypot(*tangent.T)[:, None])

    def nearest(self, xy_m: FloatArray, first: int = 0, window: int | None = None) -> int:
        """Number of the point nearest to a position, from a point on, within a window of points."""
        stop = None if window is None else first + window
        return first + int(((self.xy_m[first:stop] - xy_m) ** 2).sum(axis=1).argmin())


@dataclass(frozen=True, eq=False)
class Drive:
    """The true motion of one drive, at steps of 10 ms."""

    #: (n, 2) m, map frame.
    xy_m: FloatArray
    #: (n, 2) m/s, map frame: the velocity that the person added.
    command_m_s: FloatArray

    def __len__(self) -> int:
        """Number of steps."""
        return len(self.xy_m)


def inward_m_s(aside_m: float) -> float:
    """Sideways velocity of the navigation at a signed distance from its path, m/s."""
    return float(np.clip(-PULL_PER_S * aside_m, -SIDEWAYS_M_S, SIDEWAYS_M_S))


def drive(path: Path, start_m: FloatArray, steer: Steering, speed_m_s: float = FORWARD_M_S) -> Drive:
    """Drive along a path to its end.

    Args:
        path: The path that the navigation follows.
        start_m: (2,) m, map frame.
        steer: The velocity that the person adds.
        speed_m_s: Velocity along the path, m/s.

    Returns:
        Positions and the person's velocities.
    """
    here = start_m.astype(float)
    progress = path.nearest(here)
    track, commands = [here], []
    for step in range(round(LIMIT_S / STEP_S)):
        progress = path.nearest(here, progress, window=12)
        aside = np.array([-path.tangent[progress, 1], path.tangent[progress, 0]])
        error = float((here - path.xy_m[progress]) @ aside)
        inward = inward_m_s(error)
        command = steer(step * STEP_S, here)
        commands.append(command)
        left = float(np.hypot(*(path.xy_m[-1] - here)))
        if progress >= len(path.xy_m) - 2 and (left < STOP_M or (path.xy_m[-1] - here) @ path.tangent[-1] < 0):
            break
        # slower near the end: the robot does not stop from full speed
        forward = min(speed_m_s, 0.8 * left + 0.05)
        here = here + STEP_S * (forward * path.tangent[progress] + inward * aside + command)
        track.append(here)
    # a drive that does not arrive in time ends with a step without a command
    return Drive(np.array(track[: len(commands)]), np.array(commands))
