"""The message types that navirl understands, by the role that they serve.

A new message type is one more entry in the tuple of its role: which field of the message stands for which field of the
role, and how the topics that serve are recognised. No other file knows the type. Where releases define a type in
different ways, each has an entry, and the first whose fields the definition in the log has counts. The fields of each
role:

- every role: ``stamp``, the time of the measurement, and ``frame``, each where the type has one;
- wrench: ``fx``, ``fy``, ``fz``, the force in N;
- odometry: ``px``, ``py``, ``pz`` in m, and ``qx``, ``qy``, ``qz``, ``qw``; where the type has them ``child``, the
  robot's own frame, and ``vx``, ``vy``, the velocity forward and to the left in m/s;
- map: ``resolution``, ``width``, ``height``, the origin ``px``, ``py``, ``qz``, ``qw``, and ``data``, the cells;
- people: ``px``, ``py``, ``pz`` in m, one person for each entry; where the type has them ``name`` and ``space``, which
  together identify people; where entries may be other things, ``label``, their class, and ``score`` where an
  entry has several classes;
- goal: ``px``, ``py``, ``pz`` in m; of a sequence the last entry is the goal. Or of an action ``accepted``, a time that
  identifies a goal, and its ``status``; or ``goal``, its number, and ``left``, the distance to it in m;
- joystick: any other field is a command that is 0 at rest; a sequence ``axes`` may rest elsewhere.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import BoolArray

#: Fields of a role, by which the rest of navirl asks for them -> fields of the message.
Fields = Mapping[str, str]
#: How well the name of a topic fits, the smallest number best; None where it serves only if the user names it.
Fitness = Callable[[str], int | None]

#: Names of topics about people; Cartographer calls the robot's own pose tracked_pose.
_PEOPLE_NAMES: Final = r"people|person|human|pedestrian|agent|track(?!ed_pose)"
_ROBOT_NAMES: Final = r"mocap|vicon|vrpn|optitrack|slam|robot|odom|tracked_pose|pose_?stamped|/pose$"
_GOAL_NAMES: Final = r"goal|target"
#: Lists of poses that are not people.
_LIST_NAMES: Final = r"particle|cloud|waypoint|plan|path|goal|grasp"
#: Velocities that a hand gives; navigation publishes on the others.
_BY_HAND: Final = r"teleop|joy|key|manual|remote"


def _any_name(_: str) -> int | None:
    return 0


def _named(
    needed: str | None = None, refused: str | None = None, preferred: str | None = None, avoided: str | None = None
) -> Fitness:
    """A rule by patterns that occur in a topic's name, in capitals or not.

    Args:
        needed: The name must hold this.
        refused: It must not hold this.
        preferred: Names that hold this go first.
        avoided: Names that hold this go last.
    """

    def fitness(name: str) -> int | None:
        def holds(pattern: str | None, otherwise: bool) -> bool:
            return otherwise if pattern is None else re.search(pattern, name, re.IGNORECASE) is not None

        if not holds(needed, otherwise=True) or holds(refused, otherwise=False):
            return None
        return int(not holds(preferred, otherwise=True)) + int(holds(avoided, otherwise=False))

    return fitness


@dataclass(frozen=True)
class MessageType:
    """A message type in a role."""

    #: "geometry_msgs/msg/WrenchStamped".
    name: str
    fields: Fields
    #: The sequence whose entries the message is about, "poses[]"; None for one thing a message.
    sequence: str | None = None
    fitness: Fitness = _any_name
    #: Whether several topics of this type serve the role together, such as one for each person.
    joined: bool = False
    #: By field of the role, which of its values count: entries with other values are left out.
    counted: Mapping[str, Callable[[NDArray[Any]], BoolArray]] = field(default_factory=dict)
    #: Which classes are people, where entries have a class: a number, or texts in lower case.
    people_classes: frozenset[int | str] = frozenset()

    def of_entries(self, field_name: str) -> bool:
        """Whether a field belongs to the sequence's entries, not to the message."""
        return self.sequence is not None and self.fields[field_name].startswith(self.sequence)


