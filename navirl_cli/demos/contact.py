"""When and how the person pushes: bias, low-pass filter, map frame and contact intervals of a wrench."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.bias import bias_of
from navirl_cli.demos.demonstration import Contact
from navirl_cli.demos.smoothing import low_passed
from navirl_cli.errors import LogError
from navirl_cli.logs.recording import Recording

#: The force of a hand changes below about 5 Hz; noise of gears and wheels lies above.
CUTOFF_HZ = 5.0
#: Contacts with a shorter pause between them are one, s; shorter contacts are bumps, s.
MIN_GAP_S = 0.15
MIN_CONTACT_S = 0.08


@dataclass(frozen=True)
class PushSettings:
    """Which forces count as a push."""

    #: Horizontal force above which a contact begins, N; it ends below half of it.
    begins_n: float = 3.0
    #: The force is low-passed below this frequency, Hz.
    cutoff_hz: float = CUTOFF_HZ


@dataclass(frozen=True, eq=False)
class Pushes:
    """The interaction force of a whole recording, and its contacts."""

    #: (n,) ns.
    t_ns: IntArray
    #: (n, 2) N, map frame, bias removed, low-passed.
    force_n: FloatArray
    #: (n, 2) N, base frame: forward and to the left, bias removed, not filtered.
    base_n: FloatArray
    #: (c, 2) first and last sample of every contact, both included.
    spans: IntArray
    #: Standard deviation of each component of the low-passed force without contact, N.
    noise_n: float

    def force_at(self, t_ns: IntArray) -> FloatArray:
        """(m, 2) N, map frame, at other times, between samples on straight lines."""
        return np.stack([np.interp(t_ns, self.t_ns, axis) for axis in self.force_n.T], axis=1)


def pushes_of(recording: Recording, settings: PushSettings) -> Pushes:
    """Find the person's pushes in a recording.

    The bias is the offset of the bridge, and the handle's weight while the robot stays level. It changes slowly in the
    sensor's frame and is removed there. Then the force is rotated through the base frame into the map frame. If the
    sensor moves on the robot, the handle's weight is not constant in the sensor's frame: the part that rotates with the
    sensor counts as a push, unless the sensor moves slowly. The sensor's place does not matter: a force is the same at
    any point of a rigid body, and the torque, which depends on the lever arm, is not used.

    Raises:
        LogError: The recording holds no wrench.
    """
    wrench = recording.wrench
    if wrench is None:
        raise LogError(f"{recording.log}: expected a wrench, found none")
    seconds = (wrench.t_ns - wrench.t_ns[0]) / 1e9
    bias, quiet = bias_of(seconds, wrench.force_n, settings.begins_n)
    base = np.einsum("...ij,...j->...i", wrench.to_base[..., :2, :], wrench.force_n - bias)
    smooth = low_passed(base, 1 / float(np.median(np.diff(seconds))), settings.cutoff_hz)
    yaw = np.interp(wrench.t_ns, recording.t_ns, np.unwrap(recording.yaw_rad))
    cos, sin = np.cos(yaw), np.sin(yaw)
    force = np.stack([cos * smooth[:, 0] - sin * smooth[:, 1], sin * smooth[:, 0] + cos * smooth[:, 1]], axis=1)
    size = np.hypot(*force.T)
    # by the median of a Rayleigh distribution: a push beside a quiet stretch leaks into it through the filter
    noise = float(np.median(size[quiet]) / np.sqrt(2 * np.log(2)))
    spans = hysteresis(size, settings.begins_n, settings.begins_n / 2)
    return Pushes(wrench.t_ns, force, base, _tidy(spans, wrench.t_ns), noise)


def hysteresis(size: FloatArray, high: float, low: float) -> IntArray:
    """Stretches above ``low`` that rise above ``high`` somewhere.

    Args:
        size: (n,) values.
        high: A stretch must exceed this once.
        low: It stays above this.

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
    """Longest time within a trial without a force, s."""
    inside = pushes.t_ns[(pushes.t_ns > start_ns) & (pushes.t_ns < stop_ns)]
    return float(np.diff(np.concatenate([[start_ns], inside, [stop_ns]])).max() / 1e9)


def _tidy(spans: IntArray, t_ns: IntArray) -> IntArray:
    """Join contacts with a short pause between them, then drop bumps."""
    joined: list[list[int]] = []
    for first, last in spans.tolist():
        if joined and t_ns[first] - t_ns[joined[-1][1]] < MIN_GAP_S * 1e9:
            joined[-1][1] = last
        else:
            joined.append([first, last])
    kept = [span for span in joined if t_ns[span[1]] - t_ns[span[0]] >= MIN_CONTACT_S * 1e9]
    return np.array(kept, dtype=np.int64).reshape(-1, 2)
