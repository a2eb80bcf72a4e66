"""The cost of path length: c0 |s - s'| (first part of Eq. 11)."""

from collections.abc import Sequence
from dataclasses import dataclass

from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter


@dataclass(frozen=True)
class StepLength:
    """Each step costs its length."""

    parameters = (Parameter("c0", "1/m", -1e4, -1e-2, 10.0, -50.0, "reward per metre driven"),)

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:
        """Value and derivative by move."""
        length = scene.lattice.step_m[None, :]
        return Jet(theta[0] * length, [length])
