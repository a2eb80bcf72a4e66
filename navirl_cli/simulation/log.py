"""A session written as the MCAP log that rosbag2 would have recorded."""

import base64
import json
import zlib
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Condition
from navirl_cli.files import check_writable, new_folder
from navirl_cli.logs.messages.writer import LogWriter, header, message_type, planar_pose
from navirl_cli.logs.recording import SESSION_RECORD
from navirl_cli.parallel import map_in_order
from navirl_cli.simulation import protocol, sensors
from navirl_cli.simulation.behaviour import Behaviour
from navirl_cli.simulation.driving import GAIN_S_KG, STEP_S, Drive
from navirl_cli.simulation.person import STICK_M_S

#: Name of the metadata record that holds the truth; only tests read it.
TRUTH_RECORD = "navirl.truth"
#: The clock's zero: the first session starts here, the next an hour later, ns.
EPOCH_NS = 1_750_000_000_000_000_000
HOUR_NS = 3_600_000_000_000
#: Delay from measurement to receipt, ns.
LATENCY_NS = (1_000_000, 4_000_000)


@dataclass(eq=False)
class Timeline:
    """A session in time, at steps of 10 ms."""

    xy_m: list[FloatArray] = field(default_factory=list)
    #: The person's force on the robot, N, map frame.
    force_n: list[FloatArray] = field(default_factory=list)
    #: Deflection of the joystick, forward and left.
    stick: list[FloatArray] = field(default_factory=list)
    #: Of each pass: step of its goal's announcement, of its first motion, and one past its last.
    spans: list[tuple[int, int, int]] = field(default_factory=list)
    steps: int = 0

    def add(self, part: Drive, force_n: FloatArray | None = None, stick: FloatArray | None = None) -> None:
        """Append a drive."""
        none = np.zeros_like(part.xy_m)
        self.xy_m.append(part.xy_m)
        self.force_n.append(none if force_n is None else force_n)
        self.stick.append(none if stick is None else stick)
        self.steps += len(part)


def lay_out(session: protocol.Session) -> Timeline:
    """Put the passes in sequence, with the robot driven back between them."""
    line = Timeline()
    here = session.passes[0].drive.xy_m[0]
    for number, one in enumerate(session.passes):
        start = one.drive.xy_m[0]
        if number:
            back = protocol.drive_back(here, start)
            line.add(back, stick=np.gradient(back.xy_m, STEP_S, axis=0) / protocol.BACK_M_S)
            line.add(protocol.standing(back.xy_m[-1], 0.3))
            start = back.xy_m[-1]
        line.add(protocol.standing(start, protocol.STAND_BEFORE_S))
        announced = line.steps
        line.add(protocol.standing(start, protocol.STAND_ANNOUNCED_S))
        moving = line.steps
        pushed = one.steering / GAIN_S_KG if one.condition is Condition.FORCE else None
        steered = one.steering / STICK_M_S if one.condition is Condition.JOYSTICK else None
        # the robot stands a few centimetres beside the pass's start, as after a drive back by hand
        blend = np.clip(1 - np.arange(len(one.drive)) * STEP_S / 1.0, 0, 1)[:, None] * (start - one.drive.xy_m[0])
        line.add(Drive(one.drive.xy_m + blend, one.steering), pushed, steered)
        line.spans.append((announced, moving, line.steps))
        here = one.drive.xy_m[-1]
        line.add(protocol.standing(here, protocol.STAND_AFTER_S))
    return line


@dataclass(frozen=True)
class Simulated:
    """The log of a simulated participant."""

    path: FilePath
    trials: int
    size_bytes: int


