"""From a recording to its demonstrations."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from navirl_cli.demos.contact import Pushes, PushSettings, contacts_within, pushes_of
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.grid import FloatArray, Grid, grid_from_occupancy
from navirl_cli.demos.lines import path_length_m, thinned
from navirl_cli.demos.rasterize import rasterize
from navirl_cli.demos.trials import MIN_TRAVEL_M, Split, Trial, trials_of
from navirl_cli.errors import DemonstrationError, NavirlError
from navirl_cli.logs.recording import Declared, Recording

#: A joystick that is deflected beyond this steers the robot, and for this long in all it makes a joystick trial.
STICK_DEAD_ZONE = 0.1
STEERED_S = 0.3
#: A path of cells is longer than its line; one shorter than this share of it has lost something.
LOOPS = 0.9
#: A contact must stand out of the noise this many times.
NOISE_MARGIN = 5.0


@dataclass(frozen=True)
class ExtractSettings:
    """What a user can say about the extraction."""

    split: Split = Split.GOAL
    resolution_m: float = 0.1
    robot_radius_m: float = 0.3
    push: PushSettings = field(default_factory=PushSettings)
    participant: str | None = None
    #: (x, y) m, map frame, each: in place of the log's people.
    people_m: tuple[tuple[float, float], ...] | None = None
    #: In place of the log's goals; a log that announces none has it from its start.
    goal_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class Extraction:
    """What came out of one recording."""

    demonstrations: tuple[Demonstration, ...]
    #: What was skipped, and why.
    skipped: tuple[str, ...]
    #: What of the log could not be read.
    damage: tuple[str, ...]
    #: What is odd but was used.
    notes: tuple[str, ...]


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
    if settings.goal_m is not None and len(recording.goal_t_ns) == 0:
        recording = replace(recording, goal_t_ns=recording.t_ns[:1], goal_m=np.array([settings.goal_m]))
    occupancy = recording.occupancy
    grid = grid_from_occupancy(
        occupancy.data, occupancy.resolution_m, occupancy.origin_m, settings.robot_radius_m
    ).resampled(settings.resolution_m)
    pushes = pushes_of(recording, settings.push)
    trials = trials_of(recording, settings.split)
    participant = settings.participant or recording.participant or recording.log.removesuffix(".mcap")
    found: list[Demonstration] = []
    skipped: list[str] = []
    for number, trial in enumerate(trials, start=1):
        name = f"{participant}/{number}"
        try:
            found.append(_demonstration(recording, trial, pushes, grid, settings, name))
        except NavirlError as error:
            seconds = (recording.t_ns[trial.first] - recording.t_ns[0]) / 1e9
            skipped.append(f"{recording.log}: the trial {seconds:.1f} s after its start: {error}")
    if not found:
        reasons = "; ".join(skipped) or "no stretch in which the robot moves"
        raise DemonstrationError(f"{recording.log}: no trial became a demonstration: {reasons}")
    notes = [
        *recording.notes,
        *_noise_notes(recording, pushes, settings.push),
        *(f"{d.id}: {note}" for d in found for note in d.notes),
    ]
    return Extraction(tuple(found), tuple(skipped), recording.damage, tuple(notes))


def numbered(demonstrations: Iterable[Demonstration]) -> list[Demonstration]:
    """Demonstrations of several logs with ids that are unique: a participant's trials are counted through."""
    counts: Counter[str] = Counter()
    unique = []
    for demonstration in demonstrations:
        counts[demonstration.participant] += 1
        unique.append(replace(demonstration, id=f"{demonstration.participant}/{counts[demonstration.participant]}"))
    return unique


