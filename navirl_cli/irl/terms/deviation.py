"""The cost of leaving the nominal path: a_g d(s)^2 (second part of Eq. 11)."""

from collections.abc import Sequence
from dataclasses import dataclass

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter


@dataclass(frozen=True)
class Deviation:
    """Each step costs the squared distance of its cell to the nominal path."""

    name = "deviation"
    formula = "a_g d(s)^2"
    symbols = ("d is the distance from the nominal path.",)

    parameters = (
        Parameter(
            "a_g",
            "1/m^2",
            lower=-1e4,
            upper=0.0,
            scale=1.0,
            initial=-0.01,
            meaning="reward per step and squared metre from the nominal path",
        ),
    )
    about_people = False
    about_turns = False

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivative by cell."""
        squared = scene.deviation_m[:, None] ** 2
        return Jet(theta[0] * squared, [squared])
