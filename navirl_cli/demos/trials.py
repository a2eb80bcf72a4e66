"""Where one trial ends and the next begins."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeVar

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.errors import DemonstrationError
from navirl_cli.logs.recording import Declared, Published, Recording

Entry = TypeVar("Entry", Declared, Published)

#: A slower robot stands, m/s; window over which the speed is measured, s.
STANDING_M_S = 0.04
WINDOW_S = 0.5
#: A robot at rest this near to its goal has arrived, m.
ARRIVED_M = 0.5
#: A goal this near to the present one is the same goal announced again, m.
SAME_GOAL_M = 0.05
#: A trial of the session record this near in time is the one that starts here, s.
SAME_START_S = 1.0
#: A rest of this length separates two trials where they are split at stops, s.
REST_S = 1.0
#: A trial that covers less is empty, m.
MIN_TRAVEL_M = 0.5


class Split(StrEnum):
    """Where a new trial starts."""

    GOAL = "goal"
    STOP = "stop"
    NONE = "none"


@dataclass(frozen=True)
class Trial:
    """A stretch of poses."""

    #: First and one past the last pose.
    first: int
    stop: int
    #: (x, y) m, map frame; None where the log announces none.
    goal_m: tuple[float, float] | None
    #: False where a goal was announced and the robot did not rest near it.
    arrived: bool = True
    #: When its goal was announced, ns; None without one.
    from_ns: int | None = None
    #: Until when it could have gone on, ns: its declared end, or the next goal; None for the log's end.
    until_ns: int | None = None
    #: One past the last pose until then; None for the log's end.
    border: int | None = None
    #: Whether the session record gives its end.
    declared: bool = False


def trials_of(recording: Recording, split: Split) -> list[Trial]:
    """Split a recording into trials.

    ``goal``: a trial starts when a goal is announced. It ends at the time given in the session record; else where the
    robot first comes to rest near the goal; else where it was nearest before the next goal. So the drive back belongs
    to no trial. Announcing the present goal again starts no trial, unless the robot was there and has left.
    ``stop``: trials are the drives between rests. ``none``: one trial.

    Args:
        recording: Poses and goals.
        split: How.

    Returns:
        Trials in order of time; those that cover less than half a metre are included, for the caller to report.

    Raises:
        DemonstrationError: The recording has no goal to split at.
    """
    standing = speeds_m_s(recording.t_ns, recording.xy_m) < STANDING_M_S
    if split is Split.NONE:
        return [Trial(0, len(recording.t_ns), None)]
    if split is Split.STOP:
        return _between_rests(recording.t_ns, standing)
    if recording.goal_problem:
        raise DemonstrationError(recording.goal_problem)
    return _at_goals(recording, standing)


def with_goal(recording: Recording, goal_m: tuple[float, float] | None) -> Recording:
    """The recording with the user's goal in place of its own; in one without goals it is announced at the start."""
    if goal_m is None:
        return recording
    times = recording.goal_t_ns if len(recording.goal_t_ns) else recording.t_ns[:1]
    return replace(recording, goal_t_ns=times, goal_m=np.tile(goal_m, (len(times), 1)))


def entries_by_trial(entries: Sequence[Entry], recording: Recording, trials: Sequence[Trial]) -> dict[int, Entry]:
    """The entry of a metadata record for each trial, by the trial's place in the list.

    An entry belongs to the trial whose start is nearest, if it is not farther than the trial is long. Of several such
    entries the nearest one counts.

    Args:
        entries: In any order.
        recording: The log.
        trials: In order of time.
    """
    starts = [int(recording.t_ns[trial.first]) for trial in trials]
    found: dict[int, Entry] = {}
    for entry in entries if trials else ():
        after = bisect_left(starts, entry.t_ns)
        number = min(range(max(after - 1, 0), min(after + 1, len(trials))), key=lambda n: abs(entry.t_ns - starts[n]))
        away, length = abs(entry.t_ns - starts[number]), int(recording.t_ns[trials[number].stop - 1]) - starts[number]
        if away < length and (number not in found or away < abs(found[number].t_ns - starts[number])):
            found[number] = entry
    return found


