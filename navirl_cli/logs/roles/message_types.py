"""Message types that navirl understands: which of their fields say what."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

#: Fields of a role, by which the rest of navirl asks for them -> fields of the message.
Fields = Mapping[str, str]

_STAMP: Final = {"stamp": "header.stamp", "frame": "header.frame_id"}


def _axes(name: str, path: str, axes: str = "xyz") -> dict[str, str]:
    return {f"{name}{axis}": f"{path}.{axis}" for axis in axes}


def _pose(path: str) -> dict[str, str]:
    return _axes("p", f"{path}.position") | _axes("q", f"{path}.orientation", "xyzw")


@dataclass(frozen=True)
class Kind:
    """A message type in a role."""

    #: "geometry_msgs/msg/WrenchStamped".
    type_name: str
    fields: Fields
    #: The sequence whose entries the message is about, "poses[]"; None for one thing a message.
    sequence: str | None = None

    def of_entries(self, name: str) -> bool:
        """Whether a field is one of the sequence's entries, not of the message."""
        return self.sequence is not None and self.fields[name].startswith(self.sequence)


def _listed(type_name: str, sequence: str, position: str, **more: str) -> Kind:
    """A message that lists people or poses."""
    fields = _STAMP | _axes("p", f"{sequence}.{position}" if position else sequence)
    return Kind(type_name, fields | {name: f"{sequence}.{path}" for name, path in more.items()}, sequence)


_POSE_STAMPED: Final = Kind("geometry_msgs/msg/PoseStamped", _STAMP | _pose("pose"))
_POSE_WITH_COVARIANCE: Final = Kind("geometry_msgs/msg/PoseWithCovarianceStamped", _STAMP | _pose("pose.pose"))
TF: Final = Kind(
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
)
WRENCHES: Final = (
    Kind("geometry_msgs/msg/WrenchStamped", _STAMP | _axes("f", "wrench.force")),
    Kind("geometry_msgs/msg/Wrench", _axes("f", "force")),
)
POSES: Final = (
    Kind(
        "nav_msgs/msg/Odometry",
        _STAMP | {"child": "child_frame_id"} | _pose("pose.pose") | _axes("v", "twist.twist.linear", "xy"),
    ),
    _POSE_WITH_COVARIANCE,
    _POSE_STAMPED,
)
MAPS: Final = (
    Kind(
        "nav_msgs/msg/OccupancyGrid",
        _STAMP
        | _pose("info.origin")
        | {"resolution": "info.resolution", "width": "info.width", "height": "info.height", "data": "data[]"},
        "data[]",
    ),
)
GOALS: Final = (
    _POSE_STAMPED,
    _listed("nav_msgs/msg/Path", "poses[]", "pose.position"),
)
#: Those that list people first, then those that may be about anything.
PEOPLE: Final = (
    _listed("people_msgs/msg/People", "people[]", "position", name="name"),
    _listed("spencer_tracking_msgs/msg/TrackedPersons", "tracks[]", "pose.pose.position", name="track_id"),
    _listed("hunav_msgs/msg/Agents", "agents[]", "position.position", name="id", kind="type"),
    _listed("geometry_msgs/msg/PoseArray", "poses[]", "position"),
    _POSE_STAMPED,
    _POSE_WITH_COVARIANCE,
    Kind(
        "visualization_msgs/msg/MarkerArray",
        {"stamp": "markers[].header.stamp", "frame": "markers[].header.frame_id"}
        | _axes("p", "markers[].pose.position")
        | {"name": "markers[].id", "space": "markers[].ns", "kind": "markers[].type", "action": "markers[].action"},
        "markers[]",
    ),
)
_TWIST: Final = _axes("l", "twist.linear") | _axes("a", "twist.angular")
COMMANDS: Final = (
    Kind("sensor_msgs/msg/Joy", {"stamp": "header.stamp", "axes": "axes[]"}, "axes[]"),
    Kind("geometry_msgs/msg/TwistStamped", {"stamp": "header.stamp"} | _TWIST),
    Kind("geometry_msgs/msg/Twist", {name: path.removeprefix("twist.") for name, path in _TWIST.items()}),
)
