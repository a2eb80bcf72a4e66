"""The robot's sensors: mounting angle, bias, noise, drift and delay added to the truth."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.simulation.driving import STEP_S

#: Messages a second; the wrench comes with every step, at 100 Hz.
ODOMETRY_HZ, TRANSFORM_HZ, STICK_HZ, PEOPLE_HZ = 30.0, 10.0, 20.0, 2.0
FORCE_NOISE_N, TORQUE_NOISE_NM = 0.25, 0.01
#: Resolution of the analogue-digital converter.
FORCE_STEP_N, TORQUE_STEP_NM = 1 / 32, 1 / 512
#: Height of the sensor on the robot, m, and its rotation (roll, pitch, yaw), rad.
SENSOR_AT_M = (0.05, 0.0, 0.62)
SENSOR_RPY = (0.08, -0.05, 2.1)
#: Share by which the wheels measure too much, and drift of the heading, rad/s.
WHEEL_SCALE, HEADING_DRIFT = 0.012, 0.0011
#: The localisation's error, m and rad, and the time over which it changes, s.
LOCALISED_M, LOCALISED_RAD, LOCALISED_OVER_S = 0.003, 0.002, 2.0


@dataclass(frozen=True, eq=False)
class Poses:
    """Planar poses."""

    #: (n, 2) m.
    xy_m: FloatArray
    #: (n,) rad.
    yaw_rad: FloatArray

    def after(self, inner: "Poses") -> "Poses":
        """The poses ``inner`` expressed in the frame in which these are given: self o inner."""
        return Poses(self.xy_m + _turned(inner.xy_m, self.yaw_rad), self.yaw_rad + inner.yaw_rad)

    def inverse(self) -> "Poses":
        """The frames of these poses' reference, seen from the poses."""
        return Poses(_turned(-self.xy_m, -self.yaw_rad), -self.yaw_rad)

    def at(self, index: IntArray) -> "Poses":
        """Some of the poses."""
        return Poses(self.xy_m[index], self.yaw_rad[index])


def steps_at(rate_hz: float, count: int) -> IntArray:
    """The steps, of a number of steps, nearest to the ticks of a rate."""
    ticks = np.arange(0, count - 1, 1 / (rate_hz * STEP_S))
    return np.round(ticks).astype(np.int64)


def heading_of(count: int, rng: np.random.Generator) -> FloatArray:
    """(n,) rad: the robot looks along the hallway and sways a little."""
    t = np.arange(count) * STEP_S
    heading: FloatArray = 0.04 * np.sin(2 * np.pi * t / 11 + rng.uniform(0, 6)) + 0.02 * np.sin(2 * np.pi * t / 3.7)
    return heading


def wrench_of(force_n: FloatArray, yaw_rad: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Measured force (n, 3) N and torque (n, 3) N m in the sensor's frame, from the true force in the map frame."""
    flat = _turned(force_n, -yaw_rad)
    spatial = np.column_stack([flat, np.zeros(len(flat))])
    inside = Rotation.from_euler("xyz", SENSOR_RPY).inv()
    bias = np.array([1.8, -2.6, -6.5]) + rng.normal(0, 0.6, 3)
    force = inside.apply(spatial) + bias + rng.normal(0, FORCE_NOISE_N, spatial.shape)
    # the hand holds the rim of the robot, 0.1 m below the sensor
    torque = inside.apply(np.cross((0.0, 0.0, -0.1), spatial)) + rng.normal(0, TORQUE_NOISE_NM, spatial.shape)
    return np.round(force / FORCE_STEP_N) * FORCE_STEP_N, np.round(torque / TORQUE_STEP_NM) * TORQUE_STEP_NM


def odometry_of(true: Poses, rng: np.random.Generator) -> Poses:
    """The wheels' estimate of the poses, from an origin of its own: steps too long and a drifting heading."""
    step = _turned(np.diff(true.xy_m, axis=0), -true.yaw_rad[:-1]) * (1 + WHEEL_SCALE)
    count = len(true.yaw_rad)
    drift = HEADING_DRIFT * rng.choice([-1, 1]) * np.arange(count) * STEP_S
    drift += np.cumsum(rng.normal(0, 2e-5, count))
    yaw = true.yaw_rad + drift + rng.uniform(-np.pi, np.pi)
    start = rng.uniform(-2, 2, 2)
    xy = start + np.concatenate([np.zeros((1, 2)), np.cumsum(_turned(step, yaw[:-1]), axis=0)])
    return Poses(xy, yaw)


def localised(true: Poses, rng: np.random.Generator) -> Poses:
    """The localisation's estimate of the poses: the truth and an error that changes slowly."""
    count = len(true.yaw_rad)
    error = np.zeros((count, 3))
    keep = 1 - STEP_S / LOCALISED_OVER_S
    kicks = rng.normal(0, np.sqrt(1 - keep**2), (count, 3))
    for number in range(1, count):
        error[number] = keep * error[number - 1] + kicks[number]
    return Poses(true.xy_m + LOCALISED_M * error[:, :2], true.yaw_rad + LOCALISED_RAD * error[:, 2])


def _turned(xy: FloatArray, yaw_rad: FloatArray) -> FloatArray:
    """(n, 2) vectors rotated by (n,) angles."""
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.stack([cos * xy[:, 0] - sin * xy[:, 1], sin * xy[:, 0] + cos * xy[:, 1]], axis=1)
