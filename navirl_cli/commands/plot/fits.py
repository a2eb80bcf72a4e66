"""Figures of a fit: profile likelihoods, and its iterations."""

from math import ceil
from pathlib import Path

import click

from navirl_cli.artefacts.rewards import read_reward
from navirl_cli.commands import completion
from navirl_cli.commands.plot.page import Page, page_options
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section
from navirl_cli.errors import ArtefactError


@click.command(
    cls=Command,
    examples=[
        Example("All profiles of a fit", "navirl plot profile reward.json -o profile.pdf"),
        Example("One of them", "navirl plot profile reward.json --parameter sigma_p -o profile.png"),
    ],
)
@page_options
@click.argument("reward", type=FilePath)
@section(
    "Chosen",
    click.option(
        "--parameter",
        "parameters",
        multiple=True,
        shell_complete=completion.parameters,
        help="Parameter whose profile to draw; repeatable; all by default.",
    ),
)
def profile(page: Page, reward: Path, parameters: tuple[str, ...]) -> None:
    """Draw profile likelihoods of a fit.

    They show how well the data identify a parameter. The reward file holds them after navirl fit --profile.
    """
    from navirl_cli.figures.profile import chosen_profiles, draw_profiles

    learnt = read_reward(reward)
    if not learnt.profiles:
        raise ArtefactError(f"{reward}: expected profile likelihoods, found none; fit again with --profile sigma_p")
    units = {parameter.name: parameter.unit for parameter in learnt.reward.parameters}
    with page.look():
        figure = draw_profiles(chosen_profiles(learnt.profiles, parameters), units, page.width_in)
    page.save(figure, trim=False)


@click.command(
    cls=Command,
    examples=[
        Example("A fit", "navirl plot convergence reward.json -o convergence.pdf"),
        Example("A page wide", "navirl plot convergence reward.json --wide -o convergence.png"),
    ],
)
@page_options
@click.argument("reward", type=FilePath)
def convergence(page: Page, reward: Path) -> None:
    """Draw log-likelihood and parameters over a fit's iterations."""
    from navirl_cli.figures.convergence import ROW_IN, columns_for, draw_convergence

    learnt = read_reward(reward)
    search, parameters = learnt.search, learnt.reward.parameters
    if search is None:
        raise ArtefactError(f"{reward}: expected iterations of a fit, found none; fit again with this version")
    panels, columns = 1 + len(parameters), columns_for(page.width_in)
    page.draw(
        lambda axes: draw_convergence(axes, search.log_likelihood, search.theta, parameters),
        height_in=ceil(panels / columns) * ROW_IN,
        panels=panels,
        columns=columns,
    )
