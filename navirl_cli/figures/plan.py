"""A planned path over the expected visits of the policy."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.lines import Line2D

from navirl_cli.arrays import FloatArray
from navirl_cli.evaluation.compare import LEARNT
from navirl_cli.figures.cells import VISITS, DrawnCells, draw_policy, likely_window
from navirl_cli.figures.marks import merged_handles
from navirl_cli.figures.overlay import Overlay
from navirl_cli.figures.policies import share_colours
from navirl_cli.figures.sheet import common_legend, new_figure, save_figure
from navirl_cli.figures.style import COLUMN_IN, PAGE_IN, colour_of, house_style
from navirl_cli.planning.paths import Planner


def draw_plan(output: Path, planner: Planner, lines_m: Sequence[FloatArray], *, force: bool) -> None:
    """Write a figure of planned paths, the nominal path, people and the policy's visits.

    Args:
        output: The file: .png, .pdf or .svg.
        planner: The policy.
        lines_m: Planned paths, each (k, 2) m, map frame.
        force: Whether to replace an existing file.

    Raises:
        ArtefactError: The file cannot be written.
    """
    draw_plans(output, [("", planner, lines_m)], force=force)


@house_style()
def draw_plans(
    output: Path, plans: Sequence[tuple[str, Planner, Sequence[FloatArray]]], *, force: bool
) -> list[DrawnCells]:
    """The same of several scenes, a panel for each, with one colour bar and one legend for all.

    Args:
        output: The file: .png, .pdf or .svg.
        plans: Title, policy and planned paths of each scene.
        force: Whether to replace an existing file.

    Returns:
        The artists of each panel.

    Raises:
        ArtefactError: The file cannot be written.
    """
    alone, columns = len(plans) == 1, min(len(plans), 2)
    figure, axes = new_figure(COLUMN_IN if columns == 1 else PAGE_IN, None, len(plans), columns)
    drawn = []
    for panel, (title, planner, lines_m) in zip(axes, plans, strict=True):
        scene = planner.problem.scene
        drawn.append(
            draw_policy(
                panel,
                scene,
                planner.visits,
                robot_radius_m=planner.problem.robot_radius_m,
                window_m=likely_window(scene, planner.visits, list(lines_m)),
                overlays=[Overlay("planned", LEARNT, lines_m)],
                title=title,
                legend=alone,
                scale=alone,
            )
        )
    if not alone:
        drawn = share_colours(drawn, VISITS)
        path = Line2D([], [], color=colour_of(LEARNT), linewidth=1.0, label="planned")
        common_legend(axes, [path, *merged_handles([one.marks for one in drawn])])
    save_figure(figure, output, force=force)
    return drawn
