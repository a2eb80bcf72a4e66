"""The cost of sharp turns: a_turn for a move that turns by 90 degrees or more from the move before.

Rewards of pairs of moves make the states of the decision process cells by incoming move (:mod:`navirl_cli.irl.turns`);
turns as part of a cost of motion are usual in planning (S. M. LaValle, Planning Algorithms, 2006, Sec. 15.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from navirl_cli.demos.grid import TURN_RAD
from navirl_cli.irl.scene import Scene
from navirl_cli.irl.terms.term import Jet, Parameter

#: (1, 9, 8) whether a move turns sharply from the one before; the first move of a path does not.
_SHARP = np.concatenate([pi / 2 - 1e-9 < TURN_RAD, np.zeros((1, 8), dtype=bool)]).astype(float)[None]


@dataclass(frozen=True)
class Turn:
    """Each sharp turn has a cost; the first move turns from nothing."""

    name = "turn"
    formula = "a_turn [turn >= 90 deg]"
    symbols = ("The bracket is 1 where the step turns by 90 degrees or more from the step before, otherwise 0.",)
    parameters = (
        Parameter(
            "a_turn",
            "",
            lower=-1e4,
            upper=1e4,
            scale=1.0,
            initial=-1.0,
            meaning="reward per turn of 90 degrees or more",
        ),
    )
    about_people = False
    about_turns = True

    def on(self, scene: Scene, theta: Sequence[float]) -> Jet:  # noqa: ARG002
        """Value and derivative by incoming move and move."""
        return Jet(theta[0] * _SHARP, [_SHARP])
