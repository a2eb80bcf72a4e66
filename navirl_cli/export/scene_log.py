"""A scene under a reward as an MCAP log for Foxglove, Lichtblick and RViz.

Fields are written twice: as nav_msgs/OccupancyGrid in whole per cent, which every viewer shows, and as
foxglove_msgs/Grid with the numbers themselves as float32. Both are ROS 2 messages with their definitions in the file:
one decoder reads the log, and no package of Foxglove's is needed to write it.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.errors import LogError
from navirl_cli.export.scene_view import ROBOT_FRAME, SceneView
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.log_file import LogFile
from navirl_cli.logs.messages.writer import LogWriter, header, message_type, planar_pose, time_message
from navirl_cli.logs.sources import Source

#: All topics of the log but /tf begin so.
PREFIX: Final = "/navirl"
#: Record of what the whole per cents of the OccupancyGrids mean.
SCALES: Final = "navirl.scales"
#: Metres of an arrow for each newton.
M_PER_N: Final = 0.03
_ARROW, _CYLINDER, _FLOAT32 = 0, 3, 7
_BODY_M, _HEIGHT_M = 0.5, 1.7


def write_scene(
    output: Path, view: SceneView, beside: Source | None = None, *, force: bool
) -> tuple[list[Damage], list[str]]:
    """Write the log.

    Args:
        output: The file.
        view: The scene.
        beside: A recording whose messages are copied into the log as they are.
        force: Whether to replace an existing file.

    Returns:
        What of the recording could not be read, and the topics that were added.

    Raises:
        ArtefactError: The file cannot be written.
        LogError: The recording is no MCAP file, or holds such a scene already.
    """
    damage: list[Damage] = []
    with LogWriter(output, force=force) as writer:
        if beside is not None:
            damage += beside.damage
            for file in beside.files:
                damage += _copy(writer, file)
        t_ns, frame = view.problem.t_ns, view.problem.frame
        _write_fields(writer, view, t_ns, frame)
        for name, line in view.lines.items():
            writer.message(f"{PREFIX}/{name}", _path(line, t_ns, frame), t_ns)
        people = [_person(k, place, t_ns, frame) for k, place in enumerate(view.problem.scene.people_m)]
        pushes = [
            _arrow(k, one.place_m, one.force_n, one.t_ns, frame) for k, one in enumerate(view.pushes, len(people))
        ]
        array = message_type("visualization_msgs/msg/MarkerArray")
        writer.message(f"{PREFIX}/people", array(people), t_ns)
        for marker, one in zip(pushes, view.pushes, strict=True):
            writer.message(f"{PREFIX}/pushes", array([marker]), one.t_ns)
        if beside is None:  # a recording has its own
            _write_poses(writer, view, frame)
        topics = writer.topics
    return damage, topics


def _copy(writer: LogWriter, file: Path) -> list[Damage]:
    """Copy the messages of a file, and what is unreadable of it."""
    metadata = _channel_metadata(file)
    with LogFile(file) as log:
        for batch in log.batches(lambda _: True):
            if batch.channel.topic.startswith(f"{PREFIX}/"):
                raise LogError(
                    f"{file}/{batch.channel.topic}: expected a recording, found one with such a scene in it; name the "
                    "original in `with`"
                )
            writer.copy(batch, metadata.get(batch.channel.id))
        for name, values in log.metadata:
            writer.metadata(name, values)
        return log.damage


def _channel_metadata(file: Path) -> dict[int, dict[str, str]]:
    """The metadata of channels, such as the quality of service that rosbag2 writes, as far as the summary holds it."""
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader

    try:
        with file.open("rb") as stream:
            summary = SeekingReader(stream).get_summary()
    except (McapError, OSError, ValueError, EOFError):
        return {}
    return {} if summary is None else {number: dict(one.metadata) for number, one in summary.channels.items()}


def _write_fields(writer: LogWriter, view: SceneView, t_ns: int, frame: str) -> None:
    grid = view.problem.scene.lattice.grid
    corner = planar_pose(*grid.origin_m, 0.0)
    writer.message(f"{PREFIX}/map", _occupancy(view, np.where(grid.occupied, 100, 0)), t_ns)
    scales = {}
    for name, field in (("reward", view.reward), ("visits", view.visits)):
        low, high = float(np.nanmin(field)), float(np.nanmax(field))
        # a high reward is free, a high number of visits is full
        none, full = (high, low) if name == "reward" else (0.0, high)
        share = (field - none) / (full - none) if full != none else field * 0
        percent = np.where(np.isnan(field), -1, np.round(100 * np.nan_to_num(share)))
        scales[name] = f"0 is {none:.6g}, 100 is {full:.6g}, -1 where the robot cannot be"
        writer.message(f"{PREFIX}/{name}", _occupancy(view, percent), t_ns)
        message = message_type("foxglove_msgs/msg/Grid")(
            timestamp=time_message(t_ns),
            frame_id=frame,
            pose=corner,
            column_count=grid.shape[1],
            cell_size=message_type("foxglove_msgs/msg/Vector2")(grid.resolution_m, grid.resolution_m),
            row_stride=4 * grid.shape[1],
            cell_stride=4,
            fields=[message_type("foxglove_msgs/msg/PackedElementField")(name, 0, _FLOAT32)],
            data=np.frombuffer(field.astype("<f4").tobytes(), dtype=np.uint8),
        )
        writer.message(f"{PREFIX}/{name}_grid", message, t_ns)
    writer.metadata(SCALES, scales)


def _occupancy(view: SceneView, percent: FloatArray | IntArray) -> Any:
    """A nav_msgs/OccupancyGrid of the map's geometry."""
    grid, t_ns = view.problem.scene.lattice.grid, view.problem.t_ns
    rows, columns = grid.shape
    info = message_type("nav_msgs/msg/MapMetaData")(
        time_message(t_ns), grid.resolution_m, columns, rows, planar_pose(*grid.origin_m, 0.0)
    )
    data = percent.astype(np.int8).ravel()
    return message_type("nav_msgs/msg/OccupancyGrid")(header(t_ns, view.problem.frame), info, data)