def write_logs(
    folder: FilePath,
    participants: int,
    seed: int,
    *,
    force: bool,
    behaviour: Behaviour | None = None,
    driven_m: FloatArray | None = None,
    progress: Callable[[int, str], None] | None = None,
    executor: Executor | None = None,
) -> list[Simulated]:
    """Simulate participants and write one log each, p01.mcap and so on.

    Args:
        folder: Where to write; created if it does not exist.
        participants: Number of participants.
        seed: Of the study.
        force: Replace existing files.
        behaviour: How people intervene.
        driven_m: (k, 2) m, map frame: a path that the robot drives in place of the two cycles.
        progress: Called with the number of logs written and the name of the last.
        executor: Where to simulate; by default local processes.

    Raises:
        ArtefactError: A log exists already, or cannot be written.
        SceneError: The path cannot be driven in the hallway.
    """
    jobs = [(number, folder / f"p{number:02d}.mcap") for number in range(1, participants + 1)]
    written = []
    with new_folder(folder):
        for _, path in jobs:
            check_writable(path, force=force)
        for one in map_in_order(
            partial(_simulated, seed=seed, behaviour=behaviour, driven_m=driven_m, force=force), jobs, executor
        ):
            written.append(one)
            if progress is not None:
                progress(len(written), one.path.name)
    return written


def _simulated(
    job: tuple[int, FilePath], seed: int, behaviour: Behaviour | None, driven_m: FloatArray | None, *, force: bool
) -> Simulated:
    """Write the log of one participant."""
    number, path = job
    session = write_log(number, seed, path, behaviour, driven_m, force=force)
    return Simulated(path, len(session.passes), path.stat().st_size)


