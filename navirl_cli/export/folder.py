"""A folder with all that a Nav2 robot needs to drive by a reward: fragments, masks, a node, and a README."""

from pathlib import Path
from typing import Final

import numpy as np

from navirl_cli.export import fragments
from navirl_cli.export.costs import away_from_people_m
from navirl_cli.export.fragments import Distro, yaml_text
from navirl_cli.export.masks import occupancy_of, slowing, write_mask
from navirl_cli.export.nav2 import Nav2Export, lost
from navirl_cli.export.readme import TITLE, readme_text
from navirl_cli.files import swapped_folder
from navirl_cli.planning.problem import Problem

#: Files that run on the robot; they are no part of this program.
_ROBOT: Final = Path(__file__).parent / "robot"
#: Every file that an export may write; those of an older export that a new one does not write are removed.
FILES: Final = (
    *("README.md", "planner.yaml", "costmap.yaml", "people_mask.yaml", "people_mask_node.py"),
    *("test_people_mask_node.py", "social_layer.yaml", "mask.yaml", "mask.pgm", "speed_mask.yaml", "speed_mask.pgm"),
    *("servers.yaml", "mask.launch.py"),
)
#: Shares of a person's peak cost: the robot is slowest where the cost is above the first, and free below the second.
_NEAR, _FAR = 0.5, 0.05


def write_nav2(folder: Path, export: Nav2Export) -> list[str]:
    """Write the folder; files of an older export are replaced or removed.

    Args:
        folder: Where; created if it does not exist.
        export: What.

    Returns:
        The names of the files.

    Raises:
        ArtefactError: It cannot be written.
    """
    texts = _texts(export)
    older = _is_export(folder)
    with swapped_folder(folder) as new:
        for name, text in texts.items():
            (new / name).write_text(text, encoding="utf-8")
        if export.problem is not None:
            _write_masks(new, export, export.problem)
        names = sorted(one.name for one in new.iterdir())
    if older:
        for name in set(FILES) - set(names):
            (folder / name).unlink(missing_ok=True)
    return names


def _is_export(folder: Path) -> bool:
    """Whether a folder holds an older export, whose files are not the user's own."""
    try:
        return (folder / "README.md").read_text(encoding="utf-8").startswith(TITLE)
    except (OSError, ValueError):
        return False


def _texts(export: Nav2Export) -> dict[str, str]:
    """Content by file name, without masks."""
    model = export.model
    texts = {
        "README.md": readme_text(export, lost(export)),
        "planner.yaml": yaml_text(
            fragments.planner(model, export.distro), "Merge into your parameters: the planner of these costs."
        ),
        "costmap.yaml": yaml_text(
            fragments.costmap(slow=export.slows),
            "Merge into your parameters; add the names to filters if you have some already.",
        ),
        "people_mask.yaml": yaml_text(fragments.people_mask(model), "Parameters of people_mask_node.py."),
        **{name: (_ROBOT / name).read_text(encoding="utf-8") for name in FILES if (_ROBOT / name).exists()},
    }
    if export.distro is Distro.HUMBLE:
        texts["social_layer.yaml"] = yaml_text(
            fragments.social_layer(model),
            "In place of the mask: merge into your parameters, with your own layers in plugins.",
        )
    if export.problem is not None:
        texts["servers.yaml"] = yaml_text(
            fragments.servers(export.problem.frame, slow=export.slows), "Parameters of the nodes of mask.launch.py."
        )
        texts["mask.launch.py"] = _launch_text(slow=export.slows)
    return texts


def _write_masks(folder: Path, export: Nav2Export, problem: Problem) -> None:
    grid = problem.scene.lattice.grid
    write_mask(folder / "mask.yaml", occupancy_of(export.costs(problem)), grid, force=True)
    if export.slow_percent is not None:
        away = away_from_people_m(problem.scene).min(axis=-1, initial=np.inf)
        near, far = (export.model.person_m(share) for share in (_NEAR, _FAR))
        write_mask(folder / "speed_mask.yaml", slowing(away, near, far, export.slow_percent), grid, force=True)


def _launch_text(*, slow: bool) -> str:
    """A launch file for the servers of static masks."""
    served = [(fragments.MASK_SERVER, fragments.INFO_SERVER, "mask.yaml")]
    if slow:
        served.append((fragments.SPEED_MASK_SERVER, fragments.SPEED_INFO_SERVER, "speed_mask.yaml"))
    nodes = "".join(
        f'        server("map_server", "{mask}", {{"yaml_filename": str(HERE / "{file}")}}),\n'
        f'        server("costmap_filter_info_server", "{info}"),\n'
        for mask, info, file in served
    )
    names = "".join(f'\n        "{name}",' for mask, info, _ in served for name in (mask, info))
    return f'''"""Serve the masks of this folder: ros2 launch mask.launch.py [use_sim_time:=true]."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent


def generate_launch_description():
    clock = {{"use_sim_time": LaunchConfiguration("use_sim_time")}}

    def server(executable, name, *more):
        parameters = [str(HERE / "servers.yaml"), clock, *more]
        return Node(package="nav2_map_server", executable=executable, name=name, parameters=parameters)

    names = [{names}
    ]
    return LaunchDescription([
        DeclareLaunchArgument("use_sim_time", default_value="false"),
{nodes}        Node(
            package="nav2_lifecycle_manager",
            executable="lifecycle_manager",
            name="lifecycle_manager_people_mask",
            parameters=[clock, {{"autostart": True, "node_names": names}}],
        ),
    ])
'''
