"""Versions of the artefacts' formats: files of older ones are brought to the present one when they are read."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

#: The present version, of all kinds.
VERSION = 2


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


def _names(document: dict[str, Any]) -> list[str]:
    """Which metrics a metrics file of version 1 holds."""
    means = (one for one in _at(document, ["groups", "*", "mean"]) if isinstance(one, dict))
    return list(next(means, ()))


#: Metrics that have another name since version 1, wherever values stand by metric.
_METRICS = {"peak_n": "peak_force_n", "impulse_ns": "impulse_n_s"}
_BY_METRIC = (
    *(f"groups/*/{name}" for name in ("mean", "standard_deviation", "half_interval", "monte_carlo_error", "exact")),
    "demonstrations/*/metrics",
    "pairs/*/metrics",
)
#: By kind: fields of version 1 (navirl 0.1.0) that have another name since, in this order. A star stands for every item
#: of a list and every value of an object.
_RENAMED: Mapping[str, Mapping[str, str]] = {
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
    "metrics": {
        "groups/*/paths": "path_type",
        "groups/*/error": "monte_carlo_error",
        "demonstrations/*/paths": "path_type",
        "pairs/*/less": "minus",
        "pairs/*/metrics/*/lower": "bootstrap_lower",
        "pairs/*/metrics/*/upper": "bootstrap_upper",
        "pairs/*/metrics/*/p_value": "wilcoxon_p",
        **{f"{place}/{old}": new for place in _BY_METRIC for old, new in _METRICS.items()},
    },
}
#: By kind and place: fields that version 1 does not have, and what they would be.
_ADDED: Mapping[str, Mapping[str, Mapping[str, Callable[[Any], Any]]]] = {
    "metrics": {
        "": {
            "metrics": _names,
            "missing": lambda _: {},
        },
        "groups/*": {"missing": lambda _: {}},
        "demonstrations/*": {
            "participant": lambda one: str(one.get("id")).rpartition("/")[0],  # as extract names demonstrations
            "missing": lambda _: {},
        },
        "pairs/*/metrics/*": {"student_lower": lambda _: None, "student_upper": lambda _: None},
    },
}


def is_known(version: object) -> bool:
    """Whether a file's version is one that can be read."""
    return isinstance(version, int) and not isinstance(version, bool) and 1 <= version <= VERSION


def upgraded(document: dict[str, Any], kind: str) -> dict[str, Any]:
    """Bring a document to the present version.

    Args:
        document: As read from a file, of a known version but not yet checked: whatever is not where version 1 has it
            stays as it is, and the check against the schema finds it. Changed in place.
        kind: Of artefact.

    Returns:
        The document.
    """
    if document["version"] == VERSION:
        return document
    for place, name in _RENAMED.get(kind, {}).items():
        *way, old = place.split("/")
        for parent in _at(document, way):
            if isinstance(parent, dict) and old in parent and name not in parent:
                parent[name] = parent.pop(old)
    for place, fields in _ADDED.get(kind, {}).items():
        for parent in _at(document, place.split("/") if place else []):
            if isinstance(parent, dict):
                parent |= {name: value(parent) for name, value in fields.items() if name not in parent}
    document["version"] = VERSION
    return document
