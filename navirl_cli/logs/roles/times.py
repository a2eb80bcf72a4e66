"""The stage of time: all tables of a recording on one clock."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.errors import LogError
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.roles.clocks import APART_S, NS_PER_S, Clock, Stamped, TimeSource
from navirl_cli.logs.roles.columns import Columns

#: By role the columns of its topics.
Tables = Mapping[str, Sequence[Columns]]

#: Roles whose stamps can be the recording's clock, the best first.
_REFERENCES: Final = ("odometry", "wrench")
#: Roles of which each message stands for a measurement at its own time, so that they are put in order of time.
_IN_ORDER: Final = ("odometry", "wrench")
#: Roles whose messages count from their receipt on.
_MOMENTARY: Final = ("goal", "joystick")
#: Roles whose times nothing depends on.
_TIMELESS: Final = ("map", "tf_static")


@dataclass(frozen=True, eq=False)
class Timed:
    """All tables on one clock."""

    tables: Tables
    findings: Findings


def on_one_clock(log: str, tables: Tables, source: TimeSource) -> Timed:
    """Put the messages of all topics on the clock of the odometry's stamps, and odometry and wrench in order of time.

    Args:
        log: The recording's name, for messages.
        tables: As they were read.
        source: Whether stamps or times of receipt are wanted.

    Returns:
        The tables, whose ``t_ns`` and, for tf, stamps are on the clock; and what was found out about clocks.

    Raises:
        LogError: There are no messages whose stamps could be the clock.
    """
    references = [one.stamped() for role in _REFERENCES for one in tables.get(role, ())]
    references += [_most_frequent(one) for one in tables.get("tf", ()) if len(one.owner)]
    if not references:
        raise LogError(
            f"{log}: expected odometry, a wrench or tf, whose stamps are the recording's clock, found none of them; "
            "name the odometry with `topic` odometry=/name"
        )
    clock = Clock(references[0], source)
    findings = [*_described(clock)]
    timed: dict[str, list[Columns]] = {}
    for role, several in tables.items():
        timed[role] = [_timed(role, one, clock) for one in several]
        if role in _IN_ORDER:
            ordered = [in_order(one) for one in timed[role]]
            timed[role] = [one for one, _ in ordered]
            findings += [finding for _, some in ordered for finding in some]
    return Timed(timed, (*findings, *clock.findings))


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


def _timed(role: str, columns: Columns, clock: Clock) -> Columns:
    """One topic's messages on the clock."""
    if role in _TIMELESS:
        return columns
    if role == "tf":  # its stamps may lie ahead on purpose, but jump as the clock does
        name = "header.stamp"
        return columns.at(columns.t_ns, **{name: clock.shifted(columns[name], columns.t_ns[columns.owner])})
    return columns.at(clock.times(columns.stamped(momentary=role in _MOMENTARY)))


def _most_frequent(tf: Columns) -> Stamped:
    """The stamps of the frame that tf places most often, which is the robot's: localisation corrects less often."""
    children = tf["child_frame_id"]
    child = Counter(children.tolist()).most_common(1)[0][0]
    rows = np.flatnonzero(children == child)
    return Stamped(tf.topic, tf.t_ns[tf.owner][rows], tf["header.stamp"][rows])


def _described(clock: Clock) -> Findings:
    """How the clock stands to the recorder's."""
    topic = clock.reference.topic
    if clock.simulated:
        begins_s = (int(clock.reference.log_ns[0]) + clock.offset_ns) / NS_PER_S
        return (Finding(Kind.SIMULATED, topic, size=begins_s),)
    if abs(clock.offset_ns) > APART_S * NS_PER_S:
        return (Finding(Kind.RECORDER_OFF, topic, size=clock.offset_ns / NS_PER_S),)
    return ()
