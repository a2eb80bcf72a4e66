"""The personal space: sum over people of a_p exp(-sigma_p |s - s_p|^2) (Eq. 12)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter, geometric


@dataclass(frozen=True)
class PersonalSpace:
    """Each step near people has a cost; the costs of several people add up."""

    name = "personal-space"
    formula = "sum_p a_p exp(-sigma_p |s - s_p|^2)"
    symbols = ("The sum is over people p at the positions s_p.",)

    parameters = (
        Parameter(
            "a_p", "", lower=-1e4, upper=1e4, scale=1.0, initial=-5.0, meaning="reward per step at a person's place"
        ),
        Parameter(
            "sigma_p",
            "1/m^2",
            lower=1e-3,
            upper=1e3,
            scale=1.0,
            initial=2.0,
            meaning="decay of the personal space with squared distance",
            scan=geometric(1e-3, 1e3, 15),
        ),
    )
    about_people = True
    about_turns = False

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivatives by cell."""
        a_p, sigma_p = theta
        squared = ((scene.lattice.xy_m[:, None, :] - scene.people_m[None, :, :]) ** 2).sum(axis=2)
        bump = np.exp(-sigma_p * squared)
        zeroth, first, second = (
            (bump * squared**power).sum(axis=1)[:, None] for power in (0, 1, 2)
        )  # moments over people: exp(..), d^2 exp(..), d^4 exp(..)
        return Jet(a_p * zeroth, [zeroth, -a_p * first], {(0, 1): -first, (1, 1): a_p * second})
