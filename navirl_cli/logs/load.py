"""A log's columns put on one clock and into one frame."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.frames import TransformTree
from navirl_cli.logs.reader import Contents, Series, read, scan
from navirl_cli.logs.recording import (
    SESSION_RECORD,
    Declared,
    FloatArray,
    IntArray,
    Occupancy,
    Recording,
    Wrench,
)
from navirl_cli.logs.topics import topics_by_role

STAMP, FRAME = "header.stamp", "header.frame_id"
_POSITION = tuple(f"pose.pose.position.{axis}" for axis in "xyz")
_ORIENTATION = tuple(f"pose.pose.orientation.{axis}" for axis in "xyzw")
_FORCE = tuple(f"wrench.force.{axis}" for axis in "xyz")
#: What is read as columns; of other roles whole messages are read.
_FIELDS: dict[str, tuple[str, ...]] = {
    "wrench": (STAMP, FRAME, *_FORCE),
    "odometry": (STAMP, FRAME, "child_frame_id", *_POSITION, *_ORIENTATION),
}
_NS = 1_000_000_000


def load_recording(
    path: Path, chosen: Mapping[str, str] | None = None, progress: Callable[[int, int], None] | None = None
) -> Recording:
    """Read what an extraction needs from a log.

    Args:
        path: An MCAP file.
        chosen: Topics by role, where there are several that could be meant.
        progress: Called with bytes done and bytes in all.

    Returns:
        The recording, in the frame of the log's map, on the clock of the header stamps.

    Raises:
        LogError: The log cannot be read or lacks what is needed.
        FrameError: tf does not connect the frames.
    """
    contents = scan(path)
    roles = topics_by_role(contents, chosen or {})
    result = read(path, {topic: _FIELDS.get(role) for role, topic in roles.items()}, progress)
    series = {role: result.series[topic] for role, topic in roles.items() if topic in result.series}
    for role in ("wrench", "odometry", "map"):
        if role not in series or len(series[role]) == 0:
            raise LogError(f"{path}: no message on the {role} topic {roles[role]} could be read")
    tree = TransformTree.from_messages(_messages(series, "tf_static"), _messages(series, "tf"))
    message = series["map"].messages[-1]
    fixed = message.header.frame_id
    t_ns, xy, yaw, notes = _poses(path, series["odometry"], tree, fixed)
    goals, people = _messages(series, "goal"), _messages(series, "people")
    goal_t_ns, goal_m = _placed(tree, fixed, goals, [[goal.pose] for goal in goals])
    people_t_ns, people_m = _placed(tree, fixed, people, [message.poses for message in people])
    joy = _messages(series, "joystick")
    session = _session(contents)
    return Recording(
        log=path.name,
        participant=session.get("participant"),
        t_ns=t_ns,
        xy_m=xy,
        yaw_rad=yaw,
        wrench=_wrench(path, series["wrench"], tree, str(series["odometry"].columns["child_frame_id"][0])),
        occupancy=_occupancy(path, message),
        goal_t_ns=goal_t_ns,
        goal_m=np.concatenate([*goal_m, np.zeros((0, 2))]),
        people_t_ns=people_t_ns,
        people_m=tuple(people_m),
        command_t_ns=np.array([_stamp_ns(message) for message in joy], dtype=np.int64),
        command=np.array([np.abs(message.axes).max(initial=0.0) for message in joy], dtype=float),
        declared=_declared(path, session),
        damage=tuple(str(damage) for damage in result.damage),
        notes=tuple(notes),
    )


def _messages(series: Mapping[str, Series], role: str) -> list[Any]:
    return series[role].messages if role in series else []


def _stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * _NS + int(message.header.stamp.nanosec)


def _in_order(t_ns: IntArray) -> IntArray:
    """Rows in order of time; of equal stamps the first."""
    _, rows = np.unique(t_ns, return_index=True)
    return rows


def _poses(
    path: Path, odometry: Series, tree: TransformTree, fixed: str
) -> tuple[IntArray, FloatArray, FloatArray, list[str]]:
    """Times, positions and headings of the robot in the fixed frame."""
    from scipy.spatial.transform import Rotation

    columns = odometry.columns
    rows = _in_order(columns[STAMP])
    frame, base = str(columns[FRAME][0]), str(columns["child_frame_id"][0])
    t_ns, notes = columns[STAMP][rows], []
    try:
        span = tree.span(fixed, frame) if frame.lstrip("/") != fixed.lstrip("/") else None
    except FrameError as error:
        raise FrameError(f"{path}: odometry of {base!r} is given in frame {frame!r}: {error}") from error
    if span is not None:
        # Before the localisation's first word nobody knows where the robot is.
        known = (t_ns >= span[0] - _NS) & (t_ns <= span[1] + _NS)
        if not known.any():
            raise FrameError(
                f"{path}: the transform from {frame!r} to {fixed!r} is known at no time of the odometry; "
                "check that tf and odometry are stamped by the same clock"
            )
        if not known.all():
            notes.append(f"{path.name}: {int((~known).sum())} poses lie outside the time that tf covers; left out")
        t_ns, rows = t_ns[known], rows[known]
    into = tree.lookup(fixed, frame, t_ns)
    points = np.stack([columns[name][rows] for name in _POSITION], axis=1)
    turns = into.rotation * Rotation.from_quat(np.stack([columns[name][rows] for name in _ORIENTATION], axis=1))
    ahead = turns.apply((1.0, 0.0, 0.0))
    return t_ns, into.apply(points)[:, :2], np.arctan2(ahead[:, 1], ahead[:, 0]), notes


def _wrench(path: Path, wrench: Series, tree: TransformTree, base: str) -> Wrench:
    """Forces in the sensor's frame, and how that frame is mounted."""
    columns = wrench.columns
    frame = str(columns[FRAME][0])
    rows = _in_order(columns[STAMP])
    try:
        mounted = tree.lookup(base, frame, columns[STAMP][rows[:1]])
    except FrameError as error:
        raise FrameError(f"{path}: the wrench is given in frame {frame!r}: {error}") from error
    force = np.stack([columns[name][rows] for name in _FORCE], axis=1)
    return Wrench(columns[STAMP][rows], force, mounted.rotation.as_matrix()[0])


