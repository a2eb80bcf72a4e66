"""The README of an exported folder: how to use each file, and what the files do not hold."""

from collections.abc import Sequence

from navirl_cli import __version__
from navirl_cli.documents.tables import Column, Format, Table, written
from navirl_cli.export.fragments import Distro
from navirl_cli.export.nav2 import Field, Nav2Export

#: Releases whose nav2_bringup starts servers of keepout masks by itself.
_BRINGUP = frozenset({Distro.KILTED, Distro.LYRICAL})
#: How every README begins.
TITLE = "# A learnt reward for Nav2"
_NAMES = {"navfn": "NavFn", "smac2d": "SmacPlanner2D"}


def readme_text(export: Nav2Export, losses: Sequence[str]) -> str:
    """The README.

    Args:
        export: What was exported.
        losses: What of the reward costs cannot hold, for this reward.
    """
    parts = [
        _head(export),
        *([_mask(export)] if export.problem is not None else []),
        _live(),
        *([_social()] if export.distro is Distro.HUMBLE else []),
        _losses(losses),
        _checks(),
    ]
    return "\n\n".join(parts) + "\n"


def numbers(export: Nav2Export) -> Table:
    """What was chosen: a row for the costs of people alone, one for those beside the nominal line."""
    columns = (
        Column("costs"),
        Column("planner"),
        Column("cost_travel_multiplier", decimals=1),
        Column("people_factor", "factor", decimals=2),
        Column("amplitude", decimals=1),
        Column("covariance_m2", "covariance m2", decimals=3),
        Column("planner_passes_m", "planner passes at m", decimals=2),
        Column("policy_passes_m", "policy passes at m", decimals=2),
    )
    rows = [
        (
            what,
            one.model.planner.planner,
            one.model.planner.multiplier if one.model.planner.planner == "smac2d" else None,
            one.model.people_factor,
            max(one.model.amplitude, 0.0),
            one.model.covariance_m2,
            one.planner_m,
            one.policy_m,
        )
        for what, one in export.passings
    ]
    return Table(columns, tuple(rows)).without_empty()


def _head(export: Nav2Export) -> str:
    planner = _NAMES[export.model.planner.planner]
    return f"""{TITLE} ({export.distro.value}, {planner})

Written by navirl {__version__}. A person costs amplitude x exp(-d^2 / (2 covariance_m2)) at the distance d from the
person's centre.

{written(numbers(export), Format.MARKDOWN)}

A planner drives the one path of least cost, while paths of the policy spread. So the costs of people are multiplied by
the factor with which the planner passes a person as the policy does. The last two columns are distances from the
robot's shell to a person who stands on its straight line on open ground: the planner's, and the mean over paths of the
policy. The person is no obstacle there: the costs alone keep the planner away. The live mask holds people alone, and
has the factor of that row. The robot's radius is {export.robot_radius_m:g} m.

`planner.yaml`: merge it into your parameter file. The costs hold for this planner only. Theta*
squares costs, MPPI averages them: neither has a mapping. With MPPI use CostCritic; ObstaclesCritic takes costs for
distances to obstacles."""


def _mask(export: Nav2Export) -> str:
    held = {
        Field.PEOPLE: "the people of one scene, who stand still",
        Field.LINE: "the distance from the nominal line of one route",
        Field.BOTH: "the people of one scene and the distance from the nominal line of one route",
    }[export.field]
    speed = (
        f"\n\n`speed_mask.yaml` slows the robot near the same people, for Nav2's SpeedFilter: to "
        f"{export.slow_percent:g} % of the full speed\nwhere a person's cost is above half of its peak. The controller "
        "must listen to the topic speed_limit."
        if export.slows
        else ""
    )
    stock = (
        "\n\nIn place of `mask.launch.py` and `costmap.yaml`, this release's own arguments take the mask:\n\n```sh\n"
        "ros2 launch nav2_bringup bringup_launch.py use_keepout_zones:=True keepout_mask:=$PWD/mask.yaml\n```"
        if export.distro in _BRINGUP
        else ""
    )
    return f"""## A mask that does not change

`mask.yaml` with `mask.pgm` holds {held}.
Merge `costmap.yaml` into your parameter file, start Nav2, then

```sh
ros2 launch ./mask.launch.py
```

The mode of the mask is raw: any other makes three values of all. Cells without cost are unknown in the mask, so that
the costmap keeps its own.{speed}{stock}"""


def _live() -> str:
    return """## A mask that follows people

`people_mask_node.py` listens to `/people` (people_msgs/People, or a geometry_msgs/PoseArray) and to `/map`, and
publishes the mask twice a second. Merge `costmap.yaml`, start Nav2, then

```sh
python3 people_mask_node.py --ros-args --params-file people_mask.yaml
```

Do not start it beside `mask.launch.py`: both use the same topics. `python3 test_people_mask_node.py` tests it without
ROS."""


def _social() -> str:
    return """## SocialLayer

`social_layer.yaml` is for nav2_social_costmap_plugin, in place of a mask. People who overlap cost the larger of their
costs there; in the reward, and in the masks, their costs add up."""


def _losses(losses: Sequence[str]) -> str:
    own = "".join(f"- Here: {line}.\n" for line in losses)
    return f"""## What is lost

{own}- The reward of people is paid for each step, also a diagonal one; planners pay for length. A diagonal step near
  people costs 1.41 times as much as in the reward, unless it was learnt with the term length-space.
- The distance from the nominal line has no layer: it is in a mask for one route at most.
- The policy spreads over many paths; a planner has one. Only the mean distance from people is matched, on open ground.
- Nav2's inflation has costs of its own near obstacles, and a cost_travel_multiplier above 1 raises their weight too.
  Where both meet, the larger one counts.
- The mask makes unknown cells near people known.
- The reward was learnt from people who stood still."""


def _checks() -> str:
    return """## Before the robot drives among people

A learnt reward is no safety function. Check first with the wheels off the ground, then with nobody near:

1. The costmap in RViz shows the costs around people, in the right place, and no obstacle where people only cost.
2. The collision monitor stops the robot, with this export and without.
3. Speed and acceleration limits are those that your safety assessment allows.
4. The robot still reaches its goal where people leave little room."""
