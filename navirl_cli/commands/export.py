"""``navirl export``: a learnt reward for Nav2, for viewers, and in other conventions."""

from pathlib import Path
from typing import Any

import click

from navirl_cli.artefacts.rewards import LearntReward, read_reward
from navirl_cli.commands.place import Place, scene_options
from navirl_cli.commands.shared import (
    check_output,
    echo,
    echo_json,
    finish,
    force_option,
    json_option,
    person_name_option,
    refuse_inputs,
    say,
    seed_option,
)
from navirl_cli.commands.types import Choice, Count, FilePath, Number
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.tables import ENDINGS, Format, written
from navirl_cli.errors import ArtefactError
from navirl_cli.files import replacing

#: Values of --distro, --planner and --mask; tests hold them to those of export/, which is not imported for help.
DISTROS, PLANNERS, FIELDS = ("humble", "jazzy", "kilted", "lyrical"), ("navfn", "smac2d"), ("people", "line", "both")
#: Options of each target alone.
OWN = {"nav2": ("distro", "planner", "factor", "mask", "slow"), "mcap": ("with", "count"), "table": ()}
#: Paths that are drawn for viewers.
COUNT = 5


@click.command(
    cls=Command,
    examples=[
        Example(
            "For Nav2, with a mask of a scene",
            "navirl export reward.json --to nav2 --distro jazzy --scene demos.json:p01/3 -o nav2",
        ),
        Example(
            "For Foxglove, Lichtblick or RViz, beside the original messages",
            "navirl export reward.json --to mcap --scene demos.json:p01/3 --with p01.mcap -o scene.mcap",
        ),
        Example("The parameters in other conventions", "navirl export reward.json --to table"),
    ],
)
@click.argument("reward", type=FilePath)
@section(
    "Target",
    click.option(
        "--to",
        "target",
        type=Choice(tuple(OWN)),
        required=True,
        help="A folder for Nav2, a log for viewers, or a table of the parameters in several conventions.",
    ),
)
@section("Reward", person_name_option)
@scene_options
@section(
    "Nav2",
    click.option("--distro", type=Choice(DISTROS), help="Release of ROS 2.  [default: jazzy]"),
    click.option("--planner", type=Choice(PLANNERS), help="Planner that drives by the costs.  [default: navfn]"),
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
    "Viewers",
    click.option("--with", type=FilePath, help="Recording whose messages are copied into the log."),
    click.option("--count", type=Count(0, 1000), help=f"Paths drawn from the policy.  [default: {COUNT}]"),
    seed_option,
)
@section(
    "Output",
    click.option(
        "-o",
        "--output",
        type=FilePath,
        help="Folder (nav2), log (.mcap), or table (.csv, .md, .tex or .json) to write.",
    ),
    json_option,
    force_option,
)
def export(
    reward: Path,
    person_name: str | None,
    target: str,
    output: Path | None,
    seed: int,
    as_json: bool,
    force: bool,
    **options: Any,
) -> None:
    """Write a learnt reward for Nav2, for viewers, or in other conventions.

    For Nav2, a folder: fragments of parameter files, a mask of a scene, a node that makes masks of people who move, and
    a README that says what to do with them and what they do not hold. For viewers, a log: map, reward and visits as
    grids, nominal, demonstrated and drawn paths, people, pushes and poses.
    """
    own = {name: options.pop(name) for names in OWN.values() for name in names}
    where = Place(**options)
    where.check()
    _check_words(target, own, where, output)
    inputs = [reward, *where.files(), *filter(None, [own["with"]])]
    if output is not None and target != "nav2":
        check_output(output, inputs, force=force)
    elif output is not None:
        from navirl_cli.export.folder import FILES

        refuse_inputs([output, *(output / name for name in FILES)], inputs)
        _check_folder(output, force=force)
    learnt = read_reward(reward, person_name)
    if output is None or target == "table":
        _to_table(learnt, where, output, as_json=as_json, force=force)
    elif target == "nav2":
        _to_nav2(learnt, where, own, output, as_json=as_json)
    else:
        _to_mcap(learnt, where, own, seed, output, as_json=as_json, force=force)


