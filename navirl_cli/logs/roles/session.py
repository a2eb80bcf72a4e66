"""What the experimenter knows of a session, from metadata records of the log."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any, TypeVar

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import LogError
from navirl_cli.logs.messages.reader import Contents
from navirl_cli.logs.recording import PUBLISHED_RECORD, SESSION_RECORD, Declared, Published, Session

Value = TypeVar("Value")


def session_of(log: str, contents: Iterable[Contents]) -> Session:
    """The session by the last record of each name.

    Args:
        log: The recording's name, for messages.
        contents: Of its files.

    Raises:
        LogError: A record holds something else than expected.
    """
    last: dict[str, Mapping[str, str]] = {}
    for one in contents:
        last |= {name: records[-1] for name, records in one.metadata.items() if records}
    session, published = (_Record(log, name, last.get(name, {})) for name in (SESSION_RECORD, PUBLISHED_RECORD))
    trials = "a JSON list of objects with t_ns (ns), cycle (1, 2, ...), condition, set and nominal_m (m)"
    cells = "a JSON list of objects with t_ns (ns), name and cells (pairs of whole numbers)"
    return Session(
        participant=session.values.get("participant"),
        declared=session.parsed("trials", _all(_declared), trials) or (),
        published=published.parsed("cells", _all(_published), cells) or (),
        robot_radius_m=session.parsed("robot_radius_m", _positive, "metres above 0"),
        laid_out_m_s=session.parsed("laid_out_m_s", _positive, "metres a second above 0"),
        completion_s=session.parsed("completion_s", _times, "a JSON object of lists of seconds by modality") or {},
    )


@dataclass(frozen=True)
class _Record:
    """One metadata record."""

    log: str
    name: str
    values: Mapping[str, str]

    def parsed(self, key: str, parse: Callable[[Any], Value], expected: str) -> Value | None:
        """The value of a key, from JSON; None where the key is missing."""
        if key not in self.values:
            return None
        try:
            return parse(json.loads(self.values[key]))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError) as error:
            raise LogError(
                f"{self.log}: metadata record {self.name}, key {key}: expected {expected}, "
                f"found {self.values[key][:60]!r} ({error})"
            ) from error


def _all(parse: Callable[[Any], Value]) -> Callable[[Iterable[Any]], tuple[Value, ...]]:
    """A parser of lists, from that of one entry."""
    return lambda entries: tuple(parse(entry) for entry in entries)


def _declared(entry: Mapping[str, Any]) -> Declared:
    """One entry, with its types checked."""
    t_ns, stop_ns, cycle, condition, part = (entry.get(key) for key in ("t_ns", "stop_ns", "cycle", "condition", "set"))
    if type(t_ns) is not int or (cycle is not None and (type(cycle) is not int or cycle < 1)):
        raise TypeError(f"t_ns {t_ns!r} and cycle {cycle!r} must be whole numbers, a cycle from 1 on")
    if stop_ns is not None and (type(stop_ns) is not int or stop_ns <= t_ns):
        raise TypeError(f"stop_ns {stop_ns!r} must be a whole number after t_ns {t_ns!r}")
    for name, value in (("condition", condition), ("set", part)):
        if not (value is None or isinstance(value, str)):
            raise TypeError(f"{name} {value!r} must be a text")
    return Declared(t_ns, stop_ns, cycle, condition, part or None, _line(entry.get("nominal_m")))


def _line(points: Any) -> FloatArray | None:
    """(k, 2) corners of a line."""
    if points is None:
        return None
    line = np.array(points, dtype=float)
    if line.ndim != 2 or line.shape[1] != 2 or len(line) < 2 or not np.isfinite(line).all():
        raise ValueError(f"nominal_m {points!r} must be two or more points of two numbers")
    return line


def _published(entry: Mapping[str, Any]) -> Published:
    """The cells of one path."""
    t_ns, cells = entry["t_ns"], np.array(entry["cells"])
    if type(t_ns) is not int or cells.dtype.kind != "i" or cells.ndim != 2 or cells.shape[1] != 2:
        raise TypeError(f"t_ns {t_ns!r} must be a whole number, and cells pairs of whole numbers")
    return Published(t_ns, str(entry["name"]), cells.astype(np.int64))


def _positive(value: Any) -> float:
    """A finite number above 0."""
    if type(value) not in {int, float} or not (isfinite(value) and value > 0):
        raise ValueError(f"{value!r} is not a positive number")
    return float(value)


def _times(entries: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Times by modality."""
    return {modality: tuple(map(_positive, times)) for modality, times in entries.items()}
