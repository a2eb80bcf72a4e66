"""The figures of a report on one learnt reward, as files."""

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.figures import properties
from navirl_cli.figures.conditions import draw_path_panels, panels_of
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.policies import TitledScene, draw_policy_and_reward
from navirl_cli.figures.profile import draw_profiles
from navirl_cli.figures.screens import Drawing, save_for_screens
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLUMN_IN
from navirl_cli.irl.profile import Profile
from navirl_cli.irl.solved import SolvedScene
from navirl_cli.irl.terms.term import Parameter
from navirl_cli.parallel import map_in_order

#: A drawn figure, and whether to remove empty height.
_Drawn = tuple[Figure, bool]


def draw_report(
    demonstrations: Sequence[Demonstration],
    parameters: Sequence[Parameter],
    shown: tuple[Demonstration, SolvedScene],
    groups: Iterable[GroupMetrics],
    profiles: Sequence[Profile],
    folder: Path,
) -> dict[str, Path]:
    """Draw paths, policy, properties and profiles, for all screens.

    Args:
        demonstrations: All.
        parameters: Names and units of the learnt parameters.
        shown: The demonstration whose scene shows the policy, and this scene under the learnt reward.
        groups: Metrics, as :func:`navirl_cli.evaluation.compare.compare` gives them.
        profiles: Profile likelihoods; may be empty.
        folder: Where to write .png files.

    Returns:
        The files by name: paths, policy, properties, and profile if there are profiles; each with the names of
        :func:`navirl_cli.figures.screens.save_for_screens` too.
    """
    one, scene = shown
    drawings = {
        "paths": Drawing(partial(draw_groups, demonstrations)),
        "policy": Drawing(partial(draw_scenes, [(f"scene of {one.id}", scene)], one.robot_radius_m)),
        "properties": Drawing(partial(draw_property_panels, properties.bars_of(groups))),
    }
    if profiles:
        drawings["profile"] = Drawing(partial(_profiles, profiles, {one.name: one.unit for one in parameters}))
    files: dict[str, Path] = {}
    for own in map_in_order(partial(_saved, folder=folder), list(drawings.items())):
        files |= own
    return files


def _saved(job: tuple[str, Drawing], folder: Path) -> dict[str, Path]:
    """Draw one figure and save it."""
    return save_for_screens(job[1], job[0], folder)


def draw_groups(demonstrations: Sequence[Demonstration], width_in: float) -> _Drawn:
    """Paths on one map, or on a map for each group of many, in a figure of this width, inches."""
    if panels := panels_of(demonstrations):
        return draw_conditions(panels, width_in)
    figure, axes = new_figure(width_in)
    draw_paths(axes[0], demonstrations)
    return figure, True


def draw_conditions(panels: Sequence[tuple[str, Sequence[Demonstration]]], width_in: float) -> _Drawn:
    """Paths on a map for each condition, two maps in a row where a figure of this width, inches, has room."""
    figure, axes = new_figure(width_in, panels=len(panels), columns=min(_columns(width_in), len(panels)))
    draw_path_panels(axes, panels)
    return figure, True


def draw_scenes(scenes: Sequence[TitledScene], robot_radius_m: float, width_in: float) -> _Drawn:
    """Policy and reward of each scene, side by side where a figure of this width, inches, has room."""
    figure, axes = new_figure(width_in, panels=2 * len(scenes), columns=_columns(width_in))
    draw_policy_and_reward(axes, scenes, robot_radius_m)
    return figure, True


def draw_property_panels(bars: Sequence[properties.PropertyBar], width_in: float) -> _Drawn:
    """Path properties, side by side where a figure of this width, inches, has room."""
    figure, axes = new_figure(width_in, **properties.property_layout(bars, width_in, stacked=_columns(width_in) == 1))
    properties.draw_properties(axes, bars)
    return figure, False


def _profiles(profiles: Sequence[Profile], units: dict[str, str], width_in: float) -> _Drawn:
    return draw_profiles(profiles, units, width_in), False


def _columns(width_in: float) -> int:
    """Maps side by side in a figure of a width, inches."""
    return 2 if width_in > COLUMN_IN else 1
