"""From a recording to its demonstrations."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.demos.checks import (
    check_cells,
    check_end,
    check_gaps,
    check_goal,
    check_start,
    check_travel,
    jump_notes,
    path_notes,
    people_notes,
    placed_notes,
    recording_notes,
)
from navirl_cli.demos.contact import Pushes, PushSettings, contacts_within, pushes_of
from navirl_cli.demos.demonstration import Condition, Contact, Demonstration
from navirl_cli.demos.gain import Gain, gain_of
from navirl_cli.demos.grid import Grid
from navirl_cli.demos.ground import TrialGrids
from navirl_cli.demos.labelling import guess_notes, labelled, record_notes, row_notes, stated_of
from navirl_cli.demos.labels import Label
from navirl_cli.demos.people import People, people_during
from navirl_cli.demos.rasterize import Rule, rasterize
from navirl_cli.demos.trials import Split, Trial, entries_by_trial, trials_of, with_goal
from navirl_cli.demos.truncation import truncation_of, unseen_goals
from navirl_cli.errors import MOST_NAMES, DemonstrationError, NavirlError, TruncatedError, joined
from navirl_cli.logs.occupancy import Occupancy
from navirl_cli.logs.recording import Declared, Recording

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
    #: Of all trials, in place of what the logs or the labels state.
    participant: str | None = None
    condition: Condition | None = None
    cycle: int | None = None
    set: str | None = None
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
    #: What was read of objects in a store, which is true of this run alone.
    fetched: tuple[str, ...] = ()
    #: How fast the robot gives way to a push; None where it was not requested, or no push allows an estimate.
    gain: Gain | None = None
    #: Names of the paths whose cells were published with the log, and whether our cells are equal.
    published: Mapping[str, bool] = field(default_factory=dict)
    #: Times in which a course was completed, s, by modality, from the log's session record.
    completion_s: Mapping[str, Sequence[float]] = field(default_factory=dict)


def extract(recording: Recording, settings: ExtractSettings, labels: Sequence[Label] = ()) -> Extraction:
    """Turn one recording into demonstrations.

    A trial that cannot become a demonstration is skipped with the reason.

    Args:
        recording: A log's content in one frame and on one clock.
        settings: The user's choices.
        labels: What the experimenter states of the trials, over what the log's session record states.

    Returns:
        Demonstrations with ids ``participant/number``.

    Raises:
        NavirlError: No trial of the recording is usable, or a label fits none.
    """
    recording, trials, stated = _trials(recording, settings, labels)
    grids = TrialGrids(recording, _radius_m(recording, settings), settings.resolution_m)
    pushes = None if recording.wrench is None else pushes_of(recording, settings.push)
    found: list[Demonstration] = []
    skipped: list[tuple[int, NavirlError]] = []
    for number, (trial, declared) in enumerate(zip(trials, stated, strict=True), start=1):
        name = f"{declared.participant or recording.log.partition('.mcap')[0]}/{number}"
        try:
            found.append(_demonstration(recording, trial, pushes, grids, settings, name, declared))
        except NavirlError as error:
            skipped.append((number, error))
    unseen = unseen_goals(recording) if settings.split is Split.GOAL else ""
    reasons = [*_grouped(skipped), *([unseen] if unseen else [])]
    if not found:
        raise _nothing(recording, reasons, [error for _, error in skipped])
    lines = tuple(f"{recording.log}: {line}" for line in reasons)
    notes = [*recording.notes, *recording_notes(recording, pushes, settings.push)]
    own = {(number := _number(one)): stated[number - 1] for one in found}
    notes += [
        *record_notes(recording, trials),
        *row_notes(recording, trials, labels, own),
        *guess_notes(recording, own.values()),
    ]
    gain, unknown = _gain(recording, pushes, found, settings)
    notes += [f"{recording.log}: {unknown}"] if unknown else []
    # where and what stands in the log's own damage, whose paths mean nothing elsewhere
    lost = ["data of its log is lost, as extract lists"] if recording.damage else []
    warnings = (*lost, *(line.removeprefix(f"{recording.log}: ") for line in notes))
    return Extraction(
        log=recording.log,
        demonstrations=tuple(replace(one, warnings=warnings) for one in found),
        trials=len(trials),
        skipped=lines,
        damage=recording.damage,
        notes=tuple(notes),
        gain=gain,
        published=_published(recording, trials, found),
        completion_s=recording.session.completion_s,
    )


def _gain(
    recording: Recording, pushes: Pushes | None, found: Sequence[Demonstration], settings: ExtractSettings
) -> tuple[Gain | None, str]:
    """The gain where it is asked for, and why it is unknown."""
    if not settings.gain:
        return None, ""
    if recording.session.laid_out_m_s is not None:
        return None, "the gain is unknown, because the positions came without times"
    gain = None if pushes is None else gain_of(recording, pushes, found, settings.push.begins_n)
    return gain, "" if gain else "the gain is unknown, because no trial holds a push to the side"


def _nothing(recording: Recording, reasons: Sequence[str], errors: Sequence[NavirlError]) -> NavirlError:
    """The error of a recording of which no trial is left."""
    cut = bool(errors) and all(isinstance(error, TruncatedError) for error in errors)
    reasons = reasons or ["no goal is announced while poses are recorded"]
    prefix = f"{recording.log}: "
    # what was lost on the way may be the cause
    text = f"{prefix}no trial became a demonstration: {joined([*reasons, *recording.damage], prefix)}"
    return TruncatedError(text) if cut else DemonstrationError(text)


def numbered(extractions: Iterable[Extraction]) -> list[Demonstration]:
    """Demonstrations of several recordings with unique ids: a participant's trials are numbered throughout.

    A skipped trial keeps its number, so that an id means the same trial for all settings.
    """
    before: Counter[str] = Counter()
    unique = []
    for extraction in extractions:
        counted = Counter({one.participant: extraction.trials for one in extraction.demonstrations})
        for one in extraction.demonstrations:
            number = before[one.participant] + _number(one)
            unique.append(replace(one, id=f"{one.participant}/{number}"))
        before += counted
    return unique


def _grouped(skipped: Sequence[tuple[int, NavirlError]]) -> list[str]:
    """One line for each reason."""
    by_reason: dict[str, list[str]] = {}
    for number, error in skipped:
        by_reason.setdefault(str(error), []).append(str(number))
    return [
        f"trial{'s' if len(numbers) > 1 else ''} {_numbers(numbers)}: {reason}" for reason, numbers in by_reason.items()
    ]


def _numbers(numbers: Sequence[str]) -> str:
    """Numbers of trials, of many the first ones."""
    more = f" and {len(numbers) - MOST_NAMES} others" if len(numbers) > MOST_NAMES else ""
    return ", ".join(numbers[:MOST_NAMES]) + more


def _demonstration(
    recording: Recording,
    trial: Trial,
    pushes: Pushes | None,
    grids: TrialGrids,
    settings: ExtractSettings,
    name: str,
    declared: Declared,
) -> Demonstration:
    """One trial as a demonstration."""
    span = slice(trial.first, trial.stop)
    t_ns, xy = recording.t_ns[span], recording.xy_m[span]
    start_ns, stop_ns = int(t_ns[0]), int(t_ns[-1])
    check_travel(xy)
    check_gaps(recording, trial, pushes)
    cut_off = _cut_off(recording, trial, settings)
    placed = _placed(recording, trial, grids, settings, declared)
    people = placed.people
    contacts = None if pushes is None else contacts_within(pushes, start_ns, stop_ns)
    observed, corrected = _observed(contacts, steered=_steered_s(recording, start_ns, stop_ns) > STEERED_S)
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
        goal_m=placed.goal_m,
        people_m=people.people_m,
        robot_radius_m=placed.radius_m,
        grid=placed.grid,
        cells=placed.cells,
        log=recording.log,
        tracks=people.tracks,
        set=declared.set,
        nominal_m=declared.nominal_m,
        laid_out_m_s=recording.session.laid_out_m_s,
        truncated=bool(cut_off),
        notes=(*cut_off, *placed.notes, *people.notes),
    )


class _Placed(NamedTuple):
    """A trial's path on the map, with the people beside it."""

    goal_m: tuple[float, float]
    radius_m: float
    people: People
    cells: IntArray
    #: With all cells of the path free.
    grid: Grid
    notes: tuple[str, ...]


