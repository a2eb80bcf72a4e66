"""Figures of one scene under a learnt reward: policy, reward, soft value, most likely moves."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from navirl_cli.artefacts.rewards import read_reward_for
from navirl_cli.commands.choosing import Choosing, choice_options
from navirl_cli.commands.plot.page import Page, crop_option, page_options, reward_option, scene_of, trial_option
from navirl_cli.commands.shared import demonstrations_in, demos_argument, person_option, say, seed_option
from navirl_cli.commands.types import Choice, Count
from navirl_cli.commands.usage import Command, Example, Function, refuse_unused, section

if TYPE_CHECKING:
    from navirl_cli.arrays import FloatArray
    from navirl_cli.demos.demonstration import Demonstration
    from navirl_cli.figures.cells import CellOptions
    from navirl_cli.figures.overlay import Overlay
    from navirl_cli.irl.reward import Reward
    from navirl_cli.irl.scene import Scene
    from navirl_cli.irl.values import Policy

#: Values of --overlay.
DEMOS, ALL, SAMPLES = "demos", "all", "samples"


@dataclass(frozen=True, eq=False)
class Sight:
    """One scene under a learnt reward, with the paths to draw over it."""

    demonstrations: Sequence["Demonstration"]
    one: "Demonstration"
    reward: "Reward"
    crop: bool
    overlay: tuple[str, ...] = ()
    samples: int = 0
    seed: int = 0

    @cached_property
    def scene(self) -> "Scene":
        """The scene of the chosen trial."""
        from navirl_cli.irl.scene import scenes_of

        return scenes_of([self.one])[0]

    @cached_property
    def policy(self) -> "Policy":
        """The learnt policy."""
        from navirl_cli.irl.likelihood import policy_of

        return policy_of(self.reward, self.scene)

    @cached_property
    def visits(self) -> "FloatArray":
        """(n,) expected visits of every state."""
        return self.policy.visits_by_cell(self.scene.start)

    @property
    def moves(self) -> "FloatArray":
        """(n, 8) probability of each move in every state."""
        return self.policy.probability_by_cell(self.scene.start)

    @property
    def options(self) -> "CellOptions":
        """Common options of all figures of the scene."""
        from navirl_cli.figures.cells import sight_of

        return sight_of(self.scene, self.visits, self.one.robot_radius_m, self._overlays(), crop=self.crop)

    def _overlays(self) -> list["Overlay"]:
        """Paths to draw over the map, driven ones below."""
        import numpy as np

        from navirl_cli.figures.overlay import driven, overlays_of
        from navirl_cli.irl.paths import sample_paths, sampled_lines_m

        sampled_m: list[FloatArray] = []
        if SAMPLES in self.overlay:
            paths = sample_paths(self.policy, self.scene.start, self.samples, np.random.default_rng(self.seed))
            sampled_m = sampled_lines_m(self.policy, paths)
        shown: Sequence[Demonstration] = ()
        if {DEMOS, ALL} & {*self.overlay}:
            shown, note = driven(self.demonstrations, self.one, everywhere=ALL in self.overlay)
            if note:
                say(note)
        return overlays_of(shown, sampled_m)


def scene_options(function: Function) -> Function:
    """Options of figures of one scene, as arguments ``page`` and ``sight``."""

    @wraps(function)
    def packed(
        page: Page,
        demos: tuple[Path, ...],
        reward: Path,
        choosing: Choosing,
        person: str | None,
        trial: str | None,
        **others: Any,
    ) -> Any:
        refuse_unused("--overlay samples", "samples", "seed", used=SAMPLES in others["overlay"])
        everyone = demonstrations_in(*demos)
        learnt = read_reward_for(reward, everyone, person)
        one, demonstrations = scene_of(choosing, everyone, [learnt], trial)
        return function(page, Sight(demonstrations, one, learnt.reward, **others))

    scene = section(
        "Scene",
        reward_option,
        person_option,
        trial_option,
        crop_option,
        click.option(
            "--overlay",
            multiple=True,
            type=Choice((DEMOS, ALL, SAMPLES)),
            help="Draw paths over the map: demonstrated in this scene by this participant (demos), all chosen ones on "
            "this map (all), or sampled from the policy; repeatable.",
        ),
        click.option(
            "--samples",
            default=20,
            show_default=True,
            type=Count(1, 1000),
            help="Paths sampled from the policy for --overlay samples.",
        ),
        seed_option,
    )
    chosen = choice_options(reward=True, trial=False)
    return page_options(demos_argument(chosen(scene(packed))))  # type: ignore[return-value]


@click.command(
    cls=Command,
    examples=[
        Example("The first trial", "navirl plot policy demos.json --reward reward.json -o policy.pdf"),
        Example(
            "One trial, with demonstrated paths",
            "navirl plot policy demos.json --reward reward.json --trial p01/3 --overlay demos -o policy.png",
        ),
    ],
)
@scene_options
def policy(page: Page, sight: Sight) -> None:
    """Draw expected visits of every cell under the learnt policy.

    As in Fig. 8 of the paper, left, in the scene of one trial.
    """
    from navirl_cli.figures.cells import draw_policy

    page.draw(lambda axes: draw_policy(axes[0], sight.scene, sight.visits, **sight.options))


@click.command(
    cls=Command,
    examples=[
        Example("The first trial", "navirl plot reward demos.json --reward reward.json -o reward.pdf"),
        Example("A detail", "navirl plot reward demos.json --reward reward.json --crop -o reward.png"),
    ],
)
@scene_options
def reward(page: Page, sight: Sight) -> None:
    """Draw the learnt reward of every cell.

    As in Fig. 8 of the paper, right, with the nominal path. What depends on the moves alone is not in it: the cost of
    path length and of turns.
    """
    from navirl_cli.figures.cells import draw_reward

    page.draw(lambda axes: draw_reward(axes[0], sight.scene, sight.reward.by_cell(sight.scene), **sight.options))


@click.command(
    cls=Command,
    examples=[
        Example("The first trial", "navirl plot value demos.json --reward reward.json -o value.pdf"),
        Example(
            "With sampled paths",
            "navirl plot value demos.json --reward reward.json --overlay samples -o value.png",
        ),
    ],
)
@scene_options
def value(page: Page, sight: Sight) -> None:
    """Draw the soft value of every cell, with contour lines.

    The soft value is the expected reward from the cell to the goal, with the entropy of the moves.
    """
    from navirl_cli.figures.values import draw_value

    page.draw(lambda axes: draw_value(axes[0], sight.scene, sight.policy.value_by_cell(), **sight.options))


@click.command(
    cls=Command,
    examples=[
        Example("The first trial", "navirl plot actions demos.json --reward reward.json -o actions.pdf"),
        Example("A page wide", "navirl plot actions demos.json --reward reward.json --crop --wide -o actions.png"),
    ],
)
@scene_options
def actions(page: Page, sight: Sight) -> None:
    """Draw the most likely move in every cell as an arrow.

    The longer an arrow, the more probable is its move.
    """
    from navirl_cli.figures.actions import draw_actions

    page.draw(lambda axes: draw_actions(axes[0], sight.scene, sight.moves, **sight.options))
