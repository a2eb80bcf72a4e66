"""``navirl watch``: a folder of recordings that grows, to a reward and the next paths."""

from pathlib import Path

import click

from navirl_cli.commands.shared import (
    namespace_option,
    refuse_inputs,
    say,
    split_option,
    topic_option,
    topics_by_role,
)
from navirl_cli.commands.types import Choice, FilePath, Number
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.trials import Split
from navirl_cli.documents.inline import printable
from navirl_cli.irl.selection import Steps


@click.command(
    cls=Command,
    examples=[
        Example(
            "During a visit, from what earlier participants taught",
            "navirl watch logs --reward reward.json --participant p04 --condition force -o visit",
        ),
        Example("Once, in a script", "navirl watch logs --condition force -o visit --once"),
    ],
)
@click.argument("folder", type=FilePath)
@section(
    "Learning",
    click.option(
        "--reward",
        type=FilePath,
        help="Earlier reward file as prior: one reward as a Gaussian, or, of fit --pool persons, how earlier people "
        "differ.  [default: learn from the recordings alone]",
    ),
    click.option(
        "--condition",
        "conditions",
        multiple=True,
        type=Choice([condition.value for condition in Condition]),
        help="Learn from trials of this condition only; repeatable.",
    ),
    click.option(
        "--steps",
        type=Choice([steps.value for steps in Steps]),
        default=Steps.ALL.value,
        show_default=True,
        help="Learn from all steps of a path, from those during contact, or from those during contact or within the "
        "person's reach (reachable).",
    ),
)
@section(
    "Recordings",
    click.option("--participant", help="Participant, instead of the name in the log or of the file."),
    split_option,
    topic_option,
    namespace_option,
    click.option(
        "--map", "map_file", type=FilePath, help="Nav2 map YAML beside its pgm or png, instead of the map in the log."
    ),
    click.option("--no-wrench", is_flag=True, help="Ignore forces; also for logs without a wrench."),
    click.option("--robot-radius", type=Number(0, 10), help="Radius of the robot, m.  [default: the log's, or 0.3]"),
    click.option(
        "--settle",
        type=Number(0, 3600),
        default=30.0,
        show_default=True,
        help="A recording without an end, as of a recorder that was killed, is finished after this time without "
        "growth, s.",
    ),
    click.option("--once", is_flag=True, help="Take what is finished now, and end."),
)
@section(
    "Paths",
    click.option("--max-speed", type=Number(0.01, 10), default=0.5, show_default=True, help="Of planned paths, m/s."),
    click.option(
        "--max-acceleration", type=Number(0.01, 20), default=0.5, show_default=True, help="Of planned paths, m/s^2."
    ),
)
@section(
    "Output",
    click.option(
        "-o",
        "--output",
        type=FilePath,
        required=True,
        help="Folder of the results. What is in it is continued, also after a kill.",
    ),
)
def watch(
    folder: Path,
    reward: Path | None,
    conditions: tuple[str, ...],
    steps: str,
    participant: str | None,
    split: str,
    topics: tuple[tuple[str, str], ...],
    namespace: str | None,
    map_file: Path | None,
    no_wrench: bool,
    robot_radius: float | None,
    settle: float,
    once: bool,
    max_speed: float,
    max_acceleration: float,
    output: Path,
) -> None:
    """Learn from the recordings of a folder as they are finished, and plan the next paths.

    Waits for recordings. Each finished one is extracted, and the reward is learnt from all of them. Then reward.json,
    demos.json, the paths of the next cycle (path_1.csv, .json, .yaml for Nav2, and so on) and the figure paths.png are
    replaced. One line says what is learnt, how it changed, how sure it is, and whether another pass would still change
    it by more than 5 cm. A recording counts once, by its content. Ctrl-C ends.
    """
    from navirl_cli.artefacts.rewards import read_reward
    from navirl_cli.files import new_folder
    from navirl_cli.logs.load import Forces, LoadOptions
    from navirl_cli.logs.map_file import read_map
    from navirl_cli.planning.smooth import Limits
    from navirl_cli.watching import learning
    from navirl_cli.watching.folder import Folder
    from navirl_cli.watching.loop import Watch
    from navirl_cli.watching.visit import REWARD, Visit

    refuse_inputs([output / REWARD], [] if reward is None else [reward])
    earlier = None if reward is None else read_reward(reward)
    settings = ExtractSettings(
        split=Split(split),
        participant=participant,
        robot_radius_m=robot_radius,
        resolution_m=0.1 if earlier is None else earlier.resolution_m,
    )
    options = LoadOptions(
        topics=topics_by_role(topics),
        namespace=namespace,
        occupancy=None if map_file is None else read_map(map_file),
        forces=Forces.IGNORED if no_wrench else Forces.NEEDED,
    )
    choice = learning.Choice(conditions, Steps(steps), earlier, reward)
    choice.prior  # noqa: B018 - refuses an earlier reward that is no maximum, before any work
    with new_folder(output):
        loop = Watch(
            Folder(folder, settle),
            Visit(output, settings, options, map_file),
            choice,
            Limits(max_speed, max_acceleration),
            lambda line: click.echo(printable(line)),
            say,
        )
        loop.run(once=once)
    if loop.lost:
        click.get_current_context().exit(3)
