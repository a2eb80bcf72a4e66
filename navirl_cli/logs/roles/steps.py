"""Steps of clocks: when, by how much, and which clock made them.

Stamps and times of receipt are each held against their own period, and both against the order in which the recorder
wrote. Of the two the one that breaks its period has stepped. Where both do, by the same time, the clock of the computer
has. A stamp and a time of receipt that jump ahead together may also be a pause of the recording; then the robot's path
decides. Times of receipt that go back may also be pieces of a file that stand in another order than they were recorded
in; then the pieces follow each other without overlap.

What is honest is no step: a recorder that stalls receives late and catches up, so that the least latency within two
seconds does not change; dropped messages and pauses move stamps and times of receipt alike.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.logs.roles.clocks import NS_PER_S
from navirl_cli.logs.roles.tracks import Track, since_first

#: The least step that is recognised, s: more than latency varies by.
STEP_S: Final = 0.45
#: Within this time a recorder that stalled has caught up, s.
_WINDOW_S: Final = 2.0
#: and this many messages are enough to see one that is not late.
_LEAST: Final = 8
#: A clock whose rate is this near to 1 runs in real time; a simulation's may not.
_REAL_TIME: Final = 0.02
#: Two topics see the same step if their sizes agree to this, s.
_SAME_S: Final = 0.3
#: A topic has gone on where its time lies this near to its period, s.
_EVEN_S: Final = 0.2
#: Messages that are in flight while a clock steps show the step of one time before that of the other.
_IN_FLIGHT: Final = 3
#: A topic with more changes than the first number, or more steps than the second, has no regular times.
_MOST, _MOST_STEPS = 2000, 40
#: Two times in nanoseconds of 63 bits are not farther apart, s.
_LARGEST_S: Final = 4.6e9
#: From this distance on a robot has moved, m.
_MOVED_M: Final = 0.05


@dataclass(frozen=True, eq=False)
class Path:
    """Where the odometry is at its messages: the witness of whether time has passed."""

    #: (n,) places in the recorder's order, ascending, (n,) ns of receipt, and (n, 2) m.
    order: IntArray
    received_ns: IntArray
    xy_m: FloatArray


@dataclass(frozen=True, eq=False)
class _Change:
    """Where one track's times change."""

    track: Track
    #: Places in the recorder's order of the messages before and after.
    before: int
    after: int
    #: Of the first messages whose time of receipt, and whose stamp, is after the step: mostly the same.
    received_after: int
    stamped_after: int
    #: Time of receipt of the message before, ns.
    at_ns: int
    #: Steps of the recorder's clock and of the stamps', s; both positive and equal for what may be a pause.
    received_s: float
    stamped_s: float | None

    @property
    def size_s(self) -> float:
        """The larger of both steps, s."""
        return max(abs(self.received_s), abs(self.stamped_s or 0.0))

    @property
    def ahead(self) -> bool:
        """Whether all times jump ahead together, as in a pause."""
        return self.received_s > STEP_S and (self.stamped_s is None or abs(self.stamped_s - self.received_s) < _SAME_S)


@dataclass(eq=False)
class Step:
    """A step of one clock or of several, as all tracks see it."""

    #: By the recorder's clock, s; 0 where it goes on evenly.
    received_s: float
    #: By track the step of its stamps, s.
    stamped_s: dict[Track, float] = field(default_factory=dict)
    #: By track the places of the first messages whose time of receipt, and whose stamp, is after it.
    places: dict[Track, tuple[int, int]] = field(default_factory=dict)
    #: Between these places all tracks have it.
    before: int = 0
    after: int = 0
    #: Time of receipt before it by the recorder's own clock, ns.
    at_ns: int = 0
    #: Whether it may be a pause of the recording.
    ahead: bool = False
    #: Whether it is one of all topics, and not of the receipt of some.
    common: bool = True

    def places_in(self, track: Track) -> tuple[int, int]:
        """Where it is in a track's times of receipt, and in its stamps."""
        return self.places.get(track, (self.after, self.after))


def steps_of(tracks: Sequence[Track], path: Path | None) -> tuple[list[Step], list[Step]]:
    """The steps of clocks in a recording.

    Args:
        tracks: All of it, with times of receipt that are possible.
        path: Of the robot's odometry, where there is some.

    Returns:
        Steps, in the recorder's order; and pauses of all topics of which it stays unknown whether a clock stepped.
    """
    dense = sorted((track for track in tracks if track.is_dense), key=lambda one: (not one.is_stamped, one.period_s))
    found: list[Step] = []
    for track in dense:
        changes = [one for one in _changes(track) if STEP_S < one.size_s < _LARGEST_S]
        for change in changes if len(changes) <= _MOST_STEPS else ():
            _join(found, change)
    steps: list[Step] = []
    unknown: list[Step] = []
    for step in sorted(found, key=lambda one: one.after):
        if step.ahead:
            everywhere = _is_common(step, dense) and _is_everywhere(step, tracks)
            verdict = _passed(step, path) if everywhere else True
            (unknown if verdict is None else steps if not verdict else []).append(step)
        elif step.received_s < 0 and _is_disorder(step, path):
            continue
        else:
            step.common = not step.received_s or _is_common(step, dense)
            steps.append(step)
    return steps, unknown


