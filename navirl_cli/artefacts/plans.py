"""Files of planned paths: JSON to keep, CSV to look at, and the poses that Nav2 takes, as YAML or as a log."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Final

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.artefacts.store import number, numbers, read_json, write_json
from navirl_cli.errors import ArtefactError
from navirl_cli.files import Input, replacing
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.paths import Mode, Path, Planner, measured, rewards_by_term
from navirl_cli.planning.problem import Problem
from navirl_cli.planning.smooth import SmoothLine

#: Length of the shortest path that can be driven, m.
_LEAST_M: Final = 0.5
#: Topic of the paths in a log, as Nav2's planners name it; further ones have a number behind it.
PLAN_TOPIC: Final = "/plan"


@dataclass(frozen=True, eq=False)
class Planned:
    """A path with its smooth line, if one was asked for."""

    path: Path
    smooth: SmoothLine | None = None

    @property
    def line_m(self) -> FloatArray:
        """(n, 2) m, map frame: the line to drive."""
        return self.path.line_m if self.smooth is None else self.smooth.xy_m

    @property
    def yaw_rad(self) -> FloatArray:
        """(n,) direction of travel at every point, rad."""
        if self.smooth is not None:
            return self.smooth.yaw_rad
        steps = np.diff(self.path.line_m, axis=0)
        yaw = np.arctan2(steps[:, 1], steps[:, 0])
        directions: FloatArray = np.append(yaw, yaw[-1])
        return directions


def plan_document(
    planner: Planner, planned: Sequence[Planned], mode: Mode, seed: int, inputs: Sequence[Input]
) -> dict[str, Any]:
    """Planned paths as the content of a plan file.

    Args:
        planner: Its problem and reward.
        planned: The paths.
        mode: Of the paths.
        seed: Of drawn paths.
        inputs: Files that were read.
    """
    problem, scene = planner.problem, planner.problem.scene
    nominal = Planned(planner.path(problem.nominal_states))
    return {
        "inputs": [vars(one) for one in inputs],
        "mode": mode.value,
        "seed": seed,
        "frame": problem.frame,
        "start_m": list(problem.start_m),
        "goal_m": list(problem.goal_m),
        "start_yaw_rad": problem.start_yaw_rad,
        "people_m": scene.people_m.tolist(),
        "robot_radius_m": problem.robot_radius_m,
        "resolution_m": scene.lattice.grid.resolution_m,
        "parameters": {p.name: value for p, value in zip(planner.reward.parameters, planner.reward.theta, strict=True)},
        "nominal": _path_document(problem, planner.reward, nominal),
        "paths": [_path_document(problem, planner.reward, one) for one in planned],
    }


def _path_document(problem: Problem, reward: Reward, one: Planned) -> dict[str, Any]:
    """One path."""
    lines = measured(problem, one.line_m)
    people = len(problem.scene.people_m) > 0
    content: dict[str, Any] = {
        "length_m": float(lines.length_m[0]),
        "min_distance_m": number(float(lines.min_distance_m[0])) if people else None,
        "area_m2": float(lines.area_m2[0]),
        "log_probability": number(one.path.log_probability),
        "reward_by_term": {
            name.replace("-", "_"): value for name, value in rewards_by_term(problem, reward, one.path.states).items()
        },
        "cells": problem.scene.lattice.cells[one.path.states].tolist(),
        "xy_m": numbers(one.line_m),
        "yaw_rad": numbers(one.yaw_rad),
    }
    if one.smooth is not None:
        content |= {
            "t_s": numbers(one.smooth.t_s),
            "speed_m_s": numbers(one.smooth.speed_m_s),
            "curvature_1_m": numbers(one.smooth.curvature_1_m),
            "deviation_m": one.smooth.deviation_m,
        }
    return content


def read_plan(path: FilePath) -> dict[str, Any]:
    """The content of a plan file.

    Raises:
        ArtefactError: As in :func:`navirl_cli.artefacts.store.read_json`.
    """
    return read_json(path, "plan")


def read_line(path: FilePath) -> FloatArray:
    """(k, 2) m, map frame: the first path of a plan file, .json or .csv, or of any CSV table with x_m and y_m.

    Raises:
        ArtefactError: The file cannot be read, or holds no path.
    """
    if path.suffix == ".json":
        line = np.array(read_plan(path)["paths"][0]["xy_m"], dtype=float)
    else:
        try:
            rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
            first = [row for row in rows if row.get("path") == rows[0].get("path")]
            line = np.array([(float(row["x_m"]), float(row["y_m"])) for row in first])
        except OSError as error:
            raise ArtefactError(f"{path}: cannot be read: {error.strerror or error}") from error
        except (KeyError, ValueError, TypeError, csv.Error) as error:
            raise ArtefactError(
                f"{path}: expected a CSV table with numbers under x_m and y_m, as navirl plan writes it, found none "
                f"({error})"
            ) from error
    if len(line) < 2 or not np.isfinite(line).all() or np.hypot(*np.diff(line, axis=0).T).sum() < _LEAST_M:
        raise ArtefactError(f"{path}: expected a path of at least {_LEAST_M:g} m, found {len(line)} points without one")
    return line


def write_plan(output: FilePath, content: Mapping[str, Any], *, force: bool) -> None:
    """Write planned paths in the format of the file's ending: .json, .csv, .yaml or .mcap.

    Args:
        output: The file.
        content: As :func:`plan_document` makes it.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    if output.suffix == ".json":
        write_json(output, "plan", content, force=force)
    elif output.suffix == ".mcap":
        _write_log(output, content, force=force)
    else:
        text = _csv(content) if output.suffix == ".csv" else _yaml(content)
        with replacing(output, force=force) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _csv(content: Mapping[str, Any]) -> str:
    """One row for each point; columns of speed and time where they are known."""
    names = [
        "xy_m",
        "yaw_rad",
        *(name for name in ("t_s", "speed_m_s", "curvature_1_m") if name in content["paths"][0]),
    ]
    rows = [",".join(["path", "x_m", "y_m", *names[1:]])]
    for place, one in enumerate(content["paths"], 1):
        columns = [np.array(one[name], dtype=float).reshape(len(one["xy_m"]), -1) for name in names]
        rows += [",".join([str(place), *(f"{value:.6f}" for value in row)]) for row in np.hstack(columns).tolist()]
    return "\n".join(rows) + "\n"


