"""Fragments of Nav2's parameter files, to be merged into a robot's own.

Names of nodes and parameters as in nav2_costmap_2d, nav2_map_server and nav2_bringup of ros-navigation/navigation2, and
in robotics-upo/nav2_social_costmap_plugin.
"""

import io
from collections.abc import Mapping
from enum import StrEnum
from typing import Any, Final

from navirl_cli.export.costs import CostModel


class Distro(StrEnum):
    """Releases of ROS 2, the oldest first."""

    HUMBLE = "humble"
    JAZZY = "jazzy"
    KILTED = "kilted"
    LYRICAL = "lyrical"


#: Topics of masks and of the messages that announce them; a static mask and the live one share them.
MASK_TOPIC, INFO_TOPIC = "/people_filter_mask", "/people_filter_info"
SPEED_MASK_TOPIC, SPEED_INFO_TOPIC = "/people_speed_filter_mask", "/people_speed_filter_info"
#: Nodes that serve masks, as mask.launch.py starts them.
MASK_SERVER, INFO_SERVER = "people_mask_server", "people_info_server"
SPEED_MASK_SERVER, SPEED_INFO_SERVER = "people_speed_mask_server", "people_speed_info_server"
#: Costs below this are not worth a cell's update.
_CUTOFF: Final = 5.0
_PLANNERS: Final = {
    "navfn": ("nav2_navfn_planner", "NavfnPlanner"),
    "smac2d": ("nav2_smac_planner", "SmacPlanner2D"),
}

Tree = Mapping[str, Any]


def planner(model: CostModel, distro: Distro) -> Tree:
    """The planner for which the costs were computed, under the name that Nav2's behaviour trees use."""
    package, kind = _PLANNERS[model.planner.planner]
    own: dict[str, Any] = {
        "plugin": f"{package}{'/' if distro is Distro.HUMBLE else '::'}{kind}",
        "tolerance": 0.5,
        "allow_unknown": True,
    }
    if model.planner.planner == "navfn":
        own["use_astar"] = False
    else:
        own["cost_travel_multiplier"] = model.planner.multiplier
    return _node("planner_server", {"planner_plugins": ["GridBased"], "GridBased": own})


def costmap(*, slow: bool) -> Tree:
    """The filters of the global costmap."""
    filters: dict[str, Any] = {
        "people_filter": {
            "plugin": "nav2_costmap_2d::KeepoutFilter",
            "enabled": True,
            "filter_info_topic": INFO_TOPIC,
            "transform_tolerance": 0.1,
        }
    }
    if slow:
        filters["people_speed_filter"] = {
            "plugin": "nav2_costmap_2d::SpeedFilter",
            "enabled": True,
            "filter_info_topic": SPEED_INFO_TOPIC,
            "speed_limit_topic": "speed_limit",
            "transform_tolerance": 0.1,
        }
    return {"global_costmap": _node("global_costmap", {"filters": list(filters), **filters})}


def servers(frame: str, *, slow: bool) -> Tree:
    """The nodes that serve static masks."""
    kinds = [(MASK_SERVER, INFO_SERVER, MASK_TOPIC, INFO_TOPIC, (0, 0.0, 1.0))]
    if slow:
        # the mask holds by how much the robot slows down, because a speed of 0 would mean no limit
        kinds.append((SPEED_MASK_SERVER, SPEED_INFO_SERVER, SPEED_MASK_TOPIC, SPEED_INFO_TOPIC, (1, 100.0, -1.0)))
    tree: dict[str, Any] = {}
    for mask, info, mask_topic, info_topic, (kind, base, multiplier) in kinds:
        tree |= _node(mask, {"topic_name": mask_topic, "frame_id": frame})
        tree |= _node(
            info,
            {
                "type": kind,
                "filter_info_topic": info_topic,
                "mask_topic": mask_topic,
                "base": base,
                "multiplier": multiplier,
            },
        )
    return tree


def people_mask(model: CostModel) -> Tree:
    """The node that makes live masks."""
    return _node(
        "people_mask",
        {
            "amplitude": max(model.amplitude, 0.0),
            "covariance_m2": model.covariance_m2,
            "people_topic": "/people",
            "people_type": "people_msgs/msg/People",
            "map_topic": "/map",
            "mask_topic": MASK_TOPIC,
            "info_topic": INFO_TOPIC,
            "rate_hz": 2.0,
            "forget_s": 2.0,
        },
    )


def social_layer(model: CostModel) -> Tree:
    """The layer of nav2_social_costmap_plugin with a round space: motion and passing sides were not learnt."""
    sides = [f"covariance_{side}_{size}" for side in ("front", "rear", "right") for size in ("height", "width")]
    layer = {
        "plugin": "nav2_social_costmap_plugin::SocialLayer",
        # the layer does nothing where the cutoff is not below the amplitude
        "enabled": model.peak > 0,
        "cutoff": min(_CUTOFF, model.peak / 2),
        "amplitude": model.peak,
        **dict.fromkeys([*sides, "covariance_when_still"], model.covariance_m2),
        "use_passing": False,
        "use_vel_factor": False,
        "speed_factor_multiplier": 5.0,
        "publish_occgrid": False,
    }
    plugins = ["static_layer", "obstacle_layer", "social_layer", "inflation_layer"]
    return {"global_costmap": _node("global_costmap", {"plugins": plugins, "social_layer": layer})}


def _node(name: str, parameters: Tree) -> Tree:
    return {name: {"ros__parameters": dict(parameters)}}


def yaml_text(tree: Tree, comment: str) -> str:
    """A fragment as YAML below a comment; numbers have six digits."""
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.default_flow_style = False
    stream = io.StringIO()
    yaml.dump(_rounded(tree), stream)
    return "".join(f"# {line}\n" for line in comment.splitlines()) + stream.getvalue()


def _rounded(value: Any) -> Any:
    """Floats with six digits, so that files can be read."""
    if isinstance(value, Mapping):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value
