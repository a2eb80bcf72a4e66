"""Logs of a robot that drives 4 m through frames and is pushed, message by message: several robots, gaps, maps."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import nav_log as nav
import numpy as np

#: The robot stands until the goal is announced, drives 4 m along x, and stands again, s.
GOAL_S, DRIVES_S, RESTS_S, LASTS_S = 1.0, 2.0, 12.0, 16.0
LENGTH_M = 4.0
#: It is pushed to its left, N, from when to when, s.
PUSH_N, PUSHED_S = 12.0, (5.0, 7.0)
#: Impulse of the push, N s.
IMPULSE_N_S = PUSH_N * (PUSHED_S[1] - PUSHED_S[0])
#: How the sensor is mounted on the robot, rad.
MOUNTED_RAD = 1.2

Spans = Iterable[tuple[float, float]]
ALL: Spans = ((0.0, LASTS_S),)


@dataclass(frozen=True)
class Robot:
    """One robot of a log."""

    #: Before its topics' names, and before those of its frames.
    namespace: str = ""
    prefix: str = ""
    #: Namespace of its tf, where that is another.
    tf_namespace: str | None = None
    #: Where map -> odom places it, m.
    place_m: tuple[float, float] = (0.0, 0.0)
    mounted_rad: float = MOUNTED_RAD
    #: When its odometry and its tf are recorded, s.
    odometry: Spans = ALL
    tf: Spans = ALL
    wrench: bool = True


def x_m(seconds: Any) -> Any:
    """How far the robot has driven, m."""
    return LENGTH_M * np.clip((np.asarray(seconds) - DRIVES_S) / (RESTS_S - DRIVES_S), 0.0, 1.0)


def times(hertz: float, spans: Spans = ALL) -> list[float]:
    """Times at a rate within some spans, s."""
    seconds = np.arange(0.0, LASTS_S, 1.0 / hertz)
    return [second for second in seconds.tolist() if any(first <= second < stop for first, stop in spans)]


def at(second: float) -> int:
    return int(nav.unix(second))


def add(log: nav.Log, robot: Robot = Robot()) -> nav.Log:
    """A robot's odometry, wrench and transforms."""
    own = robot.namespace
    tf = own if robot.tf_namespace is None else robot.tf_namespace
    odom, base, sensor = (f"{robot.prefix}{name}" for name in ("odom", "base_link", "ft"))
    rng = np.random.default_rng(3)
    for second in times(10, robot.odometry):
        t_ns = at(second)
        log.add(f"{own}/odom", nav.odometry(t_ns, float(x_m(second)), 0.0, frame=odom, child=base, v=0.4), t_ns)
    for second in times(50) if robot.wrench else ():
        push = PUSH_N if PUSHED_S[0] <= second < PUSHED_S[1] else 0.0
        turned = MOUNTED_RAD
        force = push * np.array([np.sin(turned), np.cos(turned)]) + rng.normal(0.0, 0.05, 2)
        log.add(f"{own}/wrench", nav.wrench(at(second), *force.tolist(), frame=sensor), at(second))
    for second in times(5, robot.tf):
        log.add(f"{tf}/tf", nav.tf(nav.transform(at(second), "map", odom, *robot.place_m)), at(second))
    log.add(f"{tf}/tf_static", mounting(robot.mounted_rad, base, sensor), nav.START_NS)
    return log


def mounting(yaw: float, base: str = "base_link", sensor: str = "ft") -> Any:
    """The static transform of a sensor."""
    return nav.tf(nav.transform(0, base, sensor, 0.1, 0.0, yaw))


def free(rows: int = 30, columns: int = 60, origin: tuple[float, float] = (-1.05, -1.55), **more: Any) -> Any:
    """A map without obstacles around the robot's drive, 0.1 m a cell."""
    return nav.grid(rows, columns, resolution=0.1, origin=origin, **more)


def scene(*robots: Robot, world: bool = True, goal: tuple[float, float] = (LENGTH_M, 0.0)) -> nav.Log:
    """A log of some robots, one of the usual kind where none is given, with a map and a goal."""
    log = nav.Log()
    for robot in robots or (Robot(),):
        add(log, robot)
    if world:
        log.add("/map", free(), nav.START_NS)
    log.add("/goal_pose", nav.pose_stamped(at(GOAL_S), *goal), at(GOAL_S))
    return log
