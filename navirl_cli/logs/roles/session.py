"""What the experimenter knows of a session: from metadata records of the log, and as such a record."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.errors import LogError, brief
from navirl_cli.logs.messages.reader import Contents
from navirl_cli.logs.recording import PUBLISHED_RECORD, SESSION_RECORD, Declared, Published, Session

Value = TypeVar("Value")

#: No place is farther from its map's origin, m, nor time outside of 64 bits, ns.
MOST_M, _MOST_NS = 1e8, 1 << 63
#: Largest radius of a robot, m; speed, m/s; time of a course, s; number of a cycle.
MOST_RADIUS_M, _MOST_M_S, _MOST_S, MOST_CYCLES = 10.0, 100.0, 1e6, 1_000_000
#: Most corners of a line, and most people.
MOST_CORNERS, MOST_PEOPLE = 10_000, 1_000


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
    trials = (
        "a JSON list of objects with t_ns (ns), cycle (1, 2, ...), participant, condition, set, nominal_m (m) and "
        "people_m (m)"
    )
    cells = "a JSON list of objects with t_ns (ns), name and cells (pairs of whole numbers)"
    return Session(
        participant=session.values.get("participant"),
        declared=session.parsed("trials", _all(_declared), trials) or (),
        published=published.parsed("cells", _all(_published), cells) or (),
        robot_radius_m=session.parsed("robot_radius_m", _up_to(MOST_RADIUS_M), "metres above 0"),
        laid_out_m_s=session.parsed("laid_out_m_s", _up_to(_MOST_M_S), "metres a second above 0"),
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


def session_values(session: Session) -> dict[str, str]:
    """The values of a session record; :func:`session_of` reads the same session from it."""
    values = {} if session.participant is None else {"participant": session.participant}
    parts: dict[str, Any] = {
        "trials": [_entry(one) for one in session.declared] or None,
        "robot_radius_m": session.robot_radius_m,
        "laid_out_m_s": session.laid_out_m_s,
        "completion_s": {modality: list(times) for modality, times in session.completion_s.items()} or None,
    }
    return values | {key: json.dumps(part, allow_nan=False) for key, part in parts.items() if part is not None}


def _entry(declared: Declared) -> dict[str, Any]:
    """One entry of the list of trials."""
    entry = {
        "t_ns": declared.t_ns,
        "stop_ns": declared.stop_ns,
        "participant": declared.participant,
        "cycle": declared.cycle,
        "condition": declared.condition,
        "set": declared.set,
        "nominal_m": None if declared.nominal_m is None else declared.nominal_m.tolist(),
        "people_m": None if declared.people_m is None else declared.people_m.tolist(),
    }
    return {key: value for key, value in entry.items() if value is not None}


def _declared(entry: Mapping[str, Any]) -> Declared:
    """One entry, with its types and ranges checked."""
    t_ns, stop_ns, cycle = (entry.get(key) for key in ("t_ns", "stop_ns", "cycle"))
    if type(t_ns) is not int or (cycle is not None and (type(cycle) is not int or not 1 <= cycle <= MOST_CYCLES)):
        raise TypeError(f"t_ns {t_ns!r} and cycle {cycle!r} must be whole numbers, a cycle from 1 on")
    if stop_ns is not None and (type(stop_ns) is not int or stop_ns <= t_ns):
        raise TypeError(f"stop_ns {stop_ns!r} must be a whole number after t_ns {t_ns!r}")
    if not -_MOST_NS <= t_ns < _MOST_NS or (stop_ns is not None and stop_ns >= _MOST_NS):
        raise ValueError(f"t_ns {t_ns!r} and stop_ns {stop_ns!r} must be times of 64 bits")
    participant, condition, part = (_text(entry, key) for key in ("participant", "condition", "set"))
    nominal_m = _points(entry, "nominal_m", (2, MOST_CORNERS))
    people_m = _points(entry, "people_m", (0, MOST_PEOPLE))
    return Declared(t_ns, stop_ns, cycle, condition, part or None, nominal_m, participant or None, people_m)


def _text(entry: Mapping[str, Any], key: str) -> str | None:
    """A text of an entry; None where it has none."""
    value = entry.get(key)
    if not (value is None or isinstance(value, str)):
        raise TypeError(f"{key} {value!r} must be a text")
    return None if value is None else _clean(value)


def _clean(text: str) -> str:
    """A text of JSON that can be written: halves of surrogate pairs are replaced."""
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace")


def _points(entry: Mapping[str, Any], key: str, count: tuple[int, int]) -> FloatArray | None:
    """(k, 2) points of an entry, as many as allowed; None where it has none."""
    points = entry.get(key)
    if points is None:
        return None
    least, most = count
    if isinstance(points, list) and not least <= len(points) <= most:
        raise ValueError(f"{key} has {len(points)} points, where {least} to {most} are possible")
    found = np.array(points, dtype=float)
    found = found.reshape(0, 2) if points == [] else found
    if found.ndim != 2 or found.shape[1] != 2 or not (np.abs(found) <= MOST_M).all():
        raise ValueError(f"{key} {brief(points)} must be points of two numbers, at most {MOST_M:g} m from 0")
    return found


def _published(entry: Mapping[str, Any]) -> Published:
    """The cells of one path."""
    t_ns, cells = entry["t_ns"], np.array(entry["cells"])
    if type(t_ns) is not int or cells.dtype.kind != "i" or cells.ndim != 2 or cells.shape[1] != 2:
        raise TypeError(f"t_ns {t_ns!r} must be a whole number, and cells pairs of whole numbers")
    return Published(t_ns, _clean(str(entry["name"])), cells.astype(np.int64))


def _up_to(most: float) -> Callable[[Any], float]:
    """A parser of numbers above 0."""

    def positive(value: Any) -> float:
        if type(value) not in {int, float} or not 0 < value <= most:
            raise ValueError(f"{brief(value)} is not a number above 0, at most {most:g}")
        return float(value)

    return positive


def _times(entries: Mapping[str, Any]) -> dict[str, tuple[float, ...]]:
    """Times by modality."""
    return {_clean(modality): tuple(map(_up_to(_MOST_S), times)) for modality, times in entries.items()}
