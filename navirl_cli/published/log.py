"""A participant's published paths written as the MCAP log that a robot would have recorded."""

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.cells import distances_to
from navirl_cli.demos.grid import INSCRIBED, LETHAL
from navirl_cli.errors import ArtefactError
from navirl_cli.files import check_writable, new_folder
from navirl_cli.logs.messages.writer import LogWriter, header, message_type, planar_pose
from navirl_cli.logs.recording import PUBLISHED_RECORD, SESSION_RECORD, Occupancy
from navirl_cli.parallel import map_in_order
from navirl_cli.published.participant import Participant, PublishedPath, participant_of
from navirl_cli.published.runs import Run

#: The paper's speed along x (v_nav, Sec. V), m/s, at which positions are laid out, because they come without times.
SPEED_M_S: Final = 0.4
#: The clock's zero, 2020-01-01: the first session starts here, the next an hour later, ns.
EPOCH_NS: Final = 1_577_836_800_000_000_000
HOUR_NS: Final = 3_600_000_000_000
#: Rest before the first and after the last published position, gap to the next trial, ns; periods of poses and people.
BEFORE_NS, AFTER_NS, GAP_NS = 2_000_000_000, 3_000_000_000, 60_000_000_000
POSE_NS, PEOPLE_NS = 100_000_000, 200_000_000
#: From the announcement of the goal to the first motion, ns.
ANNOUNCED_NS: Final = 500_000_000
#: A step that is shorter shows no direction, m.
LEAST_STEP_M: Final = 1e-3

NOTE: Final = (
    "Paths, people, map and cells are the published data of Kollmitz et al., IROS 2020. Not measured: times (positions "
    f"are laid out along the path at {SPEED_M_S:g} m/s, rests before and after are added, and the date is made up), "
    "headings (the direction of travel) and the odometry's speeds. Nobody recorded how the robot got back between "
    "trials. No wrench and no joystick were recorded."
)


@dataclass(frozen=True, eq=False)
class Trial:
    """A published path on the log's clock."""

    path: PublishedPath
    #: (n,) ns, increasing: of every pose.
    t_ns: IntArray
    #: (n, 2) m and (n,) rad, map frame.
    xy_m: FloatArray
    yaw_rad: FloatArray
    #: (n,) m/s forward.
    speed_m_s: FloatArray

    @property
    def goal_ns(self) -> int:
        """When the goal is announced, ns."""
        return int(self.t_ns[0]) + BEFORE_NS - ANNOUNCED_NS

    @property
    def stop_ns(self) -> int:
        """When the robot is at the last published position, ns."""
        return int(self.t_ns[-1]) - AFTER_NS


def laid_out(path: PublishedPath, start_ns: int) -> Trial:
    """Give a path times: rest, the published positions at constant speed along their line, rest.

    Args:
        path: Equal successive positions count once, because they carry no time.
        start_ns: When the first rest begins, ns.
    """
    xy = path.xy_m
    xy = xy[np.concatenate([[True], (np.diff(xy, axis=0) != 0).any(axis=1)])]
    steps = np.hypot(*np.diff(xy, axis=0).T)
    t_ns = np.rint(np.concatenate([[0.0], np.cumsum(steps)]) / SPEED_M_S * 1e9).astype(np.int64)
    order = np.arange(len(t_ns))
    t_ns = np.maximum.accumulate(t_ns - order) + order  # at least a nanosecond apart
    before = np.arange(0, BEFORE_NS, POSE_NS) - BEFORE_NS
    after = t_ns[-1] + np.arange(POSE_NS, AFTER_NS + 1, POSE_NS)
    rests = len(before), len(after)
    yaw = _headings(np.diff(xy, axis=0), steps)
    return Trial(
        path,
        start_ns + BEFORE_NS + np.concatenate([before, t_ns, after]),
        np.pad(xy, (rests, (0, 0)), mode="edge"),
        np.pad(yaw, rests, mode="edge"),
        np.pad(np.full(len(steps), SPEED_M_S), (rests[0], rests[1] + 1)),
    )


