"""Figures that compare: rewards, groups of demonstrations, and demonstrations with the policy's own paths."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from navirl_cli.artefacts.rewards import read_reward_for
from navirl_cli.commands import completion
from navirl_cli.commands.choosing import Choosing, choice_options
from navirl_cli.commands.plot.page import Page, crop_option, page_options, reward_option, scene_of, trial_option
from navirl_cli.commands.shared import (
    demonstrations_in,
    demos_argument,
    person_option,
    progress_bar,
    samples_option,
    say,
    seed_option,
)
from navirl_cli.commands.types import FilePath
from navirl_cli.commands.usage import Command, Example, Function, refuse_unused, section

if TYPE_CHECKING:
    from navirl_cli.demos.demonstration import Demonstration
    from navirl_cli.irl.reward import Reward


def _group_option(count: str) -> Callable[[Function], Function]:
    """``--group`` with a text on how many."""
    return click.option(
        "--group",
        "groups",
        multiple=True,
        shell_complete=completion.groups,
        help=f"Group as in the tables of navirl evaluate, e.g. 'force, cycle 2'; {count}.",
    )


@click.command(
    cls=Command,
    examples=[
        Example(
            "Demonstrations like those learnt from", "navirl plot ranks demos.json --reward reward.json -o ranks.pdf"
        ),
        Example("One group", "navirl plot ranks demos.json --reward reward.json --group 'force, cycle 2' -o ranks.png"),
    ],
)
@page_options
@demos_argument
@choice_options(reward=True)
@section("Demonstrations", _group_option("repeatable; by default the groups that the reward was learnt from"))
@section("Learnt paths", reward_option, person_option, samples_option(), seed_option)
def ranks(
    page: Page,
    demos: tuple[Path, ...],
    choosing: Choosing,
    reward: Path,
    person: str | None,
    groups: tuple[str, ...],
    samples: int,
    seed: int,
) -> None:
    """Draw how demonstrations rank among paths of the policy.

    Ranks are by log-likelihood, with a panel for each group. They are uniform if the policy is right.
    """
    import numpy as np

    from navirl_cli.evaluation.groups import groups_named
    from navirl_cli.evaluation.ranks import Ranking, by_group_and_training, check_to_rank, chosen_to_rank, ranks_of
    from navirl_cli.figures.ranks import draw_rank_panels, rank_layout
    from navirl_cli.reports.ranks import rank_lines

    everyone = demonstrations_in(*demos)
    learnt = read_reward_for(reward, everyone, person)
    trained = learnt.trained(everyone)
    demonstrations = choosing.subset.of(everyone)
    chosen, others = demonstrations, dict[str, int]()
    if groups:
        chosen = [one for own in groups_named(demonstrations, groups) for one in own]
    elif not (choosing.subset.names or choosing.everything):
        check_to_rank(demonstrations, trained)
        chosen, others = chosen_to_rank(demonstrations, trained)
    rng = np.random.default_rng(seed)
    with progress_bar("rank", len(chosen)) as update:
        found = ranks_of(
            chosen, learnt.reward, samples, rng, progress=lambda done, _all: update(done, ""), trained=trained
        )
    panels = by_group_and_training(found)
    page.draw(lambda axes: draw_rank_panels(axes, panels), **rank_layout(len(panels), page.width_in))
    for line in rank_lines(Ranking(tuple(found), others, trained)):
        say(line)


@click.command(
    cls=Command,
    examples=[
        Example("Two rewards", "navirl plot compare demos.json --reward first.json --reward second.json -o two.png"),
        Example("Two groups", "navirl plot compare demos.json --group 'force, cycle 1' --group joystick -o two.png"),
    ],
)
@page_options
@demos_argument
@choice_options(reward=True, trial=False)
@section(
    "Compared",
    click.option("--reward", "rewards", multiple=True, type=FilePath, help="Learnt reward; give two or more."),
    _group_option("give two or more"),
)
@section("Scene", trial_option, crop_option)
def compare(
    page: Page,
    demos: tuple[Path, ...],
    choosing: Choosing,
    rewards: tuple[Path, ...],
    groups: tuple[str, ...],
    trial: str | None,
    crop: bool,
) -> None:
    """Draw several rewards, or several groups, side by side.

    Give two or more --reward, for policy and state reward in the scene of one trial; or two or more --group, for
    their driven paths.
    """
    if min(len(rewards), len(groups)) > 0 or max(len(rewards), len(groups)) < 2:
        raise click.UsageError("compare needs two or more --reward, or two or more --group.")
    if groups and trial is not None:
        raise click.UsageError("--trial selects the scene of --reward; --group draws all trials of the groups.")
    refuse_unused("--reward", "everything", used=bool(rewards))
    everyone = demonstrations_in(*demos)
    if groups:
        _draw_groups(page, choosing.of(everyone), groups, crop=crop)
        return
    learnt = [read_reward_for(path, everyone) for path in rewards]
    one, _ = scene_of(choosing, everyone, learnt, trial)
    _draw_rewards(page, one, rewards, [found.reward for found in learnt], crop=crop)


def _draw_groups(page: Page, demonstrations: Sequence["Demonstration"], groups: Sequence[str], *, crop: bool) -> None:
    """A panel of paths for each group."""
    from navirl_cli.evaluation.groups import groups_named
    from navirl_cli.figures.conditions import draw_path_panels

    panels = list(zip(groups, groups_named(demonstrations, groups), strict=True))
    page.draw(lambda axes: draw_path_panels(axes, panels, crop=crop), panels=len(panels), columns=2)


def _draw_rewards(
    page: Page, one: "Demonstration", files: Sequence[Path], rewards: Sequence["Reward"], *, crop: bool
) -> None:
    """A row of policy and state reward for each reward; equal colours are equal values."""
    import numpy as np

    from navirl_cli.figures.cells import LEAST_VISITS, likely_window, scene_window
    from navirl_cli.figures.policies import draw_policy_and_reward
    from navirl_cli.irl.scene import scenes_of
    from navirl_cli.irl.solved import solved

    scene, rows, stems = scenes_of([one])[0], [], [path.stem for path in files]
    for path, reward in zip(files, rewards, strict=True):
        name = path.stem if stems.count(path.stem) == 1 else str(path)
        rows.append((name, solved(reward, scene)))
    most = np.max([solution.visits for _, solution in rows], axis=0)
    window = likely_window(scene, most) if crop else scene_window(scene, most >= LEAST_VISITS)
    page.draw(
        lambda axes: draw_policy_and_reward(axes, rows, one.robot_radius_m, window), panels=2 * len(rows), columns=2
    )
