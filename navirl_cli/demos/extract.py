"""From a recording to its demonstrations."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.demos.checks import (
    check_cells,
    check_gaps,
    check_goal,
    check_start,
    check_travel,
    jump_notes,
    path_notes,
    people_notes,
    recording_notes,
)
from navirl_cli.demos.contact import Pushes, PushSettings, contacts_within, pushes_of
from navirl_cli.demos.demonstration import Condition, Contact, Demonstration
from navirl_cli.demos.gain import Gain, gain_of
from navirl_cli.demos.grid import Grid
from navirl_cli.demos.ground import TrialGrids
from navirl_cli.demos.people import People, people_during
from navirl_cli.demos.rasterize import Rule, rasterize
from navirl_cli.demos.trials import Split, Trial, trials_of
from navirl_cli.demos.truncation import truncation_of, unseen_goals
from navirl_cli.errors import DemonstrationError, NavirlError, TruncatedError
from navirl_cli.logs.recording import Declared, Published, Recording

Entry = TypeVar("Entry", Declared, Published)

#: A joystick that is deflected beyond this steers the robot, and for this long in all it makes a joystick trial.
STICK_DEAD_ZONE = 0.1
STEERED_S = 0.3
#: The robot's radius where neither user nor log gives one, m.
ROBOT_RADIUS_M = 0.3


@dataclass(frozen=True)
class ExtractSettings:
    """The user's choices about the extraction."""

    split: Split = Split.GOAL
    resolution_m: float = 0.1
    #: None: that of the log's session record, else ROBOT_RADIUS_M.
    robot_radius_m: float | None = None
    rasterizer: Rule = Rule.STUDY
    push: PushSettings = field(default_factory=PushSettings)
    participant: str | None = None
    #: (x, y) m, map frame, each: in place of the log's people.
    people_m: tuple[tuple[float, float], ...] | None = None
    #: In place of the log's goals; in a log without goals from its start on.
    goal_m: tuple[float, float] | None = None
    #: Whether to estimate how fast the robot gives way to a push.
    gain: bool = False
    #: Whether trials that are cut off are kept, marked as truncated.
    keep_truncated: bool = False


@dataclass(frozen=True, eq=False)
class Extraction(ByContent):
    """The demonstrations of one recording, and what was found about it."""

    #: Name of the log.
    log: str
    demonstrations: tuple[Demonstration, ...]
    #: Trials found, those that were skipped included.
    trials: int
    #: The trials that were skipped, and why.
    skipped: tuple[str, ...]
    #: Damage of the log.
    damage: tuple[str, ...]
    #: What is unusual about the recording; notes on a trial are in its demonstration.
    notes: tuple[str, ...]
    #: How fast the robot gives way to a push; None where it was not requested, or no push allows an estimate.
    gain: Gain | None = None
    #: Names of the paths whose cells were published with the log, and whether our cells are equal.
    published: Mapping[str, bool] = field(default_factory=dict)
    #: Times in which a course was completed, s, by modality, from the log's session record.
    completion_s: Mapping[str, Sequence[float]] = field(default_factory=dict)


