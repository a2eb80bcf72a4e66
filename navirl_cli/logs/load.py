"""The way of a log: bytes -> choose -> read -> time -> space -> Recording.

Each stage takes all tables at once, is entered once, and returns everything with what it found out:

1. choose (:mod:`~navirl_cli.logs.roles.topics`): which topic is what;
2. read (:mod:`~navirl_cli.logs.roles.tables`): the columns of these topics;
3. time (:mod:`~navirl_cli.logs.roles.times`): all tables on one clock;
4. space (:mod:`~navirl_cli.logs.roles.space`): all tables in one frame.

Findings are values (:mod:`~navirl_cli.logs.findings`). A stage that must refuse a log says so in ``refusals``, and the
later stages go on with what there is, so that :func:`follow` finds every reason. ``extract`` raises the first of them,
and ``inspect`` shows all (:mod:`~navirl_cli.logs.overview`): both follow the same line and cannot disagree.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Final

from navirl_cli.arrays import ByContent
from navirl_cli.errors import FrameError, LogError, NavirlError, joined
from navirl_cli.logs.container.compressed import open_log
from navirl_cli.logs.container.raw import RawFile
from navirl_cli.logs.findings import Finding, Findings, Kind, Severity, texts
from navirl_cli.logs.messages.reader import Contents, Progress, scan
from navirl_cli.logs.recording import Occupancy, Recording, Session
from navirl_cli.logs.roles.clocks import NS_PER_S, TimeSource
from navirl_cli.logs.roles.commands import commands_of
from navirl_cli.logs.roles.session import session_of
from navirl_cli.logs.roles.space import Placed, in_one_frame
from navirl_cli.logs.roles.tables import read_tables
from navirl_cli.logs.roles.times import Tables, Timed, measured_ns, on_one_clock
from navirl_cli.logs.roles.topics import HOLDS, Choice, choose, is_missing, refusal, shared_topics, topics_of, undefined
from navirl_cli.logs.sources import Source

#: Where the damage of a topic begins in its sentence.
_DAMAGE: Final = re.compile(r"^.*?: bytes \d+ to \d+: (topic \S+: )?")


#: Poses that are missing for longer at the log's beginning or end are worth a word, s.
_MISSING_S: Final = 1.0


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
    #: Of the robot, in a log of several robots.
    namespace: str | None = None
    time: TimeSource = TimeSource.HEADER
    #: The frame that everything is brought into, in place of the map's.
    frame: str | None = None
    #: The frame that the wrench is given in, in place of its header's.
    wrench_frame: str | None = None
    #: N for the unit of the wrench's forces, 1000 where they are in kN.
    force_scale: float = 1.0
    #: A map in place of the log's, in the fixed frame.
    occupancy: Occupancy | None = None
    forces: Forces = Forces.NEEDED
    #: Refuse a log of which something is lost.
    strict: bool = False


@dataclass(frozen=True, eq=False)
class Line:
    """A log after all stages."""

    #: By role the topics that were chosen, those that are not wanted included.
    choices: Mapping[str, Choice]
    #: None where a stage refused the log before.
    timed: Timed | None
    placed: Placed | None
    #: Of all stages, in their order.
    findings: Findings
    #: What is lost, in words.
    lost: tuple[str, ...]
    #: Everything of the log; None where it is refused.
    recording: Recording | None
    #: Why it is refused, all reasons in the order of the stages; empty where it is not.
    refusals: tuple[NavirlError, ...]


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
    with ExitStack() as stack:
        # a file with whole-file compression is decompressed once
        files = [stack.enter_context(open_log(file)) for file in source.files]
        line = follow(source, files, [scan(file) for file in files], options or LoadOptions(), progress)
    if line.recording is None:
        raise _refused(source.name, line)
    return line.recording


def _refused(log: str, line: Line) -> NavirlError:
    """All reasons why a log is refused, as an error of the type of the first; at the end what its topics are."""
    parts = [str(one).partition(HOLDS) for one in line.refusals]
    reasons = [reason for reason, _, _ in parts]
    told = " ".join(reasons)
    # why a topic could not be read is part of its refusal
    reasons += [text for text in line.lost if _DAMAGE.sub("", text) not in told]
    held = next((f"{colon}{topics}" for _, colon, topics in parts if topics), "")
    return type(line.refusals[0])(f"{log}: {joined(reasons, f'{log}: ')}{held}")


def follow(
    source: Source,
    files: Sequence[RawFile],
    contents: Sequence[Contents],
    options: LoadOptions,
    progress: Progress | None = None,
) -> Line:
    """Follow the line from open files to a recording, or to the reasons why there is none.

    Args:
        source: The recording.
        files: Its files, open.
        contents: Of each file.
        options: The user's choices.
        progress: Called with bytes done and bytes in all.

    Raises:
        LogError: A file is no MCAP file, or a requested topic does not fit.
    """
    log = source.name
    topics = topics_of(contents)
    choices = choose(log, topics, options.topics, options.namespace)
    chosen = _wanted(choices, options)
    refusals: list[NavirlError] = [refusal(log, topics, one) for one in chosen.values() if is_missing(one, chosen)]
    read = read_tables(log, files, chosen, progress)
    nothing = undefined(log, topics)
    refusals += [nothing] if nothing else read.refusals
    timed, placed, stopped = _related(log, read.tables, options)
    # without a clock nothing goes on; why there is none is known where a topic is missing or unread
    refusals += placed.refusals if placed else [] if refusals or stopped is None else [stopped]
    foreign = {topic.name: None for choice in chosen.values() for topic in choice.foreign}
    refusals = [_with_foreign(one, tuple(foreign)) for one in refusals]
    findings = (
        *(Finding(Kind.OTHER_ROBOT, name) for name in foreign),
        *shared_topics(topics, chosen),
        *_found(timed, placed),
    )
    damage = source.damage if nothing else (*source.damage, *read.damage)
    lost = (*map(str, damage), *texts(log, findings, Severity.LOSS))
    if lost and options.strict:
        refusals.append(LogError(f"{log}: damaged, which `strict` refuses: {'; '.join(lost)}"))
    line = Line(choices, timed, placed, findings, lost, None, tuple(refusals))
    try:
        session = session_of(log, contents)
        notes = (*source.notes, *texts(log, findings, Severity.NOTE))
        return replace(line, recording=None if refusals else _recording(log, timed, placed, session, lost, notes))
    except NavirlError as error:
        return replace(line, refusals=(*refusals, error))


def _related(log: str, tables: Tables, options: LoadOptions) -> tuple[Timed | None, Placed | None, NavirlError | None]:
    """The stages of time and of space, and why one of them stopped; None for a stage that was not passed."""
    timed = None
    try:
        timed = on_one_clock(log, tables, options.time)
        placed = in_one_frame(
            log,
            timed.tables,
            options.frame,
            options.wrench_frame,
            options.occupancy,
            options.force_scale,
            options.namespace,
        )
    except NavirlError as error:
        return timed, None, error
    return timed, placed, None


def _found(timed: Timed | None, placed: Placed | None) -> Findings:
    """The findings of the stages of time and of space."""
    return (
        *(timed.findings if timed else ()),
        *(placed.findings if placed else ()),
        *(_missing_poses(timed.tables, placed) if timed and placed else ()),
    )


def _missing_poses(tables: Tables, placed: Placed) -> Findings:
    """That poses begin after or end before everything else."""
    measured = measured_ns(tables)
    if placed.poses is None or measured is None or not len(placed.poses.t_ns):
        return ()
    late_s = (int(placed.poses.t_ns[0]) - measured[0]) / NS_PER_S
    early_s = (measured[1] - int(placed.poses.t_ns[-1])) / NS_PER_S
    known = ((Kind.POSES_BEGIN_LATE, late_s), (Kind.POSES_END_EARLY, early_s))
    return tuple(Finding(kind, "poses", size=size_s) for kind, size_s in known if size_s > _MISSING_S)


def _with_foreign(refusal: NavirlError, foreign: Sequence[str]) -> NavirlError:
    """A refusal that, where frames do not connect, names the tf topics that were left out as another robot's."""
    if not isinstance(refusal, FrameError) or not foreign:
        return refusal
    role = "tf_static" if foreign[0].endswith("tf_static") else "tf"
    left_out = f"{', '.join(foreign)} left out as another robot's; if it is this one's, `topic` {role}={foreign[0]}"
    return FrameError(f"{refusal}; {left_out}")


