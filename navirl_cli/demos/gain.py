"""How fast a robot gives way to a push: the gain k of Eqs. 1 and 2, v_r = v_nav + k F, from trials with pushes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.contact import Pushes
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.smoothing import lagged
from navirl_cli.logs.recording import Recording

#: Step of the common clock, s, and steps from one sample to the next.
STEP_S, STRIDE = 0.01, 5
#: Length of the two neighbouring windows whose means are compared, s; longer where poses are rare.
WINDOW_S = 0.25
#: Samples begin this long before a push and end this long after it, and are cut into pieces of about this length, s.
MARGIN_S, PIECE_S = 1.0, 2.5
#: Residuals farther apart than this are taken to be independent, s.
MEMORY_S = 2.0
#: Candidates for the robot's response to a push: dead time, and time constant of a first-order lag, s.
DELAYS_S = np.arange(0, 0.41, 0.02)
LAGS_S = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5)


@dataclass(frozen=True)
class Gain:
    """An estimate of k, in (m/s)/N."""

    gain_m_s_n: float
    standard_error_m_s_n: float
    #: Number of pushes that it comes from.
    pushes: int
    #: Mean time by which the velocity follows the force, s.
    delay_s: float


@dataclass(frozen=True, eq=False)
class _Samples:
    """Times around pushes at which changes of velocity and force are compared."""

    #: (n,) steps of the clock.
    at: IntArray
    #: (n,) number of the unbroken stretch of samples, and of the piece of a stretch, that each belongs to.
    stretch: IntArray
    piece: IntArray
    #: Length of the windows in steps.
    window: int
    #: Number of pushes that they surround.
    pushes: int


def gain_of(
    recording: Recording, pushes: Pushes, demonstrations: Iterable[Demonstration], begins_n: float
) -> Gain | None:
    """Estimate the gain from the sideways velocity and the sideways force in the robot's base frame.

    The navigation's own velocity v_nav is unknown, but changes slowly beside a push. So changes are compared:
    the mean velocity over a quarter of a second - that over the quarter before, against the same difference of the
    force. This filters both alike, and the information is where a push rises or falls. The part of v_nav that changes
    with the push, as the navigation pulls back to its path, is taken to be proportional to the robot's movement aside,
    with a separate factor every 2.5 s. A late response would bias the gain towards 0. So dead time and first-order lag
    of the response are those values of a grid that explain the most. The gain is in the odometry's metres, where the
    odometry gives velocities.

    The standard error is that of nonlinear least squares, robust against unequal variances and against correlation over
    2 s (W. Newey and K. West, Econometrica 55 (1987), 703-708, weights 1 - j/(m + 1)).

    Args:
        recording: Poses, and velocities where the odometry gives some.
        pushes: Of the whole recording.
        demonstrations: Trials of this recording; those with a joystick do not count.
        begins_n: Force at which a contact begins, N; a push whose sideways force is not half of it, root mean square,
            does not count.

    Returns:
        The gain, or None without a push to the side.
    """
    start_ns = int(recording.t_ns[0])
    t_s, force_t_s = (recording.t_ns - start_ns) / 1e9, (pushes.t_ns - start_ns) / 1e9
    samples = _samples(recording, pushes, demonstrations, begins_n)
    if samples is None:
        return None
    clock = np.arange(samples.at[-1] + samples.window + 1) * STEP_S
    moved = np.interp(clock, t_s, _sideways_m(recording, t_s))
    # the force at the poses' times too, so that rare poses smooth both alike
    given = np.interp(t_s, force_t_s, _integral(force_t_s, pushes.base_n[:, 1]))
    impulse = np.interp(clock, t_s, given)
    aside = _changes(np.cumsum(moved) * STEP_S, samples.at, samples.window)
    velocity = _without(_changes(moved, samples.at, samples.window), aside, samples.piece)

    def response(late: FloatArray, delay_s: float) -> FloatArray:
        changes = _changes(late, samples.at - round(delay_s / STEP_S), samples.window)
        return _without(changes, aside, samples.piece)

    return _fitted(velocity, impulse, response, samples)


def pooled(gains: Sequence[Gain]) -> Gain:
    """One gain from several recordings of one robot: their mean, weighted by the inverse of their variances."""
    weight = np.array([1 / max(gain.standard_error_m_s_n, 1e-12) ** 2 for gain in gains])
    weight /= weight.sum()
    return Gain(
        float(weight @ [gain.gain_m_s_n for gain in gains]),
        float(np.sqrt(weight**2 @ [gain.standard_error_m_s_n**2 for gain in gains])),
        sum(gain.pushes for gain in gains),
        float(weight @ [gain.delay_s for gain in gains]),
    )


def _sideways_m(recording: Recording, t_s: FloatArray) -> FloatArray:
    """(n,) movement of the robot to its left, in its own frame at each time, since the first pose, m."""
    if recording.velocity_m_s is not None:
        return _integral(t_s, recording.velocity_m_s[:, 1])
    yaw = np.unwrap(recording.yaw_rad)
    yaw = (yaw[1:] + yaw[:-1]) / 2
    steps = np.diff(recording.xy_m, axis=0)
    return np.append(0.0, np.cumsum(np.cos(yaw) * steps[:, 1] - np.sin(yaw) * steps[:, 0]))


def _integral(t_s: FloatArray, values: FloatArray) -> FloatArray:
    """(n,) integral from the first time to each, by the trapezoidal rule."""
    return np.append(0.0, np.cumsum(np.diff(t_s) * (values[1:] + values[:-1]) / 2))


def _samples(
    recording: Recording, pushes: Pushes, demonstrations: Iterable[Demonstration], begins_n: float
) -> _Samples | None:
    """The times around the pushes of all trials, or None without pushes."""
    start_ns = int(recording.t_ns[0])
    rarest = float(np.median(np.diff(recording.t_ns))) / 1e9
    window = round(max(WINDOW_S, 2 * rarest) / STEP_S)
    # across a jump of the localisation the poses give no velocity
    leaps = [(jump.t_ns - start_ns) / 1e9 for jump in recording.jumps if recording.velocity_m_s is None]
    stretches, pieces, count = [], [], 0
    for one in demonstrations:
        spans = [] if one.condition is Condition.JOYSTICK else _sideways_pushes(one, pushes, begins_n)
        count += len(spans)
        since = (one.start_ns - start_ns) / 1e9
        steps = np.arange(round(since / STEP_S) + window, round((since + one.duration_s) / STEP_S) - window, STRIDE)
        at_s = steps * STEP_S
        near = np.zeros(len(steps), dtype=bool)
        for first_s, last_s in spans:
            near |= (at_s > since + first_s - MARGIN_S) & (at_s < since + last_s + MARGIN_S)
        for leap_s in leaps:
            near &= np.abs(at_s - leap_s) > window * STEP_S
        edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(np.int8)))
        for first, stop in edges.reshape(-1, 2).tolist():
            stretches.append(steps[first:stop])
            pieces.append(np.array_split(steps[first:stop], max(1, round((stop - first) * STRIDE * STEP_S / PIECE_S))))
    if not stretches:
        return None
    every = [piece for group in pieces for piece in group]
    return _Samples(np.concatenate(stretches), _numbered(stretches), _numbered(every), window, count)


def _numbered(groups: Sequence[IntArray]) -> IntArray:
    """The number of its group for each member of groups in a row."""
    return np.repeat(np.arange(len(groups)), [len(group) for group in groups])


def _sideways_pushes(one: Demonstration, pushes: Pushes, begins_n: float) -> list[tuple[float, float]]:
    """First and last instant, s since the trial's start, of the contacts that push to the side."""
    found = []
    for contact in one.contacts or ():
        ends_ns = [one.start_ns + round(second * 1e9) for second in (contact.start_s, contact.end_s)]
        first, last = np.searchsorted(pushes.t_ns, ends_ns)
        if np.sqrt(np.mean(pushes.base_n[first : last + 1, 1] ** 2)) >= begins_n / 2:
            found.append((contact.start_s, contact.end_s))
    return found