def _headings(steps: FloatArray, lengths_m: FloatArray) -> FloatArray:
    """(n,) rad at n positions from the (n - 1, 2) steps between them: along the next one, held at rest."""
    seen = np.flatnonzero(lengths_m > LEAST_STEP_M)
    if len(seen) == 0:
        return np.zeros(len(steps) + 1)
    last = np.searchsorted(seen, np.arange(len(steps) + 1), side="right") - 1
    x, y = steps[seen[np.maximum(last, 0)]].T
    yaw: FloatArray = np.arctan2(y, x)
    return yaw


@dataclass(frozen=True)
class Imported:
    """The log of a published participant."""

    participant: str
    #: What could not be used, in words.
    lost: tuple[str, ...]
    #: None where nothing could be used.
    path: Path | None = None
    trials: int = 0
    #: Times in which the obstacle course was completed, s, by modality.
    completion_s: Mapping[str, Sequence[float]] = field(default_factory=dict)
    size_bytes: int = 0


def write_logs(
    runs: Sequence[Run],
    folder: Path,
    *,
    force: bool,
    progress: Callable[[int, str], None] | None = None,
    executor: Executor | None = None,
) -> list[Imported]:
    """Write one log for each participant.

    Args:
        runs: Their published files.
        folder: Where to write; created if it does not exist.
        force: Replace existing files.
        progress: Called with the number of participants done and the name of the last.
        executor: Where to work; by default local processes.

    Raises:
        ArtefactError: A log exists already, or cannot be written.
    """
    jobs = [(number, run, folder / f"{run.name}.mcap") for number, run in enumerate(runs)]
    imported = []
    with new_folder(folder):
        for _, _, path in jobs:
            check_writable(path, force=force)
        for one in map_in_order(partial(_imported, force=force), jobs, executor):
            imported.append(one)
            if progress is not None:
                progress(len(imported), one.participant)
    return imported


def _imported(job: tuple[int, Run, Path], *, force: bool) -> Imported:
    """Write the log of one participant."""
    number, run, path = job
    try:
        participant = participant_of(run)
    except ArtefactError as error:
        return Imported(run.name, (str(error),))
    write_log(participant, number, path, force=force)
    times = dict(participant.completion_s)
    return Imported(run.name, participant.lost, path, len(participant.paths), times, path.stat().st_size)


def write_log(participant: Participant, number: int, path: Path, *, force: bool) -> None:
    """Write a participant's log; the same input gives the same bytes.

    Args:
        participant: The published data.
        number: Of the session, from 0; it sets the clock.
        path: The log to write.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file exists and may not be replaced, or cannot be written.
    """
    start_ns = EPOCH_NS + number * HOUR_NS
    trials = []
    with LogWriter(path, force=force) as writer:
        _write_scene(writer, participant.occupancy, start_ns)
        for one in participant.paths:
            trial = laid_out(one, start_ns)
            _write_trial(writer, trial, participant)
            writer.flush()  # a trial at a time: long sessions need no more memory
            trials.append(trial)
            start_ns = int(trial.t_ns[-1]) + GAP_NS
        writer.metadata(SESSION_RECORD, _session(participant, trials))
        writer.metadata(PUBLISHED_RECORD, _published(trials))


def _write_scene(writer: LogWriter, occupancy: Occupancy, start_ns: int) -> None:
    """The map, and a constant transform to the odometry's frame: published positions are localised already."""
    rows, columns = occupancy.data.shape
    origin = planar_pose(*occupancy.origin_m, 0.0)
    head = header(start_ns, "map")
    info = message_type("nav_msgs/msg/MapMetaData")(head.stamp, occupancy.resolution_m, columns, rows, origin)
    drawn = message_type("nav_msgs/msg/OccupancyGrid")(head, info, occupancy.data.reshape(-1))
    writer.message("/map", drawn, start_ns)
    writer.message("/tf_static", _transform(start_ns, "map", "odom", planar_pose(0.0, 0.0, 0.0)), start_ns)


def _write_trial(writer: LogWriter, trial: Trial, participant: Participant) -> None:
    """Poses, people and goal."""
    _write_odometry(writer, trial)
    for t_ns, (x, y), yaw in zip(trial.t_ns.tolist(), trial.xy_m.tolist(), trial.yaw_rad.tolist(), strict=True):
        writer.message("/tf", _transform(t_ns, "odom", "base_link", planar_pose(x, y, yaw)), t_ns)
    people = message_type("geometry_msgs/msg/PoseArray")
    poses = [planar_pose(x, y, 0.0) for x, y in participant.grid.centres_of(trial.path.people)]
    for t_ns in range(int(trial.t_ns[0]), int(trial.t_ns[-1]) + 1, PEOPLE_NS):
        writer.message("/people", people(header(t_ns, "map"), poses), t_ns)
    x, y = participant.grid.centres_of(trial.path.cells[-1])
    goal = message_type("geometry_msgs/msg/PoseStamped")(header(trial.goal_ns, "map"), planar_pose(x, y, 0.0))
    writer.message("/goal_pose", goal, trial.goal_ns)


