"""A small log of a robot that drives 4 m and is pushed, with any part left out or damaged."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli.logs.messages.writer import LogWriter, header, message_type

START_NS = 1_700_000_000_000_000_000
#: The robot stands for 2 s, drives 4 m in 10 s along y = 0, and stands for 2 s; it is pushed from 5 s to 7 s.
STAND_S, DRIVE_S, LENGTH_M = 2.0, 10.0, 4.0
PUSH_S = (5.0, 7.0)
PUSH_N = np.array([0.0, 12.0])
ODOMETRY_HZ, PEOPLE_HZ = 30, 5


@dataclass(frozen=True)
class Run:
    """What to write; the defaults make an intact log."""

    wrench_topics: tuple[str, ...] = ("/wrench",)
    odometry: bool = True
    map: bool = True
    #: Occupied cells (column, row) of the map of 60 x 30 cells of 0.1 m with its corner at (-1.05, -1.55).
    obstacles: tuple[tuple[int, int], ...] = ()
    map_yaw: float = 0.0
    people: tuple[tuple[float, float], ...] | None = ((2.0, 0.9),)
    #: People who walk: corners (seconds, x, y) of each one's path, seen from the first to the last. With any, messages
    #: come at 5 Hz: first those who stand, then the walkers who are seen.
    walks: tuple[tuple[tuple[float, float, float], ...], ...] = ()
    #: How long the log lasts; after its drive the robot stands.
    lasts_s: float = 14.0
    #: (since, until, x, y): seconds, and newtons in the map's frame, which is the robot's.
    pushes: tuple[tuple[float, float, float, float], ...] = ((*PUSH_S, 0.0, 12.0),)
    #: How fast the robot gives way to a push, m/s/N.
    gain: float = 0.0
    #: Goal messages: (seconds, x, y).
    goals: tuple[tuple[float, float, float], ...] = ((1.5, 4.0, 0.0),)
    map_to_odom: bool = True
    sensor_mounted: bool = True
    #: Yaw of the wrench's frame on the robot, rad.
    sensor_yaw: float = 1.2
    #: How fast the sensor turns on the robot, rad/s, in place of its yaw.
    sensor_turns: float = 0.0
    #: Drift of the sensor's bias, N a minute, sensor frame.
    drift_n_min: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: Topics whose header stamps are 0.
    unstamped: tuple[str, ...] = ()
    people_frame: str = "map"
    goal_frame: str = "map"
    #: Cells missing from the map's data.
    map_short_by: int = 0
    resolution_m: float = 0.1
    #: Odometry messages with numbers that are not finite, and with a quaternion of zeros.
    odometry_nan: int = 0
    odometry_zero: int = 0
    wrench_nan: int = 0
    #: Where an axis of the joystick rests.
    stick_rest: float = 0.0
    moves: bool = True
    joystick: str = ""
    session: dict[str, str] | None = None
    #: JSON of the cells that were published with the log.
    published: str = ""


def write_run(path: Path, run: Run = Run()) -> Path:
    """Write the log."""
    rng = np.random.default_rng(1)
    with LogWriter(path) as log:
        if run.map:
            log.message("/map", _map(run), START_NS)
        _transforms(log, run)
        for topic in run.wrench_topics:
            _wrench(log, topic, run, rng)
        if run.odometry:
            _odometry(log, run)
        for seconds, x, y in run.goals:
            at = START_NS + round(seconds * 1e9)
            head = header(0 if "/goal_pose" in run.unstamped else at, run.goal_frame)
            log.message("/goal_pose", message_type("geometry_msgs/msg/PoseStamped")(head, _pose(x, y)), at)
        if run.people is not None:
            _people(log, run)
        if run.joystick:
            _joystick(log, run)
        if run.session is not None:
            log.metadata("navirl.session", run.session)
        if run.published:
            log.metadata("navirl.published", {"cells": run.published})
    return path


def position_m(seconds: np.ndarray) -> np.ndarray:
    """(n, 2) m where the robot truly is."""
    share = np.clip((seconds - STAND_S) / DRIVE_S, 0, 1)
    return np.stack([LENGTH_M * share, np.zeros_like(share)], axis=1)


def force_n(run: Run, seconds: np.ndarray) -> np.ndarray:
    """(n, 2) N: the pushes, in the map's frame."""
    force = np.zeros((len(seconds), 2))
    for since, until, *push in run.pushes:
        force[(seconds >= since) & (seconds < until)] += push
    return force


def _driven_m(run: Run, seconds: np.ndarray) -> np.ndarray:
    """(n, 2) m places of a robot that gives way to pushes."""
    fine = np.arange(0, run.lasts_s, 0.001)
    aside = run.gain * np.cumsum(force_n(run, fine), axis=0) * 0.001
    pushed = np.stack([np.interp(seconds, fine, axis) for axis in aside.T], axis=1)
    return pushed + (position_m(seconds) if run.moves else 0.0)


def velocity_m_s(run: Run, seconds: np.ndarray) -> np.ndarray:
    """(n, 2) m/s: how fast that robot is at an instant."""
    forward = (position_m(seconds + 1e-6) - position_m(seconds - 1e-6)) / 2e-6
    return (forward if run.moves else 0.0) + run.gain * force_n(run, seconds)


def _people(log: LogWriter, run: Run) -> None:
    """Once, or again and again where somebody walks."""
    for step in range(round(run.lasts_s * PEOPLE_HZ) if run.walks else 1):
        seconds = step / PEOPLE_HZ
        seen = [np.array(way).T for way in run.walks if way[0][0] <= seconds <= way[-1][0]]
        places = [*run.people, *((np.interp(seconds, t, x), np.interp(seconds, t, y)) for t, x, y in seen)]
        at = START_NS + round(seconds * 1e9)
        head = header(at, run.people_frame)
        log.message("/people", message_type("geometry_msgs/msg/PoseArray")(head, [_pose(x, y) for x, y in places]), at)


