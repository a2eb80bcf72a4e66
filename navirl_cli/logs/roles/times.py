"""The stage of time: all tables of a recording on one clock."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from navirl_cli.arrays import IntArray
from navirl_cli.errors import LogError
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.roles.clocks import APART_S, NS_PER_S, WILD_S, Clock, Stamped, TimeSource
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.receipts import repaired
from navirl_cli.logs.roles.steps import Path, Step, steps_of
from navirl_cli.logs.roles.tracks import STAMP, Track, tracks_of

#: By role the columns of its topics.
Tables = Mapping[str, Sequence[Columns]]

#: Roles whose stamps can be the recording's clock, the best first.
_REFERENCES: Final = ("odometry", "tf", "wrench")
#: Roles of which each message stands for a measurement at its own time, so that they are put in order of time.
_IN_ORDER: Final = ("odometry", "wrench")
#: Roles whose messages count from their receipt on: of the others some may be older than their receipt.
_MOMENTARY: Final = ("goal", "joystick")
#: Roles whose messages count from their receipt on, whatever their stamps say.
_AT_RECEIPT: Final = ("map", "tf_static")
#: Roles whose messages show that a log goes on, from so many messages on.
_REGULAR: Final = ("odometry", "wrench", "people", "joystick")
_FEWEST: Final = 10
#: How far ahead tf may be stamped, ns.
_AHEAD_NS: Final = NS_PER_S
#: No clock steps by more, s: nanoseconds in 63 bits hold no more.
_LONGEST_S: Final = 9e9
#: Messages that may overtake each other.
_OVERTAKEN: Final = 8
#: More steps of one clock are reported together.
_MOST_STEPS: Final = 4


@dataclass(frozen=True, eq=False)
class Timed:
    """All tables on one clock."""

    tables: Tables
    #: By topic (n,) ns of receipt, ascending, by the recorder's clock as it was at first.
    received_ns: Mapping[str, IntArray]
    #: Whether these differ from what the recorder wrote.
    repaired: bool
    findings: Findings


def on_one_clock(log: str, tables: Tables, source: TimeSource) -> Timed:
    """Put the messages of all topics on the clock of the odometry's stamps, and odometry and wrench in order of time.

    Times of receipt that cannot be true are replaced, and steps of clocks are taken out, before clocks are compared.

    Args:
        log: The recording's name, for messages.
        tables: As they were read.
        source: Whether stamps or times of receipt are wanted.

    Returns:
        The tables, whose ``t_ns`` and, for tf, stamps are on the clock; and what was found out about clocks.

    Raises:
        LogError: There are no messages whose stamps could be the clock.
    """
    by_role = tracks_of(tables)
    reference = _reference(by_role)
    if reference is None:
        raise LogError(
            f"{log}: expected odometry, a wrench or tf, whose stamps are the recording's clock, found none of them; "
            "name the odometry with `topic` odometry=/name"
        )
    read = [track for several in by_role.values() for some in several for track in some]
    tracks, wrong = repaired(read, reference)
    mended = dict(zip(read, tracks, strict=True))
    reference = mended[reference]
    odometry = next((mended[some[0]] for some in by_role.get("odometry", ())), None)
    steps, pauses = steps_of(tracks, _path(tables, odometry))
    without = {track: _without_steps(track, steps) for track in tracks}
    received = _received(without.values())
    start_ns = min(int(times[0]) for times in received.values())
    clock = Clock(_stamped(without[reference])[0], source)
    shifts = _shifts(steps, reference)
    timed: dict[str, list[Columns]] = {role: [] for role in tables}
    findings: list[Finding] = [*wrong, *_told(steps, pauses, tracks, start_ns), *_described(clock)]
    for role, several in tables.items():
        for columns, some in zip(several, by_role[role], strict=True):
            own = [(mended[track], without[mended[track]]) for track in some]
            one = _timed(role, columns, own, clock, () if source is TimeSource.LOG else shifts)
            if role in _IN_ORDER:
                one, late = in_order(one)
                findings += late
            timed[role].append(one)
    stepped = any(step.received_s for step in steps)
    return Timed(timed, received, bool(wrong) or stepped, (*findings, *clock.findings))


def measured_ns(tables: Tables) -> tuple[int, int] | None:
    """First and last time of what was measured regularly, ns; None for nothing.

    tf, whose stamps may lie ahead on purpose, counts with as much taken off at its end.
    """
    times = [one.t_ns for role in _REGULAR for one in tables.get(role, ()) if len(one) >= _FEWEST]
    for one in tables.get("tf", ()):
        stamps = one["header.stamp"]
        if len(one) >= _FEWEST and len(stamps := stamps[stamps > 0]):
            times.append(np.array([stamps.min(), stamps.max() - _AHEAD_NS]))
    return (min(int(one.min()) for one in times), max(int(one.max()) for one in times)) if times else None


def in_order(columns: Columns) -> tuple[Columns, Findings]:
    """The messages in order of time; of equal times in order of receipt."""
    late = int((columns.t_ns[1:] < columns.t_ns[:-1]).sum())  # a difference could overflow
    if not late:
        return columns, ()
    ordered = columns.rows(np.argsort(columns.t_ns, kind="stable"))
    return ordered, (Finding(Kind.OUT_OF_ORDER, columns.topic, late),)


def without_repeats(columns: Columns) -> tuple[Columns, Findings]:
    """The first of the messages of equal times, in order of time."""
    first = np.append(True, columns.t_ns[1:] > columns.t_ns[:-1])[: len(columns)]
    if first.all():
        return columns, ()
    return columns.rows(first), (Finding(Kind.REPEATED, columns.topic, int((~first).sum())),)


def _reference(by_role: Mapping[str, Sequence[Sequence[Track]]]) -> Track | None:
    """The track whose stamps are the recording's clock; of tf the densest, which is the robot's own odometry."""
    for role in _REFERENCES:
        tracks = [track for some in by_role.get(role, ()) for track in some]
        if tracks:
            return max(tracks, key=len) if role == "tf" else tracks[0]
    return None


def _path(tables: Tables, track: Track | None) -> Path | None:
    """Where the odometry is at its messages, in the recorder's order."""
    if track is None:
        return None
    xy = tables["odometry"][0].stacked("px", "py")[track.rows]
    good = np.isfinite(xy).all(axis=1)
    return Path(track.order[good], track.received_ns[good], xy[good])