def _write_odometry(writer: LogWriter, trial: Trial) -> None:
    vector = message_type("geometry_msgs/msg/Vector3")
    twist = message_type("geometry_msgs/msg/Twist")(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    unknown = np.zeros(36)
    template = message_type("nav_msgs/msg/Odometry")(
        header(0, "odom"),
        "base_link",
        message_type("geometry_msgs/msg/PoseWithCovariance")(planar_pose(0.0, 0.0, 0.0), unknown),
        message_type("geometry_msgs/msg/TwistWithCovariance")(twist, unknown),
    )
    columns = {
        "header.stamp": trial.t_ns,
        "pose.pose.position.x": trial.xy_m[:, 0],
        "pose.pose.position.y": trial.xy_m[:, 1],
        "pose.pose.orientation.z": np.sin(trial.yaw_rad / 2),
        "pose.pose.orientation.w": np.cos(trial.yaw_rad / 2),
        "twist.twist.linear.x": trial.speed_m_s,
    }
    writer.columns("/odom", template, trial.t_ns, columns)


def _transform(t_ns: int, parent: str, child: str, pose: Any) -> Any:
    """A tf2_msgs/msg/TFMessage of one transform, given as the child's pose in the parent."""
    place = message_type("geometry_msgs/msg/Vector3")(pose.position.x, pose.position.y, pose.position.z)
    motion = message_type("geometry_msgs/msg/Transform")(place, pose.orientation)
    stamped = message_type("geometry_msgs/msg/TransformStamped")(header(t_ns, parent), child, motion)
    return message_type("tf2_msgs/msg/TFMessage")([stamped])


def _session(participant: Participant, trials: list[Trial]) -> dict[str, str]:
    """The metadata record with what only the experimenter knows."""
    entries = []
    for trial in trials:
        part, line = trial.path.part, nominal_m(trial.path, participant)
        entry = {
            "t_ns": trial.goal_ns,
            "stop_ns": trial.stop_ns,
            "condition": part.condition,
            "cycle": part.cycle,
            "set": part.set,
        }
        entry["nominal_m"] = None if line is None else line.tolist()
        entries.append({key: value for key, value in entry.items() if value is not None})
    values = {
        "participant": participant.name,
        "trials": json.dumps(entries),
        "laid_out_m_s": json.dumps(SPEED_M_S),
        "completion_s": json.dumps(participant.completion_s),
    }
    radius = ring_m(participant.occupancy)
    return values if radius is None else values | {"robot_radius_m": json.dumps(radius)}


def nominal_m(path: PublishedPath, participant: Participant) -> FloatArray | None:
    """(2, 2) m: the line that the navigation followed past a person, along the hallway (x) through the goal.

    It is the line y = 0.05 m for every pass, wherever the robot started (Sec. IV-C). None for the obstacle course,
    which has another line.
    """
    if len(path.people) == 0:
        return None
    _, y = participant.grid.centres_of(path.cells[-1])
    return np.array([[path.xy_m[0, 0], y], [path.xy_m[-1, 0], y]])


def ring_m(occupancy: Occupancy) -> float | None:
    """Width of the ring of inscribed cells around the obstacles, m: the radius of the robot of the map.

    None where the map has no such ring.
    """
    ring, obstacles = occupancy.data == INSCRIBED, occupancy.data == LETHAL
    if not (ring.any() and obstacles.any()):
        return None
    cells = distances_to(obstacles)[ring].max()
    return round(float(cells) * occupancy.resolution_m, 6)


def _published(trials: list[Trial]) -> dict[str, str]:
    """The metadata record with the published cells, for comparison."""
    entries = [{"t_ns": trial.goal_ns, "name": trial.path.name, "cells": trial.path.cells.tolist()} for trial in trials]
    return {"cells": json.dumps(entries), "note": NOTE}
