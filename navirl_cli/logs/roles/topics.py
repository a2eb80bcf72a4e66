"""Which topic of a log plays which role, decided by message type and, where that does not tell, by name."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from navirl_cli.errors import LogError
from navirl_cli.logs.messages.reader import Contents
from navirl_cli.logs.messages.schema import full_name
from navirl_cli.logs.roles import message_types
from navirl_cli.logs.roles.message_types import Kind

#: Cartographer calls the robot's own pose tracked_pose.
_PERSON: Final = re.compile(r"people|person|human|pedestrian|agent|track(?!ed_pose)", re.IGNORECASE)
_GOAL: Final = re.compile(r"goal|target", re.IGNORECASE)
_PLAN: Final = re.compile(r"plan", re.IGNORECASE)
#: Pieces of a plan, which end where the controller looks no farther.
_NOT_PLANS: Final = re.compile(r"local|transformed|pruned", re.IGNORECASE)
#: What Nav2's filters publish as maps: speed limits, keep-out zones.
_MASK: Final = re.compile(r"mask|filter", re.IGNORECASE)
_BY_HAND: Final = re.compile(r"teleop|joy|key|manual|remote", re.IGNORECASE)
_NOT_PEOPLE: Final = re.compile(r"particle|cloud|waypoint|plan|path|goal|grasp", re.IGNORECASE)
_NOT_GOALS: Final = re.compile(
    r"mocap|vicon|vrpn|optitrack|slam|robot|odom|tracked_pose|pose_?stamped|/pose$", re.IGNORECASE
)
#: Fitness of a topic: the smallest that occurs is taken; None only when the user names it.
_Fitness = Callable[[str, str], int | None]


@dataclass(frozen=True)
class Topic:
    """A topic of a recording, over all its files and channels."""

    name: str
    type_name: str
    count: int


@dataclass(frozen=True)
class Role:
    """Something that an extraction needs from a log."""

    name: str
    kinds: tuple[Kind, ...]
    #: How well a topic (name, type) fits.
    fitness: _Fitness
    #: Why the best topic was preferred to others.
    rule: str = ""
    #: What to do without it.
    remedy: str = ""
    #: Whether nothing can be extracted without it.
    needed: bool = False
    #: Types of which several topics can serve together.
    joined: frozenset[str] = field(default=frozenset())


@dataclass(frozen=True)
class Choice:
    """What was found for a role."""

    role: Role
    #: Topics that serve; none where there is none, or where the user must choose.
    topics: tuple[Topic, ...]
    #: Why these.
    reason: str
    #: What is wrong where there are none, and what to do.
    problem: str = ""
    #: Whether there are several, of which the user must choose one.
    ambiguous: bool = False

    def kind(self, topic: Topic) -> Kind:
        """How the messages of one of the topics are read."""
        return next(kind for kind in self.role.kinds if kind.type_name == topic.type_name)


def _rank(role_kinds: Sequence[Kind]) -> dict[str, int]:
    return {kind.type_name: 10 * number for number, kind in enumerate(role_kinds)}


def _wrench(name: str, type_name: str) -> int | None:
    # a filter of unknown delay is worse than none
    return _rank(message_types.WRENCHES)[type_name] + ("filter" in name)


def _odometry(name: str, type_name: str) -> int | None:
    if type_name == "geometry_msgs/msg/PoseStamped" and (not _NOT_GOALS.search(name) or _PERSON.search(name)):
        return None
    # what a user tells the localisation at its start is no measurement
    return None if "initial" in name else _rank(message_types.POSES)[type_name]


def _map(name: str, _: str) -> int | None:
    parts = name.strip("/").split("/")
    if _MASK.search(parts[-1]):
        return 4
    if parts[-1] == "map":
        return 0
    return 3 if "local" in name else 2 if "costmap" in name else 1


def _people(name: str, type_name: str) -> int | None:
    about_people = bool(_PERSON.search(name))
    if type_name in {"geometry_msgs/msg/PoseArray"}:
        return None if _NOT_PEOPLE.search(name) else _rank(message_types.PEOPLE)[type_name] + (not about_people)
    certain = type_name.split("/", 1)[0] in {"people_msgs", "spencer_tracking_msgs", "hunav_msgs"}
    return _rank(message_types.PEOPLE)[type_name] if certain or about_people else None


def _goal(name: str, type_name: str) -> int | None:
    if type_name == "nav_msgs/msg/Path":
        if not _PLAN.search(name) or _NOT_PLANS.search(name):
            return None
        return 10 if name.endswith("/plan") else 11
    if _GOAL.search(name):
        return 0
    return None if _PERSON.search(name) or _NOT_GOALS.search(name) else 1


def _command(name: str, type_name: str) -> int | None:
    return 0 if type_name == "sensor_msgs/msg/Joy" or _BY_HAND.search(name) else None


def _tf(name: str, _: str) -> int | None:
    return None if name.endswith("tf_static") else 0


def _tf_static(name: str, _: str) -> int | None:
    return 0 if name.endswith("tf_static") else None


ROLES: Final = (
    Role(
        "wrench",
        message_types.WRENCHES,
        _wrench,
        "unfiltered before filtered, since extract filters without delay",
        "record the force-torque sensor's topic, for example with ros2_control's force_torque_sensor_broadcaster, "
        "or extract with --no-wrench",
        needed=True,
    ),
    Role(
        "odometry",
        message_types.POSES,
        _odometry,
        "odometry before the localisation's poses, which are rarer",
        "record the robot's odometry, usually /odom",
        needed=True,
    ),
    Role(
        "map",
        message_types.MAPS,
        _map,
        "a map before a costmap, a global one before a local one",
        "give the map's file with --map, or record it, usually /map; it is latched, so that ros2 bag needs its "
        "transient-local QoS override",
        needed=True,
    ),
    Role(
        "people",
        message_types.PEOPLE,
        _people,
        "messages that can only be about people first, then those whose names say so",
        "say where they stand with --person x,y",
        joined=frozenset({"geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"}),
    ),
    Role(
        "goal",
        message_types.GOALS,
        _goal,
        "a goal by name first, then any lone pose, then the end of a plan",
        "say where it is with --goal x,y, or choose --split stop or --split none",
    ),
    Role(
        "joystick",
        message_types.COMMANDS,
        _command,
        "joysticks, and velocities whose topics say that a hand gives them; navigation publishes on the others",
        "name the topic of velocities that a hand gave with --topic joystick=/name",
        joined=frozenset(kind.type_name for kind in message_types.COMMANDS),
    ),
    Role(
        "tf",
        (message_types.TF,),
        _tf,
        remedy="record /tf where poses or people are not in the map's frame",
        joined=frozenset({message_types.TF.type_name}),
    ),
    Role(
        "tf_static",
        (message_types.TF,),
        _tf_static,
        remedy="record /tf_static where the sensor is not in the robot's frame",
        joined=frozenset({message_types.TF.type_name}),
    ),
)


def is_missed(choice: Choice, picked: Mapping[str, Choice]) -> bool:
    """Whether a log lacks what nothing in it replaces, or the choice is the user's."""
    instead = choice.role.name == "odometry" and not choice.ambiguous and bool(picked["tf"].topics)
    return bool(choice.problem) and (choice.ambiguous or choice.role.needed) and not instead


