"""The cost of path length: c0 |s - s'| (first part of Eq. 11)."""

from collections.abc import Sequence
from dataclasses import dataclass

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter


@dataclass(frozen=True)
class StepLength:
    """Each step costs its length."""

    name = "length"
    formula = "c0 |s - s'|"
    symbols = ()

    parameters = (
        Parameter("c0", "1/m", lower=-1e4, upper=-1e-2, scale=10.0, initial=-50.0, meaning="reward per metre driven"),
    )
    about_people = False
    about_turns = False

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivative by move."""
        length = scene.lattice.step_m[None, :]
        return Jet(theta[0] * length, [length])
