"""One participant's session (Sec. IV-C): two cycles of pushing with a fit between, joystick, obstacle avoidance."""

from dataclasses import dataclass, field

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.demonstration import Condition, Demonstration
from navirl_cli.demos.rasterize import rasterize
from navirl_cli.errors import SceneError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, avoidance_line_m
from navirl_cli.simulation import person
from navirl_cli.simulation.behaviour import Behaviour, Displeasure
from navirl_cli.simulation.driving import STEP_S, Drive, Path, Steering, drive
from navirl_cli.simulation.hallway import (
    GOAL_X_M,
    LANE_Y_M,
    OFFSET_M,
    PERSON_RADIUS_M,
    ROBOT_RADIUS_M,
    START_X_M,
    Hallway,
)

#: Before its goal is announced, between announcement and start, and after its arrival the robot stands, s.
STAND_BEFORE_S, STAND_ANNOUNCED_S, STAND_AFTER_S = 2.0, 0.5, 1.5
BACK_M_S = 0.7
#: Side of the hallway on which the robot is driven back, m from the nominal path.
BACK_ASIDE_M = 1.3


@dataclass(frozen=True, eq=False)
class Pass:
    """One trial as it truly happened."""

    condition: Condition
    cycle: int | None
    plan: Path
    drive: Drive
    #: What the person wanted; None where nobody steered.
    wanted: Path | None = None

    @property
    def steering(self) -> FloatArray:
        """(n, 2) m/s that the person added."""
        return self.drive.command_m_s


@dataclass(frozen=True, eq=False)
class Session:
    """All passes of a participant."""

    name: str
    hallway: Hallway
    #: The participant's true reward.
    truth: Reward
    #: The reward learnt after the first cycle; None where a given path was driven.
    learnt: Reward | None
    passes: tuple[Pass, ...]
    behaviour: Behaviour = field(default_factory=Behaviour)
    #: (2,) m, map frame: the goal that is announced.
    goal_m: tuple[float, float] = (GOAL_X_M, LANE_Y_M)


@dataclass(frozen=True, eq=False)
class Someone:
    """A person in their hallway."""

    hallway: Hallway
    truth: Reward
    behaviour: Behaviour
    rng: np.random.Generator

    def hand(self, wanted: Path, plan: Path, scene: Scene, *, on_robot: bool) -> Steering:
        """Their hand during a pass."""
        judged = None if self.behaviour.tolerance_nats == 0 else Displeasure.of(self.truth, scene, plan)
        return person.Hand(wanted, self.hallway.person_m, self.rng, on_robot, self.behaviour, judged, plan)


def session(number: int, seed: int, behaviour: Behaviour | None = None, driven_m: FloatArray | None = None) -> Session:
    """Simulate a participant's session.

    Args:
        number: Of the participant, from 1.
        seed: Of the whole study; the same seed gives the same session.
        behaviour: How the person intervenes.
        driven_m: (k, 2) m, map frame: a path that the robot drives in place of the two cycles, as in :func:`_driven`.

    Raises:
        SceneError: The robot cannot drive that path in the hallway.
    """
    behaviour = behaviour or Behaviour()
    rng = np.random.default_rng([seed, number])
    hallway = Hallway.with_person(rng)
    truth = person.personal_reward(rng, behaviour.scatter)
    someone = Someone(hallway, truth, behaviour, rng)
    if driven_m is not None:
        return _driven(someone, f"p{number:02d}", driven_m)
    first = [pushed(someone, nominal_path(), offset, 1) for offset in _either_first(rng)]
    demonstrations = [as_demonstration(hallway, one, f"{number}/{i}") for i, one in enumerate(first)]
    exact = fit(evidence_of(demonstrations), Reward.named({})).reward.theta
    # six digits: the last ones differ between machines, and a sampled path could pass on the other side
    learnt = Reward(tuple(float(f"{value:.6g}") for value in exact))
    scene = scene_of(hallway, 0.0)
    second = [pushed(someone, person.sampled_path(scene, learnt, rng), 0.0, 2) for _ in range(2)]
    joystick = [steered(someone) for _ in range(2)]
    around = Path.along(avoidance_line_m(scene, ROBOT_RADIUS_M + PERSON_RADIUS_M), person.SMOOTHING_M / 2)
    alone = Pass(Condition.AUTONOMOUS, None, around, drive(around, around.xy_m[0], person.no_hand))
    return Session(f"p{number:02d}", hallway, truth, learnt, (*first, *second, *joystick, alone), behaviour)


