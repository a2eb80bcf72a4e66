"""From a log's columns to a recording: one clock, one fixed frame, plausible numbers."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from navirl_cli.arrays import ByContent
from navirl_cli.errors import LogError
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.messages.reader import Contents, Progress, ReadResult, read, scan
from navirl_cli.logs.recording import Occupancy, Recording
from navirl_cli.logs.roles.clocks import Clock, TimeSource
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.commands import commands_of
from navirl_cli.logs.roles.context import Context
from navirl_cli.logs.roles.maps import map_in, occupancy_of
from navirl_cli.logs.roles.people import goals_of, people_of
from navirl_cli.logs.roles.poses import poses_of
from navirl_cli.logs.roles.session import session_of
from navirl_cli.logs.roles.topics import Choice, choose, is_missing, refusal, topics_of
from navirl_cli.logs.roles.wrench import wrench_of
from navirl_cli.logs.sources import Source
from navirl_cli.logs.tf.transforms import Link, links_of
from navirl_cli.logs.tf.tree import TransformTree

#: The frame of a map from a file, as Nav2's map server names it.
_MAP_FRAME = "map"


class Forces(StrEnum):
    """How the wrench is used."""

    NEEDED = "needed"
    #: Taken where the log holds one.
    OPTIONAL = "optional"
    IGNORED = "ignored"


@dataclass(frozen=True, eq=False)
class LoadOptions(ByContent):
    """The user's choices about a log."""

    #: Topics by role, in place of those that navirl would choose.
    topics: Mapping[str, Sequence[str]] = field(default_factory=dict)
    time: TimeSource = TimeSource.HEADER
    #: The frame that everything is brought into, in place of the map's.
    frame: str | None = None
    #: The frame that the wrench is given in, in place of its header's.
    wrench_frame: str | None = None
    #: A map in place of the log's, in the fixed frame.
    occupancy: Occupancy | None = None
    forces: Forces = Forces.NEEDED
    #: Refuse a log of which something is lost.
    strict: bool = False


def load_recording(
    source: Source | Path, options: LoadOptions | None = None, progress: Progress | None = None
) -> Recording:
    """Read what an extraction needs from a log.

    Args:
        source: A recording's files, or its only one.
        options: The user's choices.
        progress: Called with bytes done and bytes in all.

    Returns:
        The recording, in the map's or the chosen frame, on the clock of the odometry's stamps.

    Raises:
        LogError: The log cannot be read or lacks what is needed, or something is lost and options are strict.
        FrameError: tf does not connect the frames.
    """
    if isinstance(source, Path):
        source = Source(source.name, (source,))
    options = options or LoadOptions()
    with ExitStack() as stack:
        # a file with whole-file compression is decompressed once
        files = [stack.enter_context(open_log(file)) for file in source.files]
        return _loaded(source, files, options, progress)


def _loaded(source: Source, files: Sequence[RawFile], options: LoadOptions, progress: Progress | None) -> Recording:
    """The recording of files that are open."""
    log = source.name
    contents = [scan(file) for file in files]
    columns, damage = _read(log, contents, files, options, progress)
    context, map_and_frame = _context(log, columns, options)
    poses = poses_of(next(iter(columns["odometry"]), None), context)
    forces = columns.get("wrench", [])
    wrench = wrench_of(forces[0], context, poses.base, options.wrench_frame) if forces else None
    people_t_ns, people = people_of(columns["people"], context)
    goal_t_ns, goal_m = goals_of(next(iter(columns["goal"]), None), context)
    command_t_ns, command = commands_of(columns["joystick"], context.clock)
    occupancy = occupancy_of(map_and_frame, context)
    lost = (*map(str, (*source.damage, *damage)), *context.lost)
    if lost and options.strict:
        raise LogError(f"{log}: damaged, which `strict` refuses: {'; '.join(lost)}")
    return Recording(
        log=log,
        t_ns=poses.t_ns,
        xy_m=poses.xy_m,
        yaw_rad=poses.yaw_rad,
        wrench=wrench,
        occupancy=occupancy,
        goal_t_ns=goal_t_ns,
        goal_m=goal_m,
        people_t_ns=people_t_ns,
        people=people,
        command_t_ns=command_t_ns,
        command=command,
        session=session_of(log, contents),
        velocity_m_s=poses.velocity_m_s,
        jumps=poses.jumps,
        damage=lost,
        notes=(*source.notes, *context.notes, *(f"{log}: {note}" for note in context.clock.notes)),
    )