_STAMP: Final = {"stamp": "header.stamp", "frame": "header.frame_id"}


def _axes(name: str, path: str, axes: str = "xyz") -> dict[str, str]:
    return {f"{name}{axis}": f"{path}.{axis}" for axis in axes}


def _pose(path: str) -> dict[str, str]:
    return _axes("p", f"{path}.position") | _axes("q", f"{path}.orientation", "xyzw")


def _listed(name: str, sequence: str, position: str, /, **others: str) -> MessageType:
    """A message that lists people or poses."""
    fields = _STAMP | _axes("p", f"{sequence}.{position}" if position else sequence)
    return MessageType(name, fields | {key: f"{sequence}.{path}" for key, path in others.items()}, sequence)


_POSE_STAMPED: Final = MessageType("geometry_msgs/msg/PoseStamped", _STAMP | _pose("pose"))
_POSE_WITH_COVARIANCE: Final = MessageType("geometry_msgs/msg/PoseWithCovarianceStamped", _STAMP | _pose("pose.pose"))

# In each role the types that are preferred come first.

#: A filter of unknown delay is worse than none.
_UNFILTERED: Final = _named(avoided="filter")
WRENCHES: Final = (
    MessageType("geometry_msgs/msg/WrenchStamped", _STAMP | _axes("f", "wrench.force"), fitness=_UNFILTERED),
    MessageType("geometry_msgs/msg/Wrench", _axes("f", "force"), fitness=_UNFILTERED),
)

#: The pose at which a user starts the localisation is no measurement.
_INITIAL: Final = "initial"
POSES: Final = (
    MessageType(
        "nav_msgs/msg/Odometry",
        _STAMP | {"child": "child_frame_id"} | _pose("pose.pose") | _axes("v", "twist.twist.linear", "xy"),
        fitness=_named(refused=_INITIAL),
    ),
    replace(_POSE_WITH_COVARIANCE, fitness=_named(refused=_INITIAL)),
    replace(_POSE_STAMPED, fitness=_named(needed=_ROBOT_NAMES, refused=f"{_INITIAL}|{_PEOPLE_NAMES}")),
)


def _map_fitness(name: str) -> int:
    """The map, other maps, costmaps, local ones; last what Nav2's filters publish: speed limits, keep-out zones."""
    last = name.strip("/").rpartition("/")[2]
    if re.search(r"mask|filter", last, re.IGNORECASE):
        return 4
    if last == "map":
        return 0
    return 3 if "local" in name else 2 if "costmap" in name else 1


MAPS: Final = (
    MessageType(
        "nav_msgs/msg/OccupancyGrid",
        _STAMP
        | _pose("info.origin")
        | {"resolution": "info.resolution", "width": "info.width", "height": "info.height", "data": "data[]"},
        "data[]",
        fitness=_map_fitness,
    ),
)

#: Updates of a part of a map, on the topic of the map's name with "_updates".
MAP_UPDATES: Final = MessageType(
    "map_msgs/msg/OccupancyGridUpdate",
    _STAMP | {"frame": "header.frame_id", "x": "x", "y": "y", "width": "width", "height": "height", "data": "data[]"},
    "data[]",
)

_NAVIGATION: Final = _named(needed=r"navigate_(to_pose|through_poses)/_action/", preferred="to_pose")
GOALS: Final = (
    replace(
        _POSE_STAMPED,
        fitness=_named(
            # a goal by its name is one, wherever it stands
            refused=rf"^(?!.*({_GOAL_NAMES})).*({_PEOPLE_NAMES}|{_ROBOT_NAMES})",
            preferred=_GOAL_NAMES,
        ),
    ),
    replace(
        _listed("nav_msgs/msg/Path", "poses[]", "pose.position"),
        # a piece of a plan ends where the controller looks no farther
        fitness=_named(needed="plan", refused=r"local|transformed|pruned", preferred=r"/plan$"),
    ),
    # of a navigation action only is known when goals are accepted and reached, not where they are
    MessageType(
        "action_msgs/msg/GoalStatusArray",
        {"accepted": "status_list[].goal_info.stamp", "status": "status_list[].status"},
        "status_list[]",
        fitness=_NAVIGATION,
    ),
    *(
        MessageType(
            f"nav2_msgs/action/{name}_FeedbackMessage",
            {"goal": "goal_id.uuid", "left": "feedback.distance_remaining"},
            fitness=_NAVIGATION,
        )
        for name in ("NavigateToPose", "NavigateThroughPoses")
    ),
)

