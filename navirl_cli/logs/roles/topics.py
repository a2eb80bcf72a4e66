"""Which topic of a log serves which role: by its message type and, where that leaves several, by its name."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from navirl_cli.errors import MOST_NAMES, LogError, counted, unknown
from navirl_cli.logs.container.batches import Channel
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.messages.definitions import parse_definition
from navirl_cli.logs.messages.reader import Contents
from navirl_cli.logs.messages.schema import SchemaError, full_name
from navirl_cli.logs.messages.series import lacks_definition
from navirl_cli.logs.roles import message_types
from navirl_cli.logs.roles.message_types import MessageType
from navirl_cli.logs.roles.namespaces import is_within, of_robot, owned_tf, robots_in

#: Before the list of a log's topics in a message.
HOLDS: Final = "; the log holds "
#: Most message types of a role that a message lists.
_MOST_TYPES: Final = 7


@dataclass(frozen=True)
class Topic:
    """The messages of one type on a topic of a recording, over all its files and channels."""

    name: str
    type_name: str
    count: int
    #: Channels of all files, whose definitions may differ.
    channels: tuple[Channel, ...] = field(default=(), compare=False, repr=False)

    def has(self, paths: Iterable[str]) -> bool:
        """Whether its definition has these fields; False where it does not parse."""
        for channel in self.channels[:1]:
            try:
                schema = parse_definition(
                    channel.schema_name, channel.schema_encoding, channel.schema_text, channel.message_encoding
                )
                for path in paths:
                    schema.leaf(path)
            except SchemaError:
                return False
        return True


@dataclass(frozen=True)
class Role:
    """Something that an extraction needs from a log."""

    name: str
    #: The types that can serve, the preferred ones first.
    message_types: tuple[MessageType, ...]
    #: Why the best topic was preferred to others.
    rule: str = ""
    #: What to do without it.
    remedy: str = ""
    #: Whether nothing can be extracted without it.
    needed: bool = False
    #: Types of topics that belong to a chosen one, by what their name has behind its name.
    companions: Mapping[str, MessageType] = field(default_factory=dict, hash=False)
    #: Whether topics of a preferred type are taken alone; otherwise topics of all types serve together.
    ranked: bool = True

    @property
    def joins(self) -> bool:
        """Whether several topics can serve together."""
        return any(one.joined for one in self.message_types)

    def message_type(self, topic: Topic) -> MessageType:
        """The message type of a topic, as it serves this role: where releases differ, the first that fits."""
        known = (*self.message_types, *self.companions.values())
        named = [one for one in known if one.name == topic.type_name]
        return next((one for one in named[:-1] if topic.has(one.fields.values())), named[-1])

    def rank(self, topic: Topic) -> tuple[int, int] | None:
        """How well a topic fits, the smallest rank best; None where it serves only if the user names it."""
        message_type = self.message_type(topic)
        fitness = message_type.fitness(topic.name)
        place = self.message_types.index(message_type) if self.ranked else 0
        return None if fitness is None else (place, fitness)


@dataclass(frozen=True)
class Choice:
    """The topics that were found for a role."""

    role: Role
    #: Topics that serve; empty where none fits, or where the user must choose.
    topics: tuple[Topic, ...]
    #: Why these.
    reason: str
    #: What is missing where there are no topics, and what to do.
    problem: str = ""
    #: Whether several topics fit, of which the user must choose one.
    ambiguous: bool = False
    #: Topics that would serve, but are another robot's.
    foreign: tuple[Topic, ...] = ()


ROLES: Final = (
    Role(
        "wrench",
        message_types.WRENCHES,
        "unfiltered before filtered, since extract filters without delay",
        "record the force-torque sensor's topic, for example with ros2_control's force_torque_sensor_broadcaster, "
        "or extract with `no_wrench`",
        needed=True,
    ),
    Role(
        "odometry",
        message_types.POSES,
        "odometry before the localisation's poses, which are rarer",
        "record the robot's odometry, usually /odom",
        needed=True,
    ),
    Role(
        "map",
        message_types.MAPS,
        "a map before a costmap, a global one before a local one",
        "give the map's file with `map`, or record it, usually /map; it is latched, so that ros2 bag needs its "
        "transient-local QoS override",
        needed=True,
        companions={"_updates": message_types.MAP_UPDATES},
    ),
    Role(
        "people",
        message_types.PEOPLE,
        "message types for people first, then topics named after people",
        "give their places with `person` x,y",
    ),
    Role(
        "goal",
        message_types.GOALS,
        "a topic named after goals first, then any single pose, then the end of a plan",
        "give it with `goal` x,y, or choose `split` stop or `split` none",
    ),
    Role(
        "joystick",
        message_types.COMMANDS,
        "joysticks, and velocities on topics named after manual control; navigation publishes on the others",
        "name the topic of manual velocities with `topic` joystick=/name",
        ranked=False,
    ),
    Role(
        "tf",
        (message_types.TF,),
        remedy="record /tf where poses or people are not in the map's frame",
    ),
    Role(
        "tf_static",
        (message_types.TF_STATIC,),
        remedy="record /tf_static where the sensor is not in the robot's frame",
    ),
)


def is_missing(choice: Choice, chosen: Mapping[str, Choice]) -> bool:
    """Whether a needed role has no topic and no substitute, or the user must choose one."""
    replaced = choice.role.name == "odometry" and not choice.ambiguous and bool(chosen["tf"].topics)
    return bool(choice.problem) and (choice.ambiguous or choice.role.needed) and not replaced


def short_name(type_name: str) -> str:
    """A message type as ROS users write it."""
    return type_name.replace("/msg/", "/")


def topics_of(contents: Iterable[Contents]) -> tuple[Topic, ...]:
    """The topics of the files of a recording by name; a topic of several types stands once for each."""
    counts: dict[tuple[str, str], int] = {}
    channels: dict[tuple[str, str], list[Channel]] = {}
    for one in contents:
        for channel in one.channels:
            key = (channel.topic, full_name(channel.schema_name))
            counts[key] = counts.get(key, 0) + one.counts.get(channel.id, 0)
            channels.setdefault(key, []).append(channel)
    return tuple(Topic(*key, count, tuple(channels[key])) for key, count in sorted(counts.items()))


def shared_topics(topics: Iterable[Topic], chosen: Mapping[str, "Choice"]) -> Findings:
    """The topics that serve a role and hold other types besides."""
    of_name: dict[str, list[Topic]] = {}
    for topic in topics:
        if topic.count:
            of_name.setdefault(topic.name, []).append(topic)
    used: dict[str, dict[str, None]] = {}
    for topic in (topic for choice in chosen.values() for topic in choice.topics):
        used.setdefault(topic.name, {})[short_name(topic.type_name)] = None
    return tuple(
        Finding(
            Kind.SEVERAL_TYPES,
            name,
            detail=f"{', '.join(f'{short_name(one.type_name)} ({one.count})' for one in of_name[name])}; used: "
            + ", ".join(types),
        )
        for name, types in used.items()
        if len(of_name.get(name, ())) > 1
    )


def choose(
    log: str, topics: Sequence[Topic], requested: Mapping[str, Sequence[str]], namespace: str | None = None
) -> dict[str, Choice]:
    """Choose the topics of every role.

    Args:
        log: The recording's name, for messages.
        topics: Of the recording.
        requested: Names of topics by role, where the user named some.
        namespace: Of the robot, where the user named it: its own topics serve before those that no robot owns, and
            those of other robots never.

    Returns:
        A choice for each role; a role without a topic has a problem instead.

    Raises:
        LogError: A role or the namespace does not exist, or a requested topic does not fit.
    """
    names = [role.name for role in ROLES]
    for name in requested:
        if name not in names:
            raise LogError(unknown("`topic`", name, names))
    preferred = [{one.name for one in topics}]
    if namespace is not None:
        own, shared = of_robot(log, {one.name: one.type_name for one in topics}, namespace)
        preferred = [own, shared]
    choices = {
        role.name: _with_companions(_choice(log, role, topics, requested.get(role.name, ()), preferred), topics)
        for role in ROLES
    }
    return _with_own_tf(topics, choices, requested)


def _with_companions(choice: Choice, topics: Sequence[Topic]) -> Choice:
    """A choice with the topics that belong to the chosen ones."""
    wanted = {
        (f"{topic.name}{ending}", message_type.name)
        for topic in choice.topics
        for ending, message_type in choice.role.companions.items()
    }
    more = [one for one in topics if one.count and (one.name, one.type_name) in wanted]
    return replace(choice, topics=(*choice.topics, *more)) if more else choice


def _with_own_tf(
    topics: Sequence[Topic], choices: dict[str, Choice], requested: Mapping[str, Sequence[str]]
) -> dict[str, Choice]:
    """The choices without the tf topics of other robots."""
    roles = [name for name in ("tf", "tf_static") if name not in requested]
    tf = [topic.name for name in roles for topic in choices[name].topics]
    references = [topic.name for name in ("odometry", "wrench", "map") for topic in choices[name].topics]
    odometry = choices["odometry"].role
    types = {one.name for one in odometry.message_types}
    others = [one.name for one in topics if one.type_name in types and one.name not in references]
    if any(choices[name].ambiguous for name in ("odometry", "wrench")):
        return choices  # which the user must choose first
    owned = owned_tf(tf, references, others)
    for name in roles:
        choice = choices[name]
        if owned.problem and choice.topics:
            choices[name] = Choice(choice.role, (), "", owned.problem, ambiguous=True)
            continue
        kept = tuple(topic for topic in choice.topics if topic.name in owned.kept)
        foreign = tuple(topic for topic in choice.topics if topic not in kept)
        if foreign:
            left_out = ", ".join(topic.name for topic in foreign)
            problem = "" if kept else f"no {name} of this robot; {left_out} is another robot's"
            reason = f"in the namespace of odometry, wrench and map; not {left_out}" if kept else ""
            choices[name] = Choice(choice.role, kept, reason, problem, foreign=foreign)
    return choices


def _choice(
    log: str, role: Role, topics: Sequence[Topic], requested: Sequence[str], preferred: Sequence[set[str]]
) -> Choice:
    """The topics of one role.

    Args:
        log: The recording's name.
        role: What is needed.
        topics: Of the recording.
        requested: Names of topics that the user named.
        preferred: Sets of topics, the best first; where one holds a topic that serves, the later ones do not count.
            tf, of which a robot has its own and shares /tf, takes from all of them.
    """
    if requested:
        named = tuple(_requested(log, role, topics, name) for name in dict.fromkeys(requested))
        if len(named) > 1 and not role.joins:
            names = " and ".join(topic.name for topic in named)
            raise LogError(f"{log}: `topic` {role.name}: expected one topic, found {names}; choose one")
        return Choice(role, named, "named by `topic`")
    types = {one.name for one in role.message_types}
    of_type = [one for one in topics if one.type_name in types and any(one.name in some for some in preferred)]
    ranks = {topic: rank for topic in of_type if topic.count and (rank := role.rank(topic)) is not None}
    if role.name not in ("tf", "tf_static"):
        within = ({topic: rank for topic, rank in ranks.items() if topic.name in some} for some in preferred)
        ranks = next((some for some in within if some), {})
    if not ranks:
        return Choice(role, (), "", _problem(role, of_type))
    best = tuple(topic for topic, rank in ranks.items() if rank == min(ranks.values()))
    if len(best) > 1 and not all(role.message_type(topic).joined for topic in best):
        return Choice(role, (), "", _several(role, best, topics), ambiguous=True)
    others = [topic.name for topic in ranks if topic not in best]
    skipped = [topic.name for topic in of_type if role.rule and topic.count and topic not in ranks]
    reason = f"{role.rule}; not {', '.join(others)}" if others else "the only one that fits"
    return Choice(role, best, reason + (f"; skipped by name: {', '.join(skipped)}" if skipped else ""))


def _several(role: Role, best: Sequence[Topic], topics: Sequence[Topic]) -> str:
    """The problem that several topics fit equally well, and how to choose one."""
    names = ", ".join(topic.name for topic in best)
    shown = ", ".join(sorted({short_name(topic.type_name) for topic in best}))
    robots = robots_in({one.name: one.type_name for one in topics})
    own = [one for one in robots if any(is_within(topic.name, one) for topic in best)]
    robot = f", or the robot with `namespace` {own[0]}" if own else ""
    return (
        f"several topics could be the {role.name} ({shown}): {names}; choose one with `topic` "
        f"{role.name}={best[0].name}{robot}"
    )


def _requested(log: str, role: Role, topics: Sequence[Topic], name: str) -> Topic:
    """A topic that the user named."""
    types = [one.name for one in role.message_types]
    named = [topic for topic in topics if topic.name == name]
    served = sorted((one for one in named if one.type_name in types), key=lambda one: types.index(one.type_name))
    if served:
        return served[0]
    topic = next(iter(named), None)
    field = f"{log}: `topic` {role.name}"
    fitting = [one.name for one in topics if one.type_name in types]
    if topic is None and fitting:
        raise LogError(unknown(field, name, fitting))
    found = repr(name) if topic is None else f"{name!r} of type {short_name(topic.type_name)}"
    raise LogError(f"{field}: expected a topic of type {_types(role)}, found {found}")


def _types(role: Role) -> str:
    """The message types of a role, of many the first ones."""
    names = list(dict.fromkeys(short_name(one.name) for one in role.message_types))
    more = f" or {len(names) - _MOST_TYPES} others" if len(names) > _MOST_TYPES + 1 else ""
    return " or ".join(names[:_MOST_TYPES] if more else names) + more


def _problem(role: Role, of_type: Sequence[Topic]) -> str:
    """Why a role has no topic, and what to do."""
    types = _types(role)
    empty = [topic.name for topic in of_type if not topic.count]
    unlikely = [topic.name for topic in of_type if topic.count]
    notes = f"; {', '.join(empty)} has no messages" if empty else ""
    if unlikely:
        notes += f"; if {' or '.join(unlikely)} is meant, `topic` {role.name}={unlikely[0]}"
    return f"no {role.name}: expected a topic of type {types}{notes}" + (f"; {role.remedy}" if role.remedy else "")


def undefined(log: str, topics: Sequence[Topic]) -> LogError | None:
    """The error that nothing in a log can be decoded, because no topic has a definition."""
    channels = [channel for topic in topics if topic.count for channel in topic.channels]
    if not channels or not all(map(lacks_definition, channels)):
        return None
    return LogError(
        f"{log}: none of its {counted(len(topics), 'topic')} has a definition of its messages, so that nothing "
        f"can be decoded; "
        "convert it on a computer that has the message packages, for example with ros2 bag convert"
    )


def refusal(log: str, topics: Sequence[Topic], choice: Choice) -> LogError:
    """The error that a log lacks a needed topic."""
    if not topics:
        return LogError(
            f"{log}: holds no messages: the file ends before the first one; copy it again, or use another recording"
        )
    names = [f"{topic.name} ({short_name(topic.type_name)})" for topic in topics]
    listed = ", ".join(names[:MOST_NAMES])
    if len(names) > MOST_NAMES:
        listed += f" and {len(names) - MOST_NAMES} more"
    return LogError(f"{log}: {choice.problem}{HOLDS}{listed}")
