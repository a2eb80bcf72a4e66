"""Checks that refuse a trial as evidence, and notes on what a user should know about a recording."""

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.contact import MIN_CONTACT_S, Pushes, PushSettings, hysteresis, missing_s
from navirl_cli.demos.grid import OCCUPIED_FROM, Grid, is_costmap
from navirl_cli.demos.lines import path_length_m, thinned
from navirl_cli.demos.trials import MIN_TRAVEL_M, Trial
from navirl_cli.demos.truncation import POSE_GAP_S, missing_tf
from navirl_cli.errors import DemonstrationError
from navirl_cli.logs.occupancy import Occupancy
from navirl_cli.logs.recording import Recording

#: A contact's force must exceed the noise this many times.
NOISE_MARGIN = 5.0
#: Peaks of pushes by hand lie between, N; others are in another unit.
LEAST_PEAK_N, MOST_PEAK_N = 0.5, 2000.0
#: A person whom the user places this far from all of the log's is another one, m.
SAME_PLACE_M = 0.5
#: A path of cells is longer than its line; if it is shorter than this share, a loop is missing.
LOOPS = 0.9
#: More than this share of occupied cells means that the robot drove on another map; fewer occur beside walls.
MOST_BLOCKED = 0.2
#: Longer gaps in the force make a trial unknown, s; shorter ones are noted.
FORCE_GAP_S, NOTED_GAP_S = 0.5, 0.1


def check_cells(cells: IntArray, xy_m: FloatArray, grid: Grid, robot_radius_m: float) -> None:
    """Refuse a path through occupied cells, or one that lost its loops on the grid."""
    blocked = int(grid.is_occupied(np.unique(cells, axis=0)).sum())
    if blocked > MOST_BLOCKED * len(cells):
        raise DemonstrationError(
            f"{blocked} of {len(cells)} driven cells are occupied on the map grown by {robot_radius_m:g} m; "
            "check the map and `robot_radius`"
        )
    if path_length_m(grid.centres_of(cells)) < LOOPS * path_length_m(thinned(xy_m, grid.resolution_m)):
        raise DemonstrationError(
            f"{path_length_m(xy_m):.1f} m driven become {len(cells)} cells: the path crosses itself, and the rule from "
            "poses to cells leaves loops out; split the log into trials that do not, or try `rasterizer` chain"
        )


def check_gaps(recording: Recording, trial: Trial, pushes: Pushes | None) -> None:
    """Refuse a trial with a long gap: it may be two, and without forces a push would be missed."""
    t_ns = recording.t_ns[trial.first : trial.stop]
    row = int(np.diff(t_ns, append=t_ns[-1]).argmax())
    since, until = int(t_ns[row]), int(t_ns[min(row + 1, len(t_ns) - 1)])
    if until - since > POSE_GAP_S * 1e9:
        raise DemonstrationError(
            f"poses are missing for {(until - since) / 1e9:.1f} s{missing_tf(recording, since, until)}"
        )
    if pushes is None:
        return
    gap_s = missing_s(pushes, int(t_ns[0]), int(t_ns[-1]))
    if gap_s > FORCE_GAP_S:
        raise DemonstrationError(f"the wrench is missing for {gap_s:.1f} s")


def check_travel(xy_m: FloatArray) -> None:
    """Refuse a trial in which the robot hardly moves."""
    travelled = float(np.hypot(*(xy_m - xy_m[0]).T).max())
    if travelled < MIN_TRAVEL_M:
        raise DemonstrationError(f"the robot gets no farther than {travelled:.2f} m: an empty trial")


def check_start(people: FloatArray, start: FloatArray, radius_m: float) -> None:
    """Refuse a person within the robot at the start: the scene would have no path."""
    for x, y, distance in _within(people, start, radius_m):
        raise DemonstrationError(
            f"a person at x {x:.2f} m, y {y:.2f} m stands on the path's start ({distance:.2f} m from the robot's "
            f"centre, radius {radius_m:.2f} m); check `person`, the people topic's frame and `robot_radius`"
        )


def check_end(people: FloatArray, end: FloatArray, radius_m: float, by: str) -> None:
    """Refuse a person whom the user places where the robot ended."""
    for x, y, distance in _within(people, end, radius_m):
        raise DemonstrationError(
            f"{by} {x:.2f},{y:.2f} stands where the path ends, which is its goal ({distance:.2f} m from the "
            f"robot's centre, radius {radius_m:.2f} m); correct the place"
        )


def _within(people: FloatArray, place: FloatArray, radius_m: float) -> list[tuple[float, float, float]]:
    """x, y and distance, m, of the people who stand nearer to a place than a radius."""
    distances = [float(np.hypot(x - place[0], y - place[1])) for x, y in people]
    return [(x, y, distance) for (x, y), distance in zip(people, distances, strict=True) if distance < radius_m]


def check_goal(grid: Grid, start: FloatArray, goal: tuple[float, float]) -> None:
    """Refuse a goal that the robot did not reach and could not have reached."""
    cell = grid.cells_of(goal)
    if grid.contains(cell) and grid.connected_to(grid.cells_of(start))[cell[1], cell[0]]:
        return
    raise DemonstrationError(
        f"goal unreachable: no free path on the map from x {start[0]:.2f} m, y {start[1]:.2f} m to x {goal[0]:.2f} m, "
        f"y {goal[1]:.2f} m; check the goal, the map and `robot_radius`"
    )


