"""A planned path over the expected visits of the policy."""

from collections.abc import Sequence
from pathlib import Path

from navirl_cli.arrays import FloatArray
from navirl_cli.evaluation.compare import LEARNT
from navirl_cli.figures.cells import draw_policy, likely_window
from navirl_cli.figures.overlay import Overlay
from navirl_cli.figures.sheet import new_figure, save_figure
from navirl_cli.figures.style import COLUMN_IN
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
    scene = planner.problem.scene
    figure, axes = new_figure(COLUMN_IN, None, 1, None)
    window = likely_window(scene, planner.visits, list(lines_m))
    overlays = [Overlay("planned", LEARNT, lines_m)]
    draw_policy(
        axes[0],
        scene,
        planner.visits,
        robot_radius_m=planner.problem.robot_radius_m,
        window_m=window,
        overlays=overlays,
    )
    save_figure(figure, output, force=force)