def short_name(type_name: str) -> str:
    """A type as people write it."""
    return type_name.replace("/msg/", "/")


def topics_of(contents: Iterable[Contents]) -> dict[str, Topic]:
    """The topics of the files of a recording by name; of several types on one topic the one with most messages."""
    counts: dict[tuple[str, str], int] = {}
    for one in contents:
        for channel in one.channels:
            key = (channel.topic, full_name(channel.schema_name))
            counts[key] = counts.get(key, 0) + one.counts.get(channel.id, 0)
    found: dict[str, Topic] = {}
    for (name, type_name), count in sorted(counts.items()):
        if name not in found or count > found[name].count:
            found[name] = Topic(name, type_name, count)
    return found


def choices(log: str, topics: Mapping[str, Topic], chosen: Mapping[str, Sequence[str]]) -> dict[str, Choice]:
    """Find the topics of every role.

    Args:
        log: The recording's name, for messages.
        topics: Of the recording.
        chosen: Topics by role where the user said so.

    Returns:
        A choice for each role, which may be that there is none.

    Raises:
        LogError: A role does not exist, or a chosen topic does not fit.
    """
    unknown = sorted(set(chosen) - {role.name for role in ROLES})
    if unknown:
        raise LogError(f"--topic: no role is called {unknown[0]}; roles are {', '.join(role.name for role in ROLES)}")
    return {role.name: _choice(log, role, topics, chosen.get(role.name, ())) for role in ROLES}


