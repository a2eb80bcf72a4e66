"""``navirl plan``: paths of a robot that drives by a learnt reward."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from navirl_cli.artefacts.rewards import LearntReward, check_cells, read_reward
from navirl_cli.commands import completion
from navirl_cli.commands.plot.page import FORMATS
from navirl_cli.commands.shared import (
    check_output,
    demonstrations_in,
    echo,
    echo_json,
    force_option,
    json_option,
    output_option,
    say,
    seed_option,
)
from navirl_cli.commands.types import Choice, Count, FilePath, Number, OutputPath, Point, Pose
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.demos.extract import ROBOT_RADIUS_M
from navirl_cli.errors import ArtefactError, LogError, unknown
from navirl_cli.files import Input

if TYPE_CHECKING:
    from navirl_cli.planning.problem import Problem

#: Values of --mode.
MODES = ("likely", "sample", "expected")


@dataclass(frozen=True)
class Place:
    """Where to plan: options of the section Scene."""

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
        others = [self.log, self.map_file, self.start, self.goal, self.robot_radius, self.at, *self.people]
        if self.scene is not None and any(one is not None for one in others):
            raise click.UsageError("--scene gives map, people, start and goal; leave out the others.")
        if self.log is not None and self.map_file is not None:
            raise click.UsageError("--log gives the map; leave out --map.")
        if self.log is None and self.at is not None:
            raise click.UsageError("--at goes with --log.")

    def files(self) -> list[Path]:
        """The files that it names."""
        return [one for one in (self.log, self.map_file, self._demos_and_trial[0]) if one is not None]

    def problem(self, learnt: LearntReward) -> "Problem":
        """The planning problem.

        Raises:
            NavirlError: A file cannot be read, or the scene is impossible.
        """
        path, trial = self._demos_and_trial
        if path is not None:
            return _of_demonstration(learnt, path, trial)
        if self.log is not None:
            return self._of_log(learnt, self.log)
        if self.map_file is None or self.start is None or self.goal is None:
            raise click.UsageError("Name the scene: --scene, --log, or --map with --start and --goal.")
        return self._on_map(learnt, self.map_file, self.start, self.goal)

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
        radius_m = self._radius_m(recording.session.robot_radius_m)
        grid = grid_for(recording.occupancy, radius_m, learnt.resolution_m)
        (x, y), yaw = (seen.pose_m, seen.yaw_rad) if self.start is None else _pose(self.start)
        return problem_on(grid, (x, y), goal, self.people or seen.people_m, radius_m, start_yaw_rad=yaw)

    def _on_map(
        self, learnt: LearntReward, map_file: Path, start: tuple[float, ...], goal: tuple[float, float]
    ) -> "Problem":
        from navirl_cli.logs.map_file import read_map
        from navirl_cli.planning.problem import grid_for, problem_on

        radius_m = self._radius_m(None)
        grid = grid_for(read_map(map_file), radius_m, learnt.resolution_m)
        point, yaw = _pose(start)
        return problem_on(grid, point, goal, self.people, radius_m, start_yaw_rad=yaw)

    def _radius_m(self, declared_m: float | None) -> float:
        """Radius of the robot: the user's, the log's, or the one that extract assumes."""
        return next(one for one in (self.robot_radius, declared_m, ROBOT_RADIUS_M) if one is not None)


def _of_demonstration(learnt: LearntReward, path: Path, trial: str) -> "Problem":
    """The problem of a trial in a file, or of its first one."""
    from navirl_cli.planning.problem import problem_of

    demonstrations = demonstrations_in(path)
    known = {one.id: one for one in demonstrations}
    if trial and trial not in known:
        raise ArtefactError(f"{path}: {unknown('trial', trial, known)}")
    one = known[trial] if trial else demonstrations[0]
    check_cells(learnt, [one], str(path))
    return problem_of(one)


def _pose(start: tuple[float, ...]) -> tuple[tuple[float, float], float | None]:
    """Point, and yaw where it is given."""
    x, y, *yaw = start
    return (x, y), (yaw[0] if yaw else None)


def _check_arguments(where: Place, mode: str, count: int | None, tolerance: float | None, *, smooth: bool) -> None:
    """Refuse options that are invalid whatever the files hold."""
    where.check()
    if count is not None and mode != "sample":
        raise click.UsageError("--count goes with --mode sample.")
    if tolerance is not None and not smooth:
        raise click.UsageError("--tolerance goes with --smooth.")


@click.command(
    cls=Command,
    examples=[
        Example(
            "Where most paths of the policy lead, smooth, for Nav2",
            "navirl plan reward.json --scene demos.json:p01/3 --mode expected --smooth -o path.yaml",
        ),
        Example(
            "On the map and past the people of a recording, with a figure",
            "navirl plan reward.json --log p01.mcap --plot plan.png",
        ),
        Example("In words", "navirl plan reward.json --scene demos.json:p01/3 --recommend"),
    ],
)
@click.argument("reward", type=FilePath)
@section(
    "Reward",
    click.option(
        "--person-name",
        metavar="NAME",
        shell_complete=completion.persons,
        help="Drive by this person's own reward, of a reward fitted with --pool persons.  [default: the typical "
        "person's]",
    ),
)
@section(
    "Scene",
    click.option("--scene", metavar="DEMOS[:TRIAL]", help="Scene of a demonstration, by default of the first one."),
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
@section(
    "Path",
    click.option(
        "--mode",
        type=Choice(MODES),
        default="likely",
        show_default=True,
        help="The most probable path, paths drawn from the policy, or the path along the ridge of its expected visits.",
    ),
    click.option("--count", type=Count(1, 10_000), help="Number of drawn paths, with --mode sample.  [default: 1]"),
    seed_option,
    click.option("--smooth", is_flag=True, help="A smooth line beside the path, with speeds."),
    click.option(
        "--tolerance",
        type=Number(0.01, 2),
        help="Largest distance of the smooth line from the path, m.  [default: one cell]",
    ),
    click.option("--max-speed", type=Number(0.01, 10), default=0.5, show_default=True, help="With --smooth, m/s."),
    click.option(
        "--max-acceleration", type=Number(0.01, 20), default=0.5, show_default=True, help="With --smooth, m/s^2."
    ),
)
@section(
    "Output",
    output_option(
        "Path to write: .json, .csv, .yaml (Nav2) or .mcap.", ".json", ".csv", ".yaml", ".mcap", required=False
    ),
    click.option("--plot", "figure", type=OutputPath(FORMATS), help="Figure to write: .png, .pdf or .svg."),
    click.option("--recommend", is_flag=True, help="How to pass people by this reward, in words and metres."),
    json_option,
    force_option,
)
def plan(
    reward: Path,
    person_name: str | None,
    mode: str,
    count: int | None,
    seed: int,
    smooth: bool,
    tolerance: float | None,
    max_speed: float,
    max_acceleration: float,
    output: Path | None,
    figure: Path | None,
    recommend: bool,
    as_json: bool,
    force: bool,
    **place: Any,
) -> None:
    """Plan the path of a robot that drives by a learnt reward.

    The scene is that of a demonstration, of a recording, or a map with start, goal and people. The bodies of people are
    obstacles. The path is compared with the nominal path, which the robot would drive without people.
    """
    from navirl_cli.artefacts.plans import Planned, plan_document, write_plan
    from navirl_cli.planning.paths import Mode, Planner
    from navirl_cli.planning.smooth import Limits, smoothed
    from navirl_cli.reports.plan import plan_text, plan_warnings

    where = Place(**place)
    _check_arguments(where, mode, count, tolerance, smooth=smooth)
    inputs = [reward, *where.files()]
    for path in (output, figure):
        if path is not None:
            check_output(path, inputs, force=force)
    learnt = read_reward(reward, person_name)
    planner = Planner(where.problem(learnt), learnt.reward)
    if recommend:
        _recommend(learnt, planner.problem)
    paths = planner.plan(Mode(mode), count or 1, seed)
    limits = Limits(max_speed, max_acceleration)
    room_m = tolerance or learnt.resolution_m
    planned = [Planned(one, smoothed(planner.problem, one.line_m, room_m, limits) if smooth else None) for one in paths]
    document = plan_document(planner, planned, Mode(mode), seed, [Input.of(one) for one in inputs if one.is_file()])
    if output is not None:
        write_plan(output, document, force=force)
    if figure is not None:
        from navirl_cli.figures.plan import draw_plan

        draw_plan(figure, planner, [one.line_m for one in planned], force=force)
    if as_json:
        echo_json(document)
    elif not recommend:
        echo(plan_text(document))
    for line in plan_warnings(planner, document):
        say(line)


def _recommend(learnt: LearntReward, problem: "Problem") -> None:
    """Print how to drive, for a straight passage and for the scene at hand."""
    from navirl_cli.reports.recommendation import recommendation_text

    echo(recommendation_text(learnt, problem))