def extract(recording: Recording, settings: ExtractSettings) -> Extraction:
    """Turn one recording into demonstrations.

    A trial that cannot become a demonstration is skipped with the reason.

    Args:
        recording: A log's content in one frame and on one clock.
        settings: The user's choices.

    Returns:
        Demonstrations with ids ``participant/number``.

    Raises:
        NavirlError: No trial of the recording is usable.
    """
    recording = _with_goal(recording, settings)
    grids = TrialGrids(recording, _radius_m(recording, settings), settings.resolution_m)
    pushes = None if recording.wrench is None else pushes_of(recording, settings.push)
    trials = trials_of(recording, settings.split)
    participant = settings.participant or recording.session.participant or recording.log.partition(".mcap")[0]
    found: list[Demonstration] = []
    skipped: list[tuple[int, NavirlError]] = []
    for number, trial in enumerate(trials, start=1):
        name = f"{participant}/{number}"
        try:
            found.append(_demonstration(recording, trial, pushes, grids, settings, name))
        except NavirlError as error:
            skipped.append((number, error))
    unseen = unseen_goals(recording) if settings.split is Split.GOAL else ""
    reasons = [*_grouped(skipped), *([unseen] if unseen else [])]
    if not found:
        cut = bool(skipped) and all(isinstance(error, TruncatedError) for _, error in skipped)
        why = "; ".join(reasons) or "no goal is announced while poses are recorded"
        text = f"{recording.log}: no trial became a demonstration: {why}"
        raise TruncatedError(text) if cut else DemonstrationError(text)
    lines = tuple(f"{recording.log}: {line}" for line in reasons)
    notes = [*recording.notes, *recording_notes(recording, pushes, settings.push)]
    gain = gain_of(recording, pushes, found, settings.push.begins_n) if settings.gain and pushes else None
    if settings.gain and gain is None:
        notes.append(f"{recording.log}: the gain is unknown, because no trial holds a push to the side")
    warnings = tuple(line.removeprefix(f"{recording.log}: ") for line in (*recording.damage, *notes))
    return Extraction(
        log=recording.log,
        demonstrations=tuple(replace(one, warnings=warnings) for one in found),
        trials=len(trials),
        skipped=lines,
        damage=recording.damage,
        notes=tuple(notes),
        gain=gain,
        published=_published(recording, found),
        completion_s=recording.session.completion_s,
    )


def numbered(extractions: Iterable[Extraction]) -> list[Demonstration]:
    """Demonstrations of several recordings with unique ids: a participant's trials are numbered throughout.

    A skipped trial keeps its number, so that an id means the same trial for all settings.
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


def _with_goal(recording: Recording, settings: ExtractSettings) -> Recording:
    """The recording with the user's goal in place of its own; in one without goals it is announced at the start."""
    if settings.goal_m is None:
        return recording
    times = recording.goal_t_ns if len(recording.goal_t_ns) else recording.t_ns[:1]
    return replace(recording, goal_t_ns=times, goal_m=np.tile(settings.goal_m, (len(times), 1)))


def _grouped(skipped: Sequence[tuple[int, NavirlError]]) -> list[str]:
    """One line for each reason."""
    by_reason: dict[str, list[str]] = {}
    for number, error in skipped:
        by_reason.setdefault(str(error), []).append(str(number))
    return [
        f"trial{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}: {reason}"
        for reason, numbers in by_reason.items()
    ]


def _demonstration(
    recording: Recording, trial: Trial, pushes: Pushes | None, grids: TrialGrids, settings: ExtractSettings, name: str
) -> Demonstration:
    """One trial as a demonstration."""
    span = slice(trial.first, trial.stop)
    t_ns, xy = recording.t_ns[span], recording.xy_m[span]
    start_ns, stop_ns = int(t_ns[0]), int(t_ns[-1])
    check_travel(xy)
    check_gaps(recording, trial, pushes)
    cut_off = _cut_off(recording, trial, settings)
    goal = trial.goal_m or settings.goal_m or (float(xy[-1, 0]), float(xy[-1, 1]))
    people = _people(recording, settings, start_ns, stop_ns)
    radius_m = _radius_m(recording, settings)
    check_start(people.people_m, xy[0], radius_m)
    ground = grids.during(start_ns, stop_ns)
    grid, occupancy = ground.grid, ground.occupancy
    cells, free = _on_grid(xy, grid, settings.rasterizer, radius_m)
    if not trial.arrived:
        check_goal(free, xy[0], goal)
    declared = _nearest(recording.session.declared, start_ns, stop_ns) or Declared(start_ns)
    contacts = None if pushes is None else contacts_within(pushes, start_ns, stop_ns)
    observed, corrected = _observed(contacts, steered=_steered_s(recording, start_ns, stop_ns) > STEERED_S)
    notes = [
        *cut_off,
        *ground.notes,
        *path_notes(trial, cells, grid, xy[-1] - goal),
        *jump_notes(recording, start_ns, stop_ns),
    ]
    return Demonstration(
        id=name,
        participant=name.rpartition("/")[0],
        condition=observed if declared.condition is None else _condition(declared.condition),
        corrected=corrected,
        cycle=declared.cycle,
        start_ns=start_ns,
        t_s=(t_ns - start_ns) / 1e9,
        xy_m=xy,
        yaw_rad=recording.yaw_rad[span],
        force_n=None if pushes is None else pushes.force_at(t_ns),
        contacts=contacts,
        goal_m=goal,
        people_m=people.people_m,
        robot_radius_m=radius_m,
        grid=free,
        cells=cells,
        log=recording.log,
        tracks=people.tracks,
        set=declared.set,
        nominal_m=declared.nominal_m,
        laid_out_m_s=recording.session.laid_out_m_s,
        truncated=bool(cut_off),
        notes=(*notes, *people.notes, *people_notes(recording, occupancy, people.people_m)),
    )


