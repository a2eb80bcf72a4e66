"""Figures of demonstrations: their paths, properties and forces."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from navirl_cli.artefacts.rewards import LearntReward, read_reward_for
from navirl_cli.commands.plot.page import Page, crop_option, page_options, trial_of, trial_option
from navirl_cli.commands.shared import (
    demonstrations_in,
    demos_argument,
    finish,
    person_option,
    progress_bar,
    samples_option,
    seed_option,
)
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, section

if TYPE_CHECKING:
    from navirl_cli.demos.demonstration import Demonstration
    from navirl_cli.evaluation.compare import Comparison


@click.command(
    cls=Command,
    examples=[
        Example("All demonstrations", "navirl plot paths demos.json -o paths.pdf"),
        Example("A detail, a page wide", "navirl plot paths demos.json --crop --wide -o paths.png"),
    ],
)
@page_options
@demos_argument
@section("Scene", crop_option)
def paths(page: Page, demos: Path, crop: bool) -> None:
    """Draw all driven paths over the map, by condition.

    As in Fig. 3 of the paper. Stretches in contact are thicker.
    """
    from navirl_cli.figures.paths import draw_paths

    demonstrations = demonstrations_in(demos)
    page.draw(lambda axes: draw_paths(axes[0], demonstrations, crop=crop))


@click.command(
    cls=Command,
    examples=[
        Example("Driven paths", "navirl plot properties demos.json -o properties.pdf"),
        Example("Driven and learnt paths", "navirl plot properties demos.json --reward reward.json -o properties.png"),
    ],
)
@page_options
@demos_argument
@section(
    "Learnt paths",
    click.option(
        "--reward",
        type=FilePath,
        help="Learnt reward; adds bars of its paths, for the groups from which it was learnt.",
    ),
    person_option,
    samples_option(100),
    seed_option,
)
def properties(page: Page, demos: Path, reward: Path | None, person: str | None, samples: int, seed: int) -> None:
    """Draw length, distance and area of paths as bars, by group.

    As in Fig. 7 of the paper: means, with standard deviations as whiskers.
    """
    from navirl_cli.evaluation.groups import group_of
    from navirl_cli.evaluation.metrics import PAPER_METRICS
    from navirl_cli.figures.properties import bars_of, draw_properties, height_for

    if person is not None and reward is None:
        raise click.UsageError("--person goes with --reward.")
    demonstrations = demonstrations_in(demos)
    learnt = None if reward is None else read_reward_for(reward, demonstrations, person)
    result = _compared(demonstrations, learnt, samples, seed)
    taught = set() if learnt is None else {group_of(one) for one in demonstrations if one.id in learnt.demonstrations}
    bars = bars_of(result.groups, taught)
    page.draw(
        lambda axes: draw_properties(axes, bars), height_in=height_for(bars, page.width_in), panels=len(PAPER_METRICS)
    )
    finish(result.notes)


@click.command(
    cls=Command,
    examples=[
        Example("The first trial", "navirl plot forces demos.json -o forces.pdf"),
        Example("A detail of one trial", "navirl plot forces demos.json --trial p01/3 --crop -o forces.png"),
    ],
)
@page_options
@demos_argument
@section("Scene", trial_option, crop_option)
def forces(page: Page, demos: Path, trial: str | None, crop: bool) -> None:
    """Draw the forces of one trial, over time and along its path.

    Contacts are shaded, with peak force and impulse.
    """
    from navirl_cli.figures.forces import draw_forces

    one = trial_of(demonstrations_in(demos), trial)
    page.draw(lambda axes: draw_forces(axes, one, crop=crop), panels=2, columns=1)


def _compared(
    demonstrations: list["Demonstration"], learnt: LearntReward | None, samples: int, seed: int
) -> "Comparison":
    """Properties of driven paths, and of the paths of a learnt policy, by group."""
    import numpy as np

    from navirl_cli.evaluation.compare import LEARNT, compare
    from navirl_cli.evaluation.drawn import Precision

    with progress_bar("evaluate", len(demonstrations)) as update:
        return compare(
            demonstrations,
            {} if learnt is None else {LEARNT: learnt.reward},
            Precision(samples),
            np.random.default_rng(seed),
            progress=lambda done, _all: update(done, ""),
        )
