"""The core type: one trial as evidence of how a person wants the robot to drive."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.demos.grid import Grid
from navirl_cli.errors import DemonstrationError


class Condition(StrEnum):
    """Who steered the robot besides its own navigation, and how."""

    FORCE = "force"
    JOYSTICK = "joystick"
    AUTONOMOUS = "autonomous"
    #: The log does not name the condition, and holds no wrench to find it from.
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Contact:
    """One interval in which the person pushed."""

    #: First and last instant, s since the trial's start.
    start_s: float
    end_s: float
    #: Largest horizontal force, N.
    peak_force_n: float
    #: Integral of the horizontal force, (x, y) in N s, map frame.
    impulse_n_s: tuple[float, float]

    @property
    def duration_s(self) -> float:
        """Length of the interval in s."""
        return self.end_s - self.start_s

    @property
    def direction_rad(self) -> float:
        """Direction of the impulse in the map frame, from the x axis, rad."""
        return float(np.arctan2(self.impulse_n_s[1], self.impulse_n_s[0]))


@dataclass(frozen=True, eq=False)
class PersonTrack(ByContent):
    """Where one person was during a trial."""

    name: str
    #: (k,) s since the trial's start, increasing; empty for a person who stands still.
    t_s: FloatArray
    #: (k, 2) m, map frame.
    xy_m: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and order."""
        if self.t_s.ndim != 1 or self.xy_m.shape != (len(self.t_s), 2):
            raise DemonstrationError(
                f"track of person {self.name}: t_s and xy_m need the shapes (k,) and (k, 2), "
                f"found {self.t_s.shape} and {self.xy_m.shape}"
            )
        if not (np.isfinite(self.t_s).all() and np.isfinite(self.xy_m).all() and (np.diff(self.t_s) > 0).all()):
            raise DemonstrationError(f"track of person {self.name}: needs finite places at increasing times")

    @property
    def mean_m(self) -> FloatArray:
        """(2,) mean place over the time from first to last sight, on straight lines between sights, m.

        Raises:
            IndexError: The track is empty; the place of a person who stands still is in people_m.
        """
        # relative to the first place: the mean of a person who stands still is that place, to the last digit
        from_first = self.xy_m - self.xy_m[0]
        if len(self.t_s) > 1:
            from_first = np.trapezoid(from_first, self.t_s[:, None], axis=0)[None] / (self.t_s[-1] - self.t_s[0])
        mean: FloatArray = self.xy_m[0] + from_first[0]
        return mean

    @property
    def spread_m(self) -> float:
        """Largest distance from the mean place, m; 0 for a person who stands still."""
        return float(np.hypot(*(self.xy_m - self.mean_m).T).max()) if len(self.t_s) else 0.0


@dataclass(frozen=True, eq=False)
class Demonstration(ByContent):
    """A trial: the path that was driven, the forces along it, and the scene around it."""

    #: Name, unique within a file of demonstrations: participant, slash, number of the trial.
    id: str
    participant: str
    condition: Condition
    #: Whether the person intervened (pushed, or moved the joystick), so that the path shows their preference; None
    #: where unknown.
    corrected: bool | None
    #: Number of the interaction cycle (Sec. IV-C), or None where the log has none.
    cycle: int | None
    #: Log time of the trial's start, ns since the epoch of the log's clock.
    start_ns: int
    #: (n,) s since the trial's start, increasing.
    t_s: FloatArray
    #: (n, 2) m, map frame.
    xy_m: FloatArray
    #: (n,) rad, map frame.
    yaw_rad: FloatArray
    #: (n, 2) N, map frame, bias removed and low-passed; None where the log holds no wrench.
    force_n: FloatArray | None
    #: None where contact is unknown, because forces were not read.
    contacts: tuple[Contact, ...] | None
    #: The announced goal, m, map frame.
    goal_m: tuple[float, float]
    #: (p, 2) m, map frame: the places of the people; for a person who moves the mean over the trial.
    people_m: FloatArray
    #: Radius of the robot, m.
    robot_radius_m: float
    #: Cells that the robot's centre may enter; the driven ones are free.
    grid: Grid
    #: (k, 2) column and row: the 8-connected path on the grid, from the start's cell to the cell where the trial ended.
    cells: IntArray
    #: File name of the log.
    log: str = ""
    #: How the people moved, one track for each of people_m in the same order; empty where all stood still.
    tracks: tuple[PersonTrack, ...] = ()
    #: Purpose of the trial, such as "obstacle course"; None for the session's main task.
    set: str | None = None
    #: (k, 2) m, map frame: the line that the robot's navigation followed, from the log; None for the scene's nominal
    #: path.
    nominal_m: FloatArray | None = None
    #: Speed at which positions without times were laid out, m/s; None where t_s was measured.
    laid_out_m_s: float | None = None
    #: Whether poses are missing at its beginning or end, so that it starts elsewhere or its last cell is no goal.
    truncated: bool = False
    #: What a reader of the results should know about this trial.
    notes: tuple[str, ...] = field(default=())
    #: The same about its recording.
    warnings: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        """Check shapes, order, and that the path fits the grid."""
        n = len(self.t_s)
        for name, value, shape in (
            ("t_s", self.t_s, (n,)),
            ("xy_m", self.xy_m, (n, 2)),
            ("yaw_rad", self.yaw_rad, (n,)),
            ("force_n", self.force_n, (n, 2)),
            ("people_m", self.people_m, (len(self.people_m), 2)),
            ("cells", self.cells, (len(self.cells), 2)),
            ("nominal_m", self.nominal_m, None if self.nominal_m is None else (len(self.nominal_m), 2)),
        ):
            if value is not None and value.shape != shape:
                self._refuse(f"{name} needs the shape {shape}, found {value.shape}")
            if value is not None and not np.isfinite(value).all():
                self._refuse(f"{name} holds values that are not finite")
        if len(self.tracks) not in {0, len(self.people_m)}:
            self._refuse(f"needs a track for each of its {len(self.people_m)} people, found {len(self.tracks)}")
        if n < 2 or not (np.diff(self.t_s) > 0).all():
            self._refuse("needs at least two poses at increasing times")
        if len(self.cells) < 2:
            self._refuse("its path stays within one cell: the robot did not move")
        steps = np.abs(np.diff(self.cells, axis=0)).max(axis=1)
        if (steps != 1).any():
            self._refuse(f"step {int(np.flatnonzero(steps != 1)[0])} of its path does not lead to a neighbouring cell")
        if self.grid.is_occupied(self.cells).any():
            self._refuse("its path crosses occupied cells of its map")

    def _refuse(self, reason: str) -> None:
        raise DemonstrationError(f"demonstration {self.id}: {reason}")

    @property
    def duration_s(self) -> float:
        """Time from the first pose to the last, s."""
        return float(self.t_s[-1] - self.t_s[0])

    @property
    def timed(self) -> bool:
        """Whether its times were measured: what rests on times that were laid out is not known."""
        return self.laid_out_m_s is None

    @property
    def contact_s(self) -> float | None:
        """Time in contact, s; None where it is unknown."""
        return None if self.contacts is None else sum(contact.duration_s for contact in self.contacts)
