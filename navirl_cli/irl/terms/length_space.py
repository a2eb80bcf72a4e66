"""A personal space per metre: sum over people of a_l |s - s'| exp(-sigma_l |s - s_p|^2).

Eq. 12 charges each step, so that a diagonal one costs as much as a straight one, and cells of another size change its
meaning. A cost density integrated along the path does not depend on the grid, as in planners that charge per metre
(E. A. Sisbot et al., A Human Aware Mobile Robot Motion Planner, IEEE Transactions on Robotics 23, 2007).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter, geometric


@dataclass(frozen=True)
class LengthSpace:
    """Each metre near people has a cost; the costs of several people add up."""

    name = "length-space"
    formula = "sum_p a_l |s - s'| exp(-sigma_l |s - s_p|^2)"
    symbols = ("The sum is over people p at the positions s_p.",)
    parameters = (
        Parameter(
            "a_l",
            "1/m",
            lower=-1e5,
            upper=1e5,
            scale=10.0,
            initial=-50.0,
            meaning="reward per metre at a person's place",
        ),
        Parameter(
            "sigma_l",
            "1/m^2",
            lower=1e-3,
            upper=1e3,
            scale=1.0,
            initial=2.0,
            meaning="decay of the personal space per metre with squared distance",
            scan=geometric(1e-3, 1e3, 15),
        ),
    )
    about_people = True
    about_turns = False

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivatives by cell and move."""
        a_l, sigma_l = theta
        squared = ((scene.lattice.xy_m[:, None, :] - scene.people_m[None, :, :]) ** 2).sum(axis=2)
        bump = np.exp(-sigma_l * squared)
        zeroth, first, second = (
            (bump * squared**power).sum(axis=1)[:, None] * scene.lattice.step_m for power in (0, 1, 2)
        )
        return Jet(a_l * zeroth, [zeroth, -a_l * first], {(0, 1): -first, (1, 1): a_l * second})