def _without_steps(track: Track, steps: Iterable[Step]) -> Track:
    """A track whose clocks go on evenly."""
    received = track.received_ns.copy()
    stamps = None if track.stamp_ns is None else track.stamp_ns.copy()
    places = []
    for step in steps:
        received_after, stamped_after = step.places_in(track)
        places += [received_after, stamped_after]
        if step.common or track in step.places:
            received[track.order >= received_after] -= round(step.received_s * NS_PER_S)
        if stamps is not None and track in step.stamped_s:
            stamps[(track.order >= stamped_after) & (stamps != 0)] -= round(step.stamped_s[track] * NS_PER_S)
    return replace(track, received_ns=_between(track, received, places), stamp_ns=stamps)


def _between(track: Track, received: IntArray, places: Sequence[int]) -> IntArray:
    """(n,) ns of receipt; messages beside a step that belong neither before nor after it are put between others."""
    if not places or not track.sound.size:
        return received
    unsound = np.ones(len(track), dtype=np.bool_)
    unsound[track.sound] = False
    wrong = np.flatnonzero(unsound)
    wrong = wrong[(np.abs(wrong[:, None] - np.searchsorted(track.order, places)) <= _OVERTAKEN).any(axis=1)]
    begin = received[track.sound[0]]
    expected = np.interp(wrong, track.sound, (received[track.sound] - begin).astype(np.float64))
    near = np.abs(received[wrong] - begin - expected) <= WILD_S * NS_PER_S
    fixed = received.copy()
    fixed[wrong] = np.where(near, received[wrong], begin + np.round(expected).astype(np.int64))
    return fixed


def _received(tracks: Iterable[Track]) -> dict[str, IntArray]:
    """By topic (n,) ns of receipt, ascending: of each message once, though its transforms stand in several tracks."""
    by_topic: dict[str, list[Track]] = {}
    for track in tracks:
        if len(track):
            by_topic.setdefault(track.topic, []).append(track)
    received = {}
    for topic, some in by_topic.items():
        _, first = np.unique(np.concatenate([one.order for one in some]), return_index=True)
        received[topic] = np.sort(np.concatenate([one.received_ns for one in some])[first])
    return received


def _shifts(steps: Iterable[Step], reference: Track) -> IntArray:
    """(k,) ns by which stamps of topics with few messages may have to be shifted: 0 first."""
    moved = np.cumsum([0.0, *(step.stamped_s.get(reference, step.received_s) for step in steps)])
    # steps of a damaged log may add up to more than 63 bits hold
    moved = moved[np.abs(moved) < _LONGEST_S]
    shifts: IntArray = np.unique(np.round(-moved * NS_PER_S).astype(np.int64))
    return np.concatenate([[0], shifts[shifts != 0]]).astype(np.int64)


def _stamped(track: Track, *, momentary: bool = False) -> tuple[Stamped, IntArray]:
    """A track's times in order of receipt, and the rows of the topic's columns that they belong to."""
    order = np.argsort(track.received_ns, kind="stable")
    stamps = None if track.stamp_ns is None else track.stamp_ns[order]
    return Stamped(track.name, track.received_ns[order], stamps, momentary), track.rows[order]


