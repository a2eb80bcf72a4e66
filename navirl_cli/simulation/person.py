"""The person: the path that they want the robot to drive, and how they push it there."""

from dataclasses import dataclass, field

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.simulation.behaviour import Behaviour, Displeasure, Joystick
from navirl_cli.simulation.driving import FORWARD_M_S, GAIN_S_KG, STEP_S, Path, inward_m_s
from navirl_cli.simulation.hallway import PERSON_RADIUS_M, ROBOT_RADIUS_M

#: The published parameters of all participants, in SI units (c0, a_g, a_p, sigma_p), and their spread over people.
PUBLISHED = (-54.12586, -0.873514, -4.907188, 1.679499)
SCATTER = (0.10, 0.25, 0.25, 0.20)
#: Time constant of a growing force, s.
BUILD_UP_S = 0.12
MOST_FORCE_N = 30.0
STIFFNESS_N_M = 130.0
#: Obstacle avoidance keeps the robot's centre this far from a person's, m.
CLEAR_M = ROBOT_RADIUS_M + PERSON_RADIUS_M + 0.1
#: Distance from the wanted path at which the person starts to push, and at which they stop, m.
OFF_M, CONTENT_M = 0.10, 0.03
#: The person looks this far ahead along the wanted path, m.
AHEAD_M = 0.25
#: Rounding of a path of cells into one that a robot drives, m.
SMOOTHING_M = 0.25
#: Velocity at full deflection of the joystick, m/s.
STICK_M_S = 0.4
#: Deflection by distance from the wanted path, 1/m.
STICK_PER_M = 5.0
#: With a free joystick the wanted velocity brings the robot onto the wanted path at this rate, 1/s.
RETURN_PER_S = 1.5
#: There the person looks ahead as far as the robot drives until the stick has moved, m.
FREE_AHEAD_M = 0.15
#: A person with a tolerance judges the robot's path this often, steps.
JUDGE_STEPS = 10
#: Samples of a wanted path before the person accepts the side on which the robot passes.
DRAWS = 64


def personal_reward(rng: np.random.Generator, scatter: float | None = None) -> Reward:
    """A person's own reward, sampled around the published one.

    Args:
        rng: Source of randomness.
        scatter: Standard deviation of the logarithm of each parameter; None for SCATTER.
    """
    spread = np.array(SCATTER) if scatter is None else np.full(len(SCATTER), scatter)
    factors = np.exp(rng.normal(0.0, spread))
    return Reward(tuple((np.array(PUBLISHED) * factors).tolist()))


def sampled_path(scene: Scene, reward: Reward, rng: np.random.Generator, side: float = 0.0) -> Path:
    """A path sampled from a reward's policy, rounded so that a robot can drive it.

    Args:
        scene: Start, goal and people.
        reward: Whose policy.
        rng: Source of randomness.
        side: Sign of the side (as :func:`side_of`) on which the path should pass the person; 0 for either.
    """
    policy = policy_of(reward, scene)
    samples = sample_paths(policy, scene.start, DRAWS, rng)
    person_m = scene.people_m[0]
    lines = [scene.lattice.xy_m[samples.path(number)] for number in range(DRAWS)]
    paths = [Path.along(_pushed_clear(line, person_m), SMOOTHING_M) for line in lines]
    fitting = [path for path in paths if side * side_of(path.xy_m, person_m) > 0]
    return (fitting or paths)[0]


def _pushed_clear(line_m: FloatArray, person_m: FloatArray) -> FloatArray:
    """The line, with points that would touch the person moved straight away from them, as by obstacle avoidance."""
    away = line_m - person_m
    distance = np.hypot(*away.T)[:, None]
    outward = np.where(distance > 1e-6, away / np.maximum(distance, 1e-6), (0.0, 1.0))
    clear: FloatArray = np.where(distance < CLEAR_M, person_m + CLEAR_M * outward, line_m)
    return clear


def side_of(line_m: FloatArray, person_m: FloatArray) -> float:
    """Signed offset, m, at which a line passes a person: positive to the left of the direction x."""
    nearest = line_m[((line_m - person_m) ** 2).sum(axis=1).argmin()]
    return float(nearest[1] - person_m[1])


