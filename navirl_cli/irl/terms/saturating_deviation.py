"""A cost of leaving the nominal path that saturates: a_s (1 - exp(-b_s d(s)^2)).

In place of the second part of Eq. 11, which grows without limit: a person who has moved the robot off its path may
accept any further distance. The form is the inverted Gaussian loss (F. A. Spiring, The reflected normal loss function,
Canadian Journal of Statistics 21, 1993). For small b_s it is a_s b_s d(s)^2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter, geometric


@dataclass(frozen=True)
class SaturatingDeviation:
    """Each step off the nominal path has a cost that is bounded."""

    name = "saturating-deviation"
    formula = "a_s (1 - exp(-b_s d(s)^2))"
    symbols = ("d is the distance from the nominal path.",)
    parameters = (
        Parameter(
            "a_s",
            "",
            lower=-1e4,
            upper=0.0,
            scale=1.0,
            initial=-0.5,
            meaning="reward per step far from the nominal path",
        ),
        Parameter(
            "b_s",
            "1/m^2",
            lower=1e-3,
            upper=1e3,
            scale=1.0,
            initial=4.0,
            meaning="how fast that cost is reached with squared distance",
            scan=geometric(1e-3, 1e3, 15),
        ),
    )
    about_people = False
    about_turns = False

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivatives by cell."""
        a_s, b_s = theta
        squared = scene.deviation_m[:, None] ** 2
        rest = np.exp(-b_s * squared)
        gone = -np.expm1(-b_s * squared)
        slope = squared * rest
        return Jet(a_s * gone, [gone, a_s * slope], {(0, 1): slope, (1, 1): -a_s * squared * slope})