def _driven(someone: Someone, name: str, line_m: FloatArray) -> Session:
    """A session along a given path: two passes of the second cycle, and one in which nobody pushes."""
    hallway, truth = someone.hallway, someone.truth
    _check_drivable(hallway, line_m)
    plan = Path.along(line_m)
    ends = hallway.free.cells_of(line_m[[0, -1]])
    scene = Scene.on(hallway.free, ends[0], ends[1], hallway.person_m[None])
    passes = []
    for _ in range(2):
        side = person.side_of(plan.xy_m, hallway.person_m)
        wanted = person.sampled_path(scene, truth, someone.rng, side)
        hand = someone.hand(wanted, plan, scene, on_robot=True)
        passes.append(Pass(Condition.FORCE, 2, plan, drive(plan, plan.xy_m[0], hand), wanted))
    passes.append(Pass(Condition.AUTONOMOUS, None, plan, drive(plan, plan.xy_m[0], person.no_hand)))
    x, y = line_m[-1].tolist()
    return Session(name, hallway, truth, None, tuple(passes), someone.behaviour, (x, y))


def _check_drivable(hallway: Hallway, line_m: FloatArray) -> None:
    """Refuse a path that leaves the hallway or touches the person.

    Raises:
        SceneError: It does.
    """
    cells = hallway.free.cells_of(line_m)
    inside = np.array([hallway.free.contains(cell) and not hallway.free.is_occupied(cell) for cell in cells])
    if not inside.all():
        x, y = line_m[np.argmin(inside)]
        raise SceneError(
            f"`drive`: expected a path through free space of the simulated hallway, found x {x:.2f} m, y {y:.2f} m "
            "in an obstacle or outside; plan it on the map of a simulated log"
        )
    nearest = float(np.hypot(*(Path.along(line_m).xy_m - hallway.person_m).T).min())
    if nearest < ROBOT_RADIUS_M + PERSON_RADIUS_M:
        x, y = hallway.person_m
        raise SceneError(
            f"`drive`: expected a path around the simulated person at x {x:.2f} m, y {y:.2f} m, found one that touches "
            f"them ({nearest:.2f} m between centres); plan it in the scene of a simulated log with the same `seed`"
        )


def drive_back(from_m: FloatArray, to_m: FloatArray) -> Drive:
    """The experimenter drives the robot back to a start, past the person at a distance."""
    aside = LANE_Y_M + BACK_ASIDE_M
    path = Path.along(np.array([from_m, (1.6, aside), (-1.6, aside), to_m]), 0.3)
    return drive(path, from_m, person.no_hand, BACK_M_S)


def standing(at_m: FloatArray, seconds: float) -> Drive:
    """The robot stands."""
    count = round(seconds / STEP_S)
    return Drive(np.tile(at_m, (count, 1)), np.zeros((count, 2)))


def _either_first(rng: np.random.Generator) -> tuple[float, float]:
    """Offsets of the first cycle's starts: left and right, in random order."""
    return (OFFSET_M, -OFFSET_M) if rng.random() < 0.5 else (-OFFSET_M, OFFSET_M)


def nominal_path() -> Path:
    """The straight path."""
    return Path.along(np.array([(START_X_M, LANE_Y_M), (GOAL_X_M, LANE_Y_M)]))


def scene_of(hallway: Hallway, offset_m: float) -> Scene:
    """The hallway's scene from a start aside of the nominal path."""
    ends = hallway.free.cells_of([(START_X_M, LANE_Y_M + offset_m), (GOAL_X_M, LANE_Y_M)])
    return Scene.on(hallway.free, ends[0], ends[1], hallway.person_m[None])


def pushed(someone: Someone, plan: Path, offset_m: float, cycle: int) -> Pass:
    """A pass in which the person may push the robot off its plan."""
    side = person.side_of(plan.xy_m, someone.hallway.person_m) if cycle > 1 else offset_m
    scene = scene_of(someone.hallway, offset_m)
    wanted = person.sampled_path(scene, someone.truth, someone.rng, side)
    hand = someone.hand(wanted, plan, scene, on_robot=True)
    start = np.array([START_X_M, LANE_Y_M + offset_m])
    return Pass(Condition.FORCE, cycle, plan, drive(plan, start, hand), wanted)


def steered(someone: Someone) -> Pass:
    """A pass in which the person corrects the straight path with a joystick."""
    plan, scene = nominal_path(), scene_of(someone.hallway, 0.0)
    wanted = person.sampled_path(scene, someone.truth, someone.rng)
    hand = someone.hand(wanted, plan, scene, on_robot=False)
    return Pass(Condition.JOYSTICK, None, plan, drive(plan, plan.xy_m[0], hand), wanted)


def as_demonstration(hallway: Hallway, one: Pass, name: str) -> Demonstration:
    """A pass as evidence for the fit between the cycles."""
    xy = one.drive.xy_m[::3]
    cells = rasterize(xy, hallway.free)
    zeros = np.zeros(len(xy))
    return Demonstration(
        id=name,
        participant=name,
        condition=one.condition,
        corrected=True,
        cycle=one.cycle,
        start_ns=0,
        t_s=np.arange(len(xy), dtype=float) * 3 * STEP_S,
        xy_m=xy,
        yaw_rad=zeros,
        force_n=None,
        contacts=(),
        goal_m=(GOAL_X_M, LANE_Y_M),
        people_m=hallway.person_m[None],
        robot_radius_m=ROBOT_RADIUS_M,
        grid=hallway.free.freed(cells),
        cells=cells,
    )
