"""A run of 600 wrenches whose file is damaged, and what must still be read of it."""

from collections.abc import Sequence
from pathlib import Path

import log_factory as forge
import numpy as np

from navirl_cli.logs.messages.reader import read, scan

COUNT = 600
FIELDS = ("header.stamp", "wrench.force.x")
#: Times of receipt; stamps are a millisecond earlier.
TIMES_NS = forge.START_NS + np.arange(COUNT) * 2_000_000


def damaged(path: Path, expected: slice | Sequence[int]) -> list[str]:
    """Read the wrenches, which must be the expected ones of the run's, and return the damage as texts."""
    result = read(path, {"/wrench": FIELDS})
    series = result.series["/wrench"]
    assert series.log_time_ns.tolist() == TIMES_NS[expected].tolist()
    assert series.columns["header.stamp"].tolist() == (TIMES_NS[expected] - 10**6).tolist()
    assert scan(path).counts is not None
    return [str(damage) for damage in result.damage]


def wrenches_before(path: Path, chunk: int) -> int:
    """How many wrenches stand in the chunks before one."""
    return sum(forge.messages_in_chunk(path, number, "/wrench") for number in range(chunk))


def without_summary_crc(path: Path) -> Path:
    """Drop the summary's CRC, so that a changed summary is believed."""
    return forge.overwrite(path, path.stat().st_size - 12, bytes(4))
