"""Figures of one scene under a reward: policy, reward, soft value, most likely moves."""

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Unpack

from navirl_cli.api.arguments import one_of, texts
from navirl_cli.api.calls import policy as policy_in
from navirl_cli.api.given import AnyReward, PathLike
from navirl_cli.api.page import PageOptions, drawn, own
from navirl_cli.api.results import ScenePolicy
from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.figures.actions import draw_actions
from navirl_cli.figures.cells import CellOptions, draw_policy, draw_reward, sight_of
from navirl_cli.figures.overlay import driven, overlays_of
from navirl_cli.figures.values import draw_value

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def policy(
    reward: PathLike | AnyReward,
    demonstration: Demonstration,
    *,
    person: str | None = None,
    axes: "Axes | None" = None,
    crop: bool = False,
    overlay: str | Collection[str] = (),
    samples: int = 20,
    seed: int = 0,
    demos: Sequence[Demonstration] = (),
    **page: Unpack[PageOptions],
) -> "Axes":
    """Draw the expected visits of every cell under a policy (the paper's Fig. 8, left).

    Args:
        reward: A reward, its file, or values by name of parameter.
        demonstration: Gives the map, the people, the start and the goal.
        person: Take this person's own reward, of a reward fitted with ``pool="persons"``; the typical one by default.
        axes: Axes to draw on; a new figure by default.
        crop: Show only the surroundings of the likely paths.
        overlay: Draw paths over the map: "demos" (in this scene by this participant), "all" (all of demos on this
            map), "samples"; one or several.
        samples: Number of paths sampled from the policy.
        seed: The same seed gives the same paths.
        demos: Demonstrations for the overlay. By default the given demonstration alone.
        **page: As in :class:`PageOptions`.

    Returns:
        The axes.

    Raises:
        NavirlError: The scene has no policy under the reward, or the figure cannot be written.
    """
    view = policy_in(reward, demonstration, person=person)
    options = _cells(view, crop, overlay, samples, seed, demos)
    return _drawn(draw_policy, view, view.visits_by_state, options, axes, page)


def reward(
    reward: PathLike | AnyReward,
    demonstration: Demonstration,
    *,
    person: str | None = None,
    axes: "Axes | None" = None,
    crop: bool = False,
    overlay: str | Collection[str] = (),
    samples: int = 20,
    seed: int = 0,
    demos: Sequence[Demonstration] = (),
    **page: Unpack[PageOptions],
) -> "Axes":
    """Draw the reward of every cell, with the nominal path (the paper's Fig. 8, right); arguments as :func:`policy`."""
    view = policy_in(reward, demonstration, person=person)
    options = _cells(view, crop, overlay, samples, seed, demos)
    return _drawn(draw_reward, view, view.reward.by_cell(view.scene), options, axes, page)


def value(
    reward: PathLike | AnyReward,
    demonstration: Demonstration,
    *,
    person: str | None = None,
    axes: "Axes | None" = None,
    crop: bool = False,
    overlay: str | Collection[str] = (),
    samples: int = 20,
    seed: int = 0,
    demos: Sequence[Demonstration] = (),
    **page: Unpack[PageOptions],
) -> "Axes":
    """Draw the soft value of every cell with its contours; arguments as :func:`policy`."""
    view = policy_in(reward, demonstration, person=person)
    options = _cells(view, crop, overlay, samples, seed, demos)
    return _drawn(draw_value, view, view.policy.value_by_cell(), options, axes, page)


def actions(
    reward: PathLike | AnyReward,
    demonstration: Demonstration,
    *,
    person: str | None = None,
    axes: "Axes | None" = None,
    crop: bool = False,
    overlay: str | Collection[str] = (),
    samples: int = 20,
    seed: int = 0,
    demos: Sequence[Demonstration] = (),
    **page: Unpack[PageOptions],
) -> "Axes":
    """Draw the most likely move of every cell as an arrow; arguments as :func:`policy`."""
    view = policy_in(reward, demonstration, person=person)
    options = _cells(view, crop, overlay, samples, seed, demos)
    return _drawn(draw_actions, view, view.policy.probability_by_cell(view.scene.start), options, axes, page)


def _drawn(
    draw: Callable[..., object],
    view: ScenePolicy,
    by_state: FloatArray,
    options: CellOptions,
    axes: "Axes | None",
    page: PageOptions,
) -> "Axes":
    """Draw one map of a scene, and give its axes."""
    return drawn(lambda panels: draw(panels[0], view.scene, by_state, **options), own(axes), page)[0]


def _cells(
    view: ScenePolicy,
    crop: bool,
    overlay: str | Collection[str],
    samples: int,
    seed: int,
    demos: Sequence[Demonstration],
) -> CellOptions:
    """Common options of all figures of a scene; cropped figures have the same view."""
    wanted = {one_of(("demos", "all", "samples"), one, "overlay") for one in texts(overlay)}
    shown: Sequence[Demonstration] = ()
    if wanted & {"demos", "all"}:
        shown, _ = driven(demos or [view.demonstration], view.demonstration, everywhere="all" in wanted)
    overlays = overlays_of(shown, view.sample(samples, seed=seed) if "samples" in wanted else ())
    return sight_of(view.scene, view.visits_by_state, view.demonstration.robot_radius_m, overlays, crop=crop)
