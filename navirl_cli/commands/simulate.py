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
from navirl_cli.commands.types import Count
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.tables import written


@click.command(
    cls=Command,
    examples=[
        Example("Logs of three participants", "navirl simulate -o simulated"),
        Example("Another participant with other random numbers", "navirl simulate --participants 1 --seed 7 -o other"),
    ],
)
@section(
    "Simulation",
    click.option("--participants", default=3, show_default=True, type=Count(1, 99), help="Number of participants."),
    seed_option,
)
@section("Output", output_option("Folder of the logs; created if it does not exist."), json_option, force_option)
def simulate(participants: int, seed: int, output: Path, as_json: bool, force: bool) -> None:
    """Simulate people who push a robot, and write logs with known truth.

    Each participant has a reward of their own, drawn around the published one, and pushes the robot toward paths that
    are sampled from it: two trials, a fit, two trials along learnt paths, two trials with a joystick, one trial with
    obstacle avoidance. The metadata record navirl.truth holds the true rewards, paths and forces; no other command
    reads it.
    """
    from navirl_cli.reports.logs import simulated_table
    from navirl_cli.simulation.log import write_logs

    with progress_bar("simulate", participants) as update:
        logs = write_logs(output, participants, seed, force=force, progress=update)
    table = simulated_table(logs)
    if as_json:
        echo_json({"logs": table.records()})
    else:
        echo(written(table))
