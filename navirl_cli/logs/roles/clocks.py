"""When a message was measured, on one clock for the whole recording.

A header's stamp is the time of the measurement; a message without a stamp has its time of receipt. The clock of a
recording is that of its odometry's stamps. It may be simulated, and belong to another computer than the recorder's.
Where another topic is stamped by another clock, the times of receipt give the offset between the two. Steps of clocks
are taken out before (:mod:`~navirl_cli.logs.roles.steps`).
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.logs.findings import Finding, Kind

NS_PER_S = 1_000_000_000
#: Single stamps that are farther than this from the expected time are wrong, s.
WILD_S = 1.0
#: Stamps farther than this from the expected time belong to another clock, s: no robot's messages take so long.
APART_S = 0.25
#: Stamps that drift by more than this until the end belong to another clock too, s. An offset that changes by less than
#: the second number is taken to be constant.
_DRIFT_S, _CONSTANT_S = 0.1, 0.02
#: The offset of another clock is estimated from at least this many messages.
_MIN_MESSAGES = 20
#: The longest time by which a localisation stamps its transforms ahead on purpose, s.
_TOLERANCE_S = 2.0
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
        expected = self.expected(one.log_ns)
        if one.stamp_ns is None:
            return expected
        stamped = one.stamp_ns != 0
        if not stamped.all():
            self.findings.append(Finding(Kind.UNSTAMPED, one.topic, int((~stamped).sum())))
        times = np.where(stamped, one.stamp_ns, expected)
        if one.topic != self.reference.topic:
            times = times - np.where(stamped, self.apart(one), 0)
        away = _seconds(times - expected)
        wild = stamped & (np.abs(away) > WILD_S) & ~_received_wrongly(times, one.log_ns, away)
        if self._at_ns[0] == self._at_ns[-1]:  # some converters give all messages one time of receipt
            wild[:] = False
        if wild.any() and (one.momentary or len(times) >= _MIN_MESSAGES):
            self.findings.append(Finding(Kind.WILD_STAMPS, one.topic, int(wild.sum()), WILD_S))
            times = np.where(wild, expected, times)
        return times

    def nearest(self, one: Stamped, shifts_ns: IntArray) -> IntArray:
        """Which of some shifts of the stamps brings each nearest to its receipt, (n,) ns.

        A stamp that none of them brings near, such as that of a map that was sent before the recording, is not shifted.
        """
        none = np.zeros(len(one.log_ns), dtype=np.int64)
        if one.stamp_ns is None or self.source is TimeSource.LOG:
            return none
        away = np.abs(_seconds(one.stamp_ns[:, None] + shifts_ns - self.expected(one.log_ns)[:, None]))
        best = away.argmin(axis=1)
        return np.where((away.min(axis=1) <= WILD_S) & (one.stamp_ns != 0), shifts_ns[best], none)

    def _follow(self, log_ns: IntArray, stamp_ns: IntArray) -> None:
        """Find the offset over time."""
        offset_ns = stamp_ns - log_ns
        self._base_ns = int(np.sort(offset_ns[:_OUTLIERS])[len(offset_ns[:_OUTLIERS]) // 2])
        steady = running_median(_seconds(offset_ns - self._base_ns))
        self._at_ns = log_ns
        self._offset_s = _smooth(steady, _seconds(log_ns - log_ns[0]))

    def expected(self, log_ns: IntArray) -> IntArray:
        """The clock's time when messages are received, (n,) ns."""
        first = int(self._at_ns[0])
        # differences first: nanoseconds since 1970 do not fit into a float
        at_s, known_s = _seconds(log_ns - first), _seconds(self._at_ns - first)
        rate = (self._offset_s[-1] - self._offset_s[0]) / max(known_s[-1], WILD_S)
        beyond_s = at_s - np.clip(at_s, 0.0, known_s[-1])
        offset_s = np.interp(at_s, known_s, self._offset_s) + rate * beyond_s
        shown: IntArray = log_ns + self._base_ns + np.round(offset_s * NS_PER_S).astype(np.int64)
        return shown

    def apart(self, one: Stamped, *, ahead: bool = False) -> IntArray:
        """Offset of another clock's stamps from this clock, (n,) ns; 0 where it is the same clock. Else it is noted.

        Args:
            one: Its times.
            ahead: Whether it may be stamped ahead on purpose, as transforms are.
        """
        none = np.zeros(len(one.log_ns), dtype=np.int64)
        rows = np.flatnonzero(none if one.stamp_ns is None else one.stamp_ns)
        if rows.size < _MIN_MESSAGES or one.stamp_ns is None or self.source is TimeSource.LOG:
            return none
        at_s = _seconds(one.log_ns - one.log_ns[0])
        away_s = _seconds(one.stamp_ns - self.expected(one.log_ns))
        in_time = rows[~_late(away_s[rows], at_s[rows])]
        rows = in_time if in_time.size >= _MIN_MESSAGES else rows
        steady = _smooth(running_median(away_s[rows]), at_s[rows])
        middle, change = float(np.median(steady)), float(steady[-1] - steady[0])
        if abs(middle) <= APART_S and abs(change) <= _DRIFT_S:
            return none
        kind = Kind.DRIFTING_CLOCK if abs(change) > _DRIFT_S else Kind.OTHER_CLOCK
        if ahead and abs(change) <= _DRIFT_S and 0 < middle <= _TOLERANCE_S:
            kind = Kind.STAMPED_AHEAD
        than = self.reference.topic
        self.findings.append(Finding(kind, one.topic, size=middle, change=change, detail=than))
        apart = np.interp(at_s, at_s[rows], steady) if np.ptp(steady) > _CONSTANT_S else np.full(len(away_s), middle)
        return np.round(apart * NS_PER_S).astype(np.int64)


def _seconds(ns: IntArray) -> FloatArray:
    return ns.astype(np.float64) / NS_PER_S


def _late(away_s: FloatArray, at_s: FloatArray) -> BoolArray:
    """(n,) which messages were received late, because others within some seconds were not.

    Args:
        away_s: (n,) s, stamps - expected times at their receipt.
        at_s: (n,) s of receipt, in any order.
    """
    numbers, place = np.unique(np.floor(at_s / _LATENCY_S), return_inverse=True)
    highest = np.full(len(numbers) + 2, -np.inf)
    np.maximum.at(highest, place + 1, away_s)
    near = np.max([highest[:-2], highest[1:-1], highest[2:]], axis=0)
    late: BoolArray = near[place] - away_s > APART_S
    return late if len(numbers) > 1 else np.zeros(len(at_s), dtype=np.bool_)


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
    near = np.flatnonzero(np.abs(away_s) <= WILD_S)
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


def running_median(values: FloatArray, ends: Literal["even", "odd"] = "even") -> FloatArray:
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
    medians = running_median(_block_medians(values, count)[first], "odd")
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
