"""``navirl plot``: figures of demonstrations and learnt rewards."""

import click

from navirl_cli.commands.lazy import LazyGroup
from navirl_cli.commands.usage import Example

#: By name, in the order of the help: the file that holds the command, and its summary.
FIGURES = {
    "paths": ("driven", "Draw all driven paths over the map, by condition."),
    "policy": ("maps", "Draw expected visits of every cell under the learnt policy."),
    "reward": ("maps", "Draw the learnt reward of every cell."),
    "value": ("maps", "Draw the soft value of every cell, with contour lines."),
    "actions": ("maps", "Draw the most likely move in every cell as an arrow."),
    "properties": ("driven", "Draw length, distance and area of paths by group."),
    "forces": ("driven", "Draw the forces of one trial, over time and along its path."),
    "compare": ("compare", "Draw several rewards, or several groups, side by side."),
    "ranks": ("compare", "Draw how demonstrations rank among paths of the policy."),
    "profile": ("fits", "Draw profile likelihoods of a fit."),
    "convergence": ("fits", "Draw log-likelihood and parameters over a fit's iterations."),
}


@click.group(
    cls=LazyGroup,
    known={name: (f"{__name__}.{file}", summary) for name, (file, summary) in FIGURES.items()},
    examples=[
        Example("Demonstrated paths", "navirl plot paths demos.json -o paths.pdf"),
        Example(
            "Expected visits of the learnt policy", "navirl plot policy demos.json --reward reward.json -o policy.pdf"
        ),
    ],
)
def plot() -> None:
    """Draw paths, policies, rewards, path properties and fits."""