def _occupancy(path: Path, message: Any) -> Occupancy:
    """The map, whose axes must be those of its frame."""
    origin, turn = message.info.origin.position, message.info.origin.orientation
    yaw = float(2 * np.arctan2(turn.z, turn.w))
    if abs(np.sin(yaw / 2)) > 1e-6:
        raise LogError(
            f"{path}: expected a map whose cells run along its frame's axes, found one turned by "
            f"{np.degrees(yaw):.1f} degrees; save the map with an origin of yaw 0"
        )
    data = np.asarray(message.data, dtype=np.int8).reshape(message.info.height, message.info.width)
    # A float32 of 0.1 is 0.10000000149 as a double: the shortest decimal is what was meant.
    return Occupancy(data, float(str(np.float32(message.info.resolution))), (float(origin.x), float(origin.y)))


def _placed(
    tree: TransformTree, fixed: str, messages: list[Any], poses: list[list[Any]]
) -> tuple[IntArray, list[FloatArray]]:
    """Positions of poses in the fixed frame, by message."""
    times = np.array([_stamp_ns(message) for message in messages], dtype=np.int64)
    placed = []
    for t_ns, message, group in zip(times, messages, poses, strict=True):
        points = np.array([(pose.position.x, pose.position.y, pose.position.z) for pose in group]).reshape(-1, 3)
        frame = message.header.frame_id
        if frame.lstrip("/") != fixed.lstrip("/"):
            points = tree.lookup(fixed, frame, np.full(len(points), t_ns)).apply(points)
        placed.append(points[:, :2])
    order = np.argsort(times, kind="stable")
    return times[order], [placed[row] for row in order]


def _session(contents: Contents) -> dict[str, str]:
    """The experimenter's record of the session, the last where there are several."""
    records = contents.metadata.get(SESSION_RECORD, ())
    return records[-1] if records else {}


def _declared(path: Path, session: Mapping[str, str]) -> tuple[Declared, ...]:
    """What the session record says of the trials."""
    try:
        return tuple(
            Declared(int(entry["t_ns"]), entry.get("cycle"), entry.get("condition"))
            for entry in json.loads(session.get("trials", "[]"))
        )
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise LogError(
            f"{path}: metadata record {SESSION_RECORD}, key trials: expected a JSON list of objects with t_ns, cycle "
            f"and condition, found {session['trials'][:60]!r} ({error})"
        ) from error
