"""The times of one clock's messages, in the order in which the recorder wrote them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.logs.roles.clocks import NS_PER_S, running_median
from navirl_cli.logs.roles.columns import Columns

#: A value this far from its neighbours' median, beyond some periods, is a single wrong one, s.
_WILD_S, _WILD_PERIODS = 0.45, 2.5
#: A topic is dense if it holds so many messages, with a period of at most so many s.
_DENSE, _LONGEST_S = 10, 1.0

STAMP: Final = "header.stamp"


@dataclass(frozen=True, eq=False)
class Track:
    """Messages of one topic, or transforms of one pair of frames in a topic of tf."""

    topic: str
    #: "map -> odom" for transforms, "" for topics.
    pair: str
    #: (n,) places in the recorder's order, ascending.
    order: IntArray
    #: (n,) ns of receipt.
    received_ns: IntArray
    #: (n,) ns, 0 for a missing stamp; None for messages without a header.
    stamp_ns: IntArray | None
    #: (n,) rows of the topic's columns: of messages, or of transforms.
    rows: IntArray

    def __len__(self) -> int:
        return len(self.order)

    @property
    def name(self) -> str:
        """As a message names it."""
        return f"{self.topic} ({self.pair})" if self.pair else self.topic

    @property
    def is_stamped(self) -> bool:
        """Whether it has stamps other than 0."""
        return self.stamp_ns is not None and bool(self.stamp_ns.any())

    @cached_property
    def sound(self) -> IntArray:
        """(m,) which of the messages have no single wrong stamp or time of receipt."""
        rows = np.arange(len(self))
        if self.is_stamped and self.stamp_ns is not None:
            rows = rows[self.stamp_ns != 0]
            rows = rows[~_wild(self.stamp_ns[rows])]
        return rows[~_wild(self.received_ns[rows])]

    @cached_property
    def received_s(self) -> FloatArray:
        """(m,) s of receipt of the sound messages, since the first of them."""
        return since_first(self.received_ns[self.sound])

    @cached_property
    def stamped_s(self) -> FloatArray | None:
        """(m,) s of the sound messages' stamps, since the first of them; None without stamps."""
        return since_first(self.stamp_ns[self.sound]) if self.is_stamped and self.stamp_ns is not None else None

    @cached_property
    def period_s(self) -> float:
        """The median time between two messages, s; infinite for less than two."""
        return _period(self.received_s)

    @cached_property
    def is_dense(self) -> bool:
        """Whether there are enough messages to see a step of a clock."""
        return len(self.sound) >= _DENSE and self.period_s <= _LONGEST_S


def since_first(ns: IntArray) -> FloatArray:
    """Seconds since the first; differences first, because a float cannot resolve nanoseconds since 1970."""
    return (ns - ns[:1]).astype(np.float64) / NS_PER_S


def tracks_of(tables: Mapping[str, Sequence[Columns]]) -> dict[str, list[list[Track]]]:
    """By role, for each of its topics, its tracks: of tf one for each pair of frames."""
    return {
        role: [pairs_of(one) if role == "tf" else [track_of(one)] for one in several]
        for role, several in tables.items()
    }


def track_of(columns: Columns) -> Track:
    """The messages of a topic in the recorder's order."""
    rows = np.argsort(columns.order, kind="stable")
    stamps = columns.stamped().stamp_ns
    return Track(
        columns.topic, "", columns.order[rows], columns.t_ns[rows], None if stamps is None else stamps[rows], rows
    )


def pairs_of(columns: Columns) -> list[Track]:
    """The transforms of each pair of frames in the recorder's order."""
    pairs: dict[tuple[str, str], int] = {}
    entries = zip(columns["header.frame_id"].tolist(), columns["child_frame_id"].tolist(), strict=True)
    total = len(columns.owner)
    group = np.fromiter((pairs.setdefault(pair, len(pairs)) for pair in entries), np.int64, total)
    order, received = columns.order[columns.owner], columns.t_ns[columns.owner]
    rows = np.lexsort((order, group))
    members = np.split(rows, np.flatnonzero(np.diff(group[rows])) + 1) if total else []
    return [
        Track(columns.topic, f"{parent} -> {child}", order[some], received[some], columns[STAMP][some], some)
        for (parent, child), some in zip(pairs, members, strict=True)
    ]


def _period(seconds: FloatArray) -> float:
    steps = np.diff(seconds)
    forward = steps[steps > 0]
    return float(np.median(forward)) if forward.size else np.inf


def _wild(ns: IntArray) -> BoolArray:
    """(n,) which values are single wrong ones, far from both neighbours'."""
    if len(ns) < 5:
        return np.zeros(len(ns), dtype=np.bool_)
    seconds = since_first(ns)
    limit = _WILD_S + _WILD_PERIODS * min(_period(seconds), _LONGEST_S)
    wild: BoolArray = np.abs(seconds - running_median(seconds)) > limit
    return wild
