"""Implausible numbers are found and reported; rare but true ones are kept."""

import nav_log as nav
import numpy as np
import pytest
from log_factory import Message

from navirl_cli.logs.load import load_recording
from navirl_cli.logs.roles.plausible import FORCES, PLACES, Limits, plausible_messages
from navirl_cli.logs.tf.rotations import are_rotations
from navirl_cli.logs.tf.transforms import Curve, Link

NONE = (float("nan"), float("inf"), float("-inf"), 1e300, -2e5)


def plausible(values, limits):
    return plausible_messages("/t", values, limits)[0]


def forces(n=60):
    """(n, 3) N, about 0.35 N with noise."""
    return 0.35 + np.random.default_rng(3).normal(0, 0.05, (n, 3))


@pytest.mark.parametrize("number", [*NONE, 2.6e-155, -1e-308, 3000.0])
@pytest.mark.parametrize("row", [1, 30, 58])
def test_impossible_forces_are_found(number, row):
    values = forces()
    values[row, 1] = number
    assert np.flatnonzero(~plausible(values, FORCES)).tolist() == [row]


@pytest.mark.parametrize("number", NONE)
@pytest.mark.parametrize("row", [0, 59])
def test_the_first_and_the_last_are_judged_too(number, row):
    values = forces()
    values[row] = number
    assert np.flatnonzero(~plausible(values, FORCES)).tolist() == [row]


def test_several_wrong_numbers_in_a_row():
    values = forces()
    values[10:13, 0] = np.nan
    values[20:23, 2] = 1e200
    values[30] = np.inf
    values[40, 0], values[42, 0] = 5e-200, 900.0
    assert np.flatnonzero(~plausible(values, FORCES)).tolist() == [10, 11, 12, 20, 21, 22, 30, 40, 42]


@pytest.mark.parametrize(
    "honest",
    [
        np.zeros((50, 3)),
        forces() * (np.arange(60) % 3 > 0)[:, None],
        np.full((50, 3), 7.25),
        forces() * 5e-17,
        np.random.default_rng(1).choice([0.0, 1e-17, -3e-19, 2e-16], (200, 3)),
        np.outer(np.exp(-np.arange(80.0)), [1.0, 1.0, 1.0]),
        # a simulator's zeros among other values
        np.where(np.arange(60)[:, None] % 4 > 0, forces(), 3e-17),
        # impacts: up within one sample, but of several; up to 900 N, or hanging on
        np.outer(np.r_[np.zeros(20), 600, 900, 700, 200, np.zeros(20)], [1.0, -0.5, 0.1]),
        np.outer(np.r_[np.zeros(20), np.full(20, 800.0)], [1.0, 0.0, 0.0]),
        np.outer(np.r_[np.zeros(20), 900.0, 200.0, 90.0, np.zeros(20)], [1.0, 0.0, 0.0]),
        np.outer(np.r_[np.zeros(20), 450.0, np.zeros(20)], [1.0, 0.0, 0.0]),
        # a step between two samples at the ends
        np.outer([700.0, 0.0, 0.0, 0.0, 800.0], [1.0, 0.0, 0.0]),
    ],
)
def test_honest_forces_are_kept(honest):
    good, found = plausible_messages("/wrench", honest, FORCES)
    assert good.all()
    assert found == ()


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_few_measurements(n):
    assert plausible(forces(n), FORCES).tolist() == [True] * n
    assert plausible(np.full((n, 3), np.nan), FORCES).tolist() == [False] * n


def test_places_may_stay_and_leap_but_not_there_and_back():
    still = np.full((40, 3), 4.2)
    assert plausible(still, PLACES).all()
    carried = np.where(np.arange(40)[:, None] < 20, still, still + 8.0)
    assert plausible(carried, PLACES).all()
    for number in (4.2 + 1.5, 2e6, 1e-200):
        values = still.copy()
        values[17, 0] = number
        assert np.flatnonzero(~plausible(values, PLACES)).tolist() == [17]


def test_rotations():
    turns = [(0, 0, 0, 1), (0, 0, 0.7071, 0.7071), (0, 0, 0, 0.95), (0, 0, 0, -1)]
    none = [(0, 0, 0, 0), (0, 0, 0, 1.2), (0, 0, 1e300, 1), (np.nan, 0, 0, 1), (0, 0, np.inf, 1), (0.5, 0, 0, 0.5)]
    assert are_rotations(np.array(turns, dtype=float)).tolist() == [True] * 4
    assert are_rotations(np.array(none, dtype=float)).tolist() == [False] * 6


