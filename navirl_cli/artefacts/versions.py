"""Versions of the file formats. Files of an older version are upgraded when they are read."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

#: The present version of all artefacts.
VERSION = 2


def _at(value: Any, path: list[str]) -> Iterator[Any]:
    """All values at a place."""
    if not path:
        yield value
        return
    if path[0] == "*":
        inside = list(value.values()) if isinstance(value, dict) else value if isinstance(value, list) else []
    else:
        inside = [value[path[0]]] if isinstance(value, dict) and path[0] in value else []
    for one in inside:
        yield from _at(one, path[1:])


def _names(document: dict[str, Any]) -> list[str]:
    """Which metrics a metrics file of version 1 holds."""
    means = (one for one in _at(document, ["groups", "*", "mean"]) if isinstance(one, dict))
    return list(next(means, ()))


#: Metrics of version 1 that were renamed, and where a file lists values by metric.
_METRICS = {"peak_n": "peak_force_n", "impulse_ns": "impulse_n_s"}
_BY_METRIC = (
    *(f"groups/*/{name}" for name in ("mean", "standard_deviation", "half_interval", "monte_carlo_error", "exact")),
    "demonstrations/*/metrics",
    "pairs/*/metrics",
)
#: By artefact: fields of version 1 (navirl 0.1.0) and their present names, in the order of renaming. A star stands for
#: every item of a list and every value of an object.
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
#: By artefact and place: fields that version 1 lacks, and functions that give their values.
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


def upgraded(document: dict[str, Any], artefact: str) -> dict[str, Any]:
    """Upgrade a document to the present version.

    Args:
        document: As read from a file, of a known version, not yet checked. Fields that are not where version 1 has them
            are left for the check against the schema. Changed in place.
        artefact: As in :func:`navirl_cli.artefacts.store.write_json`.

    Returns:
        The document.
    """
    if document["version"] == VERSION:
        return document
    for place, name in _RENAMED.get(artefact, {}).items():
        *path, old = place.split("/")
        for parent in _at(document, path):
            if isinstance(parent, dict) and old in parent and name not in parent:
                parent[name] = parent.pop(old)
    for place, fields in _ADDED.get(artefact, {}).items():
        for parent in _at(document, place.split("/") if place else []):
            if isinstance(parent, dict):
                parent |= {name: value(parent) for name, value in fields.items() if name not in parent}
    document["version"] = VERSION
    return document
