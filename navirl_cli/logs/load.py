"""From a log's columns to a recording: one clock, one fixed frame, numbers that can be true."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.damage import Damage
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.messages.reader import Contents, Progress, ReadResult, read, scan
from navirl_cli.logs.recording import Occupancy, Recording, Wrench
from navirl_cli.logs.roles.clocks import Clock, Stamped, TimeSource, in_order
from navirl_cli.logs.roles.columns import Table, wants
from navirl_cli.logs.roles.context import Setting
from navirl_cli.logs.roles.maps import map_in, occupancy_of
from navirl_cli.logs.roles.people import goals_of, people_of
from navirl_cli.logs.roles.plausible import FORCES
from navirl_cli.logs.roles.poses import poses_of
from navirl_cli.logs.roles.session import session_of
from navirl_cli.logs.roles.topics import Choice, choices, is_missed, refusal, topics_of
from navirl_cli.logs.sources import Source
from navirl_cli.logs.tf.transforms import Link, links_of
from navirl_cli.logs.tf.tree import TransformTree

#: The frame of a map from a file, as Nav2's map server names it.
_MAP_FRAME = "map"
#: An axis of a joystick this near to 0 rests there, if it is so in this share of the messages.
_STICK_REST, _RESTS = 0.05, 0.05


class Forces(StrEnum):
    """What becomes of the wrench."""

    NEEDED = "needed"
    #: Taken where the log holds one.
    OPTIONAL = "optional"
    IGNORED = "ignored"


@dataclass(frozen=True, eq=False)
class LoadOptions(ByContent):
    """What a user can say about a log."""

    #: Topics by role, where there are several that could be meant.
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
        # what is compressed as a whole is decompressed once
        files = [stack.enter_context(open_log(file)) for file in source.files]
        return _loaded(source, files, options, progress)


def _loaded(source: Source, files: Sequence[RawFile], options: LoadOptions, progress: Progress | None) -> Recording:
    """The recording of files that are open."""
    log = source.name
    contents = [scan(file) for file in files]
    tables, damage = _read(log, contents, files, options, progress)
    setting, drawn = _setting(log, tables, options)
    poses = poses_of(next(iter(tables["odometry"]), None), setting)
    measured = tables.get("wrench", [])
    wrench = _wrench(measured[0], setting, poses.base, options.wrench_frame) if measured else None
    people_t_ns, people = people_of(tables["people"], setting)
    goal_t_ns, goal_m = goals_of(next(iter(tables["goal"]), None), setting)
    command_t_ns, command = _commands(tables["joystick"], setting.clock)
    occupancy = occupancy_of(drawn, setting)
    lost = (*map(str, (*source.damage, *damage)), *setting.lost)
    if lost and options.strict:
        raise LogError(f"{log}: damaged, and --strict refuses it: {'; '.join(lost)}")
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
        notes=(*source.notes, *setting.notes, *(f"{log}: {note}" for note in setting.clock.notes)),
    )


def _read(
    log: str, contents: Sequence[Contents], files: Sequence[RawFile], options: LoadOptions, progress: Progress | None
) -> tuple[dict[str, list[Table]], tuple[Damage, ...]]:
    """What was read of every role's topics, and the damage."""
    topics = topics_of(contents)
    picked = choices(log, topics, options.topics)
    if options.occupancy is not None:
        del picked["map"]
    lacking = not (picked["wrench"].topics or picked["wrench"].ambiguous)
    if options.forces is Forces.IGNORED or (options.forces is Forces.OPTIONAL and lacking):
        del picked["wrench"]
    for choice in picked.values():
        if is_missed(choice, picked):
            raise refusal(log, topics, choice)
    kinds = {topic.name: choice.kind(topic) for choice in picked.values() if choice.topics for topic in choice.topics}
    maps = {topic.name for topic in picked["map"].topics} if "map" in picked else set()
    result = read(files, wants(kinds), progress, latest=maps)
    return {role: _tables(log, choice, result) for role, choice in picked.items()}, result.damage


def _setting(
    log: str, tables: Mapping[str, Sequence[Table]], options: LoadOptions
) -> tuple[Setting, tuple[Occupancy, str]]:
    """Clock and frames, and the map with its frame."""
    references = (*tables["odometry"], *tables.get("wrench", ()))
    if not references:
        raise LogError(
            f"{log}: expected odometry or a wrench, whose stamps are the recording's clock, found neither; "
            "name the odometry with --topic odometry=/name"
        )
    clock = Clock(references[0].stamped(), options.time)
    tree = TransformTree(
        [link for table in tables["tf_static"] for link in links_of(_tf_columns(table), table.owner_counts)],
        [link for table in tables["tf"] for link in _moving(table, clock)],
    )
    drawn = map_in(log, tables["map"]) if options.occupancy is None else (options.occupancy, "")
    setting = Setting(log, clock, tree, options.frame or drawn[1] or _MAP_FRAME)
    for (parent, child), count in tree.ignored.items():
        setting.note(
            f"{count} transforms {parent} -> {child} cannot be true, or were sent before the clock ran; ignored"
        )
    return setting, drawn