def _placed(
    recording: Recording, trial: Trial, grids: TrialGrids, settings: ExtractSettings, declared: Declared
) -> _Placed:
    """Put a trial on its map."""
    span = slice(trial.first, trial.stop)
    xy, start_ns, stop_ns = recording.xy_m[span], int(recording.t_ns[span][0]), int(recording.t_ns[span][-1])
    goal = trial.goal_m or settings.goal_m or (float(xy[-1, 0]), float(xy[-1, 1]))
    radius_m = _radius_m(recording, settings)
    ground = grids.during(start_ns, stop_ns)
    people = _people(recording, settings, declared, trial, ground.occupancy)
    check_start(people.people_m, xy[0], radius_m)
    cells, free = _on_grid(xy, ground.grid, settings.rasterizer, radius_m)
    if not trial.arrived:
        check_goal(free, xy[0], goal)
    notes = (
        *ground.notes,
        *path_notes(trial, cells, ground.grid, xy[-1] - goal),
        *jump_notes(recording, start_ns, stop_ns),
    )
    return _Placed(goal, radius_m, people, cells, free, notes)


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


def _people(
    recording: Recording, settings: ExtractSettings, declared: Declared, trial: Trial, occupancy: Occupancy
) -> People:
    """The people of a trial: those placed by the user, else by labels, with what contradicts them; else the log's."""
    xy, radius_m = recording.xy_m[trial.first : trial.stop], _radius_m(recording, settings)
    logged = people_during(recording, int(recording.t_ns[trial.first]), int(recording.t_ns[trial.stop - 1]))
    by = "`person`" if settings.people_m is not None else "people_m"
    placed = declared.people_m if settings.people_m is None else np.array(settings.people_m)
    if placed is None:
        return replace(logged, notes=(*logged.notes, *people_notes(recording, occupancy, logged.people_m)))
    check_end(placed, xy[-1], radius_m, by)
    known = logged.people_m if len(recording.people_t_ns) else None
    notes = placed_notes(placed, known, xy, radius_m, by)
    own = people_notes(recording, occupancy, placed) if len(placed) else ["nobody was there"]
    return People(placed, notes=(*notes, *own))


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


def _published(recording: Recording, trials: Sequence[Trial], found: Iterable[Demonstration]) -> dict[str, bool]:
    """Whether cells are as published, by the published path's name; False without a demonstration."""
    known = recording.session.published
    same = dict.fromkeys((entry.name for entry in known), False)
    by_trial = entries_by_trial(known, recording, trials)
    for one in found:
        entry = by_trial.get(_number(one) - 1)
        if entry is not None:
            same[entry.name] = np.array_equal(entry.cells, one.cells)
    return same


def _number(one: Demonstration) -> int:
    """The number of a demonstration's trial."""
    return int(one.id.rpartition("/")[2])


def _trials(
    recording: Recording, settings: ExtractSettings, labels: Sequence[Label]
) -> tuple[Recording, list[Trial], list[Declared]]:
    """The recording with goal and labels in place of its own, its trials, and what is stated of each."""
    recording = with_goal(recording, settings.goal_m)
    trials = trials_of(recording, settings.split)
    recording = replace(recording, session=labelled(recording, trials, labels))
    given = {name: getattr(settings, name) for name in ("participant", "condition", "cycle", "set")}
    return recording, trials, stated_of(recording, trials, given)


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
