"""Logs as Nav2 robots record them, message by message: any topic, any frame, any clock."""

import os
import struct
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_factory import Message, forge
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

#: A TurtleBot's run under Nav2, which is not part of the project.
REAL = Path(os.environ.get("NAVIRL_LOGS_DIR", Path(__file__).resolve().parent.parent.parent / "shared" / "logs"))
REAL /= "nav2_turtlebot.mcap"
needs_real = pytest.mark.skipif(not REAL.exists(), reason=f"no {REAL}: set NAVIRL_LOGS_DIR to the folder that holds it")
#: When runs begin by the recorder's clock, ns.
START_NS = 1_750_000_000_123_456_789
#: Types that no ROS distribution ships, by their packages' definitions.
FOREIGN = {
    "people_msgs/msg/Person": "string name\ngeometry_msgs/Point position\ngeometry_msgs/Point velocity\n"
    "float64 reliability\nstring[] tagnames\nstring[] tags\n",
    "people_msgs/msg/People": "std_msgs/Header header\npeople_msgs/Person[] people\n",
    "spencer_tracking_msgs/msg/TrackedPerson": "uint64 track_id\nbool is_occluded\nbool is_matched\n"
    "uint64 detection_id\nbuiltin_interfaces/Duration age\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist\n",
    "spencer_tracking_msgs/msg/TrackedPersons": "std_msgs/Header header\n"
    "spencer_tracking_msgs/TrackedPerson[] tracks\n",
    "hunav_msgs/msg/Agent": "uint8 PERSON=1\nuint8 ROBOT=2\nint32 id\nuint8 type\nuint8 skin\nuint8 behavior\n"
    "string name\nuint8 behavior_state\nint8 group_id\ngeometry_msgs/Pose position\nfloat32 yaw\n"
    "geometry_msgs/Twist velocity\nfloat32 desired_velocity\nfloat32 radius\nfloat32 linear_vel\n"
    "float32 angular_vel\ngeometry_msgs/Pose[] goals\nbool cyclic_goals\nfloat32 goal_radius\n"
    "geometry_msgs/Point[] closest_obs\n",
    "hunav_msgs/msg/Agents": "std_msgs/Header header\nhunav_msgs/Agent[] agents\n",
}
STORE = get_typestore(Stores.ROS2_HUMBLE)
for _name, _text in FOREIGN.items():
    STORE.register(get_types_from_msg(_text, _name))

Times = np.ndarray[Any, Any]
#: What a clock shows at a true time, s since the run's begin -> ns.
Clock = Callable[[Times], Times]


class Log:
    """Messages that become a log, in the order in which they were added."""

    def __init__(self) -> None:
        self.messages: list[Message] = []

    def add(self, topic: str, message: Any, receipt_ns: int) -> None:
        data = bytes(STORE.serialize_cdr(message, message.__msgtype__))
        self.messages.append(Message(topic, message.__msgtype__, int(receipt_ns), data))

    def write(self, path: Path, **options: Any) -> Path:
        """Write them in order of receipt."""
        definitions = {name: ("ros2msg", STORE.generate_msgdef(name, ros_version=2)[0]) for name in FOREIGN}
        messages = sorted(self.messages, key=lambda one: one.log_time_ns)
        return forge(path, messages, definitions=definitions, **{"chunk_size": 1 << 17, **options})


def build(name: str, /, **fields: Any) -> Any:
    return STORE.types[name](**fields)


def time(t_ns: int) -> Any:
    return build("builtin_interfaces/msg/Time", sec=int(t_ns) // 10**9, nanosec=int(t_ns) % 10**9)


def header(t_ns: int, frame: str) -> Any:
    return build("std_msgs/msg/Header", stamp=time(t_ns), frame_id=frame)


def point(x: float, y: float) -> Any:
    return build("geometry_msgs/msg/Point", x=float(x), y=float(y), z=0.0)


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
    return build("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))


def turn(yaw: float) -> Any:
    return build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2)))


def pose(x: float, y: float, yaw: float = 0.0) -> Any:
    return build("geometry_msgs/msg/Pose", position=point(x, y), orientation=turn(yaw))


def covariant(x: float, y: float, yaw: float = 0.0) -> Any:
    return build("geometry_msgs/msg/PoseWithCovariance", pose=pose(x, y, yaw), covariance=np.zeros(36))