@dataclass(eq=False)
class Hand:
    """A hand on the robot or on a joystick, as a function of time and the robot's position."""

    wanted: Path
    person_m: FloatArray
    rng: np.random.Generator
    #: True: pushes with a limited force within reach. False: moves a joystick from anywhere.
    on_robot: bool
    behaviour: Behaviour = field(default_factory=Behaviour)
    #: With the robot's path; needed for a tolerance.
    displeasure: Displeasure | None = None
    #: What the robot follows; needed for a free joystick.
    plan: Path | None = None
    _seen: list[FloatArray] = field(default_factory=list)
    _pushing: bool = False
    _effort: FloatArray = field(default_factory=lambda: np.zeros(2))
    _tremor: FloatArray = field(default_factory=lambda: np.zeros(2))
    _progress: int = 0
    _displeased: bool = False

    def __call__(self, t_s: float, xy_m: FloatArray) -> FloatArray:
        """(2,) velocity v_com in m/s that the person adds at a time to a robot at a position."""
        self._seen.append(xy_m)
        seen = self._seen[max(0, round((t_s - self.behaviour.delay_s) / STEP_S))]
        target = self._intended(seen)
        self._tremor += -self._tremor * STEP_S / 0.2 + 0.25 * np.sqrt(STEP_S) * self.rng.normal(size=2)
        if target.any():
            target = target + 0.12 * np.hypot(*target) * self._tremor
        self._effort = self._effort + (target - self._effort) * STEP_S / BUILD_UP_S
        if not self._pushing and np.hypot(*self._effort) < 0.02:
            self._effort = np.zeros(2)  # the hand leaves the handle
        return self.effort_to_velocity() * self._effort

    def effort_to_velocity(self) -> float:
        """Newtons, or share of the full deflection, to m/s."""
        return GAIN_S_KG if self.on_robot else STICK_M_S

    def _intended(self, seen: FloatArray) -> FloatArray:
        """The force (N) or the deflection that would bring the robot onto the wanted path."""
        self._progress = self.wanted.nearest(seen, self._progress, window=25)
        free = not self.on_robot and self.behaviour.joystick is Joystick.FREE
        look_m = FREE_AHEAD_M if free else AHEAD_M
        ahead = min(self._progress + round(look_m / 0.05), len(self.wanted.xy_m) - 1)
        aside = np.array([-self.wanted.tangent[ahead, 1], self.wanted.tangent[ahead, 0]])
        off = float((self.wanted.xy_m[ahead] - seen) @ aside)
        reachable = not self.on_robot or float(np.hypot(*(seen - self.person_m))) < self.behaviour.reach_m
        near_end = ahead >= len(self.wanted.xy_m) - 8
        # with a free joystick a person who has begun steers to the end: alone the robot would return to its plan
        enough = 0.0 if self._pushing and free else CONTENT_M if self._pushing else OFF_M
        minds = self._minds(seen) or self._pushing
        self._pushing = minds and reachable and not near_end and abs(off) > enough
        if not self._pushing:
            return np.zeros(2)
        if self.on_robot:
            return float(np.clip(STIFFNESS_N_M * off, -MOST_FORCE_N, MOST_FORCE_N)) * aside
        if free:
            wish = FORWARD_M_S * self.wanted.tangent[ahead] + RETURN_PER_S * off * aside
            stick: FloatArray = (wish - self._own_m_s(seen)) / STICK_M_S
            return stick / max(1.0, float(np.hypot(*stick)))
        return float(np.clip(STICK_PER_M * off, -1.0, 1.0)) * aside

    def _minds(self, seen: FloatArray) -> bool:
        """Whether the robot's path displeases the person by more than they tolerate."""
        if self.displeasure is None:
            return True
        if len(self._seen) % JUDGE_STEPS == 1:
            self._displeased = self.displeasure.at(seen) > self.behaviour.tolerance_nats
        return self._displeased

    def _own_m_s(self, seen: FloatArray) -> FloatArray:
        """(2,) velocity of the robot without the person, m/s."""
        plan = self.wanted if self.plan is None else self.plan
        nearest = plan.nearest(seen)
        aside = np.array([-plan.tangent[nearest, 1], plan.tangent[nearest, 0]])
        off = float((seen - plan.xy_m[nearest]) @ aside)
        own: FloatArray = FORWARD_M_S * plan.tangent[nearest] + float(inward_m_s(off)) * aside
        return own


def no_hand(_t_s: float, _xy_m: FloatArray) -> FloatArray:
    """No person touches the robot."""
    return np.zeros(2)
