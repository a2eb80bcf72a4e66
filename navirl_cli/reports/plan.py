"""What ``navirl plan`` prints."""

from collections.abc import Iterator, Mapping
from typing import Any

from navirl_cli.documents.tables import Column, Format, Table, written
from navirl_cli.evaluation.motion import PERSON_RADIUS_M
from navirl_cli.planning.paths import Mode, Planner

#: The most probable path is not typical where it passes people nearer than paths of the policy do by this, m.
_NEARER_M = 0.1
#: Rows of a table of drawn paths.
_MOST_ROWS = 20


def plan_text(content: Mapping[str, Any]) -> str:
    """The paths beside the nominal one, and what the first of them gains and pays.

    Args:
        content: Of a plan file.
    """
    parts = [written(_paths_table(content), Format.TEXT)]
    if content["mode"] != Mode.SAMPLE.value:
        parts.append(written(_terms_table(content), Format.TEXT))
    return "\n\n".join([*parts, *_smooth_lines(content)])


def _paths_table(content: Mapping[str, Any]) -> Table:
    """One row for each path, the nominal one last."""
    people = bool(content["people_m"])
    columns = [
        Column("path"),
        Column("length_m", "length m", decimals=2),
        *([Column("min_distance_m", "min. distance m", decimals=2)] if people else []),
        Column("area_m2", "area under path m²", decimals=2),
        Column("log_probability", "log-probability nats", decimals=1),
    ]
    paths = content["paths"]
    named = [(content["mode"] if len(paths) == 1 else f"{content['mode']} {i}", one) for i, one in enumerate(paths, 1)]
    rows = [
        (name, *(one[column.name] for column in columns[1:]))
        for name, one in (*named[:_MOST_ROWS], ("nominal", content["nominal"]))
    ]
    note = "Min. distance: from the robot's shell to a person's centre." if people else ""
    if people and content["nominal"]["min_distance_m"] < PERSON_RADIUS_M:
        note += " The nominal path touches a person; the reward allows that, and planned paths do not."
    if len(named) > _MOST_ROWS:
        note = f"{len(named) - _MOST_ROWS} more paths are in the file. {note}"
    return Table(tuple(columns), tuple(rows), note=note)


def _terms_table(content: Mapping[str, Any]) -> Table:
    """Reward by term of the planned path and of the nominal one."""
    planned, nominal = content["paths"][0]["reward_by_term"], content["nominal"]["reward_by_term"]
    columns = (
        Column("term", "reward nats"),
        Column("planned", decimals=1),
        Column("nominal", decimals=1),
        Column("gain", decimals=1, sign=True),
    )
    rows = [(name.replace("_", " "), planned[name], nominal[name], planned[name] - nominal[name]) for name in planned]
    sums = sum(planned.values()), sum(nominal.values())
    return Table(columns, (*rows, ("total", *sums, sums[0] - sums[1])))


def _smooth_lines(content: Mapping[str, Any]) -> Iterator[str]:
    """Duration, curvature and deviation of a smooth line."""
    first = content["paths"][0]
    if "t_s" in first:
        sharpest = max(map(abs, first["curvature_1_m"]))
        yield (
            f"Smooth: {first['t_s'][-1]:.1f} s at up to {max(first['speed_m_s']):.2f} m/s; curvature up to "
            f"{sharpest:.2f} 1/m; at most {first['deviation_m']:.3f} m from the path on cells."
        )


def plan_warnings(planner: Planner, content: Mapping[str, Any]) -> list[str]:
    """Why a planned path may not be the right one to drive."""
    least = content["paths"][0]["min_distance_m"]
    if content["mode"] != Mode.LIKELY.value or least is None:
        return []
    mean, spread = planner.passing_m
    if least > mean - _NEARER_M:
        return []
    text = (
        f"the most probable single path passes people at {least:.2f} m, but paths of the policy pass at {mean:.2f} m "
        f"(standard deviation {spread:.2f} m), because many longer paths together are more probable; `mode` expected "
        "follows them"
    )
    return [text]