def twist(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Any:
    return build("geometry_msgs/msg/Twist", linear=vector(x, y), angular=vector(0.0, 0.0, yaw))


def twist_stamped(t_ns: int, x: float) -> Any:
    return build("geometry_msgs/msg/TwistStamped", header=header(t_ns, ""), twist=twist(x))


def joy(t_ns: int, axes: Sequence[float]) -> Any:
    return build(
        "sensor_msgs/msg/Joy",
        header=header(t_ns, ""),
        axes=np.array(axes, dtype=np.float32),
        buttons=np.zeros(0, dtype=np.int32),
    )


def odometry(
    t_ns: int, x: float, y: float, yaw: float = 0.0, frame: str = "odom", child: str = "base_link", v: float = 0.0
) -> Any:
    moving = build("geometry_msgs/msg/TwistWithCovariance", twist=twist(v), covariance=np.zeros(36))
    return build(
        "nav_msgs/msg/Odometry",
        header=header(t_ns, frame),
        child_frame_id=child,
        pose=covariant(x, y, yaw),
        twist=moving,
    )


def wrench(t_ns: int, x: float = 0.0, y: float = 0.0, z: float = 0.0, frame: str = "base_link") -> Any:
    body = build("geometry_msgs/msg/Wrench", force=vector(x, y, z), torque=vector())
    return build("geometry_msgs/msg/WrenchStamped", header=header(t_ns, frame), wrench=body)


def pose_stamped(t_ns: int, x: float, y: float, frame: str = "map") -> Any:
    return build("geometry_msgs/msg/PoseStamped", header=header(t_ns, frame), pose=pose(x, y))


def amcl_pose(t_ns: int, x: float, y: float, yaw: float = 0.0, frame: str = "map") -> Any:
    return build("geometry_msgs/msg/PoseWithCovarianceStamped", header=header(t_ns, frame), pose=covariant(x, y, yaw))


def pose_array(t_ns: int, points: Sequence[tuple[float, float]], frame: str = "map") -> Any:
    return build("geometry_msgs/msg/PoseArray", header=header(t_ns, frame), poses=[pose(*one) for one in points])


def path(t_ns: int, points: Sequence[tuple[float, float]], frame: str = "map") -> Any:
    poses = [pose_stamped(t_ns, x, y, frame) for x, y in points]
    return build("nav_msgs/msg/Path", header=header(t_ns, frame), poses=poses)


def people(t_ns: int, named: Sequence[tuple[str, float, float]], frame: str = "map") -> Any:
    listed = [
        build(
            "people_msgs/msg/Person",
            name=name,
            position=point(x, y),
            velocity=point(0, 0),
            reliability=1.0,
            tagnames=["group"],
            tags=["a" * number],
        )
        for number, (name, x, y) in enumerate(named)
    ]
    return build("people_msgs/msg/People", header=header(t_ns, frame), people=listed)


def tracked(t_ns: int, numbered: Sequence[tuple[int, float, float]], frame: str = "map") -> Any:
    still = build("geometry_msgs/msg/TwistWithCovariance", twist=twist(), covariance=np.zeros(36))
    tracks = [
        build(
            "spencer_tracking_msgs/msg/TrackedPerson",
            track_id=number,
            is_occluded=False,
            is_matched=True,
            detection_id=7,
            age=build("builtin_interfaces/msg/Duration", sec=1, nanosec=2),
            pose=covariant(x, y),
            twist=still,
        )
        for number, x, y in numbered
    ]
    return build("spencer_tracking_msgs/msg/TrackedPersons", header=header(t_ns, frame), tracks=tracks)


def agents(t_ns: int, listed: Sequence[tuple[int, int, float, float]], frame: str = "map") -> Any:
    """Agents as (id, type, x, y)."""
    made = [
        build(
            "hunav_msgs/msg/Agent",
            PERSON=1,
            ROBOT=2,
            id=number,
            type=kind,
            skin=0,
            behavior=1,
            name=f"agent{number}",
            behavior_state=0,
            group_id=-1,
            position=pose(x, y),
            yaw=0.0,
            velocity=twist(),
            desired_velocity=1.0,
            radius=0.3,
            linear_vel=0.0,
            angular_vel=0.0,
            goals=[pose(0, 0)] * number,
            cyclic_goals=True,
            goal_radius=0.3,
            closest_obs=[],
        )
        for number, kind, x, y in listed
    ]
    return build("hunav_msgs/msg/Agents", header=header(t_ns, frame), agents=made)


def marker(
    t_ns: int, number: int, x: float, y: float, frame: str = "map", kind: int = 3, action: int = 0, space: str = "p"
) -> Any:
    color = build("std_msgs/msg/ColorRGBA", r=1.0, g=0.0, b=0.0, a=1.0)
    nothing = np.zeros(0, dtype=np.uint8)
    return build(
        "visualization_msgs/msg/Marker",
        header=header(t_ns, frame),
        ns=space,
        id=number,
        type=kind,
        action=action,
        pose=pose(x, y),
        scale=vector(0.5, 0.5, 1.7),
        color=color,
        lifetime=build("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=[],
        colors=[],
        texture_resource="",
        texture=build("sensor_msgs/msg/CompressedImage", header=header(0, ""), format="", data=nothing),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=build("visualization_msgs/msg/MeshFile", filename="", data=nothing),
        mesh_use_embedded_materials=False,
    )


def markers(listed: Sequence[Any]) -> Any:
    return build("visualization_msgs/msg/MarkerArray", markers=list(listed))


def transform(t_ns: int, parent: str, child: str, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Any:
    motion = build("geometry_msgs/msg/Transform", translation=vector(x, y), rotation=turn(yaw))
    return build(
        "geometry_msgs/msg/TransformStamped", header=header(t_ns, parent), child_frame_id=child, transform=motion
    )


def tf(*transforms: Any) -> Any:
    return build("tf2_msgs/msg/TFMessage", transforms=list(transforms))


def grid(
    rows: int = 4,
    columns: int = 6,
    *,
    frame: str = "map",
    resolution: float = 0.05,
    origin: tuple[float, float] = (-1.0, -2.0),
    yaw: float = 0.0,
    value: int = 0,
) -> Any:
    info = build(
        "nav_msgs/msg/MapMetaData",
        map_load_time=time(0),
        resolution=resolution,
        width=columns,
        height=rows,
        origin=pose(*origin, yaw),
    )
    data = np.full(rows * columns, value, dtype=np.int8)
    return build("nav_msgs/msg/OccupancyGrid", header=header(0, frame), info=info, data=data)


def unix(seconds: Times) -> Times:
    """The recorder's clock."""
    return START_NS + np.round(np.asarray(seconds) * 1e9).astype(np.int64)


def off(by_s: float, rate: float = 1.0) -> Clock:
    """A clock that is off the recorder's by so much at first, and goes at a rate."""
    return lambda seconds: unix(by_s + rate * np.asarray(seconds))


def simulated(from_s: float, rate: float = 1.0) -> Clock:
    """A clock that shows so many seconds at first."""
    return lambda seconds: np.round((from_s + rate * np.asarray(seconds)) * 1e9).astype(np.int64)


def never(seconds: Times) -> Times:
    """A clock that always shows 0."""
    return np.zeros(np.shape(seconds), dtype=np.int64)


def received(seconds: Times, rng: np.random.Generator, late_s: float = 0.002) -> Times:
    """Times of receipt of messages that were measured at true times: late by chance, and never out of order."""
    return np.maximum.accumulate(unix(seconds + rng.exponential(late_s, len(seconds))))


def drive(
    lasts_s: float = 20.0,
    *,
    odom: Clock = unix,
    wrench_clock: Clock = unix,
    tf_clock: Clock = unix,
    stall: tuple[float, float] = (0.0, 0.0),
    skip: Iterable[str] = (),
) -> Log:
    """A run whose numbers give the true time s: the robot's x and map -> odom's y are s / 10, the force is s N.

    Args:
        lasts_s: How long, s.
        odom: Clock of the odometry's stamps.
        wrench_clock: Of the wrench's.
        tf_clock: Of tf's.
        stall: From when to when, s, the recorder receives nothing; then all at once.
        skip: Topics to leave out.
    """
    rng = np.random.default_rng(5)
    log = Log()
    clocks = {"/odom": odom, "/wrench": wrench_clock, "/tf": tf_clock}
    for topic, (typename, seconds, place, unstamped) in _driven(lasts_s).items():
        at = received(seconds, rng)
        begin, end = unix(np.array(stall))
        at[(at >= begin) & (at < end)] = end
        if topic not in skip:
            for t_ns, receipt, data in zip(clocks[topic](seconds).tolist(), at.tolist(), unstamped, strict=True):
                stamp = struct.pack("<iI", *divmod(t_ns, 10**9))
                log.messages.append(Message(topic, typename, receipt, data[:place] + stamp + data[place + 8 :]))
    if "/map" not in skip:
        log.add("/map", grid(), START_NS)
    return log


@cache
def _driven(lasts_s: float) -> dict[str, tuple[str, Times, int, list[bytes]]]:
    """By topic: type, true times, where the stamp stands in a payload, and payloads without stamps."""
    makes: dict[str, tuple[float, int, Callable[[float], Any]]] = {
        "/odom": (20, 4, lambda s: odometry(0, s / 10, -s / 10, v=0.1)),
        "/wrench": (100, 4, lambda s: wrench(0, s)),
        "/tf": (10, 8, lambda s: tf(transform(0, "map", "odom", 0.0, s / 10))),
    }
    found = {}
    for topic, (hertz, place, make) in makes.items():
        seconds = np.arange(0.0, lasts_s, 1 / hertz)
        messages = [make(second) for second in seconds.tolist()]
        data = [bytes(STORE.serialize_cdr(one, one.__msgtype__)) for one in messages]
        found[topic] = (messages[0].__msgtype__, seconds, place, data)
    return found
