"""Figures, as ``navirl plot`` draws them: on your axes, or on a new figure.

Every function draws in the style of the command line and returns the axes. Without ``axes`` it opens a figure through
pyplot: a notebook shows it at the end of the cell, ``matplotlib.pyplot.show()`` in a window. With ``output`` it writes
the figure to that file and shows nothing. All functions take the options of :class:`PageOptions`.
"""

from collections.abc import Collection, Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np

from navirl_cli.api.arguments import subset_in, texts, within
from navirl_cli.api.given import AnyReward, Demos, PathLike, demonstrations_in, learnt_in, of_one, reward_in
from navirl_cli.api.maps import actions, policy, reward, value
from navirl_cli.api.page import PageOptions, drawn, own, width_in
from navirl_cli.artefacts.rewards import LearntReward
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.errors import ArgumentError, ArtefactError
from navirl_cli.evaluation.choice import choose
from navirl_cli.evaluation.compare import LEARNT, compare
from navirl_cli.evaluation.drawn import Precision
from navirl_cli.evaluation.groups import Trained, group_of, groups_named
from navirl_cli.evaluation.ranks import by_group_and_training, check_to_rank, chosen_to_rank, ranks_of
from navirl_cli.figures.conditions import draw_path_panels, panels_of
from navirl_cli.figures.convergence import ROW_IN, columns_for, draw_convergence
from navirl_cli.figures.forces import draw_forces
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.profile import ASPECT, draw_profile
from navirl_cli.figures.properties import bars_of, draw_properties, property_layout
from navirl_cli.figures.ranks import draw_rank_panels, rank_layout

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["actions", "convergence", "forces", "paths", "policy", "profile", "properties", "ranks", "reward", "value"]


def paths(
    demos: Demos,
    *,
    condition: str | Collection[str] = (),
    cycle: int | Collection[int] = (),
    set: str | Collection[str] = (),  # noqa: A002 the option's name
    participant: str | Collection[str] = (),
    trial: str | Collection[str] = (),
    axes: "Axes | None" = None,
    crop: bool = False,
    together: bool = False,
    **page: Unpack[PageOptions],
) -> "Axes":
    """Draw all driven paths by condition, thicker where the person pushed (the paper's Fig. 3).

    Args:
        demos: Demonstrations, or their files.
        condition: Only trials of these conditions, as of :func:`navirl_cli.fit`; so are cycle, set, participant and
            trial.
        cycle: Only trials of these cycles.
        set: Only trials of these sets.
        participant: Only trials of these participants.
        trial: Only these trials.
        axes: Axes to draw on; a new figure by default.
        crop: Show only the surroundings of the paths.
        together: One map for all groups, also with more than 40 paths and without `axes`.
        **page: As in :class:`PageOptions`.

    Returns:
        The axes; those of the first group where each has its own.

    Raises:
        NavirlError: There are no demonstrations, or the figure cannot be written.
    """
    demonstrations = subset_in(condition, cycle, set, participant, trial).of(demonstrations_in(demos))
    groups = [] if together or axes is not None else panels_of(demonstrations)
    if groups:
        shape = {"panels": len(groups), "columns": 2}
        return drawn(lambda panels: draw_path_panels(panels, groups, crop=crop), None, page, **shape)[0]
    return drawn(lambda panels: draw_paths(panels[0], demonstrations, crop=crop), own(axes), page)[0]


def properties(
    demos: Demos,
    reward: PathLike | AnyReward | None = None,
    *,
    person: str | None = None,
    condition: str | Collection[str] = (),
    cycle: int | Collection[int] = (),
    set: str | Collection[str] = (),  # noqa: A002 the option's name
    participant: str | Collection[str] = (),
    trial: str | Collection[str] = (),
    all: bool = False,  # noqa: A002 the option's name
    samples: int = 100,
    seed: int = 0,
    bars: bool = False,
    **page: Unpack[PageOptions],
) -> "list[Axes]":
    """Draw length, distance and area of paths by condition, as points with intervals (the paper's Fig. 7).

    Args:
        demos: Demonstrations, or their files.
        reward: Adds the learnt paths, for the groups from which it was learnt, or for all if these are unknown.
        person: As in :func:`policy`.
        condition: Only trials of these conditions, as of :func:`paths`; so are cycle, set, participant and trial.
        cycle: Only trials of these cycles.
        set: Only trials of these sets.
        participant: Only trials of these participants.
        trial: Only these trials.
        all: All trials. By default those that the reward was learnt from, where that is known.
        samples: Number of paths sampled from the policy in each scene.
        seed: The same seed gives the same paths.
        bars: Bars from 0 with standard deviations, in place of points.
        **page: As in :class:`PageOptions`.

    Returns:
        The axes of the three panels.

    Raises:
        NavirlError: There are no demonstrations, or the figure cannot be written.
    """
    everyone = demonstrations_in(demos)
    if person is not None and reward is None:
        raise ArgumentError("`person` goes with `reward`: name one, or leave it out")
    reward = None if reward is None else of_one(reward, person)
    trained = [] if reward is None else [_trained(reward, everyone)]
    subset = subset_in(condition, cycle, set, participant, trial)
    demonstrations = choose(everyone, subset, trained, everything=all).demonstrations
    learnt = {} if reward is None else {LEARNT: reward_in(reward, demonstrations)}
    drawing = Precision(int(within("samples", samples, 2, 100_000)))
    result = compare(demonstrations, learnt, drawing, np.random.default_rng(seed))
    rows = bars_of(result.groups, _taught(reward, demonstrations))
    layout = property_layout(rows, width_in(page))
    return drawn(lambda axes: draw_properties(axes, rows, as_bars=bars), None, page, **layout)