def write_log(
    number: int,
    seed: int,
    path: FilePath,
    behaviour: Behaviour | None = None,
    driven_m: FloatArray | None = None,
    *,
    force: bool,
) -> protocol.Session:
    """Simulate a participant and write the log.

    Args:
        number: Of the participant, from 1.
        seed: Of the study.
        path: The log to write.
        behaviour: How the person intervenes.
        driven_m: (k, 2) m, map frame: a path that the robot drives in place of the two cycles.
        force: Whether to replace an existing file.

    Returns:
        The session.
    """
    session = protocol.session(number, seed, behaviour, driven_m)
    line = lay_out(session)
    rng = np.random.default_rng([seed, number, 1])
    # a given path is driven later in the same visit
    begin_ns = EPOCH_NS + number * HOUR_NS + (0 if driven_m is None else HOUR_NS // 2)
    t_ns = begin_ns + np.arange(line.steps, dtype=np.int64) * round(STEP_S * 1e9)
    with LogWriter(path, force=force) as writer:
        _write(writer, session, line, t_ns, rng)
    return session


def _write(
    writer: LogWriter, session: protocol.Session, line: Timeline, t_ns: IntArray, rng: np.random.Generator
) -> None:
    """All topics and records of one log."""
    xy, force, stick = (np.concatenate(part) for part in (line.xy_m, line.force_n, line.stick))
    true = sensors.Poses(xy, sensors.heading_of(line.steps, rng))
    odometry = sensors.odometry_of(true, rng)
    correction = sensors.localised(true, rng).after(odometry.inverse())
    received = _Clock(t_ns, rng)
    _write_scene(writer, session, received)
    _write_passes(writer, session, line, received)
    _write_wrench(writer, sensors.wrench_of(force, true.yaw_rad, rng), received)
    _write_odometry(writer, odometry, received)
    _write_transforms(writer, correction, odometry, received)
    joy = message_type("sensor_msgs/msg/Joy")
    for step in sensors.steps_at(sensors.STICK_HZ, line.steps):
        axes = np.round(np.clip(stick[step], -1, 1), 3).astype(np.float32)
        message = joy(header(t_ns[step], "joy"), axes, np.zeros(2, dtype=np.int32))
        writer.message("/joy", message, received.at(step))
    starts = [
        {"t_ns": int(t_ns[announced]), "cycle": one.cycle, "condition": one.condition}
        for one, (announced, _, _) in zip(session.passes, line.spans, strict=True)
    ]
    writer.metadata(SESSION_RECORD, {"participant": session.name, "trials": json.dumps(starts)})
    writer.metadata(TRUTH_RECORD, {"simulation": json.dumps(_truth(session, line, t_ns, (xy, force)))})


class _Clock:
    """When the recorder receives the measurement of a step."""

    def __init__(self, t_ns: IntArray, rng: np.random.Generator) -> None:
        self.t_ns = t_ns
        self._received = t_ns + rng.integers(*LATENCY_NS, size=len(t_ns))

    def at(self, step: int) -> int:
        """When the measurement of one step is received, ns."""
        return int(self._received[step])

    def at_steps(self, steps: IntArray) -> tuple[IntArray, IntArray]:
        """Measured and received, ns."""
        return self.t_ns[steps], self._received[steps]


def _transform(t_ns: int, parent: str, child: str, place: tuple[float, float, float], turn: FloatArray) -> Any:
    vector = message_type("geometry_msgs/msg/Vector3")(*(float(value) for value in place))
    quaternion = message_type("geometry_msgs/msg/Quaternion")(*(float(value) for value in turn))
    motion = message_type("geometry_msgs/msg/Transform")(vector, quaternion)
    return message_type("geometry_msgs/msg/TransformStamped")(header(t_ns, parent), child, motion)


def _write_scene(writer: LogWriter, session: protocol.Session, clock: _Clock) -> None:
    """Map, mounting of the sensor, and the person."""
    from scipy.spatial.transform import Rotation

    first = int(clock.t_ns[0])
    walls = session.hallway.walls
    rows, columns = walls.shape
    info = message_type("nav_msgs/msg/MapMetaData")(
        header(first, "").stamp, float(np.float32(walls.resolution_m)), columns, rows, planar_pose(*walls.origin_m, 0.0)
    )
    data = (100 * walls.occupied.astype(np.int8)).reshape(-1)
    writer.message("/map", message_type("nav_msgs/msg/OccupancyGrid")(header(first, "map"), info, data), clock.at(0))
    turn = Rotation.from_euler("xyz", sensors.SENSOR_RPY).as_quat()
    mounted = _transform(first, "base_link", "ft_sensor", sensors.SENSOR_AT_M, turn)
    writer.message("/tf_static", message_type("tf2_msgs/msg/TFMessage")([mounted]), clock.at(0))
    x, y = session.hallway.person_m
    people = message_type("geometry_msgs/msg/PoseArray")
    for step in sensors.steps_at(sensors.PEOPLE_HZ, len(clock.t_ns)):
        writer.message("/people", people(header(clock.t_ns[step], "map"), [planar_pose(x, y, np.pi)]), clock.at(step))


def _write_passes(writer: LogWriter, session: protocol.Session, line: Timeline, clock: _Clock) -> None:
    """The goal of each pass, and the robot's plan."""
    stamped = message_type("geometry_msgs/msg/PoseStamped")
    for one, (announced, _, _) in zip(session.passes, line.spans, strict=True):
        head = header(clock.t_ns[announced], "map")
        writer.message("/goal_pose", stamped(head, planar_pose(*session.goal_m, 0.0)), clock.at(announced))
        points = [stamped(head, planar_pose(x, y, 0.0)) for x, y in one.plan.xy_m[::4]]
        writer.message("/plan", message_type("nav_msgs/msg/Path")(head, points), clock.at(announced + 1))


def _write_wrench(writer: LogWriter, measured: tuple[FloatArray, FloatArray], clock: _Clock) -> None:
    vector = message_type("geometry_msgs/msg/Vector3")
    wrench = message_type("geometry_msgs/msg/Wrench")(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    template = message_type("geometry_msgs/msg/WrenchStamped")(header(0, "ft_sensor"), wrench)
    stamps, received = clock.at_steps(np.arange(len(clock.t_ns)))
    columns = {
        f"wrench.{part}.{axis}": values[:, i]
        for part, values in zip(("force", "torque"), measured, strict=True)
        for i, axis in enumerate("xyz")
    }
    writer.columns("/wrench", template, received, {"header.stamp": stamps, **columns})


def _write_odometry(writer: LogWriter, odometry: sensors.Poses, clock: _Clock) -> None:
    vector = message_type("geometry_msgs/msg/Vector3")
    twist = message_type("geometry_msgs/msg/Twist")(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    covariance = np.zeros(36)
    covariance[[0, 7, 35]] = 1e-3, 1e-3, 1e-2
    template = message_type("nav_msgs/msg/Odometry")(
        header(0, "odom"),
        "base_link",
        message_type("geometry_msgs/msg/PoseWithCovariance")(planar_pose(0, 0, 0), covariance),
        message_type("geometry_msgs/msg/TwistWithCovariance")(twist, covariance),
    )
    steps = sensors.steps_at(sensors.ODOMETRY_HZ, len(clock.t_ns))
    stamps, received = clock.at_steps(steps)
    seen, velocity = odometry.at(steps), np.gradient(odometry.xy_m, STEP_S, axis=0)[steps]
    cos, sin = np.cos(seen.yaw_rad), np.sin(seen.yaw_rad)
    columns = {
        "header.stamp": stamps,
        "pose.pose.position.x": np.round(seen.xy_m[:, 0], 5),
        "pose.pose.position.y": np.round(seen.xy_m[:, 1], 5),
        "pose.pose.orientation.z": np.sin(seen.yaw_rad / 2),
        "pose.pose.orientation.w": np.cos(seen.yaw_rad / 2),
        "twist.twist.linear.x": np.round(cos * velocity[:, 0] + sin * velocity[:, 1], 4),
        "twist.twist.linear.y": np.round(cos * velocity[:, 1] - sin * velocity[:, 0], 4),
    }
    writer.columns("/odom", template, received, columns)


def _write_transforms(writer: LogWriter, correction: sensors.Poses, odometry: sensors.Poses, clock: _Clock) -> None:
    """map -> odom from the localisation, odom -> base_link from the wheels."""
    tf = message_type("tf2_msgs/msg/TFMessage")
    for step in sensors.steps_at(sensors.TRANSFORM_HZ, len(clock.t_ns)):
        both = []
        for parent, child, poses in (("map", "odom", correction), ("odom", "base_link", odometry)):
            half = poses.yaw_rad[step] / 2
            turn = np.array([0.0, 0.0, np.sin(half), np.cos(half)])
            x, y = poses.xy_m[step]
            both.append(_transform(clock.t_ns[step], parent, child, (x, y, 0.0), turn))
        writer.message("/tf", tf(both), clock.at(step))


def _truth(
    session: protocol.Session, line: Timeline, t_ns: IntArray, happened: tuple[FloatArray, FloatArray]
) -> dict[str, Any]:
    """The truth, for tests: parameters, what differs from the default behaviour, and the passes every 10 ms."""
    xy, force = happened
    names = [parameter.name for parameter in session.truth.parameters]
    return {
        "theta": dict(zip(names, session.truth.theta, strict=True)),
        **(
            {}
            if session.learnt is None
            else {"theta_learnt_between_cycles": dict(zip(names, session.learnt.theta, strict=True))}
        ),
        **({"behaviour": changed} if (changed := session.behaviour.changed()) else {}),
        "step_s": STEP_S,
        "trials": [
            {
                "condition": one.condition,
                "cycle": one.cycle,
                "goal_t_ns": int(t_ns[announced]),
                "start_t_ns": int(t_ns[moving]),
                "stop_t_ns": int(t_ns[stop - 1]),
                "xy_mm_zlib": _packed(np.diff(np.round(xy[moving:stop] * 1000), axis=0, prepend=0)),
                "force_cn_zlib": _packed(np.round(force[moving:stop] * 100)),
            }
            for one, (announced, moving, stop) in zip(session.passes, line.spans, strict=True)
        ],
    }


def _packed(values: FloatArray) -> str:
    """Integers as base64 of zlib of little-endian int16, (n, 2) row by row."""
    return base64.b64encode(zlib.compress(values.astype("<i2").tobytes(), 9)).decode()