def _check_words(target: str, own: dict[str, Any], where: Place, output: Path | None) -> None:
    """Refuse options that are invalid together whatever the files hold."""
    for other, names in OWN.items():
        for name in names:
            if other != target and own[name] is not None:
                raise click.UsageError(f"--{name} goes with --to {other}.")
    needs = {
        "--to mcap": target == "mcap",
        "--mask": own["mask"] is not None,
        "--slow": own["slow"] is not None,
        "--person": bool(where.people),
    }
    for name, needed in needs.items():
        if needed and not where.names_scene:
            raise click.UsageError(f"{name} needs a scene: --scene, --log, or --map with --start and --goal.")
    if target == "table" and where.names_scene:
        raise click.UsageError("--to table needs no scene; leave it out.")
    if output is None and target != "table":
        raise click.UsageError(f"--to {target} needs -o / --output.")
    endings = {"nav2": (), "mcap": (".mcap",), "table": tuple(ENDINGS)}[target]
    if output is not None and endings and output.suffix.lower() not in endings:
        raise click.UsageError(
            f"--output: expected a name that ends in {', '.join(endings)} with --to {target}, found '{output.name}'."
        )


def _to_table(learnt: LearntReward, where: Place, output: Path | None, *, as_json: bool, force: bool) -> None:
    from navirl_cli.export.conventions import conventions_table

    table = conventions_table(learnt.reward, learnt.resolution_m, where.radius_m(None))
    if output is not None:
        with replacing(output, force=force) as temporary:
            temporary.write_text(written(table, ENDINGS[output.suffix.lower()]) + "\n", encoding="utf-8")
    if as_json:
        echo_json({"parameters": table.records()})
    else:
        echo(written(table, Format.TEXT))


def _to_nav2(learnt: LearntReward, where: Place, own: dict[str, Any], output: Path, *, as_json: bool) -> None:
    from navirl_cli.export.folder import write_nav2
    from navirl_cli.export.fragments import Distro
    from navirl_cli.export.nav2 import Field, lost, nav2_export
    from navirl_cli.export.readme import numbers

    problem = where.problem(learnt) if where.names_scene else None
    export = nav2_export(
        learnt.reward,
        learnt.resolution_m,
        where.radius_m(None) if problem is None else problem.robot_radius_m,
        own["planner"] or "navfn",
        own["factor"],
        distro=Distro(own["distro"] or "jazzy"),
        problem=problem,
        field=Field(own["mask"] or "people"),
        slow_percent=own["slow"],
    )
    files, losses = write_nav2(output, export), lost(export)
    if as_json:
        echo_json({"costs": numbers(export).records(), "files": files, "lost": losses})
    else:
        echo(f"{written(numbers(export), Format.TEXT)}\n\n{output}: {', '.join(files)}")
    for line in losses:
        say(line)


def _to_mcap(
    learnt: LearntReward, where: Place, own: dict[str, Any], seed: int, output: Path, *, as_json: bool, force: bool
) -> None:
    from navirl_cli.export.scene_log import write_scene
    from navirl_cli.export.scene_view import view_of
    from navirl_cli.logs.sources import sources_of

    beside = None if own["with"] is None else sources_of([own["with"]], join=True)[0]
    count = COUNT if own["count"] is None else own["count"]
    view = view_of(where.problem(learnt), learnt.reward, where.demonstration(learnt), count, seed)
    damage, topics = write_scene(output, view, beside, force=force)
    if as_json:
        echo_json({"topics": topics, "damage": [str(one) for one in damage]})
    else:
        echo(f"{output}: {', '.join(topics)}")
    finish([str(one) for one in damage])


def _check_folder(output: Path, *, force: bool) -> None:
    """Refuse a folder with files in it.

    Raises:
        ArtefactError: It is a file, or it holds files and `force` is not given.
    """
    if output.exists() and not output.is_dir():
        raise ArtefactError(f"{output}: expected the name of a folder to write, found a file")
    if output.is_dir() and any(output.iterdir()) and not force:
        raise ArtefactError(f"{output}: expected a new or an empty folder, found files; replace them with `force`")
