"""What a file of navirl holds, on one screen."""

from collections.abc import Callable, Mapping, Sequence
from math import hypot
from typing import Any

from navirl_cli.artefacts.demonstrations import demonstrations_of
from navirl_cli.artefacts.steps import held_steps
from navirl_cli.documents.document import Block, Bullets, Heading
from navirl_cli.documents.tables import Column, Table
from navirl_cli.errors import ArgumentError, unknown
from navirl_cli.evaluation.groups import by_group
from navirl_cli.reports.fit import parameter_table

#: Names that one line lists.
_MOST = 12
Content = Mapping[str, Any]


def summary_of(artefact: str, content: Content) -> dict[str, Any]:
    """What a file holds, by name.

    Args:
        artefact: "demonstrations", "reward", "metrics", "plan" or "study".
        content: Of the file, in the present version.
    """
    common = {"format": content["format"], "navirl": content["navirl"]}
    return {**common, **_SUMMARIES[artefact](content), "inputs": [one["file"] for one in content["inputs"]]}


def info_report(name: str, artefact: str, content: Content) -> list[Block]:
    """The summary as lines and a table.

    Args:
        name: Of the file.
        artefact: As in :func:`summary_of`.
        content: As in :func:`summary_of`.
    """
    lines = tuple(
        f"{key.replace('_', ' ')}: {_shown(value)}"
        for key, value in summary_of(artefact, content).items()
        if value not in (None, [], {}) and not isinstance(value, dict)
    )
    return [Heading(name), Bullets(lines), _TABLES[artefact](content).without_empty()]


def field_of(summary: Content, content: Content, name: str) -> Any:
    """One value of the summary or of the file, by its name with dots between levels, as in parameters.c0.

    Raises:
        ArgumentError: There is none of this name.
    """
    found, rest = _reached(summary, name)
    if rest is None:
        return found
    deeper, left = _reached(content, name)
    if left is None:
        return deeper
    known = list(found) if isinstance(found, Mapping) else []
    deep = [f"{key}.{name}" for key, value in summary.items() if isinstance(value, Mapping) and name in value]
    if deep:
        raise ArgumentError(f"`field`: expected dots between levels, found {name!r}; did you mean {deep[0]!r}?")
    raise ArgumentError(unknown("`field`", rest if known else name, known or summary))


def _reached(content: Any, name: str) -> tuple[Any, str | None]:
    """The value that a name leads to; or the deepest one that it reaches, and the rest of the name."""
    while name:
        if isinstance(content, Mapping):
            key = next((key for key in content if name == key or name.startswith(f"{key}.")), None)
        else:
            key, is_list = name.partition(".")[0], isinstance(content, list)
            key = key if is_list and key.isdecimal() and int(key) < len(content) else None
        if key is None:
            return content, name
        content = content[int(key)] if isinstance(content, list) else content[key]
        name = name[len(key) + 1 :]
    return content, None


def _shown(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, list):
        texts = [_shown(one) for one in value[:_MOST]]
        comma = " / " if any("," in text for text in texts) else ", "
        return comma.join([*texts, *([f"{len(value) - _MOST} more"] if len(value) > _MOST else [])])
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _unique(values: Sequence[Any]) -> list[Any]:
    return sorted({value for value in values if value is not None})


def _of_demonstrations(content: Content) -> dict[str, Any]:
    own = content["demonstrations"]
    return {
        "demonstrations": len(own),
        "participants": _unique([one["participant"] for one in own]),
        "conditions": _unique([one["condition"] for one in own]),
        "cycles": _unique([one["cycle"] for one in own]),
        "sets": _unique([one["set"] for one in own]),
        "groups": {name: len(some) for name, some in by_group(demonstrations_of(content, "file")).items()},
        "resolution_m": _unique([one["resolution_m"] for one in content["maps"].values()]),
        "robot_radius_m": _unique([one["robot_radius_m"] for one in own]),
        "duration_s": _duration_s(own),
        "length_m": float(sum(map(_length_m, own))),
        "with_wrench": sum(one["contacts"] is not None for one in own),
        "truncated": sum(bool(one["truncated"]) for one in own),
        "with_warnings": sum(bool(one["warnings"]) for one in own),
        "made_by": [one.line for one in held_steps(content)],
    }


def _duration_s(own: Sequence[Content]) -> float | None:
    """Time of all trials, s; None where that of one was not measured."""
    if any(one.get("laid_out_m_s") is not None for one in own):
        return None
    return float(sum(one["t_s"][-1] - one["t_s"][0] for one in own))


def _length_m(one: Content) -> float:
    x, y = one["x_m"], one["y_m"]
    return sum(hypot(x[k + 1] - x[k], y[k + 1] - y[k]) for k in range(len(x) - 1))