@pytest.mark.parametrize("length", [0.89, 0.91, 1.0, 1.09, 1.11])
def test_odometry_and_tf_take_the_same_quaternions(length):
    quaternion = np.array([[0.0, 0.0, length, 0.0]])
    link = Link("map", "odom", np.ones(1, dtype=np.int64), np.zeros((1, 3)), quaternion)
    _, faults = Curve.of([link], "map", "odom", fixed=False, zeros=False)
    assert are_rotations(quaternion).tolist() == [not faults.ignored] == [0.9 < length < 1.1]
    assert bool(faults.rescaled) == (length in (0.91, 1.09))


@pytest.mark.parametrize(
    ("values", "report"),
    [
        ({(3, 0): np.nan}, "1 message on /ft holds implausible values (1 not finite); left out"),
        (
            {(3, 1): 2.6e-155},
            "1 message on /ft holds implausible values (1 impossible, such as 2.6e-155 N); left out",
        ),
        (
            {(3, 1): -1e300, (5, 0): np.inf, (5, 1): 1e301, (9, 2): 2500.0},
            "3 messages on /ft hold implausible values (1 not finite, 2 impossible, such as -1e+300 N); left out",
        ),
    ],
)
def test_implausible_values_are_reported_with_an_example(values, report):
    measured = forces()
    measured[3] = 0.0  # an exact zero beside the wrong number is not implausible
    for place, number in values.items():
        measured[place] = number
    if (3, 1) in values:
        measured[3, 0] = 0.0
    good, found = plausible_messages("/ft", measured, FORCES)
    assert [str(one) for one in found] == [report]
    assert (~good).sum() == len({row for row, _ in values})


def test_poses_without_a_rotation_are_counted_separately():
    values = np.zeros((9, 3))
    values[2, 0], values[4, 0], values[6, 0] = np.nan, 5e6, 7e6
    quaternions = np.tile([0.0, 0.0, 0.0, 1.0], (9, 1))
    quaternions[[1, 2, 6], 3] = 0.0, 0.0, 3.0
    good, found = plausible_messages("/odom", values, PLACES, quaternions)
    assert good.tolist() == [True, False, False, True, False, True, False, True, True]
    assert [str(one) for one in found] == [
        (
            "4 messages on /odom hold implausible values (1 not finite, 1 with a quaternion of zeros, "
            "1 with a quaternion of length 3, not 1, 1 impossible, such as 5e+06 m); left out"
        )
    ]


def test_limits_are_of_the_quantity():
    values = np.array([[0.0], [3.0], [0.0], [0.0]])
    assert plausible(values, Limits(10.0, 2.0, "m/s")).tolist() == [True, False, True, True]
    assert plausible(values, Limits(2.5, 9.0, "m/s")).tolist() == [True, False, True, True]


def test_a_flipped_exponent_in_a_file_is_reported_and_left_out(tmp_path):
    log = nav.drive(6.0)
    rows = [row for row, one in enumerate(log.messages) if one.topic == "/wrench"]
    for number, bit in ((300, 6), (200, 4)):
        one = log.messages[rows[number]]
        data = bytearray(one.payload)
        at = data.index(np.float64(number / 100).tobytes())
        data[at + 7] ^= 1 << bit
        log.messages[rows[number]] = Message(one.topic, one.typename, one.log_time_ns, bytes(data))
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    (lost,) = recording.damage
    assert lost.startswith("run.mcap: 2 messages on /wrench hold implausible values (2 impossible, such as ")
    assert len(recording.wrench.t_ns) == 598
    assert np.isfinite(recording.wrench.force_n).all()
    assert np.setdiff1d(nav.unix(np.arange(600) / 100), recording.wrench.t_ns).tolist() == [
        nav.unix(2.0),
        nav.unix(3.0),
    ]


@pytest.mark.parametrize("number", NONE)
def test_implausible_poses_people_and_goals_do_not_spoil_a_log(tmp_path, number):
    log = nav.drive(6.0)
    log.add("/odom", nav.odometry(int(nav.unix(3.01)), number, 0.0), int(nav.unix(3.01)))
    at = int(nav.unix(1.0))
    far = number * 1e3
    log.add("/goal_pose", nav.pose_stamped(at, far, 0.0), at)
    log.add("/goal_pose", nav.pose_stamped(at + 1, 1.0, 2.0), at + 1)
    log.add("/people", nav.people(at, [("ann", 1.0, far), ("bob", 2.0, 2.0)]), at)
    recording = load_recording(log.write(tmp_path / "run.mcap"))
    what = "not finite" if not np.isfinite(number) else f"impossible, such as {number:.3g} m"
    why = "are not finite" if not np.isfinite(far) else "cannot be true"
    assert recording.damage == (
        f"run.mcap: 1 message on /odom holds implausible values (1 {what}); left out",
        f"run.mcap: 1 place on /people left out: its numbers {why}",
        f"run.mcap: 1 message on /goal_pose left out: its numbers {why}",
    )
    assert len(recording.t_ns) == 120
    assert [track.name for track in recording.people] == ["bob"]
    assert recording.goal_m.tolist() == [[1.0, 2.0]]
