"""Where to plan: the options of the section Scene, and the planning problem that they name."""

from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from navirl_cli.artefacts.rewards import LearntReward, check_cells
from navirl_cli.commands.choosing import NAMES as CHOICE_NAMES
from navirl_cli.commands.choosing import Choosing, choice_options
from navirl_cli.commands.shared import demonstrations_in, say
from navirl_cli.commands.types import FilePath, Number, Point, Pose
from navirl_cli.commands.usage import Function, refuse_unused, section
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.extract import ROBOT_RADIUS_M
from navirl_cli.errors import ArtefactError, LogError, unknown

if TYPE_CHECKING:
    from navirl_cli.planning.problem import Problem

_scene_options = section(
    "Scene",
    click.option(
        "--scene", metavar="DEMOS[:TRIAL]", help="Scene of a demonstration, by default of the first chosen one."
    ),
    click.option("--log", type=FilePath, help="Map, people, pose and goal of a recording."),
    click.option("--at", type=Number(min=0), help="Time in the log, s from its first pose.  [default: the first goal]"),
    click.option("--map", "map_file", type=FilePath, help="Nav2 map YAML beside its pgm or png."),
    click.option("--start", type=Pose(), help="Start x,y or x,y,yaw in the map frame, m and rad."),
    click.option("--goal", type=Point(), help="Goal x,y in the map frame, m."),
    click.option(
        "--person", "people", multiple=True, type=Point(), help="Position of a person in the map frame, m; repeatable."
    ),
    click.option("--robot-radius", type=Number(0, 10), help="Radius of the robot, m.  [default: the scene's, or 0.3]"),
)


def scene_options(function: Function) -> Function:
    """The options of :class:`Place`; those of :func:`choice_options` choose among the demonstrations of ``--scene``."""

    @wraps(function)
    def packed(scene: str | None, robot_radius: float | None, **others: Any) -> Any:
        source = click.get_current_context().get_parameter_source("robot_radius")
        if scene is not None and source is ParameterSource.DEFAULT_MAP:
            robot_radius = None
            say("`robot_radius` is that of the scene, with which its paths were extracted, not that of navirl.toml")
        return function(scene=scene, robot_radius=robot_radius, **others)

    return choice_options(reward=True, title="Scene")(_scene_options(packed))  # type: ignore[return-value]


@dataclass(frozen=True)
class Place:
    """Where to plan: options of the section Scene."""

    choosing: Choosing
    scene: str | None
    log: Path | None
    at: float | None
    map_file: Path | None
    start: tuple[float, ...] | None
    goal: tuple[float, float] | None
    people: tuple[tuple[float, float], ...]
    robot_radius: float | None

    def check(self) -> None:
        """Refuse options that exclude each other, or that name no scene."""
        refuse_unused("--scene DEMOS", *CHOICE_NAMES, used=self.scene is not None)
        others = [self.log, self.map_file, self.start, self.goal, self.robot_radius, self.at, *self.people]
        if self.scene is not None and any(one is not None for one in others):
            raise click.UsageError("--scene gives map, people, start and goal; leave out the others.")
        if self.log is not None and self.map_file is not None:
            raise click.UsageError("--log gives the map; leave out --map.")
        if self.log is None and self.at is not None:
            raise click.UsageError("--at goes with --log.")

    @property
    def names_scene(self) -> bool:
        """Whether any option names a scene."""
        return any(one is not None for one in (self.scene, self.log, self.map_file, self.start, self.goal))

    def files(self) -> list[Path]:
        """The files that it names."""
        return [one for one in (self.log, self.map_file, self._demos_and_trial[0]) if one is not None]

    def problem(self, learnt: LearntReward) -> "Problem":
        """The planning problem.

        Raises:
            NavirlError: A file cannot be read, or the scene is impossible.
        """
        from navirl_cli.planning.problem import problem_of

        path, trial = self._demos_and_trial
        if path is not None:
            return problem_of(self._demonstration(learnt, path, trial))
        if self.log is not None:
            return self._of_log(learnt, self.log)
        if self.map_file is None or self.start is None or self.goal is None:
            raise click.UsageError("Name the scene: --scene, --log, or --map with --start and --goal.")
        return self._on_map(learnt, self.map_file, self.start, self.goal)

    def demonstration(self, learnt: LearntReward) -> Demonstration | None:
        """The demonstration whose scene it is; None for another scene.

        Raises:
            NavirlError: As in :meth:`problem`.
        """
        path, trial = self._demos_and_trial
        return None if path is None else self._demonstration(learnt, path, trial, quiet=True)

    def _demonstration(self, learnt: LearntReward, path: Path, trial: str, *, quiet: bool = False) -> Demonstration:
        """A trial in a file, or the first chosen one."""
        demonstrations = demonstrations_in(path)
        if trial:
            known = {one.id: one for one in self.choosing.subset.of(demonstrations)}
            if trial not in known:
                raise ArtefactError(f"{path}: {unknown('trial', trial, known)}")
            one = known[trial]
        else:
            one = self.choosing.scene_of(demonstrations, [learnt], quiet=quiet)[0]
        check_cells(learnt, [one], str(path))
        return one

    @property
    def _demos_and_trial(self) -> tuple[Path | None, str]:
        """File and trial of ``DEMOS[:TRIAL]``."""
        if self.scene is None:
            return None, ""
        if Path(self.scene).exists():
            return Path(self.scene), ""
        name, _, trial = self.scene.rpartition(":")
        return Path(name or trial), trial if name else ""

    def _of_log(self, learnt: LearntReward, log: Path) -> "Problem":
        from navirl_cli.logs.load import Forces, LoadOptions, load_recording
        from navirl_cli.planning.problem import grid_for, problem_on, seen_at

        recording = load_recording(log, LoadOptions(forces=Forces.OPTIONAL))
        seen = seen_at(recording, self.at)
        goal = self.goal or seen.goal_m
        if goal is None:
            raise LogError(f"{log}: announces no goal until then; name one with `goal`")
        radius_m = self.radius_m(recording.session.robot_radius_m)
        grid = grid_for(recording.occupancy, radius_m, learnt.resolution_m)
        (x, y), yaw = (seen.pose_m, seen.yaw_rad) if self.start is None else _pose(self.start)
        problem = problem_on(grid, (x, y), goal, self.people or seen.people_m, radius_m, start_yaw_rad=yaw)
        return replace(problem, t_ns=seen.t_ns)

    def _on_map(
        self, learnt: LearntReward, map_file: Path, start: tuple[float, ...], goal: tuple[float, float]
    ) -> "Problem":
        from navirl_cli.logs.map_file import read_map
        from navirl_cli.planning.problem import grid_for, problem_on

        radius_m = self.radius_m(None)
        grid = grid_for(read_map(map_file), radius_m, learnt.resolution_m)
        point, yaw = _pose(start)
        return problem_on(grid, point, goal, self.people, radius_m, start_yaw_rad=yaw)

    def radius_m(self, declared_m: float | None) -> float:
        """Radius of the robot: the user's, the log's, or the one that extract assumes."""
        return next(one for one in (self.robot_radius, declared_m, ROBOT_RADIUS_M) if one is not None)


def _pose(start: tuple[float, ...]) -> tuple[tuple[float, float], float | None]:
    """Point, and yaw where it is given."""
    x, y, *yaw = start
    return (x, y), (yaw[0] if yaw else None)