def _cut_off(recording: Recording, trial: Trial, settings: ExtractSettings) -> list[str]:
    """A note where a trial is cut off, which is refused unless the user keeps such trials."""
    reason = truncation_of(recording, trial, settings.split)
    if not reason:
        return []
    away = recording.xy_m[trial.stop - 1] - (recording.xy_m[trial.stop - 1] if trial.goal_m is None else trial.goal_m)
    far = (
        "" if trial.arrived or trial.goal_m is None else f", and the last pose is {np.hypot(*away):.2f} m from the goal"
    )
    if not settings.keep_truncated:
        raise TruncatedError(f"cut off: {reason}{far}; keep it, marked as truncated, with `keep_truncated`")
    return [f"truncated: {reason}"]


def _on_grid(xy_m: FloatArray, grid: Grid, rule: Rule, radius_m: float) -> tuple[IntArray, Grid]:
    """The path's cells, and the map with these freed."""
    cells = rasterize(xy_m, grid, rule)
    free = grid.freed(cells)
    check_cells(cells, xy_m, grid, radius_m)
    return cells, free


def _people(recording: Recording, settings: ExtractSettings, start_ns: int, stop_ns: int) -> People:
    """The people of a trial: those placed by the user, else those of the log."""
    if settings.people_m is not None:
        return People(np.array(settings.people_m))
    return people_during(recording, start_ns, stop_ns)


def _steered_s(recording: Recording, start_ns: int, stop_ns: int) -> float:
    """Time with the joystick deflected, s; a command holds until the next one, for half a second at most."""
    first, stop = np.searchsorted(recording.command_t_ns, [start_ns, stop_ns])
    if stop - first < 2:
        return 0.0
    held = np.minimum(np.diff(recording.command_t_ns[first:stop]) / 1e9, 0.5)
    return float(held[recording.command[first : stop - 1] > STICK_DEAD_ZONE].sum())


def _radius_m(recording: Recording, settings: ExtractSettings) -> float:
    """The robot's radius from the user, else from the log, m."""
    radii = (settings.robot_radius_m, recording.session.robot_radius_m, ROBOT_RADIUS_M)
    return next(radius for radius in radii if radius is not None)


def _published(recording: Recording, found: Iterable[Demonstration]) -> dict[str, bool]:
    """Whether cells are as published, by the published path's name; False without a demonstration."""
    known = recording.session.published
    same = dict.fromkeys((entry.name for entry in known), False)
    for one in found:
        entry = _nearest(known, one.start_ns, one.start_ns + round(one.duration_s * 1e9))
        if entry is not None:
            same[entry.name] = np.array_equal(entry.cells, one.cells)
    return same


def _nearest(entries: Sequence[Entry], start_ns: int, stop_ns: int) -> Entry | None:
    """The entry of a metadata record for a trial: the one whose time is nearest to the trial's start."""
    nearest = min(entries, key=lambda entry: abs(entry.t_ns - start_ns), default=None)
    # an entry far from the start belongs to another trial
    return nearest if nearest is not None and abs(nearest.t_ns - start_ns) < (stop_ns - start_ns) else None


def _observed(contacts: Sequence[Contact] | None, *, steered: bool) -> tuple[Condition, bool | None]:
    """The condition by joystick and wrench, and whether the person intervened."""
    if steered:
        return Condition.JOYSTICK, True
    if contacts is None:
        return Condition.UNKNOWN, None
    return (Condition.FORCE, True) if contacts else (Condition.AUTONOMOUS, False)


def _condition(name: str) -> Condition:
    """A condition by its name in a log."""
    try:
        return Condition(name)
    except ValueError:
        known = ", ".join(Condition)
        raise DemonstrationError(
            f"the log's session record: expected a condition ({known}), found {name!r}; correct it"
        ) from None
