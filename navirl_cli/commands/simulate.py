"""``navirl simulate``: logs of simulated people pushing a simulated robot."""

from functools import partial
from pathlib import Path

import click

from navirl_cli.commands.shared import force_option, output_option, progress_bar, seed_option
from navirl_cli.commands.types import Count
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.documents.tables import Cell, Column, Table, written
from navirl_cli.files import check_writable, new_folder
from navirl_cli.parallel import map_in_order


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
@section("Output", output_option("Folder of the logs; created if it does not exist."), force_option)
def simulate(output: Path, participants: int, seed: int, force: bool) -> None:
    """Simulate people who push a robot, and write logs with known truth.

    Each participant has a reward of their own, drawn around the published one, and pushes the robot toward paths that
    are sampled from it: two trials, a fit, two trials along learnt paths, two trials with a joystick, one trial with
    obstacle avoidance. The metadata record navirl.truth holds the true rewards, paths and forces; no other command
    reads it.
    """
    paths = [output / f"p{number:02d}.mcap" for number in range(1, participants + 1)]
    rows: list[tuple[Cell, ...]] = []
    with new_folder(output), progress_bar("simulate", participants) as update:
        for path in paths:
            check_writable(path, force=force)
        work = partial(_simulated, seed=seed, force=force)
        for row in map_in_order(work, list(enumerate(paths, start=1))):
            rows.append(row)
            update(len(rows), str(row[0]))
    columns = (Column("log"), Column("trials"), Column("size_bytes", "size MB", decimals=2, scale=1e-6))
    click.echo(written(Table(columns, tuple(rows))))


def _simulated(job: tuple[int, Path], seed: int, force: bool) -> tuple[Cell, ...]:
    """One participant's log, as a row of the table."""
    from navirl_cli.simulation.log import write_log

    number, path = job
    session = write_log(number, seed, path, force=force)
    return str(path), len(session.passes), path.stat().st_size
