"""The messages of one topic as columns, by the names that navirl uses whatever the message type is."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.logs.messages.series import Series
from navirl_cli.logs.roles.clocks import Stamped
from navirl_cli.logs.roles.message_types import MessageType


@dataclass(frozen=True, eq=False)
class Columns:
    """The messages of one topic."""

    topic: str
    message_type: MessageType
    #: (n,) ns: of receipt, ascending, as it was read; on the recording's clock after the stage of time.
    t_ns: IntArray
    #: (n,) place in the order in which the recorder wrote; comparable with that of other topics.
    order: IntArray
    #: By field of the role: (n,) for fields of messages, (total,) for fields of entries.
    by_field: Mapping[str, NDArray[Any]]
    #: (n,) entries of each message; None for a type without entries.
    counts: IntArray | None

    def __len__(self) -> int:
        return len(self.t_ns)

    def __contains__(self, name: str) -> bool:
        return name in self.by_field

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.by_field[name]

    @staticmethod
    def of(series: Series, message_type: MessageType) -> "Columns":
        """The columns of a topic that was read with the fields of a message type."""
        by_field = {name: series.columns[path] for name, path in message_type.fields.items()}
        counts = None if message_type.sequence is None else series.counts[message_type.sequence]
        return Columns(series.topic, message_type, series.log_time_ns, series.order, by_field, counts)

    @property
    def owner_counts(self) -> IntArray:
        """(n,) entries of each message: one where the type has no entries."""
        return np.ones(len(self), dtype=np.int64) if self.counts is None else self.counts

    @property
    def owner(self) -> IntArray:
        """(total,) row of the message that each entry belongs to."""
        return np.repeat(np.arange(len(self)), self.owner_counts)

    def stacked(self, *names: str) -> FloatArray:
        """(n, k) numbers of several columns side by side."""
        return np.stack([self[name].astype(np.float64) for name in names], axis=1)

    def frames(self) -> NDArray[np.object_]:
        """(total,) names of frames without leading slashes; of types without entries (n,)."""
        if "frame" not in self:
            return np.full(len(self.owner), "", dtype=object)
        frames = self["frame"]
        if self.counts is not None and not self.message_type.of_entries("frame"):
            frames = frames[self.owner]
        plain = {frame: frame.lstrip("/") for frame in set(frames.tolist())}
        return np.array([plain[frame] for frame in frames.tolist()], dtype=object)

    def rows(self, kept: NDArray[Any]) -> "Columns":
        """Some of the messages, of a type without entries."""
        by_field = {name: column[kept] for name, column in self.by_field.items()}
        return Columns(self.topic, self.message_type, self.t_ns[kept], self.order[kept], by_field, None)

    def last_entries(self) -> "Columns":
        """The last entry of each message that has some, as messages without entries."""
        counts = self.owner_counts
        some = counts > 0
        last = np.cumsum(counts)[some] - 1
        by_field = {
            name: column[last if self.message_type.of_entries(name) else some] for name, column in self.by_field.items()
        }
        return Columns(self.topic, self.message_type, self.t_ns[some], self.order[some], by_field, None)

    def at(self, t_ns: IntArray, **fields: NDArray[Any]) -> "Columns":
        """The same messages at other times, (n,) ns, and with some fields in place of their own."""
        return replace(self, t_ns=t_ns, by_field={**self.by_field, **fields})

    def stamped(self, *, momentary: bool = False) -> Stamped:
        """The messages' stamps; of entries with their own stamps the latest, since some may have none."""
        stamps = self.by_field.get("stamp")
        if stamps is not None and self.counts is not None and self.message_type.of_entries("stamp"):
            latest = np.zeros(len(self), dtype=np.int64)
            if len(stamps):
                first = np.cumsum(self.counts) - self.counts
                some = self.counts > 0
                latest[some] = np.maximum.reduceat(stamps, first[some])
            stamps = latest
        return Stamped(self.topic, self.t_ns, stamps, momentary)