def _changes(track: Track) -> list[_Change]:
    """Where a track's times break their periods; changes that cancel are none."""
    received, stamped = track.received_s, track.stamped_s
    after_s = np.diff(received)
    late = after_s - track.period_s
    if stamped is None:
        rate, early, relative = 1.0, late, np.zeros_like(late)
    else:
        steps = np.diff(stamped)
        period = float(np.median(steps))
        rate = _rate(received, stamped, max(_LEAST, round(1.0 / track.period_s)))
        early, relative = steps - period, steps - rate * after_s
    offset = np.concatenate([[0.0], np.cumsum(relative)])
    rows = np.flatnonzero((np.abs(relative) > STEP_S) | (late < -STEP_S) | ((late > STEP_S) & (early > STEP_S)))
    found: list[tuple[int, float, float]] = []
    for some in _runs(rows, _IN_FLIGHT) if len(rows) <= _MOST else ():
        r, s = float(late[some].sum()), float(early[some].sum())
        if abs(r) > STEP_S and abs(r - s) < (_SAME_S if r > 0 else STEP_S):
            # both move alike, though messages in flight may show one before the other
            found += [(row, float(late[row]), float(early[row])) for row in some.tolist()]
            continue
        for row in some.tolist():
            net = _net(offset, received, row)
            if abs(net) > STEP_S:
                found.append((row, *_attributed(float(late[row]), float(early[row]), net, rate)))
    by_row = {row: (row, r, s) for row, r, s in found}
    runs = _runs(np.array(list(by_row), dtype=np.int64), _LEAST)
    return [_change(track, [by_row[row] for row in some.tolist()]) for some in runs if len(some)]


def _runs(rows: IntArray, apart: int) -> list[IntArray]:
    """Ascending rows in runs whose neighbours are at most so far apart."""
    return np.split(rows, np.flatnonzero(np.diff(rows) > apart) + 1)


def _change(track: Track, some: Sequence[tuple[int, float, float]]) -> _Change:
    """A track's change from what its rows show, s: messages that overtake each other show it in pieces."""
    rows = track.sound
    (first, *_), (last, *_) = some[0], some[-1]
    received_row, *_ = max(some, key=lambda one: abs(one[1]))
    stamped_row, *_ = max(some, key=lambda one: abs(one[2]))
    return _Change(
        track,
        before=int(track.order[rows[first]]),
        after=int(track.order[rows[last + 1]]),
        received_after=int(track.order[rows[received_row + 1]]),
        stamped_after=int(track.order[rows[stamped_row + 1]]),
        at_ns=int(track.received_ns[rows[first]]),
        received_s=sum(one[1] for one in some),
        stamped_s=sum(one[2] for one in some) if track.is_stamped else None,
    )