def _wanted(choices: Mapping[str, Choice], options: LoadOptions) -> dict[str, Choice]:
    """The choices of the roles that the options ask for."""
    wanted = dict(choices)
    if options.occupancy is not None:
        del wanted["map"]
    lacking = not (wanted["wrench"].topics or wanted["wrench"].ambiguous)
    if options.forces is Forces.IGNORED or (options.forces is Forces.OPTIONAL and lacking):
        del wanted["wrench"]
    return wanted


def _recording(
    log: str,
    timed: Timed | None,
    placed: Placed | None,
    session: Session,
    damage: tuple[str, ...],
    notes: tuple[str, ...],
) -> Recording:
    """Everything of a log that no stage refused."""
    if timed is None or placed is None or placed.poses is None or placed.occupancy is None:
        raise LogError(f"{log}: expected poses and a map, found none")
    tables = timed.tables
    command_t_ns, command = commands_of(tables.get("joystick", ()))
    return Recording(
        log=log,
        t_ns=placed.poses.t_ns,
        xy_m=placed.poses.xy_m,
        yaw_rad=placed.poses.yaw_rad,
        wrench=placed.wrench,
        occupancy=placed.occupancy,
        maps=placed.maps,
        goal_t_ns=placed.goal_t_ns,
        goal_m=placed.goal_m,
        people_t_ns=placed.people_t_ns,
        people=placed.people,
        command_t_ns=command_t_ns,
        command=command,
        session=session,
        velocity_m_s=placed.poses.velocity_m_s,
        jumps=placed.poses.jumps,
        unplaced_ns=placed.poses.unplaced_ns,
        measured_ns=measured_ns(tables),
        no_goal=_no_goal(tables, placed),
        damage=damage,
        notes=notes,
    )


def _no_goal(tables: Tables, placed: Placed) -> str:
    """What became of the goals where none is left."""
    topics = {columns.topic for columns in tables.get("goal", ())}
    lost = [str(one) for one in placed.findings if one.about in topics and one.kind.severity is Severity.LOSS]
    return "" if len(placed.goal_t_ns) else joined(lost)
