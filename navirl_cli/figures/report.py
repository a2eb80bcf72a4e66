"""The figures of a report on one learnt reward, as files."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.figures import properties
from navirl_cli.figures.conditions import draw_path_panels, panels_of
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.policies import draw_policy_and_reward
from navirl_cli.figures.profile import draw_profiles
from navirl_cli.figures.sheet import new_figure, save_figure
from navirl_cli.figures.style import COLUMN_IN, DPI, PAGE_IN, styled
from navirl_cli.irl.profile import Profile
from navirl_cli.irl.solved import SolvedScene
from navirl_cli.irl.terms.term import Parameter
from navirl_cli.parallel import map_in_order

#: A drawn figure, and whether to remove empty height.
_Drawn = tuple[Figure, bool]


@dataclass(frozen=True)
class _Job:
    """A figure to draw and to save."""

    draw: Callable[[], _Drawn]
    path: Path
    style: str


def draw_report(
    demonstrations: Sequence[Demonstration],
    parameters: Sequence[Parameter],
    shown: tuple[Demonstration, SolvedScene],
    groups: Iterable[GroupMetrics],
    profiles: Sequence[Profile],
    folder: Path,
) -> dict[str, Path]:
    """Draw paths, policy, properties and profiles, for light and for dark screens.

    Args:
        demonstrations: All.
        parameters: Names and units of the learnt parameters.
        shown: The demonstration whose scene shows the policy, and this scene under the learnt reward.
        groups: Metrics, as :func:`navirl_cli.evaluation.compare.compare` gives them.
        profiles: Profile likelihoods; may be empty.
        folder: Where to write .png files.

    Returns:
        The files by name: paths, policy, properties, and profile if there are profiles; each with "_dark" behind its
        name too. In "policy_narrow" and "policy_narrow_dark" the two panels of the policy stand one above the other.
    """
    drawn: dict[str, Callable[[], _Drawn]] = {
        "paths": partial(_paths, demonstrations),
        "policy": partial(_policy, *shown, columns=2),
        "policy_narrow": partial(_policy, *shown, columns=1),
        "properties": partial(_properties, properties.bars_of(groups)),
    }
    if profiles:
        drawn["profile"] = partial(_profiles, profiles, {one.name: one.unit for one in parameters})
    jobs = {
        f"{name}{ending}": _Job(draw, folder / f"{name}{ending}.png", style)
        for ending, style in (("", "paper"), ("_dark", "dark"))
        for name, draw in drawn.items()
    }
    return dict(zip(jobs, map_in_order(_saved, list(jobs.values())), strict=True))


def _saved(job: _Job) -> Path:
    """Draw one figure and save it."""
    with styled(job.style, dpi=DPI):
        figure, trim = job.draw()
        save_figure(figure, job.path, trim=trim)
    return job.path


def _paths(demonstrations: Sequence[Demonstration]) -> _Drawn:
    panels = panels_of(demonstrations)
    figure, axes = new_figure(PAGE_IN, panels=max(1, len(panels)), columns=2 if panels else 1)
    if panels:
        draw_path_panels(axes, panels)
    else:
        draw_paths(axes[0], demonstrations)
    return figure, True


def _policy(one: Demonstration, scene: SolvedScene, columns: int) -> _Drawn:
    figure, axes = new_figure(PAGE_IN if columns > 1 else COLUMN_IN, panels=2, columns=columns)
    draw_policy_and_reward(axes, [(f"scene of {one.id}", scene)], one.robot_radius_m)
    return figure, True


def _properties(bars: Sequence[properties.PropertyBar]) -> _Drawn:
    figure, axes = new_figure(PAGE_IN, properties.height_for(bars, PAGE_IN), len(PAPER_METRICS))
    properties.draw_properties(axes, bars)
    return figure, False


def _profiles(profiles: Sequence[Profile], units: dict[str, str]) -> _Drawn:
    return draw_profiles(profiles, units, PAGE_IN), False
