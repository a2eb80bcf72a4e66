"""When a message was measured, on one clock for the whole recording.

A header's stamp is the time of the measurement; a message without a stamp has its time of receipt. The clock of a
recording is that of its odometry's stamps. It may be simulated, belong to another computer than the recorder's, and
jump. Where another topic is stamped by another clock, the times of receipt give the offset between the two.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.logs.findings import Finding, Kind

NS_PER_S = 1_000_000_000
#: A clock that moves by more than this against the recorder's between two messages has jumped, s.
JUMP_S = 1.0
#: Stamps farther than this from the expected time belong to another clock, s: no robot's messages take so long.
APART_S = 0.25
#: Stamps that drift by more than this until the end belong to another clock too, s. An offset that changes by less than
#: the second number is taken to be constant.
_DRIFT_S, _CONSTANT_S = 0.1, 0.02
#: The offset of another clock is estimated from at least this many messages.
_MIN_MESSAGES = 20
#: Widths of medians over offsets, messages: against single wrong stamps, and against the time that messages take. The
#: second is also a time in s, because a recorder's disk stalls all topics at once.
_OUTLIERS, _LATENCY, _LATENCY_S = 5, 51, 2.0
#: A time of receipt this far from all others is wrong, s.
_ANOTHER_DAY_S = 3600.0
#: Stamps this early are simulated or count from the computer's start, not from 1970: ns.
EARLIEST_NS = 365 * 86_400 * NS_PER_S


class TimeSource(StrEnum):
    """Which times the messages of a recording have."""

    HEADER = "header"
    LOG = "log"


@dataclass(frozen=True, eq=False)
class Stamped:
    """Times of a topic's messages, before and after correction."""

    topic: str
    #: (n,) ns of receipt, ascending.
    log_ns: IntArray
    #: (n,) ns, 0 for a missing stamp; None for messages without a header.
    stamp_ns: IntArray | None
    #: Whether a message counts from its receipt on, such as a goal. Others may be older than their receipt, such as a
    #: map that is sent to late subscribers.
    momentary: bool = False


