"""What needs measured times or forces: speeds and their derivatives, time near people, contact."""

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.segments import ZONES

#: Positions are resampled at this rate, Hz, and smoothed by cubics over so many samples (1.1 s): derivatives of noisy
#: positions are otherwise noise.
RATE_HZ, WINDOW = 10.0, 11
#: Time near people is looked at in steps of this, s.
STEP_S = 0.02


def motion_values(demonstration: Demonstration) -> dict[str, float]:
    """Duration, speed, acceleration, jerk, and time in zones; NaN where times were not measured."""
    names = ["duration_s", "speed_m_s", "acceleration_m_s2", "jerk_m_s3", *(f"{name}_s" for name, _ in ZONES)]
    if demonstration.laid_out_m_s is not None:
        return dict.fromkeys(names, float("nan"))
    sizes = [float(np.hypot(*rate.T).mean()) for rate in derivatives(demonstration.t_s, demonstration.xy_m)]
    return dict(zip(names, [demonstration.duration_s, *sizes, *_zone_times(demonstration)], strict=True))


def derivatives(t_s: FloatArray, xy_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Velocity, acceleration and jerk of a timed path.

    Args:
        t_s: (n,) s, increasing.
        xy_m: (n, 2) m.

    Returns:
        (k, 2) each, in m/s, m/s^2 and m/s^3, at 10 Hz: derivatives of cubics fitted over 1.1 s (Savitzky and Golay,
        Analytical Chemistry 36 (1964)); NaN where the path is shorter than that.
    """
    from scipy.signal import savgol_filter

    at = np.arange(t_s[0], t_s[-1] + 1e-9, 1 / RATE_HZ)
    if len(at) < WINDOW:
        nothing = np.full((1, 2), np.nan)
        return nothing, nothing, nothing
    line = np.stack([np.interp(at, t_s, axis) for axis in xy_m.T], axis=1)
    velocity, acceleration, jerk = (
        savgol_filter(line, WINDOW, 3, deriv=order, delta=1 / RATE_HZ, axis=0) for order in (1, 2, 3)
    )
    return velocity, acceleration, jerk


def _zone_times(d: Demonstration) -> list[float]:
    """Time in each zone, s."""
    if len(d.people_m) == 0:
        return [float("nan")] * len(ZONES)
    count = max(1, round(d.duration_s / STEP_S))
    at = (np.arange(count) + 0.5) / count * d.duration_s + d.t_s[0]
    x, y = (np.interp(at, d.t_s, axis) for axis in d.xy_m.T)
    distance = np.min([np.hypot(x - person[0], y - person[1]) for person in d.people_m], axis=0) - d.robot_radius_m
    limits = np.array([limit for _, limit in ZONES])
    zone = (distance[:, None] >= limits).sum(axis=1)
    inside = np.bincount(zone, minlength=len(ZONES))[: len(ZONES)]
    return [float(steps) * d.duration_s / count for steps in inside]


def contact_values(d: Demonstration) -> dict[str, float]:
    """Share of time, peak, impulse and work of the person's pushes; NaN where contact is unknown."""
    names = ("contact_share", "peak_n", "impulse_ns", "work_j")
    if d.contacts is None or d.contact_s is None or d.force_n is None:
        return dict.fromkeys(names, float("nan"))
    peak = max((contact.peak_force_n for contact in d.contacts), default=0.0)
    impulse = sum(float(np.hypot(*contact.impulse_n_s)) for contact in d.contacts)
    return dict(zip(names, (d.contact_s / d.duration_s, peak, impulse, _work_j(d)), strict=True))


def _work_j(d: Demonstration) -> float:
    """Integral of force times velocity over the contacts, J; NaN where times were not measured."""
    if d.laid_out_m_s is not None or d.force_n is None:
        return float("nan")
    velocity, _, _ = derivatives(d.t_s, d.xy_m)
    if not np.isfinite(velocity).all():
        return float("nan")
    at = d.t_s[0] + np.arange(len(velocity)) / RATE_HZ
    there = np.stack([np.interp(d.t_s, at, axis) for axis in velocity.T], axis=1)
    power = (d.force_n * there).sum(axis=1)
    total = 0.0
    for contact in d.contacts or ():
        inside = (d.t_s > contact.start_s) & (d.t_s < contact.end_s)
        t = np.concatenate([[contact.start_s], d.t_s[inside], [contact.end_s]])
        total += float(np.trapezoid(np.interp(t, d.t_s, power), t))
    return total
