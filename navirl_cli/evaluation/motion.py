"""What needs measured times or forces: speeds and their derivatives, time near people, contact."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Contact, Demonstration, PersonTrack
from navirl_cli.evaluation.segments import ZONES

#: Positions are resampled at this rate, Hz, and smoothed by cubics over so many samples (1.1 s): derivatives of noisy
#: positions are otherwise noise.
RATE_HZ, WINDOW = 10.0, 11
#: Time near people is sampled in steps of this, s.
STEP_S = 0.02
#: Radius of a standing person as an obstacle, m.
PERSON_RADIUS_M = 0.25
#: A robot that is slower does not move, m/s: what noise of positions leaves after smoothing.
STILL_M_S = 0.05


@dataclass(frozen=True, eq=False)
class Drive:
    """A demonstration as it was driven; each property is computed when it is first used."""

    demonstration: Demonstration

    @property
    def duration_s(self) -> float:
        """Time from the first pose to the last, s."""
        return self.demonstration.duration_s

    @property
    def speed_m_s(self) -> float:
        """Mean magnitude of the velocity, m/s; NaN where the path is too short for derivatives."""
        return _mean_magnitude(self._rates[0])

    @property
    def acceleration_m_s2(self) -> float:
        """Mean magnitude of the acceleration, m/s^2; NaN as for the speed."""
        return _mean_magnitude(self._rates[1])

    @property
    def jerk_m_s3(self) -> float:
        """Mean magnitude of the jerk, m/s^3; NaN as for the speed."""
        return _mean_magnitude(self._rates[2])

    @cached_property
    def zones_s(self) -> FloatArray:
        """(4,) time in each of ZONES, s; needs people."""
        zone, count = self._zone, len(self._zone)
        inside: FloatArray = np.bincount(zone, minlength=len(ZONES))[: len(ZONES)] * self.duration_s / count
        return inside

    def intrusions(self, number: int) -> int:
        """How often the robot entered a zone of ZONES or a nearer one, or began in it; needs people."""
        inside = self._zone <= number
        return int(inside[0]) + int((inside[1:] & ~inside[:-1]).sum())

    @cached_property
    def _zone(self) -> IntArray:
        """(k,) number of the zone of ZONES at equal steps of about STEP_S."""
        d = self.demonstration
        count = max(1, round(d.duration_s / STEP_S))
        at = (np.arange(count) + 0.5) / count * d.duration_s + d.t_s[0]
        robot = np.stack([np.interp(at, d.t_s, axis) for axis in d.xy_m.T], axis=1)
        away = [np.hypot(*(robot - _places(track, still, at)).T) for track, still in self._people]
        distance = np.min(away, axis=0) - d.robot_radius_m
        limits = np.array([limit for _, limit in ZONES])
        zone: IntArray = (distance[:, None] >= limits).sum(axis=1)
        return zone

    @property
    def _people(self) -> list[tuple[PersonTrack | None, FloatArray]]:
        """Track, where there is one, and mean place of each person."""
        d = self.demonstration
        return list(zip(d.tracks or (None,) * len(d.people_m), d.people_m, strict=True))

    @property
    def not_moving_s(self) -> float:
        """Time slower than STILL_M_S, s; NaN as for the speed."""
        speed = np.hypot(*self._rates[0].T)
        return float((speed < STILL_M_S).mean()) * self.duration_s if np.isfinite(speed).all() else float("nan")

    @property
    def time_to_collision_s(self) -> float:
        """Least time after which robot and a person would touch if both kept their velocity, s; needs people.

        0 where they touch already; NaN where they never move towards a touch, and as for the speed.
        """
        d, velocity = self.demonstration, self._rates[0]
        if not np.isfinite(velocity).all():
            return float("nan")
        at = d.t_s[0] + np.arange(len(velocity)) / RATE_HZ
        robot = np.stack([np.interp(at, d.t_s, axis) for axis in d.xy_m.T], axis=1)
        least = [
            touching_s(robot - there, velocity - own, d.robot_radius_m + PERSON_RADIUS_M)
            for there, own in (_moving(track, still, at) for track, still in self._people)
        ]
        found = float(np.min(least))
        return found if np.isfinite(found) else float("nan")

    @property
    def contact_share(self) -> float:
        """Share of the time in contact; needs a wrench."""
        return sum(contact.duration_s for contact in self._contacts) / self.demonstration.duration_s

    @property
    def peak_force_n(self) -> float:
        """Largest horizontal force in contact, N, 0 without contact; needs a wrench."""
        return max((contact.peak_force_n for contact in self._contacts), default=0.0)

    @property
    def impulse_n_s(self) -> float:
        """Sum over the contacts of the magnitude of the impulse, N s; needs a wrench."""
        return sum(float(np.hypot(*contact.impulse_n_s)) for contact in self._contacts)

    @cached_property
    def work_j(self) -> float:
        """Integral of force times velocity over the contacts, J; needs a wrench; NaN as for the speed."""
        d, velocity = self.demonstration, self._rates[0]
        if d.force_n is None or not np.isfinite(velocity).all():
            return float("nan")
        at = d.t_s[0] + np.arange(len(velocity)) / RATE_HZ
        there = np.stack([np.interp(d.t_s, at, axis) for axis in velocity.T], axis=1)
        power = (d.force_n * there).sum(axis=1)
        total = 0.0
        for contact in self._contacts:
            inside = (d.t_s > contact.start_s) & (d.t_s < contact.end_s)
            t = np.concatenate([[contact.start_s], d.t_s[inside], [contact.end_s]])
            total += float(np.trapezoid(np.interp(t, d.t_s, power), t))
        return total

    @property
    def _contacts(self) -> tuple[Contact, ...]:
        return self.demonstration.contacts or ()

    @cached_property
    def _rates(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return derivatives(self.demonstration.t_s, self.demonstration.xy_m)


def _places(track: PersonTrack | None, still_m: FloatArray, at_s: FloatArray) -> FloatArray:
    """(k, 2) places of a person at times, m; before and after a track the person stands."""
    if track is None or not len(track.t_s):
        return np.broadcast_to(still_m, (len(at_s), 2))
    return np.stack([np.interp(at_s, track.t_s, axis) for axis in track.xy_m.T], axis=1)


def _moving(track: PersonTrack | None, still_m: FloatArray, at_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k, 2) places, m, and velocities, m/s, of a person at times."""
    there = _places(track, still_m, at_s)
    if track is None or not len(track.t_s):
        return there, np.zeros((len(at_s), 2))
    return there, derivatives(at_s, there)[0][: len(at_s)]


