"""``navirl view``: a scene under a learnt reward in Rerun."""

from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.rewards import read_reward
from navirl_cli.commands.place import Place, scene_options
from navirl_cli.commands.shared import check_output, echo, force_option, output_option, person_name_option, seed_option
from navirl_cli.commands.types import Count, FilePath
from navirl_cli.commands.usage import Command, Example, section


@click.command(
    cls=Command,
    examples=[
        Example("Open the viewer", "navirl view reward.json --scene demos.json:p01/3"),
        Example("Write a file for it", "navirl view reward.json --scene demos.json:p01/3 -o scene.rrd"),
    ],
)
@click.argument("reward", type=FilePath)
@section("Reward", person_name_option)
@scene_options
@section(
    "Paths",
    click.option("--count", type=Count(0, 1000), default=5, show_default=True, help="Paths drawn from the policy."),
    seed_option,
)
@section(
    "Output",
    output_option("Rerun recording (.rrd) to write, instead of opening the viewer.", ".rrd", required=False),
    force_option,
)
def view(
    reward: Path, person_name: str | None, count: int, seed: int, output: Path | None, force: bool, **place: Any
) -> None:
    """Show a scene under a learnt reward in Rerun.

    Map, reward, expected visits, paths, people, and the robot with the forces on it over time. It needs the package
    rerun-sdk: pip install 'navirl[view]'.
    """
    from navirl_cli.export.rerun_scene import show_scene
    from navirl_cli.export.scene_view import view_of

    where = Place(**place)
    where.check()
    if not where.names_scene:
        raise click.UsageError("Name the scene: --scene, --log, or --map with --start and --goal.")
    if output is not None:
        check_output(output, [reward, *where.files()], force=force)
    learnt = read_reward(reward, person_name)
    shown = view_of(where.problem(learnt), learnt.reward, where.demonstration(learnt), count, seed)
    show_scene(shown, output, force=force)
    echo(f"{output or 'Rerun'}: map, reward, visits, {', '.join(shown.lines)}")
