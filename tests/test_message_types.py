"""Message types are data: a new one is an entry in the tuple of its role, and nothing else knows it."""

from dataclasses import replace

import detections
import nav_log as nav
import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.definitions import parse_definition
from navirl_cli.logs.messages.schema import SchemaError
from navirl_cli.logs.roles import topics
from navirl_cli.logs.roles.message_types import MessageType

#: Definitions of message types that neither ROS nor nav_log.py nor detections.py has, by name, as printed by
#: "ros2 interface show".
DEFINITIONS: dict[str, str] = {}
#: Fields of a role that a type must have.
NEEDED = {
    "wrench": {"fx", "fy", "fz"},
    "odometry": {"px", "py", "pz", "qx", "qy", "qz", "qw"},
    "map": {"px", "py", "qz", "qw", "resolution", "width", "height", "data", "frame"},
    "people": {"px", "py", "pz"},
    "goal": set(),
    "joystick": set(),
}
for _name, _text in DEFINITIONS.items():
    nav.FOREIGN[_name] = _text
    nav.STORE.register(get_types_from_msg(_text, _name))
ENTRIES = [(role.name, one) for role in topics.ROLES for one in role.message_types]


@pytest.mark.parametrize(("role", "one"), ENTRIES, ids=lambda value: getattr(value, "name", value))
def test_every_field_stands_in_a_definition(role, one):
    stores = [store for store in (nav.STORE, detections.NOW, detections.THEN) if one.name in store.types]
    assert stores, f"add the definition of {one.name} to DEFINITIONS"
    problems = []
    for store in stores:
        schema = parse_definition(one.name, "ros2msg", detections.definition(store, one.name), "cdr")
        try:
            for path in one.fields.values():
                schema.leaf(path)
        except SchemaError as error:
            problems.append(str(error))
    assert len(problems) < len(stores), problems
    assert NEEDED.get(role, set()) <= set(one.fields)
    assert set(one.counted) <= set(one.fields)
    assert ("label" in one.fields) == bool(one.people_classes)


def test_every_form_of_a_type_stands_once_in_a_role():
    for role in topics.ROLES:
        forms = [(one.name, tuple(one.fields.values())) for one in role.message_types]
        assert len(set(forms)) == len(forms), role.name


@pytest.fixture
def toy(monkeypatch):
    """Add a message type to a role, as an entry in message_types.py would."""

    def added(role_name, definition, message_type):
        monkeypatch.setitem(nav.FOREIGN, message_type.name, definition)
        nav.STORE.register(get_types_from_msg(definition, message_type.name))
        roles = [
            replace(role, message_types=(*role.message_types, message_type)) if role.name == role_name else role
            for role in topics.ROLES
        ]
        monkeypatch.setattr(topics, "ROLES", tuple(roles))

    return added


def test_a_new_type_of_people(toy, tmp_path):
    fields = {
        "stamp": "header.stamp",
        "frame": "header.frame_id",
        "px": "at[].x",
        "py": "at[].y",
        "pz": "at[].z",
        "type": "at[].z",
    }
    only_low = {"type": lambda z: np.asarray(z < 1.0)}
    name = "test_msgs/msg/Crowd"
    definition = "std_msgs/Header header\ngeometry_msgs/Point[] at\n"
    toy("people", definition, MessageType(name, fields, "at[]", counted=only_low))
    log = nav.drive(2.0)
    for second in (0.5, 1.0):
        at = int(nav.unix(second))
        high = nav.build("geometry_msgs/msg/Point", x=9.0, y=9.0, z=2.0)
        points = [nav.point(1.0 + second, 2.0), high]
        log.add("/crowd", nav.build(name, header=nav.header(at, "map"), at=points), at)
    (track,) = load_recording(log.write(tmp_path / "run.mcap")).people
    assert track.xy_m == pytest.approx(np.array([[1.5, 2.0], [2.0, 2.0]]))


def test_a_new_type_of_commands(toy, tmp_path):
    name = "test_msgs/msg/Steering"
    fields = {"stamp": "header.stamp", "speed": "speed", "angle": "angle"}
    toy("joystick", "std_msgs/Header header\nfloat64 speed\nfloat32 angle\n", MessageType(name, fields, joined=True))
    log = nav.drive(3.0)
    for second, speed, angle in ((0.5, 0.0, 0.0), (1.0, 0.2, -0.5), (1.5, float("nan"), 0.0)):
        at = int(nav.unix(second))
        log.add("/steering", nav.build(name, header=nav.header(at, ""), speed=speed, angle=angle), at)
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    assert recording.command_t_ns.tolist() == nav.unix(np.array([0.5, 1.0, 1.5])).tolist()
    assert recording.command.tolist() == [0.0, 0.5, 0.0]


def test_a_new_type_of_poses_by_the_names_of_its_topics(toy, tmp_path):
    name = "test_msgs/msg/Fix"
    pose = {f"p{axis}": f"pose.position.{axis}" for axis in "xyz"} | {
        f"q{axis}": f"pose.orientation.{axis}" for axis in "xyzw"
    }
    fields = {"stamp": "header.stamp", "frame": "header.frame_id"} | pose
    toy(
        "odometry",
        "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
        MessageType(name, fields, fitness=lambda topic: None if "other" in topic else 0),
    )
    log = nav.drive(2.0, skip=["/odom"])
    for step in range(20):
        at = int(nav.unix(step / 10))
        for topic, x in (("/fix", step / 10), ("/other/fix", 50.0)):
            log.add(topic, nav.build(name, header=nav.header(at, "map"), pose=nav.pose(x, 1.0)), at)
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    assert recording.xy_m == pytest.approx(np.column_stack([np.arange(20) / 10, np.ones(20)]))


def test_a_topic_that_serves_two_roles_is_read_for_both(toy, tmp_path):
    name = "test_msgs/msg/Both"
    definition = "std_msgs/Header header\ngeometry_msgs/Point goal\ngeometry_msgs/Point[] people\n"
    goal = {f"p{axis}": f"goal.{axis}" for axis in "xyz"}
    people = {f"p{axis}": f"people[].{axis}" for axis in "xyz"}
    header = {"stamp": "header.stamp", "frame": "header.frame_id"}
    toy("goal", definition, MessageType(name, header | goal))
    toy("people", definition, MessageType(name, header | people, "people[]"))
    log = nav.drive(2.0)
    at = int(nav.unix(0.5))
    log.add(
        "/scene",
        nav.build(name, header=nav.header(at, "map"), goal=nav.point(4.0, 1.0), people=[nav.point(2.0, 2.0)]),
        at,
    )
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    assert recording.goal_m.tolist() == [[4.0, 1.0]]
    assert [track.xy_m.tolist() for track in recording.people] == [[[2.0, 2.0]]]
