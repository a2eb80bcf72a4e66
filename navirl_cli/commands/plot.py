"""``navirl plot``: figures of demonstrations and of what was learnt from them."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from navirl_cli.artefacts.rewards import LearntReward, read_reward, read_reward_for
from navirl_cli.commands.shared import (
    FilePath,
    Function,
    demonstrations_in,
    demos_argument,
    force_option,
    output_option,
    progress_bar,
    samples_option,
    say,
    seed_option,
)
from navirl_cli.errors import ArtefactError, DemonstrationError

if TYPE_CHECKING:
    from navirl_cli.demos.demonstration import Demonstration
    from navirl_cli.evaluation.compare import Comparison
    from navirl_cli.figures.properties import PropertyBar
    from navirl_cli.irl.scene import Scene


def figure_options(function: Function) -> Function:
    """What every figure takes."""
    wide = click.option("--wide", is_flag=True, help="As wide as a page of two columns (7.16 in), not one (3.5 in).")
    for decorate in (demos_argument, output_option("Figure to write: .png, .pdf or .svg."), wide, force_option):
        function = decorate(function)
    return function


reward_option = click.option("--reward", type=FilePath, required=True, help="Learnt reward.")
trial_option = click.option("--trial", help="Draw the scene of this trial, e.g. p01/3; the first one's by default.")


@click.group()
def plot() -> None:
    """Draw paths, policy, reward or path properties."""


@plot.command()
@figure_options
def paths(demos: Path, output: Path, wide: bool, force: bool) -> None:
    """All driven paths over the map, by condition (as the paper's Fig. 3)."""

    def draw(axes: Any, demonstrations: list["Demonstration"]) -> None:
        from navirl_cli.figures.paths import draw_paths

        draw_paths(axes[0], demonstrations)

    _figure(demos, output, draw, wide=wide, force=force)


@plot.command()
@figure_options
@reward_option
@trial_option
def policy(demos: Path, output: Path, wide: bool, force: bool, reward: Path, trial: str | None) -> None:
    """Where the learnt policy leads: expected visits of every cell (as the paper's Fig. 8, left)."""

    def draw(axes: Any, demonstrations: list["Demonstration"]) -> None:
        import numpy as np

        from navirl_cli.figures.cells import draw_policy
        from navirl_cli.irl.likelihood import policy_of

        learnt = read_reward_for(reward, demonstrations).reward
        one, scene = _chosen(demonstrations, trial)
        start = np.zeros(scene.lattice.size)
        start[scene.start] = 1.0
        draw_policy(axes[0], scene, policy_of(learnt, scene).visits(start), robot_radius_m=one.robot_radius_m)

    _figure(demos, output, draw, wide=wide, force=force)


@plot.command("reward")
@figure_options
@reward_option
@trial_option
def reward_(demos: Path, output: Path, wide: bool, force: bool, reward: Path, trial: str | None) -> None:
    """The learnt reward of every cell, with the nominal path (as the paper's Fig. 8, right)."""

    def draw(axes: Any, demonstrations: list["Demonstration"]) -> None:
        from navirl_cli.figures.cells import draw_reward

        learnt = read_reward_for(reward, demonstrations).reward
        one, scene = _chosen(demonstrations, trial)
        draw_reward(axes[0], scene, learnt.by_cell(scene), robot_radius_m=one.robot_radius_m)

    _figure(demos, output, draw, wide=wide, force=force)


@plot.command()
@figure_options
@click.option("--reward", type=FilePath, help="Learnt reward: adds bars of its paths in the scenes it was learnt from.")
@samples_option
@seed_option
def properties(
    demos: Path, output: Path, wide: bool, force: bool, reward: Path | None, samples: int, seed: int
) -> None:
    """Length, distance and area of paths by condition, as bars (as the paper's Fig. 7)."""
    from navirl_cli.evaluation.metrics import METRICS
    from navirl_cli.figures.properties import draw_properties, height_for
    from navirl_cli.figures.sheet import check_target, new_figure, save_figure
    from navirl_cli.figures.style import COLUMN_IN, PAGE_IN

    check_target(output, force=force)
    demonstrations = demonstrations_in(demos)
    learnt = None if reward is None else read_reward_for(reward, demonstrations)
    bars, width_in = _bars(demonstrations, learnt, samples, seed), PAGE_IN if wide else COLUMN_IN
    figure, axes = new_figure(width_in, height_for(bars, width_in), len(METRICS))
    draw_properties(axes, bars)
    save_figure(figure, output, force=force, trim=False)
    click.echo(output)


@plot.command()
@click.argument("reward", type=FilePath)
@output_option("Figure to write: .png, .pdf or .svg.")
@click.option("--wide", is_flag=True, help="As wide as a page of two columns (7.16 in), not one (3.5 in).")
@force_option
def profile(reward: Path, output: Path, wide: bool, force: bool) -> None:
    """Profile likelihoods in a reward file, as made by fit --profile: how sure a parameter is, and how lopsided."""
    from navirl_cli.figures.profile import draw_profiles
    from navirl_cli.figures.sheet import check_target, save_figure
    from navirl_cli.figures.style import COLUMN_IN, PAGE_IN

    check_target(output, force=force)
    learnt = read_reward(reward)
    if not learnt.profiles:
        raise ArtefactError(f"{reward}: holds no profile; make it with navirl fit --profile sigma_p")
    units = {parameter.name: parameter.unit for parameter in learnt.reward.parameters}
    figure = draw_profiles(learnt.profiles, units, PAGE_IN if wide else COLUMN_IN)
    save_figure(figure, output, force=force, trim=False)
    click.echo(output)


def _figure(
    demos: Path, output: Path, draw: Callable[[Any, list["Demonstration"]], None], *, wide: bool, force: bool
) -> None:
    """Open a figure, draw on it, save it."""
    from navirl_cli.figures.sheet import check_target, new_figure, save_figure
    from navirl_cli.figures.style import COLUMN_IN, PAGE_IN

    check_target(output, force=force)
    demonstrations = demonstrations_in(demos)
    figure, axes = new_figure(PAGE_IN if wide else COLUMN_IN)
    draw(axes, demonstrations)
    save_figure(figure, output, force=force)
    click.echo(output)


def _chosen(demonstrations: list["Demonstration"], trial: str | None) -> tuple["Demonstration", "Scene"]:
    """The demonstration that was asked for, and its scene."""
    from navirl_cli.irl.scene import scenes_of

    for one in demonstrations:
        if trial in {None, one.id}:
            return one, scenes_of([one])[0]
    raise DemonstrationError(f"no trial is called {trial!r}; there are {', '.join(one.id for one in demonstrations)}")


def _bars(
    demonstrations: list["Demonstration"], learnt: LearntReward | None, samples: int, seed: int
) -> list["PropertyBar"]:
    """What was driven in every group, and in the groups that the policy was learnt from what it drives."""
    import numpy as np

    from navirl_cli.evaluation.compare import DRIVEN, LEARNT, ON_GRID, compare, group_of
    from navirl_cli.figures.properties import PropertyBar

    with progress_bar("evaluate", len(demonstrations)) as update:
        result: Comparison = compare(
            demonstrations,
            None if learnt is None else learnt.reward,
            samples,
            np.random.default_rng(seed),
            lambda done, _all: update(done, ""),
        )
    taught = set() if learnt is None else {group_of(one) for one in demonstrations if one.id in learnt.demonstrations}
    for note in result.notes:
        say(note)
    bars = []
    for row in result.groups:
        if row.kind == DRIVEN:
            bars.append(PropertyBar(row.group, row.group, row.mean, row.std, row.count))
        elif row.kind == ON_GRID and row.group in taught:
            # Beside learnt paths, which go from cell to cell, what was driven must go from cell to cell too.
            bars.append(PropertyBar(f"{row.group}, on grid", row.group, row.mean, row.std, row.count))
        elif row.kind == LEARNT and row.group in taught:
            bars.append(PropertyBar(f"{row.group}, learnt", LEARNT, row.mean, row.std, row.count))
    return bars
