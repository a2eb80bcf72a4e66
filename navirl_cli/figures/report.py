"""The figures of a report on one learnt reward, as files."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.figures import properties
from navirl_cli.figures.conditions import draw_path_panels, panels_of
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.policies import draw_policy_and_reward
from navirl_cli.figures.profile import draw_profiles
from navirl_cli.figures.sheet import new_figure, save_figure
from navirl_cli.figures.style import PAGE_IN
from navirl_cli.irl.profile import Profile
from navirl_cli.irl.solved import SolvedScene
from navirl_cli.irl.terms.term import Parameter


def draw_report(
    demonstrations: Sequence[Demonstration],
    parameters: Sequence[Parameter],
    shown: tuple[Demonstration, SolvedScene],
    groups: Iterable[GroupMetrics],
    profiles: Sequence[Profile],
    folder: Path,
) -> dict[str, Path]:
    """Draw paths, policy, properties and profiles.

    Args:
        demonstrations: All.
        parameters: Names and units of the learnt parameters.
        shown: The demonstration whose scene shows the policy, and this scene under the learnt reward.
        groups: Metrics, as :func:`navirl_cli.evaluation.compare.compare` gives them.
        profiles: Profile likelihoods; may be empty.
        folder: Where to write .png files.

    Returns:
        The files by name: paths, policy, properties, and profile if there are profiles.
    """
    files = {name: folder / f"{name}.png" for name in ("paths", "policy", "properties", "profile")}
    panels = panels_of(demonstrations)
    figure, axes = new_figure(PAGE_IN, panels=max(1, len(panels)), columns=2 if panels else 1)
    if panels:
        draw_path_panels(axes, panels)
    else:
        draw_paths(axes[0], demonstrations)
    save_figure(figure, files["paths"])
    one, scene = shown
    figure, axes = new_figure(PAGE_IN, panels=2, columns=2)
    draw_policy_and_reward(axes, [(f"scene of {one.id}", scene)], one.robot_radius_m)
    save_figure(figure, files["policy"])
    bars = properties.bars_of(groups)
    figure, axes = new_figure(PAGE_IN, properties.height_for(bars, PAGE_IN), len(PAPER_METRICS))
    properties.draw_properties(axes, bars)
    save_figure(figure, files["properties"], trim=False)
    if profiles:
        units = {parameter.name: parameter.unit for parameter in parameters}
        save_figure(draw_profiles(profiles, units, PAGE_IN), files["profile"], trim=False)
    else:
        del files["profile"]
    return files
