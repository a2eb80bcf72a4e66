"""When a message was measured: its header's stamp, or the time of its receipt where it has none."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli.logs.reader import Series
from navirl_cli.logs.recording import IntArray

#: The column of the header's stamp.
STAMP = "header.stamp"
NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Clock:
    """Header stamps, and the time of receipt in their place where a stamp is 0."""

    #: What the header clock shows beyond the recorder's, ns.
    offset_ns: int
    #: Topics with stamps of 0, and how many.
    unstamped: dict[str, int] = field(default_factory=dict)

    @staticmethod
    def of(odometry: Series) -> "Clock":
        """The clock of the odometry's stamps."""
        stamps = odometry.columns[STAMP]
        stamped = stamps != 0
        offset = np.median((stamps - odometry.log_time_ns)[stamped]) if stamped.any() else 0
        return Clock(int(offset))

    def stamps(self, series: Series) -> IntArray:
        """(n,) ns of a series of stamped messages."""
        stamps = series.columns[STAMP] if STAMP in series.columns else _of_messages(series.messages)
        missing = stamps == 0
        if missing.any():
            self.unstamped[series.topic] = int(missing.sum())
        times: IntArray = np.where(missing, series.log_time_ns + self.offset_ns, stamps)
        return times

    def notes(self, path: Path) -> list[str]:
        """What had no stamp."""
        return [
            f"{path.name}: {count} messages on {topic} are stamped 0; the time of their receipt stands in"
            for topic, count in self.unstamped.items()
        ]


def _of_messages(messages: list[Any]) -> IntArray:
    """(n,) ns."""
    stamps = [message.header.stamp for message in messages]
    return np.array([int(stamp.sec) * NS_PER_S + int(stamp.nanosec) for stamp in stamps], dtype=np.int64)
