"""A term of the reward that the package does not have, as a researcher would add one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter, geometric

DECAYS = geometric(1e-3, 1e3, 7)


@dataclass(frozen=True)
class Egg:
    """A personal space that reaches further along x than across: a_e exp(-s_x dx^2 - s_y dy^2), summed over people."""

    name = "egg"
    formula = "sum_p a_e exp(-s_x x_p^2 - s_y y_p^2)"
    symbols = ("x_p and y_p are the offsets from person p along the axes of the map.",)
    parameters = (
        Parameter(
            "a_e", "", lower=-1e4, upper=1e4, scale=1.0, initial=-4.0, meaning="reward per step at a person's place"
        ),
        Parameter("s_x", "1/m^2", lower=1e-3, upper=1e3, scale=1.0, initial=1.0, meaning="decay along x", scan=DECAYS),
        Parameter("s_y", "1/m^2", lower=1e-3, upper=1e3, scale=1.0, initial=3.0, meaning="decay along y", scan=DECAYS),
    )

    about_people = True
    about_turns = False

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        a_e, s_x, s_y = theta
        x2, y2 = np.moveaxis((scene.lattice.xy_m[:, None] - scene.people_m[None]) ** 2, 2, 0)
        bump = np.exp(-s_x * x2 - s_y * y2)

        def total(weight):
            return (bump * weight).sum(axis=1)[:, None]

        return Jet(
            a_e * total(1.0),
            [total(1.0), -a_e * total(x2), -a_e * total(y2)],
            {
                (0, 1): -total(x2),
                (0, 2): -total(y2),
                (1, 1): a_e * total(x2**2),
                (1, 2): a_e * total(x2 * y2),
                (2, 2): a_e * total(y2**2),
            },
        )
