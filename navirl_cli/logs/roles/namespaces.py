"""Which topics are one robot's, where several robots share a log: namespaces, as ROS launch files push them."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from navirl_cli.errors import LogError, unknown

#: Last parts of the names of tf's topics.
_TF: Final = ("tf", "tf_static")
#: Two namespaces that share so many topics by name and type are two robots.
_SHARED: Final = 2


@dataclass(frozen=True)
class Owned:
    """The tf topics of one robot."""

    #: Those that count.
    kept: tuple[str, ...]
    #: Those of other robots.
    foreign: tuple[str, ...]
    #: What the user must choose, in words; empty where the namespaces decide.
    problem: str = ""


def normalised(namespace: str) -> str:
    """A namespace with one slash before it and none behind; "" for the root."""
    return "".join(f"/{part}" for part in namespace.split("/") if part)


def parent(topic: str) -> str:
    """The namespace that a topic is in; "" for the root."""
    return topic.rpartition("/")[0]


def is_within(topic: str, namespace: str) -> bool:
    """Whether a topic is in a namespace or below."""
    return topic.startswith(f"{namespace}/")


def robots_in(types: Mapping[str, str]) -> list[str]:
    """The namespaces that look like robots: they hold tf, or the same topics as another one.

    Args:
        types: Message types by topic.
    """
    inside: dict[str, set[tuple[str, str]]] = {}
    for topic, type_name in types.items():
        inside.setdefault(parent(topic), set()).add((topic.rpartition("/")[2], type_name))
    return sorted(
        one
        for one, topics in inside.items()
        if one
        and (
            any(name in _TF for name, _ in topics)
            or any(len(topics & others) >= _SHARED for other, others in inside.items() if other not in ("", one))
        )
    )


def of_robot(log: str, types: Mapping[str, str], namespace: str) -> tuple[set[str], set[str]]:
    """The topics in a robot's namespace, and those that no robot owns.

    Args:
        log: The recording's name, for messages.
        types: Message types by topic.
        namespace: As the user gave it.

    Raises:
        LogError: No topic is in the namespace.
    """
    own_name = normalised(namespace)
    own = {topic for topic in types if own_name and is_within(topic, own_name)}
    if not own:
        known = robots_in(types) or sorted({parent(topic) for topic in types} - {""})
        if not known:
            raise LogError(
                f"{log}: `namespace`: expected topics in {own_name or '/'}, found all topics in the root; leave it out"
            )
        raise LogError(unknown(f"{log}: `namespace`", namespace, known))
    inside = {(topic.removeprefix(own_name), types[topic]) for topic in own}
    robots = {one for one in robots_in(types) if one != own_name and not is_within(own_name, one)}
    depth = own_name.count("/")
    for topic in types.keys() - own:
        beginning = "/".join(topic.split("/")[: depth + 1])
        if (topic.removeprefix(beginning), types[topic]) in inside:
            robots.add(beginning)
    shared = {topic for topic in types if not any(is_within(topic, one) for one in (own_name, *robots))}
    return own, shared


def owned_tf(tf: Collection[str], references: Iterable[str], odometry: Collection[str]) -> Owned:
    """The tf topics of the robot whose odometry, wrench and map were chosen.

    /tf counts always. Of the others those count whose namespace holds one of the references. Where all references are
    in the root, /tf counts alone; where there is none, the only namespace that has tf.

    Args:
        tf: Topics with transforms.
        references: The chosen topics of odometry, wrench and map.
        odometry: All topics with odometry that were not chosen.
    """
    namespaces = sorted({parent(topic) for topic in tf} - {""})
    references = tuple(references)
    if not references:  # nothing can be extracted, for other reasons
        return Owned(tuple(tf), ())
    own = [one for one in namespaces if any(is_within(topic, one) for topic in references)]
    apart = [one for one in own if not any(other != one and is_within(other, one) for other in own)]
    if not own and len(namespaces) == 1 and all(parent(topic) for topic in tf):
        own = [one for one in namespaces if not any(is_within(topic, one) for topic in odometry)]
    if len(apart) > 1 or (not own and len(namespaces) > 1 and all(parent(topic) for topic in tf)):
        robots = apart or namespaces
        found = "their topics are of several of these" if apart else "they are in none of these namespaces"
        problem = (
            f"transforms of several robots ({', '.join(sorted(tf))}): expected odometry, wrench and map of one robot, "
            f"found {', '.join(references)}: {found}; choose the robot with `namespace` {robots[0]}"
        )
        return Owned((), (), problem)
    kept = tuple(topic for topic in tf if parent(topic) in ("", *own))
    return Owned(kept, tuple(topic for topic in tf if topic not in kept))
