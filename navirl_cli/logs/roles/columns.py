"""A role's messages by the names that navirl uses, whatever their type."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.logs.messages.series import Series
from navirl_cli.logs.roles.clocks import Clock, Stamped
from navirl_cli.logs.roles.message_types import Kind


@dataclass(frozen=True, eq=False)
class Table:
    """The messages of one topic."""

    topic: str
    kind: Kind
    #: (n,) ns of receipt, ascending.
    log_time_ns: IntArray
    #: By the kind's field: (n,) for fields of messages, (total,) for fields of entries.
    columns: Mapping[str, NDArray[Any]]
    #: (n,) entries of each message; None for a kind without entries.
    counts: IntArray | None

    def __len__(self) -> int:
        return len(self.log_time_ns)

    @staticmethod
    def of(series: Series, kind: Kind) -> "Table":
        """A topic that was read with the fields of a kind."""
        columns = {name: series.columns[path] for name, path in kind.fields.items()}
        counts = None if kind.sequence is None else series.counts[kind.sequence]
        return Table(series.topic, kind, series.log_time_ns, columns, counts)

    @property
    def owner_counts(self) -> IntArray:
        """(n,) entries of each message: one of a kind without."""
        return np.ones(len(self), dtype=np.int64) if self.counts is None else self.counts

    @property
    def owner(self) -> IntArray:
        """(total,) the message that each entry stands in."""
        return np.repeat(np.arange(len(self)), self.owner_counts)

    def stacked(self, *names: str) -> FloatArray:
        """(n, k) numbers of several columns side by side."""
        return np.stack([self.columns[name].astype(np.float64) for name in names], axis=1)

    def frames(self) -> NDArray[np.object_]:
        """Names of frames without leading slashes, of each entry or, where a kind has none, of each message."""
        frames = self.columns.get("frame")
        if frames is None:
            return np.full(len(self.owner), "", dtype=object)
        if self.counts is not None and not self.kind.of_entries("frame"):
            frames = frames[self.owner]
        plain = {frame: frame.lstrip("/") for frame in set(frames.tolist())}
        return np.array([plain[frame] for frame in frames.tolist()], dtype=object)

    def rows(self, kept: NDArray[Any]) -> "Table":
        """The messages of some rows; for kinds without entries."""
        columns = {name: column[kept] for name, column in self.columns.items()}
        return Table(self.topic, self.kind, self.log_time_ns[kept], columns, None)

    def stamped(self, *, momentary: bool = False) -> Stamped:
        """The messages' stamps: of messages whose entries have their own, the latest, since some may have none."""
        stamps = self.columns.get("stamp")
        if stamps is not None and self.kind.of_entries("stamp"):
            counts = self.owner_counts
            first = np.cumsum(counts) - counts
            whole = np.zeros(len(self), dtype=np.int64)
            if len(stamps):
                whole[counts > 0] = np.maximum.reduceat(stamps, first[counts > 0])
            stamps = whole
        return Stamped(self.topic, self.log_time_ns, stamps, momentary)

    def times(self, clock: Clock, *, momentary: bool = False) -> IntArray:
        """(n,) ns on the recording's clock."""
        return clock.times(self.stamped(momentary=momentary))


def wants(kinds_by_topic: Mapping[str, Kind]) -> dict[str, Sequence[str]]:
    """What to read of topics, by their kinds."""
    return {topic: tuple(kind.fields.values()) for topic, kind in kinds_by_topic.items()}