#: Names of people among the classes of a detector, in lower case.
_PEOPLE_CLASSES: Final[frozenset[int | str]] = frozenset({"person", "people", "human", "pedestrian"})


def _detected(
    name: str,
    sequence: str,
    position: str,
    /,
    *,
    people: frozenset[int | str] = _PEOPLE_CLASSES,
    fitness: Fitness = _any_name,
    **others: str,
) -> MessageType:
    """A message that lists things of several classes."""
    return replace(_listed(name, sequence, position, **others), people_classes=people, fitness=fitness)


def _from_zed(package: str) -> MessageType:
    """Objects and bodies from a ZED camera, whose bodies are labelled "Body_7"."""
    sequence, position = "objects[]", "objects[].position"
    fields = _STAMP | {f"p{axis}": f"{position}[{place}]" for place, axis in enumerate("xyz")}
    fields |= {"name": f"{sequence}.label_id", "label": f"{sequence}.label"}
    return MessageType(f"{package}/msg/ObjectsStamped", fields, sequence, people_classes=_PEOPLE_CLASSES | {"body"})


def _from_autoware(package: str, name: str) -> MessageType:
    """Objects of Autoware, whose pedestrians have label 7."""
    return _detected(
        f"{package}/msg/{name}",
        "objects[]",
        "kinematics.pose_with_covariance.pose.position",
        people=frozenset({7}),
        label="classification[].label",
        score="classification[].probability",
    )


#: derived_object_msgs/Object: a pedestrian.
_PEDESTRIAN: Final[frozenset[int | str]] = frozenset({4})
#: Detectors whose entries have classes.
_DETECTIONS: Final = (
    _detected(
        "vision_msgs/msg/Detection3DArray",
        "detections[]",
        "bbox.center.position",
        name="id",
        label="results[].hypothesis.class_id",
        score="results[].hypothesis.score",
    ),
    # ROS 1, and ROS 2 before Galactic
    _detected(
        "vision_msgs/msg/Detection3DArray",
        "detections[]",
        "bbox.center.position",
        label="results[].id",
        score="results[].score",
    ),
    _detected(
        "derived_object_msgs/msg/ObjectArray",
        "objects[]",
        "pose.position",
        people=_PEDESTRIAN,
        name="id",
        label="classification",
    ),
    _detected(
        "derived_object_msgs/msg/ObjectWithCovarianceArray",
        "objects[]",
        "pose.pose.position",
        people=_PEDESTRIAN,
        name="id",
        label="classification",
    ),
    _from_zed("zed_msgs"),
    _from_zed("zed_interfaces"),
    # the same type without places in space is published too
    _detected(
        "yolo_msgs/msg/DetectionArray",
        "detections[]",
        "bbox3d.center.position",
        fitness=_named(needed="3d"),
        name="id",
        frame="bbox3d.frame_id",
        label="class_name",
    ),
    *(
        _from_autoware(package, name)
        for package in ("autoware_perception_msgs", "autoware_auto_perception_msgs")
        for name in ("TrackedObjects", "DetectedObjects")
    ),
)