def _of_reward(content: Content) -> dict[str, Any]:
    first = content.get("intervals") or [{"parameters": []}]
    return {
        "status": content["status"],
        "parameters": {one["name"]: one["value"] for one in content["parameters"]},
        "standard_errors": {one["name"]: one["standard_error"] for one in content["parameters"]},
        "lower": {one["name"]: one["lower"] for one in first[0]["parameters"]},
        "upper": {one["name"]: one["upper"] for one in first[0]["parameters"]},
        "terms": list(content.get("terms", [])),
        "demonstrations": len(content["demonstrations"]),
        "participants": list(content["participants"]),
        "groups": list(content.get("groups", [])),
        "learnt_from": f"{content['learnt_from']} steps",
        "steps": content["steps"],
        "log_likelihood": content["log_likelihood"],
        "resolution_m": content["resolution_m"],
        "method": content["method"],
        "l2": content["l2"],
        "prior": content["prior"],
        "analyses": [name for name in ("bootstrap", "profiles", "cross_validation") if content[name]],
    }


def _of_metrics(content: Content) -> dict[str, Any]:
    ranks = content["ranks"]
    return {
        "metrics": list(content["metrics"]),
        "demonstrations": len(content["demonstrations"]),
        "groups": list(dict.fromkeys(one["group"] for one in content["groups"])),
        "path_types": list(dict.fromkeys(one["path_type"] for one in content["groups"])),
        "pairs": [f"{one['group']} - {one['minus']}" for one in content["pairs"]],
        "ranked": 0 if ranks is None else len(ranks["demonstrations"]),
        "samples": content["samples"],
        "seed": content["seed"],
    }


def _of_plan(content: Content) -> dict[str, Any]:
    first = content["paths"][0]
    return {
        "mode": content["mode"],
        "paths": len(content["paths"]),
        "length_m": first["length_m"],
        "min_distance_m": first["min_distance_m"],
        "log_probability": first["log_probability"],
        "frame": content["frame"],
        "start_m": list(content["start_m"]),
        "goal_m": list(content["goal_m"]),
        "people": len(content["people_m"]),
        "robot_radius_m": content["robot_radius_m"],
        "resolution_m": content["resolution_m"],
        "parameters": dict(content["parameters"]) if isinstance(content["parameters"], Mapping) else {},
    }


def _of_study(content: Content) -> dict[str, Any]:
    return {
        "participants": list(content["participants"]),
        "demonstrations": len(content["demonstrations"]),
        "verdicts": {one["claim"]: one["verdict"] for one in content["claims"]},
    }


def _groups_table(content: Content) -> Table:
    columns = (
        Column("group"),
        Column("trials"),
        Column("participants"),
        Column("duration_s", "duration s", decimals=1),
    )
    rows = []
    for name, some in by_group(demonstrations_of(content, "file")).items():
        mean_s = sum(one.duration_s for one in some) / len(some) if all(one.timed for one in some) else None
        rows.append((name, len(some), len({one.participant for one in some}), mean_s))
    return Table(columns, tuple(rows), note="Duration: mean of the group's trials.")


def _means_table(content: Content) -> Table:
    names = content["metrics"]
    columns = (
        Column("group"),
        Column("path_type", "path"),
        Column("n"),
        *(Column(name, significant=4) for name in names),
    )
    rows = [
        (
            one["group"],
            one["path_type"],
            one["count"],
            *({**one["mean"], **one.get("exact", {})}.get(name) for name in names),
        )
        for one in content["groups"]
    ]
    return Table(columns, tuple(rows), note="Means over demonstrations, or of the learnt policy.")


def _paths_table(content: Content) -> Table:
    columns = (
        Column("path"),
        Column("length_m", "length m", decimals=2),
        Column("min_distance_m", "min. distance m", decimals=2),
        Column("area_m2", "area under path m²", decimals=2),
    )
    named = [*((f"{n}", one) for n, one in enumerate(content["paths"][:_MOST], 1)), ("nominal", content["nominal"])]
    return Table(columns, tuple((name, *(one[column.name] for column in columns[1:])) for name, one in named))


def _claims_table(content: Content) -> Table:
    columns = (Column("claim"), Column("verdict"))
    return Table(columns, tuple((one["claim"], one["verdict"]) for one in content["claims"]))


_SUMMARIES: Mapping[str, Callable[[Content], dict[str, Any]]] = {
    "demonstrations": _of_demonstrations,
    "reward": _of_reward,
    "metrics": _of_metrics,
    "plan": _of_plan,
    "study": _of_study,
}
_TABLES: Mapping[str, Callable[[Content], Table]] = {
    "demonstrations": _groups_table,
    "reward": parameter_table,
    "metrics": _means_table,
    "plan": _paths_table,
    "study": _claims_table,
}
