"""The stage of reading: the columns of the topics that were chosen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from navirl_cli.errors import LogError
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.messages.reader import Progress, ReadResult, read
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.topics import Choice


@dataclass(frozen=True, eq=False)
class TablesRead:
    """What was read of a recording."""

    #: By role, the columns of its topics that hold messages.
    tables: Mapping[str, Sequence[Columns]]
    damage: tuple[Damage, ...]
    #: The needed topics of which nothing could be read.
    refusals: tuple[LogError, ...]


def read_tables(
    log: str, files: Sequence[RawFile], chosen: Mapping[str, Choice], progress: Progress | None
) -> TablesRead:
    """Read the fields that the roles want, in one pass over the files.

    Args:
        log: The recording's name, for messages.
        files: Of the recording, open.
        chosen: The topics by role.
        progress: Called with bytes done and bytes in all.

    Raises:
        LogError: A file is no MCAP file.
    """
    maps = {(topic.name, topic.type_name) for topic in chosen["map"].topics} if "map" in chosen else set()
    result = read(files, _wanted(chosen), progress, packed=maps)
    tables = {role: _columns(choice, result) for role, choice in chosen.items()}
    refusals = [
        _unread(log, choice, result)
        for role, choice in chosen.items()
        if choice.topics and choice.role.needed and not tables[role]
    ]
    return TablesRead(tables, result.damage, tuple(refusals))


def _wanted(chosen: Mapping[str, Choice]) -> dict[tuple[str, str], Sequence[str]]:
    """The fields to read by topic and type; a topic that serves several roles is read once."""
    wanted: dict[tuple[str, str], dict[str, None]] = {}
    for choice in chosen.values():
        for topic in choice.topics:
            wanted.setdefault((topic.name, topic.type_name), {}).update(
                dict.fromkeys(choice.role.message_type(topic).fields.values())
            )
    return {topic: tuple(fields) for topic, fields in wanted.items()}


def _columns(choice: Choice, result: ReadResult) -> list[Columns]:
    """The columns of a role's topics that hold messages."""
    return [
        Columns.of(series, choice.role.message_type(topic))
        for topic in choice.topics
        if (series := result.series.get((topic.name, topic.type_name))) is not None and len(series)
    ]


def _unread(log: str, choice: Choice, result: ReadResult) -> LogError:
    """Why no message of a role could be read."""
    names = ", ".join(topic.name for topic in choice.topics)
    prefixes = [f"topic {topic.name}: " for topic in choice.topics]
    reasons = [one.reason for one in result.damage if any(topic.name in one.reason for topic in choice.topics)]
    for prefix in prefixes:
        reasons = [reason.removeprefix(prefix) for reason in reasons]
    why = f": {'; '.join(dict.fromkeys(reasons))}" if reasons else ""
    return LogError(f"{log}: no message on the {choice.role.name} topic {names} could be read{why}")
