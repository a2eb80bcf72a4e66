"""From a recording to its demonstrations."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from navirl_cli.demos.checks import (
    check_cells,
    check_gaps,
    check_goal,
    check_start,
    jump_notes,
    people_notes,
    recording_notes,
)
from navirl_cli.demos.contact import Pushes, PushSettings, contacts_within, pushes_of
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.gain import Gain, gain_of
from navirl_cli.demos.grid import Grid, IntArray, grid_from_occupancy
from navirl_cli.demos.people import People, people_during
from navirl_cli.demos.rasterize import Rule, rasterize
from navirl_cli.demos.trials import MIN_TRAVEL_M, Split, Trial, trials_of
from navirl_cli.errors import DemonstrationError, NavirlError
from navirl_cli.logs.recording import Declared, Recording

#: A joystick that is deflected beyond this steers the robot, and for this long in all it makes a joystick trial.
STICK_DEAD_ZONE = 0.1
STEERED_S = 0.3


@dataclass(frozen=True)
class ExtractSettings:
    """What a user can say about the extraction."""

    split: Split = Split.GOAL
    resolution_m: float = 0.1
    robot_radius_m: float = 0.3
    rasterizer: Rule = Rule.STUDY
    push: PushSettings = field(default_factory=PushSettings)
    participant: str | None = None
    #: (x, y) m, map frame, each: in place of the log's people.
    people_m: tuple[tuple[float, float], ...] | None = None
    #: In place of the log's goals; a log that announces none has it from its start.
    goal_m: tuple[float, float] | None = None
    #: Whether to estimate how fast the robot gives way to a push.
    gain: bool = False


@dataclass(frozen=True)
class Extraction:
    """What came out of one recording."""

    #: Name of the log.
    log: str
    demonstrations: tuple[Demonstration, ...]
    #: Trials found, those that were skipped included.
    trials: int
    #: What was skipped, and why.
    skipped: tuple[str, ...]
    #: What of the log could not be read.
    damage: tuple[str, ...]
    #: What is odd about the recording; notes on a trial stand in its demonstration.
    notes: tuple[str, ...]
    #: How fast the robot gives way to a push; None where nobody asked, or nobody pushed.
    gain: Gain | None = None


def extract(recording: Recording, settings: ExtractSettings) -> Extraction:
    """Turn one recording into demonstrations.

    A trial that cannot become a demonstration is skipped with the reason; the others stand.

    Args:
        recording: A log's content in one frame.
        settings: The user's choices.

    Returns:
        Demonstrations with ids ``participant/number``.

    Raises:
        NavirlError: Nothing in the recording is usable.
    """
    recording = _with_said(recording, settings)
    occupancy = recording.occupancy
    grid = grid_from_occupancy(
        occupancy.data, occupancy.resolution_m, occupancy.origin_m, settings.robot_radius_m
    ).resampled(settings.resolution_m)
    pushes = pushes_of(recording, settings.push)
    trials = trials_of(recording, settings.split)
    participant = settings.participant or recording.participant or recording.log.partition(".mcap")[0]
    found: list[Demonstration] = []
    skipped: list[tuple[int, str]] = []
    for number, trial in enumerate(trials, start=1):
        name = f"{participant}/{number}"
        try:
            found.append(_demonstration(recording, trial, pushes, grid, settings, name))
        except NavirlError as error:
            skipped.append((number, str(error)))
    if not found:
        reasons = "; ".join(_grouped(skipped)) or "no goal is announced while poses are recorded"
        raise DemonstrationError(f"{recording.log}: no trial became a demonstration: {reasons}")
    lines = tuple(f"{recording.log}: {line}" for line in _grouped(skipped))
    notes = [*recording.notes, *recording_notes(recording, pushes, settings.push)]
    gain = gain_of(recording, pushes, found, settings.push.begins_n) if settings.gain else None
    if settings.gain and gain is None:
        notes.append(f"{recording.log}: no trial holds a push to the side, so that its gain is unknown")
    return Extraction(recording.log, tuple(found), len(trials), lines, recording.damage, tuple(notes), gain)


def numbered(extractions: Iterable[Extraction]) -> list[Demonstration]:
    """Demonstrations of several recordings with unique ids: a participant's trials are counted through.

    A trial that was skipped keeps its number, so that an id means the same trial whatever the settings.
    """
    before: Counter[str] = Counter()
    unique = []
    for extraction in extractions:
        counted = Counter({one.participant: extraction.trials for one in extraction.demonstrations})
        for one in extraction.demonstrations:
            number = before[one.participant] + int(one.id.rpartition("/")[2])
            unique.append(replace(one, id=f"{one.participant}/{number}"))
        before += counted
    return unique


def _with_said(recording: Recording, settings: ExtractSettings) -> Recording:
    """The recording with the goal that the user said in place of its own; without any it is announced at the start."""
    if settings.goal_m is None:
        return recording
    times = recording.goal_t_ns if len(recording.goal_t_ns) else recording.t_ns[:1]
    return replace(recording, goal_t_ns=times, goal_m=np.tile(settings.goal_m, (len(times), 1)))


def _grouped(skipped: list[tuple[int, str]]) -> list[str]:
    """One line a reason."""
    by_reason: dict[str, list[str]] = {}
    for number, reason in skipped:
        by_reason.setdefault(reason, []).append(str(number))
    return [
        f"trial{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}: {reason}"
        for reason, numbers in by_reason.items()
    ]


def _demonstration(
    recording: Recording, trial: Trial, pushes: Pushes, grid: Grid, settings: ExtractSettings, name: str
) -> Demonstration:
    """One trial as a demonstration."""
    span = slice(trial.first, trial.stop)
    t_ns, xy = recording.t_ns[span], recording.xy_m[span]
    start_ns, stop_ns = int(t_ns[0]), int(t_ns[-1])
    travelled = float(np.hypot(*(xy - xy[0]).T).max())
    if travelled < MIN_TRAVEL_M:
        raise DemonstrationError(f"the robot gets no farther than {travelled:.2f} m: an empty trial")
    check_gaps(recording, trial, pushes)
    goal = trial.goal_m or settings.goal_m or (float(xy[-1, 0]), float(xy[-1, 1]))
    people = _people(recording, settings, start_ns, stop_ns)
    check_start(people.people_m, xy[0], settings.robot_radius_m)
    cells = rasterize(xy, grid, settings.rasterizer)
    free = grid.freed(cells)
    check_cells(cells, xy, grid, settings.robot_radius_m)
    if not trial.arrived:
        check_goal(free, xy[0], goal)
    contacts = contacts_within(pushes, start_ns, stop_ns)
    steered = _steered_s(recording, start_ns, stop_ns) > STEERED_S
    declared = _declared(recording, start_ns, stop_ns)
    observed = Condition.JOYSTICK if steered else Condition.FORCE if contacts else Condition.AUTONOMOUS
    path_notes = _path_notes(trial, cells, grid, float(np.hypot(*(xy[-1] - goal))))
    jumps = jump_notes(recording, start_ns, stop_ns)
    return Demonstration(
        id=name,
        participant=name.rpartition("/")[0],
        condition=observed if declared.condition is None else _condition(declared.condition),
        corrected=bool(contacts) or steered,
        cycle=declared.cycle,
        start_ns=start_ns,
        t_s=(t_ns - start_ns) / 1e9,
        xy_m=xy,
        yaw_rad=recording.yaw_rad[span],
        force_n=np.stack([np.interp(t_ns, pushes.t_ns, axis) for axis in pushes.force_n.T], axis=1),
        contacts=contacts,
        goal_m=goal,
        people_m=people.people_m,
        robot_radius_m=settings.robot_radius_m,
        grid=free,
        cells=cells,
        log=recording.log,
        tracks=people.tracks,
        notes=(*path_notes, *jumps, *people.notes, *people_notes(recording, people.people_m)),
    )


def _path_notes(trial: Trial, cells: IntArray, grid: Grid, from_goal_m: float) -> list[str]:
    """What is odd about where a trial led."""
    notes = []
    if not trial.arrived:
        notes.append(f"ended {from_goal_m:.2f} m from its goal; its last cell stands for the goal")
    blocked = int(grid.is_occupied(np.unique(cells, axis=0)).sum())
    if blocked:
        notes.append(f"{blocked} driven cells that the map calls occupied were freed")
    return notes


def _people(recording: Recording, settings: ExtractSettings, start_ns: int, stop_ns: int) -> People:
    """The people of a trial: those whom the user placed, else those of the log."""
    if settings.people_m is not None:
        return People(np.array(settings.people_m))
    return people_during(recording, start_ns, stop_ns)


def _steered_s(recording: Recording, start_ns: int, stop_ns: int) -> float:
    """Time with the joystick deflected, s; a command holds until the next one, half a second at most."""
    first, stop = np.searchsorted(recording.command_t_ns, [start_ns, stop_ns])
    if stop - first < 2:
        return 0.0
    held = np.minimum(np.diff(recording.command_t_ns[first:stop]) / 1e9, 0.5)
    return float(held[recording.command[first : stop - 1] > STICK_DEAD_ZONE].sum())


def _declared(recording: Recording, start_ns: int, stop_ns: int) -> Declared:
    """What the protocol says of the trial: the entry whose time lies nearest to the trial's start."""
    if not recording.declared:
        return Declared(start_ns)
    nearest = min(recording.declared, key=lambda entry: abs(entry.t_ns - start_ns))
    # An entry far from the start belongs to another trial.
    return nearest if abs(nearest.t_ns - start_ns) < (stop_ns - start_ns) else Declared(start_ns)


def _condition(name: str) -> Condition:
    """A condition by its name in a log."""
    try:
        return Condition(name)
    except ValueError:
        known = ", ".join(Condition)
        raise DemonstrationError(f"unknown condition {name!r} in the log's session record; known are {known}") from None