def _tables(log: str, choice: Choice, result: ReadResult) -> list[Table]:
    """What was read of a role's topics."""
    tables = [
        Table.of(result.series[topic.name], choice.kind(topic))
        for topic in choice.topics
        if topic.name in result.series and len(result.series[topic.name])
    ]
    if choice.topics and not tables and choice.role.needed:
        names = ", ".join(topic.name for topic in choice.topics)
        reasons = [str(one) for one in result.damage if any(topic.name in one.reason for topic in choice.topics)]
        why = f": {'; '.join(reasons)}" if reasons else ""
        raise LogError(f"{log}: no message on the {choice.role.name} topic {names} could be read{why}")
    return tables


def _tf_columns(table: Table) -> Mapping[str, NDArray[Any]]:
    return {path: table.columns[name] for name, path in table.kind.fields.items()}


def _moving(table: Table, clock: Clock) -> list[Link]:
    """Links of /tf, whose stamps may lie ahead on purpose but jump as the clock does."""
    columns = _tf_columns(table)
    stamps = columns["transforms[].header.stamp"]
    return links_of(columns, table.owner_counts, clock.shifted(stamps, table.log_time_ns[table.owner]))


def _wrench(table: Table, setting: Setting, base: str, said: str | None) -> Wrench:
    """Forces in the sensor's frame, and how that frame is mounted."""
    table, own = setting.one_frame(table)
    table = setting.measured(table, FORCES, "fx", "fy", "fz")
    if len(table) == 0:
        raise LogError(f"{setting.log}: topic {table.topic}: expected forces, found none that are finite")
    frame = said or own
    if not frame:
        setting.note(f"{table.topic} names no frame; it is taken to be {base!r}, unless --wrench-frame says otherwise")
        frame = base
    stamps = table.times(setting.clock)
    notes: list[str] = []
    rows = in_order(table.topic, stamps, notes)
    for text in notes:
        setting.note(text)
    force = table.stacked("fx", "fy", "fz")[rows]
    t_ns = stamps[rows]
    try:
        span = setting.tree.span(base, frame)
        mounted = setting.tree.lookup(base, frame, t_ns[:1] if span is None else np.clip(t_ns, *span))
    except FrameError as error:
        raise FrameError(
            f"{setting.log}: the wrench is given in frame {frame!r}: {error}; or say with --wrench-frame which frame "
            "its axes are parallel to"
        ) from error
    turns = mounted.rotation.as_matrix()
    if span is not None:
        setting.note(f"the wrench's frame {frame!r} moves on {base!r}; the handle's weight may not cancel out")
    return Wrench(t_ns, force, turns[0] if span is None else turns)


def _commands(tables: Sequence[Table], clock: Clock) -> tuple[IntArray, FloatArray]:
    """(c,) ns and (c,) how far the joystick is from where its axes rest: a stick at 0, a pad's triggers at 1."""
    times = [np.zeros(0, dtype=np.int64)]
    away = [np.zeros(0)]
    for table in tables:
        if len(table) == 0:
            continue
        if table.counts is None:
            axes = table.stacked("lx", "ly", "lz", "ax", "ay", "az")
        else:
            axes = np.full((len(table), max(int(table.counts.max()), 1)), np.nan)
            first = np.cumsum(table.counts) - table.counts
            places = np.arange(len(table.columns["axes"])) - first[table.owner]
            axes[table.owner, places] = table.columns["axes"]
        axes = np.where(np.isfinite(axes), axes, 0.0)
        near = np.abs(axes) < _STICK_REST
        # what comes back to 0 rests there, wherever it is most of the time; a trigger shows 0 until it is first touched
        back = (near & np.logical_or.accumulate(~near, axis=0)).mean(axis=0) > _RESTS
        rest = np.where(back | (table.counts is None), 0.0, np.median(axes, axis=0))
        away.append(np.abs(axes - rest).max(axis=1))
        times.append(clock.times(Stamped(table.topic, table.log_time_ns, table.columns.get("stamp"), momentary=True)))
    t_ns = np.concatenate(times)
    order = np.argsort(t_ns, kind="stable")
    return t_ns[order], np.concatenate(away)[order]