def _read(
    log: str, contents: Sequence[Contents], files: Sequence[RawFile], options: LoadOptions, progress: Progress | None
) -> tuple[dict[str, list[Columns]], tuple[Damage, ...]]:
    """The columns of every role's topics, and the damage."""
    topics = topics_of(contents)
    chosen = choose(log, topics, options.topics)
    if options.occupancy is not None:
        del chosen["map"]
    lacking = not (chosen["wrench"].topics or chosen["wrench"].ambiguous)
    if options.forces is Forces.IGNORED or (options.forces is Forces.OPTIONAL and lacking):
        del chosen["wrench"]
    for choice in chosen.values():
        if is_missing(choice, chosen):
            raise refusal(log, topics, choice)
    maps = {topic.name for topic in chosen["map"].topics} if "map" in chosen else set()
    result = read(files, _wanted(chosen), progress, latest=maps)
    return {role: _columns(log, choice, result) for role, choice in chosen.items()}, result.damage


def _wanted(chosen: Mapping[str, Choice]) -> dict[str, Sequence[str]]:
    """The fields to read by topic; a topic that serves several roles is read once."""
    wanted: dict[str, dict[str, None]] = {}
    for choice in chosen.values():
        for topic in choice.topics:
            wanted.setdefault(topic.name, {}).update(dict.fromkeys(choice.role.message_type(topic).fields.values()))
    return {topic: tuple(fields) for topic, fields in wanted.items()}


def _context(
    log: str, columns: Mapping[str, Sequence[Columns]], options: LoadOptions
) -> tuple[Context, tuple[Occupancy, str]]:
    """Clock and frames, and the map with its frame."""
    references = (*columns["odometry"], *columns.get("wrench", ()))
    if not references:
        raise LogError(
            f"{log}: expected odometry or a wrench, whose stamps are the recording's clock, found neither; "
            "name the odometry with `topic` odometry=/name"
        )
    clock = Clock(references[0].stamped(), options.time)
    tree = TransformTree(
        [link for one in columns["tf_static"] for link in links_of(_tf_columns(one), one.owner_counts)],
        [link for one in columns["tf"] for link in _moving(one, clock)],
    )
    map_and_frame = map_in(log, columns["map"]) if options.occupancy is None else (options.occupancy, "")
    context = Context(log, clock, tree, options.frame or map_and_frame[1] or _MAP_FRAME)
    for (parent, child), some in tree.faults.items():
        for faults in some:
            if faults.ignored:
                context.note(f"transforms {parent} -> {child}: {faults}; ignored")
            if faults.rescaled:
                context.note(f"transforms {parent} -> {child}: {faults.rescaled}")
    return context, map_and_frame


def _columns(log: str, choice: Choice, result: ReadResult) -> list[Columns]:
    """The columns of a role's topics that hold messages."""
    columns = [
        Columns.of(result.series[topic.name], choice.role.message_type(topic))
        for topic in choice.topics
        if topic.name in result.series and len(result.series[topic.name])
    ]
    if choice.topics and not columns and choice.role.needed:
        names = ", ".join(topic.name for topic in choice.topics)
        reasons = [str(one) for one in result.damage if any(topic.name in one.reason for topic in choice.topics)]
        why = f": {'; '.join(reasons)}" if reasons else ""
        raise LogError(f"{log}: no message on the {choice.role.name} topic {names} could be read{why}")
    return columns


def _tf_columns(columns: Columns) -> Mapping[str, NDArray[Any]]:
    """The columns by the fields of the message."""
    return {path: columns[name] for name, path in columns.message_type.fields.items()}


def _moving(columns: Columns, clock: Clock) -> list[Link]:
    """Links of /tf, whose stamps may lie ahead on purpose but jump as the clock does."""
    by_path = _tf_columns(columns)
    stamps = by_path["transforms[].header.stamp"]
    return links_of(by_path, columns.owner_counts, clock.shifted(stamps, columns.log_time_ns[columns.owner]))
