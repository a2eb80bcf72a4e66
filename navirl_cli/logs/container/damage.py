"""The parts of a file that could not be used: their place, their time, and the reason."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

_NS_PER_S = 1e9


@dataclass(frozen=True)
class Damage:
    """A part of a file that could not be used."""

    path: Path
    #: Bytes [start, stop) of the file.
    start: int
    stop: int
    #: What happened, and what was lost by it.
    reason: str
    #: Begin and end of the time of receipt, s since the file's first message; an end of None is the end of the file.
    #: None where the time is not known.
    span_s: tuple[float, float | None] | None = None

    def __str__(self) -> str:
        when = ""
        if self.span_s is not None:
            begin, end = self.span_s
            when = f" ({begin:.2f} s to {'its end' if end is None else f'{end:.2f} s'})"
        return f"{self.path}: bytes {self.start} to {self.stop}{when}: {self.reason}"


@dataclass
class _Entry:
    """Damage with its time in ns."""

    start: int
    stop: int
    reason: str
    span_ns: tuple[int, int | None] | None


class DamageList:
    """The damage of one file, collected while the file is walked over.

    Args:
        path: The file's name.
        known: Damage that is known before the walk.
    """

    def __init__(self, path: Path, known: Iterable[Damage] = ()) -> None:
        self._path = path
        self._known = tuple(known)
        self._entries: list[_Entry] = []
        #: Gaps whose end in time is not known yet.
        self._open: list[_Entry] = []
        #: First and latest time of receipt so far, ns.
        self._span_ns: tuple[int, int] | None = None
        #: Messages by channel that message indexes name and that cannot be read.
        self.lost_messages: Counter[int] = Counter()

    def add(self, start: int, stop: int, reason: str, span_ns: tuple[int, int | None] | None = None) -> None:
        """Add damage of bytes [start, stop) with its begin and end in ns; an end of None is the end of the file."""
        self._entries.append(_Entry(start, stop, reason, span_ns))

    def add_gap(self, start: int, stop: int, reason: str) -> None:
        """Add damage that lasts from the latest message so far to the next one that the walk finds."""
        self.add(start, stop, reason, None if self._span_ns is None else (self._span_ns[1], None))
        self._open.append(self._entries[-1])

    def met(self, span_ns: tuple[int, int] | None) -> None:
        """Extend the file's time by the first and last time of receipt of a piece, ns; None if not known."""
        if span_ns is None:
            return
        begin, end = span_ns
        for gap in self._open:
            since = begin if gap.span_ns is None else gap.span_ns[0]
            gap.span_ns = (since, max(since, begin))
        self._open.clear()
        first, latest = self._span_ns or span_ns
        self._span_ns = (min(first, begin), max(latest, end))

    def in_order(self) -> list[Damage]:
        """All damage so far, ordered by place; it is found in another order, because the walk runs ahead."""
        found = [*self._known, *map(self._dated, self._entries)]
        return sorted(dict.fromkeys(found), key=lambda damage: damage.start)

    def _dated(self, entry: _Entry) -> Damage:
        """Damage with its time since the file's first message, which may stand anywhere in the file."""
        span_s = None
        if entry.span_ns is not None:
            begin, end = entry.span_ns
            first = begin if self._span_ns is None else self._span_ns[0]
            span_s = ((begin - first) / _NS_PER_S, None if end is None else (end - first) / _NS_PER_S)
        return Damage(self._path, entry.start, entry.stop, entry.reason, span_s)