def _demonstration(
    recording: Recording, trial: Trial, pushes: Pushes, grid: Grid, settings: ExtractSettings, name: str
) -> Demonstration:
    """One trial as a demonstration."""
    span = slice(trial.first, trial.stop)
    t_ns, xy = recording.t_ns[span], recording.xy_m[span]
    travelled = float(np.hypot(*(xy - xy[0]).T).max())
    if travelled < MIN_TRAVEL_M:
        raise DemonstrationError(f"the robot gets no farther than {travelled:.2f} m: an empty trial")
    goal = settings.goal_m or trial.goal_m or (float(xy[-1, 0]), float(xy[-1, 1]))
    people = _people(recording, settings, t_ns[0], t_ns[-1])
    _check_start(people, xy[0], settings.robot_radius_m)
    cells = rasterize(xy, grid)
    blocked = int(grid.is_occupied(np.unique(cells, axis=0)).sum())
    notes = []
    free = grid.freed(cells)
    if not trial.arrived:
        _check_goal(free, xy[0], goal)
        notes.append(
            f"ended {float(np.hypot(*(xy[-1] - goal))):.2f} m from its goal; its last cell stands for the goal"
        )
    if blocked:
        notes.append(f"{blocked} driven cells that the map calls occupied were freed")
    if path_length_m(grid.centres_of(cells)) < LOOPS * path_length_m(thinned(xy, grid.resolution_m)):
        notes.append("its path on the grid is much shorter than the driven one: the rule cuts loops off")
    if len(people) == 0:
        notes.append("no people in the scene; say where they stand with --person x,y")
    contacts = contacts_within(pushes, int(t_ns[0]), int(t_ns[-1]))
    steered = _steered_s(recording, int(t_ns[0]), int(t_ns[-1])) > STEERED_S
    declared = _declared(recording, int(t_ns[0]), int(t_ns[-1]))
    observed = Condition.JOYSTICK if steered else Condition.FORCE if contacts else Condition.AUTONOMOUS
    return Demonstration(
        id=name,
        participant=name.rpartition("/")[0],
        condition=observed if declared.condition is None else _condition(declared.condition),
        corrected=bool(contacts) or steered,
        cycle=declared.cycle,
        start_ns=int(t_ns[0]),
        t_s=(t_ns - t_ns[0]) / 1e9,
        xy_m=xy,
        yaw_rad=recording.yaw_rad[span],
        force_n=np.stack([np.interp(t_ns, pushes.t_ns, axis) for axis in pushes.force_n.T], axis=1),
        contacts=contacts,
        goal_m=goal,
        people_m=people,
        robot_radius_m=settings.robot_radius_m,
        grid=free,
        cells=cells,
        log=recording.log,
        notes=tuple(notes),
    )


def _noise_notes(recording: Recording, pushes: Pushes, push: PushSettings) -> list[str]:
    """A threshold within the noise finds contacts where there are none."""
    if push.begins_n >= NOISE_MARGIN * pushes.noise_n:
        return []
    note = (
        f"{recording.log}: without contact the force still shakes by {pushes.noise_n:.2f} N, so that contacts from "
        f"{push.begins_n:g} N on may be noise; raise --contact-force to {NOISE_MARGIN * pushes.noise_n:.1f}"
    )
    return [note]


def _people(recording: Recording, settings: ExtractSettings, start_ns: int, stop_ns: int) -> FloatArray:
    """(p, 2) m: mean places over the trial, by place in the message; the last known ones where it says none."""
    if settings.people_m is not None:
        return np.array(settings.people_m)
    if not recording.people_m:
        return np.zeros((0, 2))
    first, stop = np.searchsorted(recording.people_t_ns, [start_ns, stop_ns])
    during = recording.people_m[first:stop] or (recording.people_m[max(first - 1, 0)],)
    most = max(len(people) for people in during)
    whole = [people for people in during if len(people) == most]
    mean: FloatArray = np.mean(whole, axis=0)
    return mean


def _check_start(people: FloatArray, start: FloatArray, radius_m: float) -> None:
    """Nobody can stand where the robot starts."""
    for x, y in people:
        distance = float(np.hypot(x - start[0], y - start[1]))
        if distance < radius_m:
            raise DemonstrationError(
                f"a person at x {x:.2f} m, y {y:.2f} m stands on the path's start ({distance:.2f} m from the robot's "
                f"centre, radius {radius_m:.2f} m); check --person, the people topic's frame and --robot-radius"
            )


def _check_goal(grid: Grid, start: FloatArray, goal: tuple[float, float]) -> None:
    """A goal that the robot did not arrive at must be one that it could have arrived at."""
    cell = grid.cells_of(goal)
    if grid.contains(cell) and grid.connected_to(grid.cells_of(start))[cell[1], cell[0]]:
        return
    raise DemonstrationError(
        f"goal unreachable: no free way on the map from x {start[0]:.2f} m, y {start[1]:.2f} m to x {goal[0]:.2f} m, "
        f"y {goal[1]:.2f} m; check the goal, the map and --robot-radius"
    )


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