def touching_s(apart_m: FloatArray, velocity_m_s: FloatArray, radius_m: float) -> FloatArray:
    """Time until two discs touch that keep their velocities.

    Args:
        apart_m: (k, 2) from one centre to the other, m.
        velocity_m_s: (k, 2) rate of change of that, m/s.
        radius_m: Sum of both radii, m.

    Returns:
        (k,) s: 0 where they touch, infinity where they will not.
    """
    # |p + v t|^2 = r^2: the smaller root, if the distance falls and gets so small
    a = (velocity_m_s**2).sum(axis=1)
    b = (apart_m * velocity_m_s).sum(axis=1)
    c = (apart_m**2).sum(axis=1) - radius_m**2
    meets = (b < 0) & (b**2 - a * c >= 0)
    root = np.sqrt(np.where(meets, b**2 - a * c, 0.0))
    later = np.where(meets, c / np.where(meets, -b + root, 1.0), np.inf)
    times: FloatArray = np.where(c <= 0, 0.0, later)
    return times


def derivatives(t_s: FloatArray, xy_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Velocity, acceleration and jerk of a timed path.

    Args:
        t_s: (n,) s, increasing.
        xy_m: (n, 2) m.

    Returns:
        (k, 2) each, in m/s, m/s^2 and m/s^3, at 10 Hz: derivatives of cubics fitted over 1.1 s (Savitzky and Golay,
        Analytical Chemistry 36 (1964)); NaN where the path is shorter than that.
    """
    at = np.arange(t_s[0], t_s[-1] + 1e-9, 1 / RATE_HZ)
    if len(at) < WINDOW:
        missing = np.full((1, 2), np.nan)
        return missing, missing, missing
    line = np.stack([np.interp(at, t_s, axis) for axis in xy_m.T], axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(line, WINDOW, axis=0)
    half = WINDOW // 2
    offsets = np.arange(-half, half + 1) / RATE_HZ
    # (4, WINDOW): samples of a window to the coefficients of its least-squares cubic about the window's middle.
    fitted = np.linalg.pinv(np.vander(offsets, 4, increasing=True))
    rates = []
    for order in (1, 2, 3):
        # (WINDOW, WINDOW): samples to derivatives at each of the window's places; those before the first and after the
        # last middle are taken from the first and last window.
        powers = np.polynomial.polynomial.polyder(np.eye(4), order)
        there = np.vander(offsets, 4 - order, increasing=True) @ powers @ fitted
        rates.append(
            np.concatenate([there[:half] @ windows[0].T, windows @ there[half], there[half + 1 :] @ windows[-1].T])
        )
    velocity, acceleration, jerk = rates
    return velocity, acceleration, jerk


def _mean_magnitude(rate: FloatArray) -> float:
    """Mean magnitude of (k, 2) vectors."""
    return float(np.hypot(*rate.T).mean())