def recording_notes(recording: Recording, pushes: Pushes | None, push: PushSettings) -> list[str]:
    """What is unusual about a recording."""
    notes = ["contact is unknown: no wrench was read"] if pushes is None else _wrench_notes(pushes, push)
    if recording.session.laid_out_m_s is not None:
        notes.append(
            f"the positions came without times and were laid out at {recording.session.laid_out_m_s:g} m/s: durations, "
            "speeds and impulses are not measured"
        )
    if is_costmap(recording.occupancy.data):
        notes.append("the map is a costmap that is inflated already (cells of 99); `robot_radius` does not grow it")
    return [f"{recording.log}: {note}" for note in notes]


def _unit_note(pushes: Pushes) -> str:
    """A hint where the forces look like pushes, but no hand pushes so; empty otherwise."""
    size = np.hypot(*pushes.force_n.T)
    peak_n = float(size.max(initial=0.0))
    if LEAST_PEAK_N <= peak_n <= MOST_PEAK_N or not peak_n:
        return ""
    unit, factor = ("kN", "1000") if peak_n < LEAST_PEAK_N else ("mN", "0.001")
    lasting = hysteresis(size, 0.9 * peak_n, 0.5 * peak_n)
    lasts_s = (pushes.t_ns[lasting[:, 1]] - pushes.t_ns[lasting[:, 0]]) / 1e9
    rest_n = float(np.median(size))
    if peak_n < NOISE_MARGIN * max(rest_n, pushes.noise_n) or lasts_s.max(initial=0.0) < MIN_CONTACT_S:
        return ""
    only = " only" if peak_n < LEAST_PEAK_N else ""
    return (
        f"the wrench rises to {peak_n:.3g} N{only}, in the shape of pushes, but no hand pushes so; if its unit is "
        f"{unit}, give `force_scale` {factor}"
    )


def _wrench_notes(pushes: Pushes, push: PushSettings) -> list[str]:
    """What is unusual about the forces."""
    notes = [text] if (text := _unit_note(pushes)) else []
    # a threshold within the noise finds false contacts
    least = NOISE_MARGIN * pushes.noise_n
    if push.begins_n < least:
        notes.append(
            f"without contact the force varies by {pushes.noise_n:.2f} N, so that contacts from "
            f"{push.begins_n:g} N on may be noise; raise `contact_force` to {least:.1f}"
        )
    gaps = int((np.diff(pushes.t_ns) > NOTED_GAP_S * 1e9).sum())
    if gaps:
        notes.append(f"gaps of more than {NOTED_GAP_S:g} s in the wrench: {gaps}; the force is interpolated linearly")
    return notes


def path_notes(trial: Trial, cells: IntArray, grid: Grid, from_goal_m: FloatArray) -> list[str]:
    """What is unusual about a trial's path, which ended (2,) m away from its goal."""
    notes = []
    if not trial.arrived:
        notes.append(f"ended {np.hypot(*from_goal_m):.2f} m from its goal; its last cell stands for the goal")
    blocked = int(grid.is_occupied(np.unique(cells, axis=0)).sum())
    if blocked:
        notes.append(f"{blocked} driven cells that are occupied on the map were freed")
    return notes


def jump_notes(recording: Recording, start_ns: int, stop_ns: int) -> list[str]:
    """Where in a trial the localisation jumps."""
    jumps = [jump for jump in recording.jumps if start_ns <= jump.t_ns <= stop_ns]
    if not jumps:
        return []
    largest = max(jumps, key=lambda jump: jump.size_m)
    how = "jumps" if len(jumps) == 1 else f"jumps {len(jumps)} times, at most"
    return [f"the localisation {how} by {largest.size_m:.2f} m at {(largest.t_ns - start_ns) / 1e9:.1f} s"]


def placed_notes(given: FloatArray, logged: FloatArray | None, xy_m: FloatArray, radius_m: float, by: str) -> list[str]:
    """What contradicts the people whom the user placed.

    Args:
        given: (p, 2) m, the user's people.
        logged: (q, 2) m, those of the log in this trial; None where it has no messages about people.
        xy_m: (n, 2) m, the driven path.
        radius_m: The robot's.
        by: The argument or column that places them.
    """
    notes = []
    for person in given:
        nearest_m = float(np.hypot(*(xy_m - person).T).min())
        if nearest_m < radius_m:
            notes.append(
                f"the robot drove through {_at(person, by)}: its centre passed {nearest_m:.2f} m from there, radius "
                f"{radius_m:.2f} m; correct the place"
            )
    if logged is None:
        return notes
    if len(given) != len(logged):
        notes.append(f"people by {by}: {len(given)}; in the log: {len(logged)}; those of the log are ignored")
    for person in given if len(logged) else ():
        away_m = np.hypot(*(logged - person).T)
        x, y = logged[int(away_m.argmin())]
        if away_m.min() > SAME_PLACE_M:
            notes.append(
                f"{_at(person, by)} contradicts the log, whose nearest person is {away_m.min():.2f} m from there, at x "
                f"{x:.2f} m, y {y:.2f} m; the log's people are ignored"
            )
    return notes


def _at(person: FloatArray, by: str) -> str:
    return f"{by} {person[0]:.2f},{person[1]:.2f}"


def people_notes(recording: Recording, occupancy: Occupancy, people: FloatArray) -> list[str]:
    """A scene without people, and people in a wall or off the map of a trial."""
    if len(people) == 0:
        remedy = "" if len(recording.people_t_ns) else "; give their places with `person` x,y"
        return [f"no people in the scene{remedy}"]
    walls = Grid(occupancy.data >= OCCUPIED_FROM, occupancy.resolution_m, occupancy.origin_m)
    inside, blocked = walls.contains(walls.cells_of(people)), walls.is_occupied(walls.cells_of(people))
    return [
        f"a person at x {x:.2f} m, y {y:.2f} m stands {'in a wall of' if within else 'off'} the map"
        for (x, y), within, wall in zip(people, inside, blocked, strict=True)
        if wall
    ]
