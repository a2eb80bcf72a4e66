"""Which topic of a log plays which role, decided by message type."""

from collections.abc import Mapping
from dataclasses import dataclass

from navirl_cli.errors import LogError
from navirl_cli.logs.reader import Contents


@dataclass(frozen=True)
class Role:
    """Something that an extraction needs from a log."""

    name: str
    type_name: str
    #: What to do without it; None where the extraction can go on.
    remedy: str | None = None
    #: How the topic's last part ends, where the type alone does not tell (tf and tf_static share theirs).
    static: bool = False


ROLES: tuple[Role, ...] = (
    Role(
        "wrench",
        "geometry_msgs/msg/WrenchStamped",
        "record the force-torque sensor's topic, for example with ros2_control's force_torque_sensor_broadcaster",
    ),
    Role("odometry", "nav_msgs/msg/Odometry", "record the robot's odometry, usually /odom"),
    Role(
        "map",
        "nav_msgs/msg/OccupancyGrid",
        "record the map, usually /map; it is latched, so that ros2 bag needs its transient-local QoS override",
    ),
    Role("people", "geometry_msgs/msg/PoseArray"),
    Role("goal", "geometry_msgs/msg/PoseStamped"),
    Role("joystick", "sensor_msgs/msg/Joy"),
    Role("tf", "tf2_msgs/msg/TFMessage"),
    Role("tf_static", "tf2_msgs/msg/TFMessage", static=True),
)


def topics_by_role(contents: Contents, chosen: Mapping[str, str]) -> dict[str, str]:
    """Find the topic of every role.

    Args:
        contents: Of the log.
        chosen: Topics by role where the user said so.

    Returns:
        Topic by role, for the roles that the log can fill.

    Raises:
        LogError: A needed role has no topic, a role has several and none is chosen, or a chosen topic does not fit.
    """
    unknown = sorted(set(chosen) - {role.name for role in ROLES})
    if unknown:
        raise LogError(f"--topic: no role is called {unknown[0]}; roles are {', '.join(role.name for role in ROLES)}")
    found = {}
    for role in ROLES:
        topic = _topic_of(role, contents, chosen.get(role.name))
        if topic is not None:
            found[role.name] = topic
    return found


def _topic_of(role: Role, contents: Contents, wish: str | None) -> str | None:
    """The one topic of a role, or None where the role is not needed."""
    types = {channel.topic: channel.schema_name for channel in contents.channels}
    if wish is not None:
        if types.get(wish) != role.type_name:
            held = f"it holds {types[wish]}" if wish in types else "there is no such topic"
            raise LogError(f"{contents.path}: --topic {role.name}={wish}: expected {role.type_name}, but {held}")
        return wish
    fitting = sorted(topic for topic, held in types.items() if held == role.type_name and _fits(role, topic))
    spoken = [topic for topic in fitting if contents.topic_count(topic) > 0]
    if len(spoken) > 1:
        raise LogError(
            f"{contents.path}: several topics could be the {role.name} ({role.type_name}): {', '.join(spoken)}; "
            f"choose one with --topic {role.name}={spoken[0]}"
        )
    if spoken:
        return spoken[0]
    if role.remedy is None:
        return None
    empty = f"; {', '.join(fitting)} is there without messages" if fitting else ""
    if not types:
        raise LogError(
            f"{contents.path}: holds no messages: the file ends before the first one; "
            "copy it anew, or use another recording"
        )
    listed = ", ".join(f"{topic} ({held})" for topic, held in sorted(types.items()))
    raise LogError(
        f"{contents.path}: no {role.name}: expected a topic of type {role.type_name}{empty}; "
        f"the log holds {listed}; {role.remedy}"
    )


def _fits(role: Role, topic: str) -> bool:
    return role.type_name != "tf2_msgs/msg/TFMessage" or topic.endswith("tf_static") == role.static
