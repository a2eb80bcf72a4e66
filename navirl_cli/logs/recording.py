"""The core type of logs: poses in the fixed frame, raw forces, people, goals, commands and the map."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import ByContent, FloatArray, IntArray
from navirl_cli.errors import LogError
from navirl_cli.logs.occupancy import MapHistory
from navirl_cli.logs.occupancy import Occupancy as Occupancy  # noqa: PLC0414 which others import from here

#: Name of the metadata record with what only the experimenter knows. Its keys: "participant", a name; and in JSON
#: "trials", a list of objects with "t_ns", the time of the trial's goal or start, and any of "stop_ns", "participant",
#: "cycle", "condition", "set", "nominal_m" and "people_m"; "robot_radius_m"; "completion_s", lists of times by
#: modality; and, where positions came without times, "laid_out_m_s", the speed at which they were laid out.
SESSION_RECORD = "navirl.session"
#: Name of the metadata record with cells that were published with the paths: key "cells", a JSON list of objects with
#: "t_ns" (as above), "name" and "cells" (pairs column, row).
PUBLISHED_RECORD = "navirl.published"


@dataclass(frozen=True, eq=False)
class Wrench(ByContent):
    """Force measurements in the sensor's frame."""

    #: (n,) ns, increasing.
    t_ns: IntArray
    #: (n, 3) N, sensor frame, as measured.
    force_n: FloatArray
    #: (3, 3) rotation that turns a vector of the sensor frame into the robot's base frame; (n, 3, 3), one for each
    #: measurement, where the sensor moves on the robot.
    to_base: FloatArray


@dataclass(frozen=True, eq=False)
class Track(ByContent):
    """Where one person was seen."""

    #: The person's name in the log; without names the place in the message ("1", "2").
    name: str
    #: (k,) ns, increasing.
    t_ns: IntArray
    #: (k, 2) m, fixed frame.
    xy_m: FloatArray


@dataclass(frozen=True)
class Jump:
    """A correction by which the localisation moves the robot at once."""

    t_ns: int
    size_m: float


@dataclass(frozen=True, eq=False)
class Declared(ByContent):
    """The experimenter's entry for the trial that starts at a time."""

    t_ns: int
    #: When it ended, ns; None: when the robot came to rest near its goal.
    stop_ns: int | None = None
    cycle: int | None = None
    condition: str | None = None
    #: Purpose of the trial, such as "obstacle course"; None for the session's main task.
    set: str | None = None
    #: (k, 2) m, fixed frame: the line that the robot's navigation followed.
    nominal_m: FloatArray | None = None
    #: In place of the session's, where several participants took part.
    participant: str | None = None
    #: (p, 2) m, fixed frame: where people stood, none of them with p = 0; None where the log's messages count.
    people_m: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Published(ByContent):
    """The published cells of the trial that starts at a time."""

    t_ns: int
    name: str
    #: (k, 2) column and row.
    cells: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Session(ByContent):
    """What only the experimenter knows of a session."""

    participant: str | None = None
    declared: tuple[Declared, ...] = ()
    published: tuple[Published, ...] = ()
    robot_radius_m: float | None = None
    #: Speed at which positions without times were laid out, m/s; None where times were measured.
    laid_out_m_s: float | None = None
    #: Times in which a course was completed, s, by modality.
    completion_s: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


#: Longest time between two measurements of a recording, ns (36 years): differences of times must not overflow.
_LONGEST_NS: Final = 1 << 60
#: Fewer forces have no bias that could be told from a push.
LEAST_FORCES = 50


@dataclass(frozen=True, eq=False)
class Recording:
    """Everything of one log, on one clock and in one fixed frame."""

    #: File name of the log.
    log: str
    #: (n,) ns, increasing: the robot's poses in the fixed frame.
    t_ns: IntArray
    #: (n, 2) m and (n,) rad, fixed frame.
    xy_m: FloatArray
    yaw_rad: FloatArray
    wrench: Wrench | None
    #: The only map, or the last one.
    occupancy: Occupancy
    #: (g,) ns and (g, 2) m, fixed frame.
    goal_t_ns: IntArray
    goal_m: FloatArray
    #: (m,) ns of every message about people, those without people included.
    people_t_ns: IntArray
    people: tuple[Track, ...]
    #: (c,) ns and (c,) largest deflection of the joystick, 0..1.
    command_t_ns: IntArray
    command: FloatArray
    session: Session = field(default_factory=Session)
    #: (n, 2) m/s forward and to the left, base frame, at the poses' times; None where the odometry has none.
    velocity_m_s: FloatArray | None = None
    jumps: tuple[Jump, ...] = ()
    #: All maps, where there are several.
    maps: MapHistory | None = None
    #: (u,) ns of odometry that tf does not place.
    unplaced_ns: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    #: First and last time of anything that was measured, ns; None: those of the poses.
    measured_ns: tuple[int, int] | None = None
    #: Why there is no goal where there is none, as far as it is known: "1 message on /goal_pose left out: ...".
    no_goal: str = ""
    #: What could not be read, in words.
    damage: tuple[str, ...] = field(default=())
    #: What is unusual about the log, in words.
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        """Check shapes and that time runs forward."""
        if len(self.t_ns) < 2:
            raise LogError(f"{self.log}: expected poses of a moving robot, found {len(self.t_ns)}")
        if not (self.t_ns[1:] > self.t_ns[:-1]).all():
            raise LogError(f"{self.log}: pose times must increase")
        if self.xy_m.shape != (len(self.t_ns), 2) or self.yaw_rad.shape != self.t_ns.shape:
            raise LogError(
                f"{self.log}: poses need shapes (n, 2) and (n,), found {self.xy_m.shape}, {self.yaw_rad.shape}"
            )
        if self.wrench is not None:
            self._check_wrench(self.wrench.t_ns)
        for name, t_ns in (
            ("poses", self.t_ns),
            ("wrench", self.t_ns[:0] if self.wrench is None else self.wrench.t_ns),
        ):
            if len(t_ns) and (span := int(t_ns[-1]) - int(t_ns[0])) > _LONGEST_NS:
                raise LogError(
                    f"{self.log}: {name}: expected times of one recording, found {span / 3.156e16:.0f} years between "
                    "the first and the last; correct the stamps or times of receipt"
                )

    def _check_wrench(self, t_ns: IntArray) -> None:
        """Check that there are enough forces to find a bias, and that they were measured while the robot drove."""
        if len(t_ns) < LEAST_FORCES:
            raise LogError(f"{self.log}: expected a wrench of at least {LEAST_FORCES} messages, found {len(t_ns)}")
        if t_ns[0] > self.t_ns[-1] or t_ns[-1] < self.t_ns[0]:
            raise LogError(
                f"{self.log}: wrench and poses share no time: expected stamps of one clock, found the wrench "
                f"{(int(t_ns[0]) - int(self.t_ns[0])) / 1e9:+.0f} s from the poses; correct the stamps"
            )

    @property
    def goal_problem(self) -> str:
        """Why trials cannot be split at goals, and what to do; empty where there are goals."""
        if len(self.goal_t_ns):
            return ""
        remedy = "give one with `goal` x,y, or choose `split` stop or `split` none"
        if self.no_goal:
            return f"{self.log}: trials cannot be split at goals, because no goal is left: {self.no_goal}; or {remedy}"
        return f"{self.log}: no goal is announced, so that trials cannot be split at goals; {remedy}"

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last time at which anything was measured, ns."""
        first, last = int(self.t_ns[0]), int(self.t_ns[-1])
        given = self.measured_ns or (first, last)
        return min(given[0], first), max(given[1], last)