def speeds_m_s(t_ns: IntArray, xy_m: FloatArray) -> FloatArray:
    """(n,) speed over half a second around each pose, so that the noise of single poses does not count, m/s."""
    t = (t_ns - t_ns[0]) / 1e9
    early, late = np.maximum(t - WINDOW_S / 2, t[0]), np.minimum(t + WINDOW_S / 2, t[-1])
    moved = [np.interp(late, t, axis) - np.interp(early, t, axis) for axis in xy_m.T]
    speed: FloatArray = np.hypot(*moved) / np.maximum(late - early, 1e-9)
    return speed


def _between_rests(t_ns: IntArray, standing: BoolArray) -> list[Trial]:
    """Drives between rests that are long enough."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], standing, [False]]).astype(np.int8)))
    rests = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if t_ns[b - 1] - t_ns[a] >= REST_S * 1e9]
    borders = [0] + [border for rest in rests for border in rest] + [len(t_ns)]
    return [Trial(int(a), int(b), None) for a, b in zip(borders[::2], borders[1::2], strict=True) if b - a > 1]


def _at_goals(recording: Recording, standing: BoolArray) -> list[Trial]:
    """From each new goal to the rest near it, before the next new goal."""
    starts = np.searchsorted(recording.t_ns, recording.goal_t_ns)
    kept: list[tuple[int, FloatArray]] = []
    times: list[int] = []
    for start, goal, t_ns in zip(starts.tolist(), recording.goal_m, recording.goal_t_ns.tolist(), strict=True):
        if start < len(recording.t_ns) and (not kept or _is_new(recording, kept[-1], start, goal)):
            kept.append((start, goal))
            times.append(t_ns)
    if not kept:
        return []
    borders = [start for start, _ in kept[1:]] + [len(recording.t_ns)]
    return [
        replace(
            _towards(recording, standing, (start, border), goal, until_ns),
            from_ns=max(from_ns, recording.span_ns[0]),
        )
        for (start, goal), border, from_ns, until_ns in zip(kept, borders, times, [*times[1:], None], strict=True)
        if border - start > 1
    ]


def _is_new(recording: Recording, present: tuple[int, FloatArray], start: int, goal: FloatArray) -> bool:
    """Whether an announcement starts a trial: another goal, or the same one after the robot was there and has left."""
    since, aim = present
    if np.hypot(*(goal - aim)) >= SAME_GOAL_M:
        return True
    distance = np.hypot(*(recording.xy_m[since : start + 1] - goal).T)
    return bool((distance < ARRIVED_M).any() and distance[-1] > ARRIVED_M)


def _towards(
    recording: Recording, standing: BoolArray, span: tuple[int, int], goal: FloatArray, until_ns: int | None
) -> Trial:
    """The trial within a span of poses that ends near a goal."""
    first, border = span
    distance = np.hypot(*(recording.xy_m[first:border] - goal).T)
    target = (float(goal[0]), float(goal[1]))
    declared = _declared_stop(recording, first, border)
    if declared is not None:
        stop, stop_ns = declared
        near = bool(distance[stop - first - 1] < ARRIVED_M)
        return Trial(first, stop, target, arrived=near, until_ns=stop_ns, border=stop, declared=True)
    resting = np.flatnonzero(standing[first:border] & (distance < ARRIVED_M) & _has_left(distance))
    if len(resting):
        return Trial(first, first + int(resting[0]) + 1, target)
    nearest = int(distance.argmin())
    near = bool(distance[nearest] < ARRIVED_M)
    return Trial(first, first + max(nearest, 1) + 1, target, arrived=near, until_ns=until_ns, border=border)


def _declared_stop(recording: Recording, first: int, border: int) -> tuple[int, int] | None:
    """One past the last pose of the trial that starts with a pose, and its end, ns, from the session record."""
    start_ns = int(recording.t_ns[first])
    ended = [entry for entry in recording.session.declared if entry.stop_ns is not None]
    entry = min(ended, key=lambda entry: abs(entry.t_ns - start_ns), default=None)
    if entry is None or entry.stop_ns is None or abs(entry.t_ns - start_ns) > SAME_START_S * 1e9:
        return None
    stop = int(np.clip(np.searchsorted(recording.t_ns, entry.stop_ns, side="right"), first + 2, border))
    return stop, entry.stop_ns


def _has_left(distance: FloatArray) -> BoolArray:
    """(n,) whether the robot has moved since the start: waiting at an old goal is no arrival at a new one."""
    left: BoolArray = np.abs(distance - distance[0]) > MIN_TRAVEL_M / 2
    return left