#: hunav_msgs/Agent and pedsim_msgs/AgentState: the robot is among the agents.
_ROBOT_AGENT: Final = 2
#: visualization_msgs/Marker: cubes, spheres, cylinders and meshes are bodies; lines, arrows and texts are not.
_BODIES: Final = (1, 2, 3, 10)
_ADDED: Final = 0
_NO_ROBOT: Final[Mapping[str, Callable[[NDArray[Any]], BoolArray]]] = {
    "type": lambda types: np.asarray(types != _ROBOT_AGENT)
}
#: Types that list people first, then those that may be about anything.
PEOPLE: Final = (
    _listed("people_msgs/msg/People", "people[]", "position", name="name"),
    _listed("spencer_tracking_msgs/msg/TrackedPersons", "tracks[]", "pose.pose.position", name="track_id"),
    replace(
        _listed("hunav_msgs/msg/Agents", "agents[]", "position.position", name="id", type="type"),
        counted=_NO_ROBOT,
    ),
    _listed("leg_detector_msgs/msg/PersonArray", "people[]", "pose.position", name="id"),
    _listed("leg_tracker/msg/PersonArray", "people[]", "pose.position", name="id"),
    _listed("pedsim_msgs/msg/TrackedPersons", "tracks[]", "pose.pose.position", name="track_id"),
    *(
        replace(
            _listed("pedsim_msgs/msg/AgentStates", "agent_states[]", place, name="id", type="type"), counted=_NO_ROBOT
        )
        for place in ("pose.position", "position")
    ),
    # the array's own header often names no frame
    _listed(
        "people_msgs/msg/PositionMeasurementArray",
        "people[]",
        "pos",
        name="object_id",
        stamp="header.stamp",
        frame="header.frame_id",
    ),
    _listed("spencer_tracking_msgs/msg/DetectedPersons", "detections[]", "pose.pose.position", name="detection_id"),
    *_DETECTIONS,
    replace(
        _listed("geometry_msgs/msg/PoseArray", "poses[]", "position"),
        fitness=_named(refused=_LIST_NAMES, preferred=_PEOPLE_NAMES),
    ),
    replace(_POSE_STAMPED, fitness=_named(needed=_PEOPLE_NAMES), joined=True),
    replace(_POSE_WITH_COVARIANCE, fitness=_named(needed=_PEOPLE_NAMES), joined=True),
    MessageType(
        "visualization_msgs/msg/MarkerArray",
        {"stamp": "markers[].header.stamp", "frame": "markers[].header.frame_id"}
        | _axes("p", "markers[].pose.position")
        | {"name": "markers[].id", "space": "markers[].ns", "type": "markers[].type", "action": "markers[].action"},
        "markers[]",
        fitness=_named(needed=_PEOPLE_NAMES),
        counted={
            "type": lambda types: np.isin(types, _BODIES),
            "action": lambda actions: np.asarray(actions == _ADDED),
        },
    ),
)

_TWIST: Final = _axes("l", "twist.linear") | _axes("a", "twist.angular")
COMMANDS: Final = (
    MessageType("sensor_msgs/msg/Joy", {"stamp": "header.stamp", "axes": "axes[]"}, "axes[]", joined=True),
    MessageType(
        "geometry_msgs/msg/TwistStamped",
        {"stamp": "header.stamp"} | _TWIST,
        fitness=_named(needed=_BY_HAND),
        joined=True,
    ),
    MessageType(
        "geometry_msgs/msg/Twist",
        {name: path.removeprefix("twist.") for name, path in _TWIST.items()},
        fitness=_named(needed=_BY_HAND),
        joined=True,
    ),
)

TF: Final = MessageType(
    "tf2_msgs/msg/TFMessage",
    {
        name: f"transforms[].{name}"
        for name in (
            "header.stamp",
            "header.frame_id",
            "child_frame_id",
            *(f"transform.translation.{axis}" for axis in "xyz"),
            *(f"transform.rotation.{axis}" for axis in "xyzw"),
        )
    },
    "transforms[]",
    fitness=_named(refused=r"tf_static$"),
    joined=True,
)
TF_STATIC: Final = replace(TF, fitness=_named(needed=r"tf_static$"))
