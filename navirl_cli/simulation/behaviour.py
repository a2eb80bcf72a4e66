"""How simulated people intervene: reach, tolerance, delay, joystick, and how much people differ."""

from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.simulation.driving import FORWARD_M_S, PULL_PER_S, SIDEWAYS_M_S, Path

#: The predicted path of the robot is evaluated at points this far apart, m.
_PIECE_M = 0.05
#: A person judges the robot's path this far before and behind themselves, m.
BESIDE_M = 0.5


class Joystick(StrEnum):
    """How people use the joystick."""

    #: With the thresholds of the hand; the stick is moved in proportion to the distance from the wanted path.
    PROPORTIONAL = "proportional"
    #: The stick also cancels the robot's pull to its own path, so that the robot drives as the person wants.
    FREE = "free"


@dataclass(frozen=True)
class Behaviour:
    """How the people of a simulation intervene. The defaults are those of the sample logs."""

    #: Arm, two steps toward the robot, and the robot's radius: centre to centre, m.
    reach_m: float = 2.4
    #: People start to intervene only where the robot's path displeases them by more than this, nats; 0: they correct
    #: each deviation from the path that they want.
    tolerance_nats: float = 0.0
    #: Reaction time, s.
    delay_s: float = 0.25
    #: Standard deviation between people of the logarithm of each parameter; None for 0.10, 0.25, 0.25 and 0.20.
    scatter: float | None = None
    joystick: Joystick = Joystick.PROPORTIONAL

    def changed(self) -> dict[str, Any]:
        """What differs from the defaults."""
        return {one.name: getattr(self, one.name) for one in fields(self) if getattr(self, one.name) != one.default}


@dataclass(frozen=True, eq=False)
class Displeasure:
    """By how much the path of a robot that returns to its plan displeases a person."""

    lattice: Lattice
    plan: Path
    #: (2,) m.
    person_m: FloatArray
    #: (n,) how much rarer than the most visited place beside it the person's own policy visits each state, nats.
    rarity: FloatArray
    #: Along the plan from its start, m, at each of its points.
    along_m: FloatArray

    @staticmethod
    def of(reward: Reward, scene: Scene, plan: Path) -> "Displeasure":
        """Displeasure of the person of a scene.

        Args:
            reward: The person's.
            scene: The hallway, along x.
            plan: What the robot follows.
        """
        lattice = scene.lattice
        visits = policy_of(reward, scene).visits_from(scene.start)
        most = np.zeros(lattice.grid.shape[1])
        np.maximum.at(most, lattice.cells[:, 0], visits)
        tiny = np.finfo(float).tiny
        rarity = np.log(np.maximum(most[lattice.cells[:, 0]], tiny)) - np.log(np.maximum(visits, tiny))
        length = np.hypot(*np.diff(plan.xy_m, axis=0).T)
        return Displeasure(lattice, plan, scene.people_m[0], rarity, np.concatenate([[0.0], np.cumsum(length)]))

    def at(self, xy_m: FloatArray) -> float:
        """How rare the robot's path beside the person will be in the person's own policy.

        Args:
            xy_m: (2,) m, position of the robot.

        Returns:
            Log of the visits of the most visited place over those of the robot's place, nats; the largest within
            BESIDE_M of the person along the hallway, 0 behind.
        """
        line = self.predicted_m(xy_m)
        beside = line[np.abs(line[:, 0] - self.person_m[0]) < BESIDE_M]
        states = self.lattice.states_of(self.lattice.grid.cells_of(beside))
        return float(self.rarity[states[states >= 0]].max(initial=0.0))

    def predicted_m(self, xy_m: FloatArray) -> FloatArray:
        """(k, 2) m: how the robot returns to its plan from a position and follows it to the end."""
        nearest = self.plan.nearest(xy_m)
        tangent = self.plan.tangent[nearest]
        off = float((xy_m - self.plan.xy_m[nearest]) @ (-tangent[1], tangent[0]))
        ahead = np.arange(self.along_m[nearest], self.along_m[-1], _PIECE_M)
        t = (ahead - self.along_m[nearest]) / FORWARD_M_S
        # at its limit the robot returns evenly, then exponentially
        limit = SIDEWAYS_M_S / PULL_PER_S
        evenly = max(0.0, abs(off) - limit) / SIDEWAYS_M_S
        left = np.where(
            t < evenly,
            abs(off) - SIDEWAYS_M_S * t,
            min(abs(off), limit) * np.exp(-PULL_PER_S * np.maximum(t - evenly, 0.0)),
        )
        x, y, along, across = (
            np.interp(ahead, self.along_m, axis) for axis in (*self.plan.xy_m.T, *self.plan.tangent.T)
        )
        line: FloatArray = np.stack([x, y], axis=1) + np.sign(off) * left[:, None] * np.stack([-across, along], axis=1)
        return np.concatenate([line, self.plan.xy_m[-1:]])