@dataclass(eq=False)
class Clock:
    """The clock of a recording.

    Args:
        reference: Stamps of the odometry, which define it.
        source: Whether stamps or times of receipt are wanted.
    """

    reference: Stamped
    source: TimeSource = TimeSource.HEADER
    #: What is unusual about the stamps.
    findings: list[Finding] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Track the reference's offset from the recorder's clock over time."""
        log_ns, stamp_ns = self.reference.log_ns, self.reference.stamp_ns
        stamp_ns = np.zeros_like(log_ns) if stamp_ns is None else stamp_ns
        stamped = np.flatnonzero(stamp_ns != 0)
        if self.source is TimeSource.HEADER and not stamped.size:
            self.source = TimeSource.LOG
            if len(log_ns):
                self.findings.append(Finding(Kind.NO_STAMPS, self.reference.topic))
        #: Offset at the first stamp, ns. Later offsets are relative to it, so that floats hold them.
        self._base_ns = 0
        self._shifts_ns = np.zeros(1, dtype=np.int64)
        self._at_ns = log_ns[stamped[:1]] if self.source is TimeSource.HEADER else np.zeros(1, dtype=np.int64)
        self._offset_s = np.zeros(1)
        if self.source is TimeSource.HEADER:
            self._follow(log_ns[stamped], stamp_ns[stamped])

    @property
    def offset_ns(self) -> int:
        """Offset of the clock from the recorder's at the start, ns."""
        return self._base_ns

    @property
    def simulated(self) -> bool:
        """Whether stamps do not count from 1970 while times of receipt do."""
        if self.source is TimeSource.LOG or not len(self.reference.log_ns):
            return False
        middle = int(self.reference.log_ns[len(self.reference.log_ns) // 2])
        return middle > EARLIEST_NS > middle + self._base_ns

    def times(self, one: Stamped) -> IntArray:
        """Times of messages on this clock, (n,) ns; what is unusual about them is noted."""
        if self.source is TimeSource.LOG:
            return one.log_ns.copy()
        expected = self._expected(one.log_ns)
        if one.stamp_ns is None:
            return expected
        stamped = one.stamp_ns != 0
        if not stamped.all():
            self.findings.append(Finding(Kind.UNSTAMPED, one.topic, int((~stamped).sum())))
        times = np.where(stamped, self.shifted(one.stamp_ns, one.log_ns), expected)
        if one.topic != self.reference.topic:
            times = times - np.where(stamped, self._apart(one, _seconds(times - expected), stamped), 0)
        away = _seconds(times - expected)
        wild = stamped & (np.abs(away) > JUMP_S) & ~_received_wrongly(times, one.log_ns, away)
        if self._at_ns[0] == self._at_ns[-1]:  # some converters give all messages one time of receipt
            wild[:] = False
        if wild.any() and (one.momentary or len(times) >= _MIN_MESSAGES):
            self.findings.append(Finding(Kind.WILD_STAMPS, one.topic, int(wild.sum()), JUMP_S))
            times = np.where(wild, expected, times)
        return times

    def shifted(self, stamp_ns: IntArray, log_ns: IntArray) -> IntArray:
        """Stamps (n,) ns, moved over the clock's jumps by their times of receipt; stamps of 0 stay."""
        if self.source is TimeSource.LOG:
            return log_ns
        if len(self._shifts_ns) == 1:
            return stamp_ns
        candidates = stamp_ns[:, None] + self._shifts_ns
        best = np.abs(candidates - self._expected(log_ns)[:, None]).argmin(axis=1)
        moved: IntArray = candidates[np.arange(len(stamp_ns)), best]
        return np.where(stamp_ns == 0, 0, moved)

    def _follow(self, log_ns: IntArray, stamp_ns: IntArray) -> None:
        """Find jumps, and the offset between them."""
        offset_ns = stamp_ns - log_ns
        self._base_ns = int(np.sort(offset_ns[:_OUTLIERS])[len(offset_ns[:_OUTLIERS]) // 2])
        steady, jumped = _steady(_seconds(offset_ns - self._base_ns), log_ns)
        jumps = np.flatnonzero(np.diff(jumped))
        self._shifts_ns = np.round(-jumped[np.r_[0, jumps + 1]] * NS_PER_S).astype(np.int64)
        self._at_ns = log_ns
        self._offset_s = _smooth(steady - jumped, _seconds(log_ns - log_ns[0]))
        for row in jumps.tolist():
            at_s = (int(log_ns[row]) - int(log_ns[0])) / NS_PER_S
            size = float(jumped[row + 1] - jumped[row])
            self.findings.append(Finding(Kind.CLOCK_STEP, "the clock", size=size, at_s=at_s))

    def _expected(self, log_ns: IntArray) -> IntArray:
        """The clock's time when messages are received, (n,) ns."""
        first = int(self._at_ns[0])
        # differences first: nanoseconds since 1970 do not fit into a float
        at_s, known_s = _seconds(log_ns - first), _seconds(self._at_ns - first)
        rate = (self._offset_s[-1] - self._offset_s[0]) / max(known_s[-1], JUMP_S)
        beyond_s = at_s - np.clip(at_s, 0.0, known_s[-1])
        offset_s = np.interp(at_s, known_s, self._offset_s) + rate * beyond_s
        shown: IntArray = log_ns + self._base_ns + np.round(offset_s * NS_PER_S).astype(np.int64)
        return shown

    def _apart(self, one: Stamped, away_s: FloatArray, stamped: BoolArray) -> IntArray:
        """Offset of another clock's stamps from this clock, (n,) ns; 0 where it is the same clock."""
        rows = np.flatnonzero(stamped)
        none = np.zeros(len(away_s), dtype=np.int64)
        if rows.size < _MIN_MESSAGES:
            return none
        at_s = _seconds(one.log_ns - one.log_ns[0])
        steady, jumped = _steady(away_s[rows], one.log_ns[rows])
        steady = jumped + _smooth(steady - jumped, at_s[rows])
        middle, change = float(np.median(steady)), float(steady[-1] - steady[0])
        if abs(middle) <= APART_S and abs(change) <= _DRIFT_S:
            return none
        kind = Kind.DRIFTING_CLOCK if abs(change) > _DRIFT_S else Kind.OTHER_CLOCK
        than = self.reference.topic
        self.findings.append(Finding(kind, one.topic, size=middle, change=change, detail=than))
        apart = np.interp(at_s, at_s[rows], steady) if np.ptp(steady) > _CONSTANT_S else np.full(len(away_s), middle)
        return np.round(apart * NS_PER_S).astype(np.int64)


def _seconds(ns: IntArray) -> FloatArray:
    return ns.astype(np.float64) / NS_PER_S


def _received_wrongly(times_ns: IntArray, log_ns: IntArray, away_s: FloatArray) -> BoolArray:
    """Which times are far from their receipt because the receipt is wrong.

    Args:
        times_ns: (n,) ns on the recording's clock.
        log_ns: (n,) ns of receipt, ascending.
        away_s: (n,) s, times - expected times at their receipt.

    Returns:
        (n,) True where a time is too old, but in order among the others, because the recorder stalled; and where a time
        lies among the others, but its receipt on another day.
    """
    near = np.flatnonzero(np.abs(away_s) <= JUMP_S)
    if not near.size:
        return np.zeros(len(times_ns), dtype=np.bool_)
    following = np.searchsorted(near, np.arange(len(times_ns)))
    late: BoolArray = (following > 0) & (following < near.size) & (away_s < 0)
    earlier, later = (times_ns[near[np.clip(following + step, 0, near.size - 1)]] for step in (-1, 0))
    slack_ns = round(APART_S * NS_PER_S)
    late &= (earlier - slack_ns <= times_ns) & (times_ns <= later + slack_ns)
    elsewhere = np.maximum(_seconds(log_ns[near[0]] - log_ns), _seconds(log_ns - log_ns[near[-1]])) > _ANOTHER_DAY_S
    inside = (times_ns >= times_ns[near].min()) & (times_ns <= times_ns[near].max())
    wrongly: BoolArray = late | (elsewhere & inside)
    return wrongly


def _steady(offset_s: FloatArray, log_ns: IntArray) -> tuple[FloatArray, FloatArray]:
    """(n,) s, the offset of a clock without single wrong values; and (n,) s, the sum of its jumps until then."""
    steady = _running_median(offset_s)
    steps = np.diff(steady, prepend=steady[:1])
    # a slow simulation cannot shift the offset by more than the time between two messages
    jumps = np.abs(steps) > JUMP_S + _seconds(np.diff(log_ns, prepend=log_ns[:1]))
    return steady, np.cumsum(np.where(jumps, steps, 0.0))


def _running_median(values: FloatArray, ends: Literal["even", "odd"] = "even") -> FloatArray:
    """(n,) medians over five neighbours, against single wrong values.

    Args:
        values: (n,) in order.
        ends: How the values continue beyond their ends: "even", mirrored, so that a wrong value at an end is no
            majority; or "odd", point-mirrored, so that a rise continues.
    """
    if len(values) < _OUTLIERS:
        return values.copy()
    padded = np.pad(values, _OUTLIERS // 2, mode="reflect", reflect_type=ends)
    steady: FloatArray = np.median(np.lib.stride_tricks.sliding_window_view(padded, _OUTLIERS), axis=1)
    return steady


def _smooth(values: FloatArray, at_s: FloatArray) -> FloatArray:
    """(n,) medians over blocks, interpolated between their middles, against the time that messages take.

    Args:
        values: (n,) s.
        at_s: (n,) s, ascending: times of receipt.
    """
    count = max(1, min(-(-len(values) // _LATENCY), int((at_s[-1] - at_s[0]) / _LATENCY_S)))
    # in time, not in rows: the clock continues across a gap
    middles, first = np.unique(_block_medians(at_s, count), return_index=True)
    medians = _running_median(_block_medians(values, count)[first], "odd")
    if len(middles) > 1:  # the ends continue as their neighbours do
        apart = np.diff(middles)[[0, -1]]
        beyond = np.clip(at_s[[0, -1]] - middles[[0, -1]], -apart, apart)
        ends = medians[[0, -1]] + np.diff(medians)[[0, -1]] / apart * beyond
        outer = middles[[0, -1]] + beyond
        middles, medians = np.r_[outer[0], middles, outer[1]], np.r_[ends[0], medians, ends[1]]
    smooth: FloatArray = np.interp(at_s, middles, medians)
    return smooth


def _block_medians(values: FloatArray, count: int) -> FloatArray:
    """(count,) medians of blocks of as equal sizes as possible, the longer ones first."""
    size, longer = divmod(len(values), count)
    first, rest = np.split(values, [longer * (size + 1)])
    return np.concatenate(
        [np.median(first.reshape(longer, size + 1), axis=1), np.median(rest.reshape(-1, size), axis=1)]
    )
