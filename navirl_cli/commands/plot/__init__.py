"""``navirl plot``: figures of demonstrations and of what was learnt from them."""

from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import click

from navirl_cli.artefacts.rewards import LearntReward, read_reward, read_reward_for
from navirl_cli.commands.plot import compare as plot_compare
from navirl_cli.commands.plot import maps as plot_maps
from navirl_cli.commands.plot.page import Page, crop_option, page_options, trial_option
from navirl_cli.commands.shared import (
    FilePath,
    demonstrations_in,
    demos_argument,
    progress_bar,
    samples_option,
    say,
    seed_option,
)
from navirl_cli.errors import ArtefactError

if TYPE_CHECKING:
    from navirl_cli.demos.demonstration import Demonstration
    from navirl_cli.evaluation.compare import Comparison
    from navirl_cli.figures.properties import PropertyBar


@click.group()
def plot() -> None:
    """Draw paths, policy, reward, path properties and how a fit went."""


for command in (plot_maps.policy, plot_maps.reward, plot_maps.value, plot_maps.actions):
    plot.add_command(command)
for command in (plot_compare.ranks, plot_compare.compare):
    plot.add_command(command)


@plot.command()
@page_options
@demos_argument
@crop_option
def paths(page: Page, demos: Path, crop: bool) -> None:
    """All driven paths over the map, by condition (as the paper's Fig. 3)."""
    from navirl_cli.figures.paths import draw_paths

    demonstrations = demonstrations_in(demos)
    page.draw(lambda axes: draw_paths(axes[0], demonstrations, crop=crop))


@plot.command()
@page_options
@demos_argument
@click.option("--reward", type=FilePath, help="Learnt reward: adds bars of its paths in the scenes it was learnt from.")
@samples_option
@seed_option
def properties(page: Page, demos: Path, reward: Path | None, samples: int, seed: int) -> None:
    """Length, distance and area of paths by condition, as bars (as the paper's Fig. 7)."""
    from navirl_cli.evaluation.metrics import PAPER_METRICS
    from navirl_cli.figures.properties import draw_properties, height_for

    demonstrations = demonstrations_in(demos)
    learnt = None if reward is None else read_reward_for(reward, demonstrations)
    bars = _bars(demonstrations, learnt, samples, seed)
    page.draw(
        lambda axes: draw_properties(axes, bars), height_in=height_for(bars, page.width_in), panels=len(PAPER_METRICS)
    )


@plot.command()
@page_options
@demos_argument
@trial_option
@crop_option
def forces(page: Page, demos: Path, trial: str | None, crop: bool) -> None:
    """How the person pushed in a trial: forces over time with contacts, and as arrows along the path."""
    from navirl_cli.figures.forces import draw_forces

    one = plot_maps.trial_of(demonstrations_in(demos), trial)
    page.draw(lambda axes: draw_forces(axes, one, crop=crop), panels=2, columns=1)


@plot.command()
@page_options
@click.argument("reward", type=FilePath)
def profile(page: Page, reward: Path) -> None:
    """Profile likelihoods in a reward file, as made by fit --profile: how sure a parameter is, and how lopsided."""
    from navirl_cli.figures.profile import draw_profiles

    learnt = read_reward(reward)
    if not learnt.profiles:
        raise ArtefactError(f"{reward}: holds no profile; make it with navirl fit --profile sigma_p")
    units = {parameter.name: parameter.unit for parameter in learnt.reward.parameters}
    with page.look():
        figure = draw_profiles(learnt.profiles, units, page.width_in)
    page.save(figure, trim=False)


@plot.command()
@page_options
@click.argument("reward", type=FilePath)
def convergence(page: Page, reward: Path) -> None:
    """How a fit came to its maximum: log-likelihood and parameters over the iterations."""
    from navirl_cli.figures.convergence import ROW_IN, columns_for, draw_convergence

    learnt = read_reward(reward)
    search, parameters = learnt.search, learnt.reward.parameters
    if search is None:
        raise ArtefactError(f"{reward}: holds no iterations, as files of older versions; fit anew with navirl fit")
    panels, columns = 1 + len(parameters), columns_for(page.width_in)
    page.draw(
        lambda axes: draw_convergence(axes, search.log_likelihood, search.theta, parameters),
        height_in=ceil(panels / columns) * ROW_IN,
        panels=panels,
        columns=columns,
    )


def _bars(
    demonstrations: list["Demonstration"], learnt: LearntReward | None, samples: int, seed: int
) -> list["PropertyBar"]:
    """What was driven in every group, and in the groups that the policy was learnt from what it drives."""
    import numpy as np

    from navirl_cli.evaluation.compare import DRIVEN, LEARNT, ON_GRID, compare
    from navirl_cli.evaluation.drawn import Precision
    from navirl_cli.evaluation.groups import group_of
    from navirl_cli.figures.properties import bars_of

    with progress_bar("evaluate", len(demonstrations)) as update:
        result: Comparison = compare(
            demonstrations,
            {} if learnt is None else {LEARNT: learnt.reward},
            Precision(samples),
            np.random.default_rng(seed),
            progress=lambda done, _all: update(done, ""),
        )
    taught = set() if learnt is None else {group_of(one) for one in demonstrations if one.id in learnt.demonstrations}
    for note in result.notes:
        say(note)
    # Learnt paths go from cell to cell: beside them stand the driven ones along their cells.
    return bars_of(
        row for row in result.groups if row.kind == DRIVEN or (row.kind in {ON_GRID, LEARNT} and row.group in taught)
    )