def _pose(x: float, y: float, yaw: float = 0.0) -> Any:
    point = message_type("geometry_msgs/msg/Point")(float(x), float(y), 0.0)
    turn = message_type("geometry_msgs/msg/Quaternion")(0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    return message_type("geometry_msgs/msg/Pose")(point, turn)


def _map(run: Run) -> Any:
    data = np.zeros((30, 60), dtype=np.int8)
    for column, row in run.obstacles:
        data[row, column] = 100
    info = message_type("nav_msgs/msg/MapMetaData")(
        header(START_NS, "").stamp, run.resolution_m, 60, 30, _pose(-1.05, -1.55, run.map_yaw)
    )
    return message_type("nav_msgs/msg/OccupancyGrid")(
        header(START_NS, "map"), info, data.reshape(-1)[run.map_short_by :]
    )


def _transforms(log: LogWriter, run: Run) -> None:
    tf = message_type("tf2_msgs/msg/TFMessage")
    vector = message_type("geometry_msgs/msg/Vector3")

    def stamped(t_ns: int, parent: str, child: str, pose: Any) -> Any:
        motion = message_type("geometry_msgs/msg/Transform")(
            vector(pose.position.x, pose.position.y, 0.0), pose.orientation
        )
        return message_type("geometry_msgs/msg/TransformStamped")(header(t_ns, parent), child, motion)

    if run.sensor_turns:
        for step in range(round(2 * run.lasts_s) + 1):
            at = START_NS + step * 500_000_000
            log.message("/tf", tf([stamped(at, "base", "sensor", _pose(0, 0, run.sensor_turns * step / 2))]), at)
    elif run.sensor_mounted:
        log.message("/tf_static", tf([stamped(START_NS, "base", "sensor", _pose(0, 0, run.sensor_yaw))]), START_NS)
    if run.map_to_odom:
        # The odometry's frame is turned by 90 degrees and moved.
        for step in range(round(2 * run.lasts_s) + 1):
            at = START_NS + step * 500_000_000
            log.message("/tf", tf([stamped(at, "map", "odom", _pose(1.0, 2.0, np.pi / 2))]), at)


def _wrench(log: LogWriter, topic: str, run: Run, rng: np.random.Generator) -> None:
    seconds = np.arange(0, run.lasts_s, 0.01)
    times = START_NS + np.round(seconds * 1e9).astype(np.int64)
    push = force_n(run, seconds)
    yaw = run.sensor_turns * seconds if run.sensor_turns else run.sensor_yaw
    cos, sin = np.cos(yaw), np.sin(yaw)
    force = np.column_stack([cos * push[:, 0] + sin * push[:, 1], -sin * push[:, 0] + cos * push[:, 1], 0 * seconds])
    force += np.array([3.0, -2.0, 5.0]) + rng.normal(0, 0.2, force.shape) + np.outer(seconds / 60, run.drift_n_min)
    force[200 : 200 + run.wrench_nan] = np.nan
    vector = message_type("geometry_msgs/msg/Vector3")
    wrench = message_type("geometry_msgs/msg/Wrench")(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    template = message_type("geometry_msgs/msg/WrenchStamped")(header(0, "sensor"), wrench)
    columns = {f"wrench.force.{axis}": force[:, i] for i, axis in enumerate("xyz")}
    log.columns(topic, template, times, {"header.stamp": times, **columns})


def _odometry(log: LogWriter, run: Run) -> None:
    seconds = np.arange(0, run.lasts_s, 1 / ODOMETRY_HZ)
    times = START_NS + np.round(seconds * 1e9).astype(np.int64)
    true = _driven_m(run, seconds)
    # map -> odom turns by 90 degrees and moves by (1, 2): odom = R(-90) (map - (1, 2)).
    moved = true - (1.0, 2.0)
    vector = message_type("geometry_msgs/msg/Vector3")
    twist = message_type("geometry_msgs/msg/Twist")(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    template = message_type("nav_msgs/msg/Odometry")(
        header(0, "odom"),
        "base",
        message_type("geometry_msgs/msg/PoseWithCovariance")(_pose(0, 0, -np.pi / 2), np.zeros(36)),
        message_type("geometry_msgs/msg/TwistWithCovariance")(twist, np.zeros(36)),
    )
    columns = {"pose.pose.position.x": moved[:, 1], "pose.pose.position.y": -moved[:, 0]}
    columns["twist.twist.linear.x"], columns["twist.twist.linear.y"] = velocity_m_s(run, seconds).T
    columns["pose.pose.position.x"][max(0, len(seconds) - run.odometry_nan) :] = np.nan
    turn = np.full((len(seconds), 2), (np.sin(-np.pi / 4), np.cos(-np.pi / 4)))
    turn[200 : 200 + run.odometry_zero] = 0.0
    columns["pose.pose.orientation.z"], columns["pose.pose.orientation.w"] = turn.T
    log.columns("/odom", template, times, {"header.stamp": times, **columns})


def _joystick(log: LogWriter, run: Run) -> None:
    for step in range(round(20 * run.lasts_s)):
        at = START_NS + step * 50_000_000
        axes = np.array([0.0, 0.7 if 100 <= step < 140 else 0.0, run.stick_rest], dtype=np.float32)
        axes = axes if run.joystick == "moved" else axes[[0, 2]]
        joy = message_type("sensor_msgs/msg/Joy")(
            header(0 if "/joy" in run.unstamped else at, ""), axes, np.zeros(0, dtype=np.int32)
        )
        log.message("/joy", joy, at)
