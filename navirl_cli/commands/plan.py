"""``navirl plan``: paths of a robot that drives by a learnt reward."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from navirl_cli.artefacts.rewards import LearntReward, read_reward
from navirl_cli.commands.place import Place, scene_options
from navirl_cli.commands.plot.page import FORMATS
from navirl_cli.commands.shared import (
    check_output,
    echo,
    echo_json,
    force_option,
    json_option,
    output_option,
    person_name_option,
    say,
    seed_option,
)
from navirl_cli.commands.types import Choice, Count, FilePath, Number, OutputPath
from navirl_cli.commands.usage import Command, Example, refuse_unused, section
from navirl_cli.files import Input

if TYPE_CHECKING:
    from navirl_cli.planning.problem import Problem

#: Values of --mode.
MODES = ("likely", "sample", "expected")


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
@section("Reward", person_name_option)
@scene_options
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
    refuse_unused("--mode sample or --recommend", "seed", used=mode == Mode.SAMPLE.value or recommend)
    inputs = [reward, *where.files()]
    for path in (output, figure):
        if path is not None:
            check_output(path, inputs, force=force)
    learnt = read_reward(reward, person_name)
    planner = Planner(where.problem(learnt), learnt.reward)
    if recommend:
        _recommend(learnt, planner.problem, seed)
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


def _recommend(learnt: LearntReward, problem: "Problem", seed: int) -> None:
    """Print how to drive, for a straight passage and for the scene at hand."""
    from navirl_cli.reports.recommendation import recommendation_text

    echo(recommendation_text(learnt, problem, seed))
