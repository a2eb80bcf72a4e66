"""A personal space with different widths before, behind and beside a person.

    sum over people of a_n exp(-sigma u^2 - sigma_beside v^2),   sigma = sigma_before where u <= 0, else sigma_behind,

u and v being the offsets of the cell from the person along and across a direction. In place of Eq. 12; the form is that
of R. Kirby, Social Robot Navigation (2010), Appendix A. The direction is that of the robot's nominal travel past the
person, because demonstrations do not hold where people face. Before a person is where the robot has not passed yet, in
front of a person who faces it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter, geometric

_DECAY = geometric(1e-3, 1e3, 7)


def _decay(side: str) -> Parameter:
    return Parameter(
        f"sigma_{side}",
        "1/m^2",
        lower=1e-3,
        upper=1e3,
        scale=1.0,
        initial=2.0,
        meaning=f"decay of the personal space {side} the person with squared distance",
        scan=_DECAY,
    )


@dataclass(frozen=True)
class AnisotropicSpace:
    """Each step near people has a cost that depends on the side of the person; the costs of several people add up."""

    name = "anisotropic-space"
    formula = "sum_p a_n exp(-sigma_before|behind u_p^2 - sigma_beside v_p^2)"
    symbols = (
        "The sum is over people p at the positions s_p.",
        "u_p and v_p are the offsets s - s_p along and across the robot's nominal travel past the person.",
        "Before the person is where u_p <= 0.",
    )
    parameters = (
        Parameter(
            "a_n", "", lower=-1e4, upper=1e4, scale=1.0, initial=-5.0, meaning="reward per step at a person's place"
        ),
        _decay("before"),
        _decay("behind"),
        _decay("beside"),
    )
    about_people = True
    about_turns = False

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivatives by cell."""
        a_n, *sigmas = theta
        offset = scene.lattice.xy_m[:, None, :] - scene.people_m[None, :, :]
        along = scene.travel_past_people
        u = (offset * along).sum(axis=2)
        v = offset[..., 1] * along[:, 0] - offset[..., 0] * along[:, 1]
        squares = [np.minimum(u, 0.0) ** 2, np.maximum(u, 0.0) ** 2, v**2]
        bump = np.exp(-sum(sigma * square for sigma, square in zip(sigmas, squares, strict=True)))
        total = bump.sum(axis=1)[:, None]
        first = [(bump * square).sum(axis=1)[:, None] for square in squares]
        second = {(0, j + 1): -one for j, one in enumerate(first)}
        for j, k in combinations_with_replacement(range(3), 2):
            second[j + 1, k + 1] = a_n * (bump * squares[j] * squares[k]).sum(axis=1)[:, None]
        return Jet(a_n * total, [total, *(-a_n * one for one in first)], second)