def _path(line_m: FloatArray, t_ns: int, frame: str) -> Any:
    """A nav_msgs/Path whose poses look along it."""
    head = header(t_ns, frame)
    steps = np.diff(line_m, axis=0)
    yaw = np.arctan2(steps[:, 1], steps[:, 0])
    pose = message_type("geometry_msgs/msg/PoseStamped")
    poses = [pose(head, planar_pose(x, y, a)) for (x, y), a in zip(line_m, np.append(yaw, yaw[-1:]), strict=True)]
    return message_type("nav_msgs/msg/Path")(head, poses)


def _person(number: int, place_m: FloatArray, t_ns: int, frame: str) -> Any:
    """A person as a cylinder."""
    x, y = place_m
    pose = planar_pose(x, y, 0.0)
    pose.position.z = _HEIGHT_M / 2
    return _marker(number, _CYLINDER, "people", pose, (_BODY_M, _BODY_M, _HEIGHT_M), (0.1, 0.3, 0.8), t_ns, frame)


def _arrow(number: int, place_m: FloatArray, force_n: FloatArray, t_ns: int, frame: str) -> Any:
    """A push as an arrow from the place of the robot, as long as the force is large."""
    x, y = place_m
    pose = planar_pose(x, y, float(np.arctan2(force_n[1], force_n[0])))
    size = (M_PER_N * float(np.hypot(*force_n)), 0.06, 0.06)
    return _marker(number, _ARROW, "pushes", pose, size, (0.85, 0.2, 0.1), t_ns, frame)


def _marker(
    number: int,
    kind: int,
    namespace: str,
    pose: Any,
    size_m: tuple[float, float, float],
    colour: tuple[float, float, float],
    t_ns: int,
    frame: str,
) -> Any:
    """A visualization_msgs/Marker that stays."""
    return message_type("visualization_msgs/msg/Marker")(
        header=header(t_ns, frame),
        ns=namespace,
        id=number,
        type=kind,
        action=0,
        pose=pose,
        scale=message_type("geometry_msgs/msg/Vector3")(*size_m),
        color=message_type("std_msgs/msg/ColorRGBA")(*colour, 1.0),
        lifetime=message_type("builtin_interfaces/msg/Duration")(0, 0),
        frame_locked=False,
        points=[],
        colors=[],
        texture_resource="",
        texture=message_type("sensor_msgs/msg/CompressedImage")(header(0, ""), "", np.empty(0, dtype=np.uint8)),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=message_type("visualization_msgs/msg/MeshFile")("", np.empty(0, dtype=np.uint8)),
        mesh_use_embedded_materials=False,
    )


def _write_poses(writer: LogWriter, view: SceneView, frame: str) -> None:
    """The robot's motion as tf."""
    stamped, many = message_type("geometry_msgs/msg/TransformStamped"), message_type("tf2_msgs/msg/TFMessage")
    for t_ns, (x, y), yaw in zip(*view.poses(), strict=True):
        turn = planar_pose(x, y, yaw).orientation
        move = message_type("geometry_msgs/msg/Vector3")(float(x), float(y), 0.0)
        transform = message_type("geometry_msgs/msg/Transform")(move, turn)
        writer.message("/tf", many([stamped(header(int(t_ns), frame), ROBOT_FRAME, transform)]), int(t_ns))