def _choice(log: str, role: Role, topics: Mapping[str, Topic], wishes: Sequence[str]) -> Choice:
    """The topics of one role."""
    types = {kind.type_name for kind in role.kinds}
    if wishes:
        named = tuple(_wished(log, role, topics, wish) for wish in dict.fromkeys(wishes))
        if len(named) > 1 and not role.joined:
            names = " and ".join(topic.name for topic in named)
            raise LogError(f"{log}: --topic {role.name}: expected one topic, found {names}; choose one")
        return Choice(role, named, "named by --topic")
    fitting = [topic for topic in topics.values() if topic.type_name in types]
    ranks = {topic.name: role.fitness(topic.name, topic.type_name) for topic in fitting}
    spoken = [topic for topic in fitting if topic.count and ranks[topic.name] is not None]
    if not spoken:
        return Choice(role, (), "", _nothing(role, fitting))
    best = min(rank for topic in spoken if (rank := ranks[topic.name]) is not None)
    taken = tuple(topic for topic in spoken if ranks[topic.name] == best)
    others = [topic.name for topic in spoken if topic not in taken]
    if len(taken) > 1 and not {topic.type_name for topic in taken} <= role.joined:
        names = ", ".join(topic.name for topic in taken)
        types_taken = ", ".join(sorted({short_name(topic.type_name) for topic in taken}))
        return Choice(
            role,
            (),
            "",
            f"several topics could be the {role.name} ({types_taken}): {names}; "
            f"choose one with --topic {role.name}={taken[0].name}",
            ambiguous=True,
        )
    passed = [topic.name for topic in fitting if role.rule and topic.count and ranks[topic.name] is None]
    reason = f"{role.rule}; not {', '.join(others)}" if others else "the only one that fits"
    return Choice(role, taken, reason + (f"; passed over by name: {', '.join(passed)}" if passed else ""))


def _wished(log: str, role: Role, topics: Mapping[str, Topic], wish: str) -> Topic:
    """A topic that the user named."""
    types = [kind.type_name for kind in role.kinds]
    topic = topics.get(wish)
    if topic is None or topic.type_name not in types:
        held = "there is no such topic" if topic is None else f"it holds {short_name(topic.type_name)}"
        raise LogError(f"{log}: --topic {role.name}={wish}: expected {' or '.join(map(short_name, types))}, but {held}")
    return topic


def _nothing(role: Role, fitting: Sequence[Topic]) -> str:
    """Why a role has no topic, and what to do."""
    empty = [topic.name for topic in fitting if not topic.count]
    unlikely = [topic.name for topic in fitting if topic.count]
    notes = f"; {', '.join(empty)} is there without messages" if empty else ""
    if unlikely:
        notes += f"; if {' or '.join(unlikely)} is meant, --topic {role.name}={unlikely[0]}"
    types = " or ".join(short_name(kind.type_name) for kind in role.kinds)
    return f"no {role.name}: expected a topic of type {types}{notes}" + (f"; {role.remedy}" if role.remedy else "")


def refusal(log: str, topics: Mapping[str, Topic], choice: Choice) -> LogError:
    """The error that a log does not hold what is needed."""
    if not topics:
        return LogError(
            f"{log}: holds no messages: the file ends before the first one; copy it anew, or use another recording"
        )
    listed = ", ".join(f"{topic.name} ({short_name(topic.type_name)})" for topic in topics.values())
    return LogError(f"{log}: {choice.problem}; the log holds {listed}")
