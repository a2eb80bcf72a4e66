"""Figures of demonstrations: their paths, properties and forces."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from navirl_cli.artefacts.rewards import LearntReward, read_reward_for
from navirl_cli.commands.choosing import Choosing, choice_options
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
from navirl_cli.commands.usage import Command, Example, refuse_unused, section

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
@choice_options(reward=False)
@section(
    "Scene",
    crop_option,
    click.option("--together", is_flag=True, help="One map for all groups, also with more than 40 paths."),
)
def paths(page: Page, demos: tuple[Path, ...], choosing: Choosing, crop: bool, together: bool) -> None:
    """Draw all driven paths over the map, by condition.

    As in Fig. 3 of the paper. Stretches in contact are thicker. More than 40 paths have a map for each group.
    """
    from navirl_cli.figures.conditions import draw_path_panels, panels_of
    from navirl_cli.figures.paths import draw_paths

    demonstrations = choosing.of(demonstrations_in(*demos))
    panels = [] if together else panels_of(demonstrations)
    if panels:
        page.draw(lambda axes: draw_path_panels(axes, panels, crop=crop), panels=len(panels), columns=2)
    else:
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
@choice_options(reward=True)
@section(
    "Learnt paths",
    click.option(
        "--reward",
        type=FilePath,
        help="Learnt reward; adds its paths, for the groups from which it was learnt.",
    ),
    person_option,
    samples_option(100),
    seed_option,
)
@section("Look", click.option("--bars", "as_bars", is_flag=True, help="Bars from 0, as in Fig. 7 of the paper."))
def properties(
    page: Page,
    demos: tuple[Path, ...],
    choosing: Choosing,
    reward: Path | None,
    person: str | None,
    samples: int,
    seed: int,
    as_bars: bool,
) -> None:
    """Draw length, distance and area of paths by group.

    Points are means with their 95 % intervals, from participants' means, and with standard deviations as thin lines.
    """
    from navirl_cli.evaluation.groups import group_of
    from navirl_cli.figures.properties import bars_of, draw_properties, property_layout

    refuse_unused("--reward", "person", "samples", "seed", "everything", used=reward is not None)
    everyone = demonstrations_in(*demos)
    learnt = None if reward is None else read_reward_for(reward, everyone, person)
    demonstrations = choosing.of(everyone, [] if learnt is None else [learnt])
    result = _compared(demonstrations, learnt, samples, seed)
    taught = set() if learnt is None else {group_of(one) for one in demonstrations if one.id in learnt.demonstrations}
    bars = bars_of(result.groups, taught)
    page.draw(lambda axes: draw_properties(axes, bars, as_bars=as_bars), **property_layout(bars, page.width_in))
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
@choice_options(reward=False, trial=False)
@section("Scene", trial_option, crop_option)
def forces(page: Page, demos: tuple[Path, ...], choosing: Choosing, trial: str | None, crop: bool) -> None:
    """Draw the forces of one trial, over time and along its path.

    Contacts are shaded, with peak force and impulse.
    """
    from navirl_cli.figures.forces import draw_forces

    one = trial_of(choosing.of(demonstrations_in(*demos)), trial)
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