def _rate(received: FloatArray, stamped: FloatArray, apart: int) -> float:
    """How fast the stamps' clock goes by the recorder's: the median over so many messages, in which few steps are."""
    apart = max(1, min(apart, len(received) // 4))
    received_s, stamped_s = received[apart:] - received[:-apart], stamped[apart:] - stamped[:-apart]
    forward = (received_s > 0) & (stamped_s > 0)
    rate = float(np.median(stamped_s[forward] / received_s[forward])) if forward.any() else 1.0
    return rate if abs(rate - 1.0) > _REAL_TIME else 1.0


def _net(offset: FloatArray, received: FloatArray, row: int) -> float:
    """By how much the offset of the messages with the least latency changes after a row, s.

    A recorder that catches up brings the offset back to where it was: what goes beyond that is another step.
    """
    before, after = _window(offset, received, row, -1), _window(offset, received, row + 1, 1)
    highest = float(before.max())
    falls = offset[row + 1] < offset[row]
    return float((np.minimum(after, highest) if falls else after).max()) - highest


def _window(offset: FloatArray, received: FloatArray, row: int, step: int) -> FloatArray:
    """The offsets within some time before or after a row.

    The window also holds so many messages that a recorder that stalls cannot fill it.
    """
    count = 1
    while 0 <= (at := row + step * count) < len(offset):
        if count >= _LEAST and not -STEP_S <= step * (received[at] - received[row]) <= _WINDOW_S:
            break
        count += 1
    return offset[row : row + count] if step > 0 else offset[row - count + 1 : row + 1]


def _attributed(late: float, early: float, net: float, rate: float) -> tuple[float, float]:
    """Which clock stepped.

    Args:
        late: Time of receipt after the message before, less a period, s.
        early: The same of the stamp.
        net: By how much stamps step against times of receipt, s.
        rate: Of the stamps' clock.

    Returns:
        Steps of the times of receipt and of the stamps, s: of two explanations that with the shorter pause.
    """
    explanations = []
    if late >= -_EVEN_S:
        explanations.append((max(late, 0.0), 0.0, net))
    if early >= -_EVEN_S:
        explanations.append((max(early / rate, 0.0), -net / rate, 0.0))
    if not explanations:
        return late, net + rate * late
    _, received, stamped = min(explanations)
    return received, stamped


def _join(found: list[Step], change: _Change) -> None:
    """Add a track's change to the step that it is part of, or make it a step."""
    for step in found:
        overlaps = max(step.before, change.before) < min(step.after, change.after)
        near = abs(step.at_ns - change.at_ns) < (change.track.period_s + 1.0) * NS_PER_S
        if change.track in step.places or not (overlaps or near):
            continue
        if abs(step.received_s - change.received_s) > _SAME_S:
            continue
        if change.stamped_s is None and not step.received_s:
            continue
        if not step.received_s and all(
            abs(one - (change.stamped_s or 0.0)) > _SAME_S for one in step.stamped_s.values()
        ):
            continue
        step.ahead = step.ahead and change.ahead
        if overlaps:
            step.before, step.after = max(step.before, change.before), min(step.after, change.after)
        break
    else:
        step = Step(change.received_s, before=change.before, after=change.after, at_ns=change.at_ns, ahead=change.ahead)
        found.append(step)
    step.places[change.track] = change.received_after, change.stamped_after
    if change.stamped_s:
        same = [one for one in step.stamped_s.values() if abs(one - change.stamped_s) < _SAME_S]
        both = abs(change.stamped_s - step.received_s) < _SAME_S
        # one clock steps by one time: that of the densest topic is the most exact
        step.stamped_s[change.track] = step.received_s if both else same[0] if same else change.stamped_s


def _is_everywhere(step: Step, tracks: Iterable[Track]) -> bool:
    """Whether no message of any topic stands in the file where the times jump ahead, with a time in between."""
    slack = round(0.1 * NS_PER_S)
    first, last = step.at_ns + slack, step.at_ns + round(step.received_s * NS_PER_S) - slack
    for track in tracks:
        between = track.received_ns[(track.order > step.before) & (track.order < step.after)]
        if ((first < between) & (between < last)).any():
            return False
    return True


def _passed(step: Step, path: Path | None) -> bool | None:
    """Whether time has passed while the times jump ahead, by how far the robot came; None if it stands still."""
    if path is None:
        return None
    before = int(np.searchsorted(path.order, step.before, side="right")) - 1
    after = int(np.searchsorted(path.order, step.after))
    if before < 2 or after > len(path.order) - 3 or before >= after:
        return None
    came = float(np.hypot(*(path.xy_m[after] - path.xy_m[before])))
    sides = [
        np.hypot(*np.diff(path.xy_m[part], axis=0).T)
        for part in (slice(before - 2, before + 1), slice(after, after + 3))
    ]
    usual, fastest = min(float(side.mean()) for side in sides), max(float(side.max()) for side in sides)
    rows = step.received_s * NS_PER_S / max(float(np.median(np.diff(path.received_ns))), 1.0)
    if usual * rows < max(_MOVED_M, 2 * fastest):
        return None
    return came > (after - before + 1) * fastest + 0.01


def _is_disorder(step: Step, path: Path | None) -> bool:
    """Whether times go back because pieces of the file stand in another order than they were recorded in."""
    track = next(iter(step.places))
    if any(not stamped for stamped in [step.stamped_s.get(one, 0.0) for one in step.places if one.is_stamped]):
        return False  # stamps that go on evenly in the file's order prove that order
    row = int(np.searchsorted(track.order, step.places[track][0]))
    if _is_regular(track, row):
        return True
    if path is None or not 0 < (row := int(np.searchsorted(path.order, step.after))) < len(path.order):
        return False
    then = int(np.abs(path.received_ns[:row] - path.received_ns[row]).argmin())
    on, back = (float(np.hypot(*(path.xy_m[row] - path.xy_m[one]))) for one in (row - 1, then))
    return back + _MOVED_M < on


def _is_regular(track: Track, row: int) -> bool:
    """Whether a track's times of receipt, brought into their own order, neither overlap nor leave a gap."""
    received = since_first(track.received_ns)
    in_time = np.sort(received)
    steps = np.diff(in_time)
    largest = max(float(np.diff(received).max()), track.period_s)
    if steps.max() > largest + 5 * track.period_s:
        return False  # the pieces do not follow each other
    first, last = float(received[row]), float(received[row - 1])
    # where pieces overlap, there are more messages than the time between the two has room for
    inside = int(((received >= first) & (received <= last)).sum())
    steps = np.diff(received)
    usual_s = float(steps[(steps > 0) & (steps < 3 * track.period_s)].mean())
    return inside * usual_s <= 1.02 * (last - first) + 5 * track.period_s


def _is_common(step: Step, dense: Iterable[Track]) -> bool:
    """Whether most topics that could see a step of the recorder's clock do."""
    capable = {
        track.topic for track in dense if track in step.places or (track.order[2] < step.after <= track.order[-3])
    }
    seen = {track.topic for track in step.places}
    return len(seen) >= 0.5 * len(capable | seen)
