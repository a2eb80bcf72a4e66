"""What makes a trial unfit to learn from, and what a user should know of a recording."""

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.contact import Pushes, PushSettings, missing_s
from navirl_cli.demos.grid import OCCUPIED_FROM, Grid, is_costmap
from navirl_cli.demos.lines import path_length_m, thinned
from navirl_cli.demos.trials import MIN_TRAVEL_M, Trial
from navirl_cli.errors import DemonstrationError
from navirl_cli.logs.recording import Recording

#: A contact must stand out of the noise this many times.
NOISE_MARGIN = 5.0
#: A path of cells is longer than its line; one shorter than this share of it has lost something.
LOOPS = 0.9
#: A trial most of which the map denies was driven on another map; this share is bad luck at a wall.
MOST_BLOCKED = 0.2
#: Without poses, or without a force, for longer than this a trial is not known, s; shorter holes in it are noted.
POSE_GAP_S, FORCE_GAP_S, FORCE_HOLE_S = 1.0, 0.5, 0.1


def check_cells(cells: IntArray, xy_m: FloatArray, grid: Grid, robot_radius_m: float) -> None:
    """A path that the map denies, or that lost its loops on the grid, is no evidence."""
    blocked = int(grid.is_occupied(np.unique(cells, axis=0)).sum())
    if blocked > MOST_BLOCKED * len(cells):
        raise DemonstrationError(
            f"{blocked} of {len(cells)} driven cells are occupied on the map grown by {robot_radius_m:g} m; "
            "check the map and `robot_radius`"
        )
    if path_length_m(grid.centres_of(cells)) < LOOPS * path_length_m(thinned(xy_m, grid.resolution_m)):
        raise DemonstrationError(
            f"{path_length_m(xy_m):.1f} m driven become {len(cells)} cells: the way crosses itself, and the rule from "
            "poses to cells cuts loops off; split the log into trials that do not, or try `rasterizer` chain"
        )


def check_gaps(recording: Recording, trial: Trial, pushes: Pushes | None) -> None:
    """Two trials across a hole in the log must not pass for one, nor a dead sensor for a person who does not push."""
    t_ns = recording.t_ns[trial.first : trial.stop]
    hole = float(np.diff(t_ns).max(initial=0) / 1e9)
    if hole > POSE_GAP_S:
        raise DemonstrationError(f"poses are missing for {hole:.1f} s")
    if pushes is None:
        return
    silent = missing_s(pushes, int(t_ns[0]), int(t_ns[-1]))
    if silent > FORCE_GAP_S:
        raise DemonstrationError(f"the wrench is missing for {silent:.1f} s")


def check_travel(xy_m: FloatArray) -> None:
    """A robot that hardly moves shows no path."""
    travelled = float(np.hypot(*(xy_m - xy_m[0]).T).max())
    if travelled < MIN_TRAVEL_M:
        raise DemonstrationError(f"the robot gets no farther than {travelled:.2f} m: an empty trial")


def check_start(people: FloatArray, start: FloatArray, radius_m: float) -> None:
    """Nobody can stand where the robot starts."""
    for x, y in people:
        distance = float(np.hypot(x - start[0], y - start[1]))
        if distance < radius_m:
            raise DemonstrationError(
                f"a person at x {x:.2f} m, y {y:.2f} m stands on the path's start ({distance:.2f} m from the robot's "
                f"centre, radius {radius_m:.2f} m); check `person`, the people topic's frame and `robot_radius`"
            )


def check_goal(grid: Grid, start: FloatArray, goal: tuple[float, float]) -> None:
    """A goal that the robot did not arrive at must be one that it could have arrived at."""
    cell = grid.cells_of(goal)
    if grid.contains(cell) and grid.connected_to(grid.cells_of(start))[cell[1], cell[0]]:
        return
    raise DemonstrationError(
        f"goal unreachable: no free way on the map from x {start[0]:.2f} m, y {start[1]:.2f} m to x {goal[0]:.2f} m, "
        f"y {goal[1]:.2f} m; check the goal, the map and `robot_radius`"
    )


def recording_notes(recording: Recording, pushes: Pushes | None, push: PushSettings) -> list[str]:
    """What is odd about a recording as a whole."""
    notes = ["contact is unknown: no wrench was read"] if pushes is None else _wrench_notes(pushes, push)
    if recording.session.laid_out_m_s is not None:
        notes.append(
            f"its positions came without times, and were laid out at {recording.session.laid_out_m_s:g} m/s: durations "
            "and speeds are not measured"
        )
    if is_costmap(recording.occupancy.data):
        notes.append("its map is a costmap that is inflated already (cells of 99); `robot_radius` does not grow it")
    return [f"{recording.log}: {note}" for note in notes]


def _wrench_notes(pushes: Pushes, push: PushSettings) -> list[str]:
    """What is odd about the forces."""
    notes = []
    # A threshold within the noise finds contacts where there are none.
    least = NOISE_MARGIN * pushes.noise_n
    if push.begins_n < least:
        notes.append(
            f"without contact the force still shakes by {pushes.noise_n:.2f} N, so that contacts from "
            f"{push.begins_n:g} N on may be noise; raise `contact_force` to {least:.1f}"
        )
    holes = int((np.diff(pushes.t_ns) > FORCE_HOLE_S * 1e9).sum())
    if holes:
        notes.append(f"the wrench breaks off for more than {FORCE_HOLE_S:g} s, {holes} x; straight lines bridge it")
    return notes


def jump_notes(recording: Recording, start_ns: int, stop_ns: int) -> list[str]:
    """Where in a trial the localisation moves the robot at once."""
    jumps = [jump for jump in recording.jumps if start_ns <= jump.t_ns <= stop_ns]
    if not jumps:
        return []
    largest = max(jumps, key=lambda jump: jump.size_m)
    how = "jumps" if len(jumps) == 1 else f"jumps {len(jumps)} times, at most"
    return [f"the localisation {how} by {largest.size_m:.2f} m at {(largest.t_ns - start_ns) / 1e9:.1f} s"]


def people_notes(recording: Recording, people: FloatArray) -> list[str]:
    """Nobody there at all, or where none can stand: in a wall, or off the map."""
    if len(people) == 0:
        told = len(recording.people_t_ns) > 0
        return ["nobody is in the scene" if told else "no people in the scene; say where they stand with `person` x,y"]
    occupancy = recording.occupancy
    walls = Grid(occupancy.data >= OCCUPIED_FROM, occupancy.resolution_m, occupancy.origin_m)
    inside, blocked = walls.contains(walls.cells_of(people)), walls.is_occupied(walls.cells_of(people))
    return [
        f"a person at x {x:.2f} m, y {y:.2f} m stands {'in a wall of' if within else 'off'} the map"
        for (x, y), within, wall in zip(people, inside, blocked, strict=True)
        if wall
    ]
