"""What only the experimenter knows of a session, as a metadata record of the log says it."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from navirl_cli.errors import LogError
from navirl_cli.logs.reader import Contents
from navirl_cli.logs.recording import SESSION_RECORD, Declared


def session_of(log: str, contents: Iterable[Contents]) -> tuple[str | None, tuple[Declared, ...]]:
    """The participant's name, and what is declared of the trials; the last record counts.

    Args:
        log: The recording's name, for messages.
        contents: Of its files.

    Raises:
        LogError: The record is not as it should be.
    """
    records = [record for one in contents for record in one.metadata.get(SESSION_RECORD, ())]
    session: Mapping[str, str] = records[-1] if records else {}
    try:
        declared = tuple(_declared(entry) for entry in json.loads(session.get("trials", "[]")))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise LogError(
            f"{log}: metadata record {SESSION_RECORD}, key trials: expected a JSON list of objects with t_ns (ns), "
            f"cycle (1, 2, ...) and condition, found {session['trials'][:60]!r} ({error})"
        ) from error
    return session.get("participant"), declared


def _declared(entry: Mapping[str, Any]) -> Declared:
    """One entry, with its types checked: a number as text would go on as text."""
    t_ns, cycle, condition = entry["t_ns"], entry.get("cycle"), entry.get("condition")
    if type(t_ns) is not int or (cycle is not None and (type(cycle) is not int or cycle < 1)):
        raise TypeError(f"t_ns {t_ns!r} and cycle {cycle!r} must be whole numbers, a cycle from 1 on")
    if not (condition is None or isinstance(condition, str)):
        raise TypeError(f"condition {condition!r} must be a text")
    return Declared(t_ns, cycle, condition)