def _yaml(content: Mapping[str, Any]) -> str:
    """The first path as the fields of a nav_msgs/Path, which nav2_simple_commander takes."""
    frame = content["frame"].replace("\\", "\\\\").replace('"', '\\"')
    head = f'header: {{frame_id: "{frame}"}}'
    lines = [
        "# The fields of a nav_msgs/msg/Path. With nav2_simple_commander's BasicNavigator:",
        "#   from rosidl_runtime_py.set_message import set_message_fields",
        "#   path = Path(); set_message_fields(path, yaml.safe_load(open(this_file)))",
        "#   navigator.followPath(path)                or  navigator.goThroughPoses(path.poses)",
        head,
        "poses:",
    ]
    first = content["paths"][0]
    for (x, y), yaw in zip(first["xy_m"], first["yaw_rad"], strict=True):
        turn = f"{{x: 0.0, y: 0.0, z: {np.sin(yaw / 2):.9f}, w: {np.cos(yaw / 2):.9f}}}"
        lines += [
            f"- {head}",
            f"  pose: {{position: {{x: {x:.6f}, y: {y:.6f}, z: 0.0}}, orientation: {turn}}}",
        ]
    return "\n".join(lines) + "\n"


def _write_log(output: FilePath, content: Mapping[str, Any], *, force: bool) -> None:
    """Every path as a nav_msgs/Path on a topic of its own, at time 0."""
    from navirl_cli.logs.messages.writer import LogWriter, header, message_type, planar_pose

    path_type, pose_type = message_type("nav_msgs/msg/Path"), message_type("geometry_msgs/msg/PoseStamped")
    head = header(0, content["frame"])
    with LogWriter(output, force=force) as writer:
        for place, one in enumerate(content["paths"], 1):
            poses = [
                pose_type(head, planar_pose(x, y, yaw)) for (x, y), yaw in zip(one["xy_m"], one["yaw_rad"], strict=True)
            ]
            topic = PLAN_TOPIC if place == 1 else f"{PLAN_TOPIC}_{place}"
            writer.message(topic, path_type(head, poses), 0)