def _changes(integral: FloatArray, at: IntArray, window: int) -> FloatArray:
    """(n,) mean over the window after each step - mean over the window before it, of the integral's derivative."""
    before, here, after = (integral[np.maximum(at + shift, 0)] for shift in (-window, 0, window))
    changes: FloatArray = (after - 2 * here + before) / (window * STEP_S)
    return changes


def _without(values: FloatArray, aside: FloatArray, piece: IntArray) -> FloatArray:
    """The part of values that is not proportional to the robot's movement aside, piece by piece."""
    square = np.bincount(piece, aside**2)
    factor = np.divide(np.bincount(piece, values * aside), square, out=np.zeros_like(square), where=square > 0)
    return values - factor[piece] * aside


def _late(integral: FloatArray, lag_s: float) -> FloatArray:
    """The integral of a signal after a first-order lag, from the signal's integral."""
    return lagged(integral, float(np.exp(-STEP_S / lag_s))) if lag_s else integral


def _fitted(
    velocity: FloatArray, impulse: FloatArray, response: Callable[[FloatArray, float], FloatArray], samples: _Samples
) -> Gain:
    """The gain with the dead time and the lag that explain the most, and its standard error."""
    best, delay, lag = -1.0, 0.0, 0.0
    for tried in LAGS_S:
        late = _late(impulse, tried)
        for wait in DELAYS_S.tolist():
            force = response(late, wait)
            explained = float((force @ velocity) ** 2 / (force @ force))
            if explained > best:
                best, delay, lag = explained, wait, tried
    force = response(_late(impulse, lag), delay)
    k = float(force @ velocity / (force @ force))
    # delay and lag were estimated too, which adds uncertainty where they are not at the end of their range
    slopes = [force]
    if delay > 0:
        earlier, later = (response(_late(impulse, lag), delay + change) for change in (-0.02, 0.02))
        slopes.append(k * (later - earlier) / 0.04)
    if lag > 0:
        shorter, longer = (response(_late(impulse, lag * factor), delay) for factor in (0.9, 1.1))
        slopes.append(k * (longer - shorter) / (0.2 * lag))
    variance = _covariance(np.stack(slopes, axis=1), velocity - k * force, samples.stretch)[0, 0]
    return Gain(k, float(np.sqrt(variance)), samples.pushes, delay + lag)


def _covariance(slopes: FloatArray, residual: FloatArray, stretch: IntArray) -> FloatArray:
    """(m, m) covariance of least squares with (n, m) derivatives, by Newey and West within each stretch."""
    memory = round(MEMORY_S / (STRIDE * STEP_S))
    scores = slopes * residual[:, None]
    middle = np.zeros((slopes.shape[1],) * 2)
    for number in range(int(stretch[-1]) + 1):
        part = scores[stretch == number]
        middle += part.T @ part
        for apart in range(1, min(memory, len(part) - 1) + 1):
            product = part[apart:].T @ part[:-apart]
            middle += (1 - apart / (memory + 1)) * (product + product.T)
    bread = np.linalg.pinv(slopes.T @ slopes)
    covariance: FloatArray = bread @ middle @ bread
    return covariance
