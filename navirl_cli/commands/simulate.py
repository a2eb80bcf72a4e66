"""``navirl simulate``: logs of simulated people pushing a simulated robot."""

from pathlib import Path

import click

from navirl_cli.commands.shared import (
    echo,
    echo_json,
    force_option,
    json_option,
    output_option,
    progress_bar,
    seed_option,
)
from navirl_cli.commands.types import Choice, Count, FilePath, Number
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.tables import written


@click.command(
    cls=Command,
    examples=[
        Example("Logs of three participants", "navirl simulate -o simulated"),
        Example("Another participant with other random numbers", "navirl simulate --participants 1 --seed 7 -o other"),
        Example("People with a short reach", "navirl simulate --participants 1 --reach 1.2 --joystick free -o short"),
    ],
)
@section(
    "Simulation",
    click.option("--participants", default=3, show_default=True, type=Count(1, 99), help="Number of participants."),
    seed_option,
    click.option(
        "--drive",
        type=FilePath,
        help="Path that the robot drives, .csv or .json of navirl plan: two trials in which the person may push, and "
        "one in which nobody does.  [default: the two cycles of the study]",
    ),
)
@section(
    "People",
    click.option(
        "--reach",
        default=2.4,
        show_default=True,
        type=Number(0.5, 20),
        help="Distance within which people push, between the centres of robot and person, m.",
    ),
    click.option(
        "--tolerance",
        default=0.0,
        show_default=True,
        type=Number(0, 1000),
        help="People start to intervene only where the robot's path displeases them by more than this, nats: the "
        "logarithm of how many times more often a policy of their own reward visits the best place beside them.",
    ),
    click.option("--delay", default=0.25, show_default=True, type=Number(0, 5), help="Reaction time, s."),
    click.option(
        "--scatter",
        type=Number(0, 2),
        help="Standard deviation between people of the logarithm of each parameter; 0 for people alike.  "
        "[default: 0.10 of c0, 0.25 of a_g and a_p, 0.20 of sigma_p]",
    ),
    click.option(
        "--joystick",
        type=Choice(["proportional", "free"]),
        default="proportional",
        show_default=True,
        help="The stick is moved by the distance from the wanted path (proportional), or so that the robot drives as "
        "the person wants (free).",
    ),
)
@section("Output", output_option("Folder of the logs; created if it does not exist."), json_option, force_option)
def simulate(
    participants: int,
    seed: int,
    drive: Path | None,
    reach: float,
    tolerance: float,
    delay: float,
    scatter: float | None,
    joystick: str,
    output: Path,
    as_json: bool,
    force: bool,
) -> None:
    """Simulate people who push a robot, and write logs with known truth.

    Each participant has a reward of their own, drawn around the published one, and pushes the robot toward paths that
    are sampled from it: two trials, a fit, two trials along learnt paths, two trials with a joystick, one trial with
    obstacle avoidance. With --drive the robot drives a given path instead, past the same people for the same seed. The
    metadata record navirl.truth holds the true rewards, paths and forces, and the options of people that differ from
    their defaults; no other command reads it.
    """
    from navirl_cli.artefacts.plans import read_line
    from navirl_cli.reports.logs import simulated_table
    from navirl_cli.simulation.behaviour import Behaviour, Joystick
    from navirl_cli.simulation.log import write_logs

    driven_m = None if drive is None else read_line(drive)
    behaviour = Behaviour(reach, tolerance, delay, scatter, Joystick(joystick))
    with progress_bar("simulate", participants) as update:
        logs = write_logs(
            output, participants, seed, force=force, behaviour=behaviour, driven_m=driven_m, progress=update
        )
    table = simulated_table(logs)
    if as_json:
        echo_json({"logs": table.records()})
    else:
        echo(written(table))
