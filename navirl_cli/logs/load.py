"""A log's columns put on one clock and into one frame."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.frames import Transforms, TransformTree
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
from navirl_cli.logs.stamps import STAMP, Clock
from navirl_cli.logs.topics import topics_by_role

FRAME = "header.frame_id"
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
    clock = Clock.of(series["odometry"])
    tree = TransformTree.from_messages(_messages(series, "tf_static"), _messages(series, "tf"))
    message = series["map"].messages[-1]
    fixed = message.header.frame_id
    odometry, notes = _sound(path, roles["odometry"], series["odometry"], (*_POSITION, *_ORIENTATION))
    t_ns, xy, yaw = _poses(path, odometry, clock, tree, fixed, notes)
    goal_t_ns, goal_m = _placed(path, "goal", series, clock, tree, fixed, notes)
    people_t_ns, people_m = _placed(path, "people", series, clock, tree, fixed, notes)
    wrench, dropped = _sound(path, roles["wrench"], series["wrench"], _FORCE)
    session = _session(contents)
    command_t_ns, command = _deflection(series, clock)
    return Recording(
        log=path.name,
        participant=session.get("participant"),
        t_ns=t_ns,
        xy_m=xy,
        yaw_rad=yaw,
        wrench=_wrench(path, wrench, clock, tree, str(odometry.columns["child_frame_id"][0])),
        occupancy=_occupancy(path, message),
        goal_t_ns=goal_t_ns,
        goal_m=np.concatenate([*goal_m, np.zeros((0, 2))]),
        people_t_ns=people_t_ns,
        people_m=tuple(people_m),
        command_t_ns=command_t_ns,
        command=command,
        declared=_declared(path, session),
        damage=tuple(str(damage) for damage in result.damage),
        notes=(*notes, *dropped, *clock.notes(path)),
    )


def _messages(series: Mapping[str, Series], role: str) -> list[Any]:
    return series[role].messages if role in series else []


def _deflection(series: Mapping[str, Series], clock: Clock) -> tuple[IntArray, FloatArray]:
    """(c,) ns and (c,) how far the joystick is from where its axes rest: a pad's triggers rest at 1."""
    joystick = series.get("joystick")
    if joystick is None or len(joystick) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    width = max(len(message.axes) for message in joystick.messages)
    axes = np.full((len(joystick), max(width, 1)), np.nan)
    for row, message in enumerate(joystick.messages):
        axes[row, : len(message.axes)] = message.axes
    axes = np.where(np.isfinite(axes), axes, 0.0)
    away = np.abs(axes - np.median(axes, axis=0)).max(axis=1)
    times = clock.stamps(joystick)
    order = np.argsort(times, kind="stable")
    return times[order], away[order]


def _sound(path: Path, topic: str, series: Series, fields: tuple[str, ...]) -> tuple[Series, list[str]]:
    """A series without messages whose numbers are not finite, or whose quaternion is none; and a note of them."""
    values = np.stack([series.columns[name] for name in fields], axis=1)
    good = np.isfinite(values).all(axis=1)
    turn = [fields.index(name) for name in _ORIENTATION if name in fields]
    if turn:
        good &= np.nan_to_num(np.square(values[:, turn]).sum(axis=1)) > 1e-6
    if good.all():
        return series, []
    if not good.any():
        raise LogError(f"{path}: topic {topic}: expected numbers, found none that are finite in any of its messages")
    columns = {name: column[good] for name, column in series.columns.items()}
    kept = replace(series, log_time_ns=series.log_time_ns[good], columns=columns)
    return kept, [f"{path.name}: {int((~good).sum())} messages on {topic} hold no finite numbers; left out"]


def _in_order(t_ns: IntArray) -> IntArray:
    """Rows in order of time; of equal stamps the first."""
    _, rows = np.unique(t_ns, return_index=True)
    return rows


