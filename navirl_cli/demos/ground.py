"""The ground of each trial: the map that was in force, and its grid for the robot's centre."""

from dataclasses import dataclass, field

from navirl_cli.demos.grid import Grid, grid_from_occupancy
from navirl_cli.logs.occupancy import Occupancy
from navirl_cli.logs.recording import Recording


@dataclass(frozen=True, eq=False)
class Ground:
    """The map of a trial."""

    occupancy: Occupancy
    grid: Grid
    #: What is unusual about it, in words.
    notes: tuple[str, ...]


@dataclass(eq=False)
class TrialGrids:
    """The grids of a recording's trials, each made once.

    Args:
        recording: With one map, or several over time.
        robot_radius_m: By which obstacles grow, m.
        resolution_m: Side of the cells, m.
    """

    recording: Recording
    robot_radius_m: float
    resolution_m: float
    _known: dict[int, tuple[Occupancy, Grid]] = field(default_factory=dict)

    def during(self, start_ns: int, stop_ns: int) -> Ground:
        """The map in force at a trial's end: a map that grows holds the whole path only then."""
        maps = self.recording.maps
        number = 0 if maps is None else maps.number_at(stop_ns)
        if number not in self._known:
            occupancy = self.recording.occupancy if maps is None else maps.occupancy(number)
            grid = grid_from_occupancy(
                occupancy.data, occupancy.resolution_m, occupancy.origin_m, self.robot_radius_m
            ).resampled(self.resolution_m)
            self._known[number] = occupancy, grid
        changes = 0 if maps is None else maps.changes(start_ns, stop_ns)
        times = "once" if changes == 1 else f"{changes} times"
        notes = (f"the map changes {times} during the trial; the last one counts",) if changes else ()
        return Ground(*self._known[number], notes)
