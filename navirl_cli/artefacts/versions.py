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


def _objects(document: Any, path: list[str]) -> Iterator[dict[str, Any]]:
    """All objects at a place."""
    return (one for one in _at(document, path) if isinstance(one, dict))


def _names(document: dict[str, Any]) -> list[str]:
    """Which metrics a metrics file of version 1 holds."""
    return list(next(_objects(document, ["groups", "*", "mean"]), ()))


def _object(parent: Mapping[str, Any], name: str) -> dict[str, Any]:
    """An object of a parent; an empty one where something else stands, which the check finds."""
    value = parent.get(name)
    return value if isinstance(value, dict) else {}


def _participant(demonstration: Mapping[str, Any]) -> str:
    """The participant of an id, as extract names demonstrations."""
    return str(demonstration.get("id")).rpartition("/")[0]


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
    "study": {
        "participants/*/trouble": "problems",
        "pooled/trouble": "problems",
        "metrics/*/paths": "count",
        "claims/*/asked": "question",
        "claims/*/differences/*/of": "quantity",
        "claims/*/differences/*/lower": "student_lower",
        "claims/*/differences/*/upper": "student_upper",
        "claims/*/differences/*/against": "participants_against",
    },
}
#: By artefact and place: fields of version 1 that stand in an object beside them since.
_MOVED: Mapping[str, Mapping[str, Mapping[str, str]]] = {"study": {"demonstrations/*": {"onset_m": "metrics"}}}
#: By artefact and place: fields that version 1 lacks, and functions that give their values.
_ADDED: Mapping[str, Mapping[str, Mapping[str, Callable[[Any], Any]]]] = {
    "metrics": {
        "": {
            "metrics": _names,
            "missing": lambda _: {},
        },
        "groups/*": {"missing": lambda _: {}},
        "demonstrations/*": {
            "participant": _participant,
            "missing": lambda _: {},
        },
        "pairs/*/metrics/*": {"student_lower": lambda _: None, "student_upper": lambda _: None},
    },
    "study": {
        "metrics/*": {"missing": lambda _: {}, "missing_on_grid": lambda _: {}},
        "claims/*/differences/*": {"n": lambda one: len(_object(one, "by_participant"))},
        "demonstrations/*": {
            "participant": _participant,
            "missing": lambda _: {},
            "missing_on_grid": lambda _: {},
        },
    },
}


def _rename(document: dict[str, Any], place: list[str], name: str) -> None:
    """Give a field another name."""
    *path, old = place
    for parent in _objects(document, path):
        if old in parent and name not in parent:
            parent[name] = parent.pop(old)


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
        _rename(document, place.split("/"), name)
    for place, moved in _MOVED.get(artefact, {}).items():
        for parent in _objects(document, place.split("/")):
            for name in moved.keys() & parent.keys():
                if isinstance(target := parent.get(moved[name]), dict):
                    target[name] = parent.pop(name)
    for place, fields in _ADDED.get(artefact, {}).items():
        for parent in _objects(document, place.split("/") if place else []):
            parent |= {name: value(parent) for name, value in fields.items() if name not in parent}
    document["version"] = VERSION
    return document
