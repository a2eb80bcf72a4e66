"""When and how the person pushes: bias, low-pass, map frame and contact intervals of a wrench."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from navirl_cli.demos.demonstration import Contact
from navirl_cli.demos.grid import FloatArray, IntArray
from navirl_cli.errors import LogError
from navirl_cli.logs.recording import Recording

#: A hand on a robot moves its force below about 5 Hz; gear and wheel noise lie above.
CUTOFF_HZ = 5.0
#: Length of the stretches whose quietness is judged, s.
STRETCH_S = 0.25
#: Contacts that break off for less than this are one, s; shorter ones are bumps.
MIN_GAP_S = 0.15
MIN_CONTACT_S = 0.08


@dataclass(frozen=True)
class PushSettings:
    """How a force counts as a push."""

    #: Horizontal force above which a contact begins, N; it ends below half of it.
    begins_n: float = 3.0
    cutoff_hz: float = CUTOFF_HZ


@dataclass(frozen=True)
class Pushes:
    """The interaction force of a whole recording, and its contacts."""

    #: (n,) ns.
    t_ns: IntArray
    #: (n, 2) N, map frame, bias removed, low-passed.
    force_n: FloatArray
    #: (c, 2) first and last sample of every contact, both included.
    spans: IntArray
    #: Standard deviation of each component of the low-passed force without contact, N.
    noise_n: float


def pushes_of(recording: Recording, settings: PushSettings) -> Pushes:
    """Find the person's pushes in a recording.

    The bias is constant in the sensor's frame (offset of the bridge, and the handle's weight while the robot stays
    level), so that it is removed there, then the force is turned through the base frame into the map frame.

    Raises:
        LogError: The recording holds too few wrench messages.
    """
    wrench = recording.wrench
    if wrench is None or len(wrench.t_ns) < 50:
        found = 0 if wrench is None else len(wrench.t_ns)
        raise LogError(f"{recording.log}: expected a wrench of at least 50 messages, found {found}")
    if wrench.t_ns[0] > recording.t_ns[-1] or wrench.t_ns[-1] < recording.t_ns[0]:
        raise LogError(
            f"{recording.log}: wrench and poses share no time: expected stamps of one clock, found the wrench "
            f"{(int(wrench.t_ns[0]) - int(recording.t_ns[0])) / 1e9:+.0f} s from the poses; correct the stamps"
        )
    rate = 1e9 / float(np.median(np.diff(wrench.t_ns)))
    bias, quiet = quiet_bias(wrench.force_n, rate)
    smooth = _low_pass(wrench.force_n - bias, rate, settings.cutoff_hz)
    base = smooth @ wrench.to_base.T
    yaw = np.interp(wrench.t_ns, recording.t_ns, np.unwrap(recording.yaw_rad))
    cos, sin = np.cos(yaw), np.sin(yaw)
    force = np.stack([cos * base[:, 0] - sin * base[:, 1], sin * base[:, 0] + cos * base[:, 1]], axis=1)
    size = np.hypot(*force.T)
    # The median of a Rayleigh distribution: a push beside a quiet stretch leaks into it through the filter.
    noise = float(np.median(size[quiet]) / np.sqrt(2 * np.log(2)))
    spans = hysteresis(size, settings.begins_n, settings.begins_n / 2)
    return Pushes(wrench.t_ns, force, _tidy(spans, wrench.t_ns), noise)


def quiet_bias(force_n: FloatArray, rate_hz: float) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The sensor's bias from the stretches in which nobody pushes.

    A stretch is quiet when it varies hardly more than the quietest tenth of all. A steady push varies little too, but
    most quiet stretches are free of contact, so that their median is, and stretches far from it are left out.

    Args:
        force_n: (n, 3) N, sensor frame.
        rate_hz: Samples a second.

    Returns:
        (3,) bias in N, and (n,) samples of the quiet stretches that it comes from.
    """
    length = max(4, round(STRETCH_S * rate_hz))
    count = max(1, len(force_n) // length)
    blocks = force_n[: count * length].reshape(count, -1, 3)
    spread = np.sqrt(blocks.var(axis=1).sum(axis=1))
    quiet = spread <= 2 * np.quantile(spread, 0.1) + 1e-12
    means = blocks.mean(axis=1)
    centre = np.median(means[quiet], axis=0)
    away = np.sqrt(((means - centre) ** 2).sum(axis=1))
    quiet &= away <= 3 * np.median(away[quiet]) + 1e-12
    samples = np.zeros(len(force_n), dtype=bool)
    samples[: count * length] = np.repeat(quiet, blocks.shape[1])
    return means[quiet].mean(axis=0), samples


def hysteresis(size: FloatArray, high: float, low: float) -> IntArray:
    """Stretches above ``low`` that rise above ``high`` somewhere.

    Args:
        size: (n,) values.
        high: What a stretch must exceed once.
        low: What it stays above.

    Returns:
        (c, 2) first and last sample of every stretch.
    """
    above = np.concatenate([[False], size > low, [False]])
    edges = np.flatnonzero(above[1:] != above[:-1])
    first, last = edges[::2], edges[1::2] - 1
    rises = np.cumsum(np.concatenate([[0], size > high]))
    strong = rises[last + 1] > rises[first]
    return np.stack([first[strong], last[strong]], axis=1)


def contacts_within(pushes: Pushes, start_ns: int, stop_ns: int) -> tuple[Contact, ...]:
    """The contacts of one trial, cut to it.

    Args:
        pushes: Of the whole recording.
        start_ns: First instant of the trial.
        stop_ns: Last instant of the trial.

    Returns:
        Contacts with times since the trial's start.
    """
    first, last = np.searchsorted(pushes.t_ns, [start_ns, stop_ns])
    contacts = []
    for begin, end in np.clip(pushes.spans, first, max(first, last - 1)):
        if end <= begin:
            continue
        t = (pushes.t_ns[begin : end + 1] - start_ns) / 1e9
        force = pushes.force_n[begin : end + 1]
        impulse = np.diff(t) @ (force[:-1] + force[1:]) / 2
        contacts.append(
            Contact(
                float(t[0]),
                float(t[-1]),
                float(np.hypot(*force.T).max()),
                (float(impulse[0]), float(impulse[1])),
            )
        )
    return tuple(contacts)


def missing_s(pushes: Pushes, start_ns: int, stop_ns: int) -> float:
    """Longest time within a trial for which there is no force, s."""
    inside = pushes.t_ns[(pushes.t_ns > start_ns) & (pushes.t_ns < stop_ns)]
    return float(np.diff(np.concatenate([[start_ns], inside, [stop_ns]])).max() / 1e9)


def _low_pass(force_n: FloatArray, rate_hz: float, cutoff_hz: float) -> FloatArray:
    """Butterworth of second order, run both ways: no delay."""
    from scipy.signal import butter, sosfiltfilt

    if cutoff_hz >= rate_hz / 2:
        return force_n
    smooth: FloatArray = sosfiltfilt(butter(2, cutoff_hz, fs=rate_hz, output="sos"), force_n, axis=0)
    return smooth


def _tidy(spans: IntArray, t_ns: IntArray) -> IntArray:
    """Join contacts that break off for a moment, then drop bumps."""
    joined: list[list[int]] = []
    for first, last in spans.tolist():
        if joined and t_ns[first] - t_ns[joined[-1][1]] < MIN_GAP_S * 1e9:
            joined[-1][1] = last
        else:
            joined.append([first, last])
    kept = [span for span in joined if t_ns[span[1]] - t_ns[span[0]] >= MIN_CONTACT_S * 1e9]
    return np.array(kept, dtype=np.int64).reshape(-1, 2)
