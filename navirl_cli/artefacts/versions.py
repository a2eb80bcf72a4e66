"""Versions of the artefacts' formats: files of older ones are brought to the present one when they are read."""

from collections.abc import Iterator, Mapping
from typing import Any

#: The present version, of all kinds.
VERSION = 2
#: By kind: fields of version 1 (navirl 0.1.0) that have another name since. A star stands for every item of a list and
#: every value of an object.
_RENAMED_SINCE_1: Mapping[str, Mapping[str, str]] = {
    "demonstrations": {
        "demonstrations/*/contacts/*/peak_n": "peak_force_n",
        "demonstrations/*/contacts/*/impulse_ns": "impulse_n_s",
        "gain/m_s_per_n": "gain_m_s_n",
        "gain/standard_error": "standard_error_m_s_n",
        "gain/logs/*/m_s_per_n": "gain_m_s_n",
        "gain/logs/*/standard_error": "standard_error_m_s_n",
    },
    "reward": {
        "bootstrap/told": "identified_draws",
        "cross_validation/models/*/per_step": "log_likelihood_per_step",
    },
}


def is_later(document: Mapping[str, Any]) -> bool:
    """Whether only a later navirl knows the version of a document."""
    version = document.get("version")
    return isinstance(version, int) and version > VERSION


def upgraded(document: dict[str, Any], kind: str) -> dict[str, Any]:
    """Bring a document to the present version.

    Args:
        document: As read from a file, not yet checked: whatever is not where version 1 has it stays as it is, and the
            check against the schema finds it. Changed in place.
        kind: Of artefact.

    Returns:
        The document.
    """
    version = document.get("version")
    if isinstance(version, int) and not isinstance(version, bool) and version == 1:
        for place, name in _RENAMED_SINCE_1.get(kind, {}).items():
            *way, old = place.split("/")
            for parent in _at(document, way):
                if isinstance(parent, dict) and old in parent and name not in parent:
                    parent[name] = parent.pop(old)
        document["version"] = VERSION
    return document


def _at(value: Any, way: list[str]) -> Iterator[Any]:
    """All values at a place."""
    if not way:
        yield value
        return
    if way[0] == "*":
        inside = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
    else:
        inside = [value[way[0]]] if isinstance(value, dict) and way[0] in value else []
    for one in inside:
        yield from _at(one, way[1:])