def _timed(
    role: str, columns: Columns, tracks: Sequence[tuple[Track, Track]], clock: Clock, shifts: Sequence[int] | IntArray
) -> Columns:
    """One topic's messages on the clock.

    Args:
        role: That it serves.
        columns: As read.
        tracks: Its tracks before and after steps were taken out.
        clock: Of the recording.
        shifts: (k,) ns by which stamps of topics with few messages may have to be shifted.
    """
    t_ns = columns.t_ns.copy()
    if role == "tf":
        stamps = columns[STAMP].copy()
        for track, after in tracks:
            one, rows = _stamped(after)
            stamps[rows] = _transform_times(columns, track, one, rows, clock, shifts)
            t_ns[columns.owner[rows]] = clock.expected(one.log_ns)
        return columns.at(t_ns, **{STAMP: stamps})
    ((track, after),) = tracks
    one, rows = _stamped(after, momentary=role in _MOMENTARY)
    if role in _AT_RECEIPT:
        t_ns[rows] = clock.expected(one.log_ns)
        return columns.at(t_ns)
    if not track.is_dense and one.stamp_ns is not None and len(shifts) > 1:
        one = replace(one, stamp_ns=one.stamp_ns + clock.nearest(one, np.asarray(shifts)))
    t_ns[rows] = clock.times(one)
    if columns.counts is not None:
        return columns.at(t_ns)
    return columns.at(t_ns).rows(rows)


def _transform_times(
    columns: Columns, track: Track, one: Stamped, rows: IntArray, clock: Clock, shifts: Sequence[int] | IntArray
) -> IntArray:
    """(n,) ns of a pair's transforms on the clock."""
    if clock.source is TimeSource.LOG or one.stamp_ns is None:
        return one.log_ns
    stamps = one.stamp_ns
    if not track.is_dense and len(shifts) > 1:
        stamps = stamps + clock.nearest(one, np.asarray(shifts))
    values = [columns[name][rows] for name in columns.message_type.fields if name.startswith("transform.")]
    if all((value == value[0]).all() for value in values):
        return stamps  # it does not matter when they count
    return np.where(stamps != 0, stamps - clock.apart(replace(one, stamp_ns=stamps), ahead=True), 0)


def _told(steps: Iterable[Step], pauses: Sequence[Step], tracks: Sequence[Track], start_ns: int) -> Findings:
    """What steps and pauses say, each once; many steps of one clock together."""
    found: dict[tuple[Kind, str], list[Finding]] = {}
    moved_ns = 0
    for step in steps:
        at_s = (step.at_ns - moved_ns - start_ns) / NS_PER_S
        if step.common:
            moved_ns += round(step.received_s * NS_PER_S)
        about, size = _whose(step, tracks)
        kind = Kind.CLOCK_STEP if step.common else Kind.LATER_RECEIPTS
        found.setdefault((kind, about), []).append(Finding(kind, about, size=size, at_s=at_s))
    told = []
    for (_, about), some in found.items():
        if len(some) <= _MOST_STEPS:
            told += some
            continue
        largest = max((one.size for one in some), key=abs)
        told.append(Finding(Kind.CLOCK_STEPS, about, len(some), largest, some[0].at_s))
    told.sort(key=lambda one: one.at_s or 0.0)
    return (*told, *_paused(pauses, start_ns))


def _paused(pauses: Sequence[Step], start_ns: int) -> Findings:
    """What pauses of all topics say: a single one may be a step, many are how the recording was made."""
    sizes = [step.received_s for step in pauses]
    first_s = (pauses[0].at_ns - start_ns) / NS_PER_S if pauses else 0.0
    if len(pauses) == 1:
        return (Finding(Kind.PAUSE, "all topics", size=sizes[0], at_s=first_s),)
    if pauses:
        return (Finding(Kind.PAUSES, "all topics", len(pauses), max(sizes), first_s),)
    return ()


def _whose(step: Step, tracks: Iterable[Track]) -> tuple[str, float]:
    """The clock that stepped, and by how much, s."""
    if not step.common:
        return _names(step.places, tracks), step.received_s
    together = [track for track, s in step.stamped_s.items() if abs(s - step.received_s) < APART_S]
    if not step.received_s:
        return f"the clock that stamps {_names(step.stamped_s, tracks)}", next(iter(step.stamped_s.values()))
    if together:
        return (
            f"the clock of the computer (stamps of {_names(together, tracks)}, and times of receipt)",
            step.received_s,
        )
    return "the recorder's clock (times of receipt; not the stamps)", step.received_s


def _names(some: Iterable[Track], tracks: Iterable[Track]) -> str:
    """The names of tracks: of a topic of tf its own where all of its pairs are meant."""
    chosen = list(some)
    names = []
    for track in chosen:
        whole = all(one in chosen for one in tracks if one.topic == track.topic and one.is_dense)
        names.append(track.topic if whole else track.name)
    *others, last = sorted(set(names))
    return f"{', '.join(others)} and {last}" if others else last


def _described(clock: Clock) -> Findings:
    """How the clock stands to the recorder's."""
    topic = clock.reference.topic
    if clock.simulated:
        begins_s = (int(clock.reference.log_ns[0]) + clock.offset_ns) / NS_PER_S
        return (Finding(Kind.SIMULATED, topic, size=begins_s),)
    if abs(clock.offset_ns) > APART_S * NS_PER_S:
        return (Finding(Kind.RECORDER_OFF, topic, size=clock.offset_ns / NS_PER_S),)
    return ()
