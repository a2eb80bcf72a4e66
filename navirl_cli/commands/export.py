"""``navirl export``: a learnt reward for Nav2, for viewers, and in other conventions."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from navirl_cli.artefacts.rewards import LearntReward, read_reward
from navirl_cli.commands.place import Place, scene_options
from navirl_cli.commands.shared import echo, echo_json, force_option, json_option, refuse_inputs, say
from navirl_cli.commands.types import Choice, FilePath, Number
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.errors import ArtefactError

if TYPE_CHECKING:
    from navirl_cli.export.nav2 import Nav2Export

#: Values of --to, --distro, --planner and --mask; tests hold them to those of export/, which is not imported for help.
TARGETS = ("nav2",)
DISTROS, PLANNERS, FIELDS = ("humble", "jazzy", "kilted", "lyrical"), ("navfn", "smac2d"), ("people", "line", "both")


@click.command(
    cls=Command,
    examples=[
        Example(
            "For Nav2, with a mask of a scene",
            "navirl export reward.json --to nav2 --distro jazzy --scene demos.json:p01/3 -o nav2",
        ),
        Example(
            "For SmacPlanner2D, with a speed mask",
            "navirl export reward.json --to nav2 --planner smac2d --scene demos.json:p01/3 --slow 40 -o smac",
        ),
    ],
)
@click.argument("reward", type=FilePath)
@section("Target", click.option("--to", "target", type=Choice(TARGETS), required=True, help="Who takes the reward."))
@scene_options
@section(
    "Nav2",
    click.option("--distro", type=Choice(DISTROS), default="jazzy", show_default=True, help="Release of ROS 2."),
    click.option(
        "--planner", type=Choice(PLANNERS), default="navfn", show_default=True, help="Planner that drives by the costs."
    ),
    click.option(
        "--factor",
        type=Number(0.01, 100),
        help="By which people cost more than in the reward.  [default: the planner passes a person as the policy does]",
    ),
    click.option(
        "--mask",
        type=Choice(FIELDS),
        help="What the mask of the scene holds: people, distance from the nominal line, or both.  [default: people]",
    ),
    click.option("--slow", type=Number(1, 99), help="Write a speed mask too: per cent of the full speed at people."),
)
@section(
    "Output",
    click.option("-o", "--output", type=FilePath, required=True, help="Folder to write."),
    json_option,
    force_option,
)
def export(
    reward: Path,
    target: str,  # noqa: ARG001 - one so far
    distro: str,
    planner: str,
    factor: float | None,
    mask: str | None,
    slow: float | None,
    output: Path,
    as_json: bool,
    force: bool,
    **place: Any,
) -> None:
    """Write a learnt reward for other programs.

    For Nav2, a folder: fragments of parameter files, a mask of a scene, a node that makes masks of people who move, and
    a README that says what to do with them and what they do not hold. Amplitudes are those of the planner's costs.
    """
    from navirl_cli.documents.tables import Format, written
    from navirl_cli.export.folder import write_nav2
    from navirl_cli.export.nav2 import lost
    from navirl_cli.export.readme import numbers

    where = Place(**place)
    where.check()
    has_scene = where.names_scene
    for value, name in ((mask, "--mask"), (slow, "--slow")):
        if value is not None and not has_scene:
            raise click.UsageError(f"{name} needs a scene: --scene, --log, or --map with --start and --goal.")
    refuse_inputs([output], [reward, *where.files()])
    _check_folder(output, force=force)
    export = _nav2_export(read_reward(reward), where, (distro, planner, factor, mask, slow))
    files = write_nav2(output, export)
    losses = lost(export)
    if as_json:
        echo_json({**numbers(export.passing).records()[0], "files": files, "lost": losses})
    else:
        echo(f"{written(numbers(export.passing), Format.TEXT)}\n\n{output}: {', '.join(files)}")
    for line in losses:
        say(line)


def _nav2_export(
    learnt: LearntReward, where: Place, words: tuple[str, str, float | None, str | None, float | None]
) -> "Nav2Export":
    """The costs, matched for the scene's robot."""
    from navirl_cli.export.costs import matched
    from navirl_cli.export.fragments import Distro
    from navirl_cli.export.nav2 import Field, Nav2Export

    distro, planner, factor, mask, slow = words
    problem = where.problem(learnt) if where.names_scene else None
    radius_m = where.radius_m(None) if problem is None else problem.robot_radius_m
    passing = matched(planner, learnt.reward, learnt.resolution_m, radius_m, factor)
    return Nav2Export(passing, Distro(distro), radius_m, problem, Field(mask or "people"), slow)


def _check_folder(output: Path, *, force: bool) -> None:
    """Refuse a folder with files in it.

    Raises:
        ArtefactError: It is a file, or it holds files and `force` is not given.
    """
    if output.exists() and not output.is_dir():
        raise ArtefactError(f"{output}: expected the name of a folder to write, found a file")
    if output.is_dir() and any(output.iterdir()) and not force:
        raise ArtefactError(f"{output}: expected a new or an empty folder, found files; replace them with `force`")