def forces(demonstration: Demonstration, *, crop: bool = False, **page: Unpack[PageOptions]) -> "list[Axes]":
    """Draw the forces of a trial: over time with contacts, and as arrows along the path.

    Args:
        demonstration: The trial.
        crop: Show only the surroundings of the path.
        **page: As in :class:`PageOptions`.

    Returns:
        The axes of both panels.

    Raises:
        NavirlError: The trial has no wrench, or the figure cannot be written.
    """
    return drawn(lambda axes: draw_forces(axes, demonstration, crop=crop), None, page, panels=2, columns=1)


def ranks(
    demos: Demos,
    reward: PathLike | AnyReward,
    *,
    person: str | None = None,
    condition: str | Collection[str] = (),
    cycle: int | Collection[int] = (),
    set: str | Collection[str] = (),  # noqa: A002 the option's name
    participant: str | Collection[str] = (),
    trial: str | Collection[str] = (),
    all: bool = False,  # noqa: A002 the option's name
    group: str | Sequence[str] = (),
    samples: int = 1000,
    seed: int = 0,
    **page: Unpack[PageOptions],
) -> "list[Axes]":
    """Draw the ranks of demonstrations among paths of the policy by group: uniform if the policy is right.

    Args:
        demos: Demonstrations, or their files.
        reward: A reward, its file, or values by name of parameter.
        person: As in :func:`policy`.
        condition: Only trials of these conditions, as of :func:`paths`; so are cycle, set, participant and trial.
        cycle: Only trials of these cycles.
        set: Only trials of these sets.
        participant: Only trials of these participants.
        trial: Only these trials.
        all: All trials, also of groups that the reward was not learnt from.
        group: Groups to rank; by default those that the reward was learnt from, where that is known.
        samples: Number of paths sampled from the policy in each scene.
        seed: The same seed gives the same paths.
        **page: As in :class:`PageOptions`.

    Returns:
        The axes of the panels, one for each group.

    Raises:
        NavirlError: A scene has no policy under the reward, no demonstration is like those that it was learnt from, or
            the figure cannot be written.
    """
    everyone, subset = demonstrations_in(demos), subset_in(condition, cycle, set, participant, trial)
    reward = of_one(reward, person)
    parameters, trained = reward_in(reward, everyone), _trained(reward, everyone)
    demonstrations = choose(everyone, subset, everything=all).demonstrations
    if names := texts(group):
        chosen = [one for own in groups_named(demonstrations, names) for one in own]
    elif subset.names or all:
        chosen = list(demonstrations)
    else:
        check_to_rank(demonstrations, trained)
        chosen, _ = chosen_to_rank(demonstrations, trained)
    found = ranks_of(chosen, parameters, samples, np.random.default_rng(seed), trained=trained)
    panels = by_group_and_training(found)
    return drawn(lambda axes: draw_rank_panels(axes, panels), None, page, **rank_layout(len(panels), width_in(page)))


def convergence(reward: PathLike | LearntReward, **page: Unpack[PageOptions]) -> "list[Axes]":
    """Draw log-likelihood and parameters over the iterations of a fit.

    Args:
        reward: A learnt reward, or its file.
        **page: As in :class:`PageOptions`.

    Returns:
        The axes of the panels.

    Raises:
        NavirlError: The reward holds no iterations, or the figure cannot be written.
    """
    learnt = learnt_in(reward)
    search, parameters = learnt.search, learnt.reward.parameters
    if search is None:
        raise ArtefactError("reward: expected the iterations of its fit, found none; fit it again")
    panels, columns = 1 + len(parameters), columns_for(width_in(page))
    return drawn(
        lambda axes: draw_convergence(axes, search.log_likelihood, search.theta, parameters),
        None,
        page,
        panels=panels,
        columns=columns,
        height_in=ceil(panels / columns) * ROW_IN,
    )


def profile(
    reward: PathLike | LearntReward, name: str, *, axes: "Axes | None" = None, **page: Unpack[PageOptions]
) -> "Axes":
    """Draw the profile likelihood of a parameter with its interval.

    Args:
        reward: A reward that was learnt with ``profile=NAME``, or its file.
        name: The parameter.
        axes: Axes to draw on; a new figure by default.
        **page: As in :class:`PageOptions`.

    Returns:
        The axes.

    Raises:
        NavirlError: The reward holds no profile of the parameter, or the figure cannot be written.
    """
    learnt = learnt_in(reward)
    found = next((one for one in learnt.profiles if one.name == name), None)
    if found is None:
        known = ", ".join(one.name for one in learnt.profiles) or "none"
        raise ArgumentError(
            f"expected a parameter with a profile likelihood ({known}), found {name!r}; fit again with `profile`"
        )
    unit = next(parameter.unit for parameter in learnt.reward.parameters if parameter.name == name)
    height_in = width_in(page) * ASPECT
    return drawn(lambda panels: draw_profile(panels[0], found, unit), own(axes), page, height_in=height_in)[0]


def _trained(reward: PathLike | AnyReward, demonstrations: Sequence[Demonstration]) -> Trained | None:
    """What a reward was learnt from; None where that is unknown."""
    known = isinstance(reward, str | Path | LearntReward)
    return learnt_in(reward).trained(demonstrations) if known else None  # type: ignore[arg-type]


def _taught(reward: PathLike | AnyReward | None, demonstrations: Sequence[Demonstration]) -> set[str]:
    """Groups from which a reward was learnt; all if these are unknown."""
    learnt = learnt_in(reward) if isinstance(reward, str | Path | LearntReward) else None
    return {group_of(one) for one in demonstrations if learnt is None or one.id in learnt.demonstrations}