def _poses(
    path: Path, odometry: Series, clock: Clock, tree: TransformTree, fixed: str, notes: list[str]
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Times, positions and headings of the robot in the fixed frame."""
    from scipy.spatial.transform import Rotation

    columns = odometry.columns
    stamps = clock.stamps(odometry)
    rows = _in_order(stamps)
    frame, base = str(columns[FRAME][0]), str(columns["child_frame_id"][0])
    t_ns = stamps[rows]
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
    turns = Rotation.from_quat(np.stack([columns[name][rows] for name in _ORIENTATION], axis=1))
    poses = into.after(Transforms(turns, points))
    return t_ns, poses.translation_m[:, :2], poses.yaw_rad


def _wrench(path: Path, wrench: Series, clock: Clock, tree: TransformTree, base: str) -> Wrench:
    """Forces in the sensor's frame, and how that frame is mounted."""
    columns = wrench.columns
    frame = str(columns[FRAME][0])
    stamps = clock.stamps(wrench)
    rows = _in_order(stamps)
    try:
        moves = tree.span(base, frame) is not None
        mounted = tree.lookup(base, frame, stamps[rows[:1]])
    except FrameError as error:
        raise FrameError(f"{path}: the wrench is given in frame {frame!r}: {error}") from error
    if moves:
        raise FrameError(
            f"{path}: the wrench's frame {frame!r} moves on {base!r}: expected a fixed mounting in /tf_static; "
            "record the wrench in a frame that is fixed on the robot"
        )
    force = np.stack([columns[name][rows] for name in _FORCE], axis=1)
    return Wrench(stamps[rows], force, mounted.rotation.as_matrix()[0])


def _occupancy(path: Path, message: Any) -> Occupancy:
    """The map, whose axes must be those of its frame."""
    info = message.info
    origin, turn = info.origin.position, info.origin.orientation
    yaw = float(2 * np.arctan2(turn.z, turn.w))
    if abs(np.sin(yaw / 2)) > 1e-6:
        raise LogError(
            f"{path}: expected a map whose cells run along its frame's axes, found one turned by "
            f"{np.degrees(yaw):.1f} degrees; save the map with an origin of yaw 0"
        )
    if not (0 < info.resolution < np.inf and np.isfinite([origin.x, origin.y]).all()):
        raise LogError(
            f"{path}: expected a map with a positive resolution and a finite origin, found {info.resolution}"
        )
    data = np.asarray(message.data, dtype=np.int8)
    if data.size != info.height * info.width or data.size == 0:
        raise LogError(
            f"{path}: expected a map of {info.height} x {info.width} cells, found {data.size}; record the map anew"
        )
    # A float32 of 0.1 is 0.10000000149 as a double: the shortest decimal is what was meant.
    resolution = float(str(np.float32(info.resolution)))
    return Occupancy(data.reshape(info.height, info.width), resolution, (float(origin.x), float(origin.y)))


def _placed(
    path: Path,
    role: str,
    series: Mapping[str, Series],
    clock: Clock,
    tree: TransformTree,
    fixed: str,
    notes: list[str],
) -> tuple[IntArray, list[FloatArray]]:
    """Times of a role's messages, and the positions in each, in the fixed frame; what cannot be placed is noted."""
    if role not in series or len(series[role]) == 0:
        return np.zeros(0, dtype=np.int64), []
    messages, stamps = series[role].messages, clock.stamps(series[role])
    times, placed, lost = [], [], []
    for t_ns, message in zip(stamps.tolist(), messages, strict=True):
        group = message.poses if hasattr(message, "poses") else [message.pose]
        points = np.array([(pose.position.x, pose.position.y, pose.position.z) for pose in group]).reshape(-1, 3)
        try:
            if message.header.frame_id.lstrip("/") != fixed.lstrip("/"):
                points = tree.lookup(fixed, message.header.frame_id, np.full(len(points), t_ns)).apply(points)
        except FrameError as error:
            lost.append(str(error))
            continue
        if not np.isfinite(points).all():
            lost.append("its numbers are not finite")
            continue
        times.append(t_ns)
        placed.append(points[:, :2])
    if lost:
        notes.append(f"{path.name}: {len(lost)} messages on the {role} topic left out: {lost[0]}")
    order = np.argsort(times, kind="stable")
    return np.array(times, dtype=np.int64)[order], [placed[row] for row in order]


def _session(contents: Contents) -> dict[str, str]:
    """The experimenter's record of the session, the last where there are several."""
    records = contents.metadata.get(SESSION_RECORD, ())
    return records[-1] if records else {}


def _declared(path: Path, session: Mapping[str, str]) -> tuple[Declared, ...]:
    """What the session record says of the trials."""
    try:
        return tuple(_declared_trial(entry) for entry in json.loads(session.get("trials", "[]")))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise LogError(
            f"{path}: metadata record {SESSION_RECORD}, key trials: expected a JSON list of objects with t_ns (ns), "
            f"cycle (1, 2, ...) and condition, found {session['trials'][:60]!r} ({error})"
        ) from error


def _declared_trial(entry: Mapping[str, Any]) -> Declared:
    """One entry, with its types checked: a number as text would go on as text."""
    t_ns, cycle, condition = entry["t_ns"], entry.get("cycle"), entry.get("condition")
    if type(t_ns) is not int or (cycle is not None and (type(cycle) is not int or cycle < 1)):
        raise TypeError(f"t_ns {t_ns!r} and cycle {cycle!r} must be whole numbers, a cycle from 1 on")
    if not (condition is None or isinstance(condition, str)):
        raise TypeError(f"condition {condition!r} must be a text")
    return Declared(t_ns, cycle, condition)
