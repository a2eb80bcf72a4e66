"""When messages were measured: simulated, missing, jumping and foreign clocks, from the file to the recording.

Runs of `nav_log.drive` tell the true time by their numbers: the robot's x is a tenth of it, the force in N is it.
"""

import re
from dataclasses import replace

import nav_log as nav
import numpy as np
import pytest

from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.roles import clocks
from navirl_cli.logs.roles.clocks import Clock, Stamped, TimeSource
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.message_types import WRENCHES
from navirl_cli.logs.roles.times import in_order, without_repeats

OTHER = "run.mcap: /wrench is stamped by another clock than /odom: "
AHEAD = (
    "run.mcap: /tf (map -> odom) is stamped 1.00 s ahead, as AMCL does by its transform_tolerance; it is used from its "
    "receipt on"
)
WILD = "run.mcap: 1 message on {topic} has a stamp more than 1 s off its clock; its time of receipt is used"


@pytest.fixture
def load(tmp_path):
    def loaded(log=None, time=TimeSource.HEADER, **changes):
        path = (nav.drive(**changes) if log is None else log).write(tmp_path / "run.mcap")
        recording = load_recording(path, LoadOptions(time=time))
        assert recording.damage == ()
        return recording

    return loaded


def misaligned_s(recording):
    """(n,) s by which each force is away from the pose of the same true time."""
    true_s = recording.xy_m[:, 0] * 10
    force = recording.wrench.force_n[:, 0]
    inside = (force >= true_s[0]) & (force <= true_s[-1])
    assert inside.sum() > 0.9 * len(force)
    begin = int(recording.t_ns[0])
    at_s = np.interp(force, true_s, (recording.t_ns - begin) / 1e9)
    return np.abs((recording.wrench.t_ns - begin) / 1e9 - at_s)[inside]


def check_aligned(recording, within_s, poses=400):
    """Forces, poses and tf must go by one clock: y in tf cancels out y in the odometry."""
    assert len(recording.t_ns) == poses
    assert misaligned_s(recording).max() < within_s
    assert np.abs(recording.xy_m[:, 1]).max() < 0.011


def changed(clock, **rows):
    """A clock of which some stamps are others: by number from the front (r0) or the end (e1)."""

    def shown(seconds):
        times = clock(seconds)
        for name, t_ns in rows.items():
            times[int(name[1:]) * (1 if name[0] == "r" else -1)] = t_ns
        return times

    return shown


def jumping(*jumps):
    """The recorder's clock, but for jumps (at s, by s)."""
    return lambda seconds: nav.unix(seconds) + sum(np.where(seconds >= at, round(by * 1e9), 0) for at, by in jumps)


def stepped(topics, by_s, at_s):
    return (
        f"run.mcap: the clock that stamps {topics} jumps by {by_s:+.2f} s {at_s:.1f} s after the start; later times "
        "were shifted to continue"
    )


def everywhere(clock):
    return {"odom": clock, "wrench_clock": clock, "tf_clock": clock}


# one clock


def test_intact_stamps_are_kept_to_the_nanosecond(load):
    recording = load()
    assert recording.t_ns.tolist() == nav.unix(np.arange(400) / 20).tolist()
    assert recording.wrench.t_ns.tolist() == nav.unix(np.arange(2000) / 100).tolist()
    assert recording.notes == ()
    check_aligned(recording, 1e-9)


def test_simulated_time_against_unix_receipt(load):
    recording = load(**everywhere(nav.simulated(928.8)))
    assert recording.t_ns.tolist() == nav.simulated(928.8)(np.arange(400) / 20).tolist()
    assert recording.notes == ()
    check_aligned(recording, 1e-9)


def test_a_simulation_slower_than_real_time(load):
    recording = load(**everywhere(nav.simulated(50.0, rate=0.5)))
    assert (recording.t_ns[-1] - recording.t_ns[0]) / 1e9 == pytest.approx(19.95 / 2)
    assert recording.notes == ()
    check_aligned(recording, 1e-9)


def test_a_slow_simulation_goes_on_where_odometry_pauses(load):
    slow = nav.simulated(50.0, rate=0.5)
    log = nav.drive(40.0, **everywhere(slow))
    silent = [(0.0, 6.0), (20.0, 25.0), (36.0, 40.0)]
    log.messages = [
        one
        for one in log.messages
        if one.topic != "/odom" or not any(a <= (one.log_time_ns - nav.START_NS) / 1e9 < b for a, b in silent)
    ]
    recording = load(log)
    assert recording.wrench.t_ns.tolist() == slow(np.arange(4000) / 100).tolist()
    assert recording.notes == ()


# stamps of 0


def test_without_any_stamps_times_of_receipt_are_used(load):
    recording = load(**everywhere(nav.never))
    assert "run.mcap: no message on /odom has a stamp; times of receipt are used" in recording.notes
    check_aligned(recording, 0.03)


def test_some_stamps_of_0_are_received_times(load):
    recording = load(**everywhere(lambda seconds: np.where(seconds < 1.5, 0, nav.simulated(100.0)(seconds))))
    assert set(recording.notes) == {
        "run.mcap: transforms map -> odom: 15 stamped 0 before the clock ran; ignored",
        "run.mcap: 10 poses lie outside the time that tf covers; left out",
        "run.mcap: 30 messages on /odom are stamped 0; their times of receipt are used",
        "run.mcap: 150 messages on /wrench are stamped 0; their times of receipt are used",
    }
    # tf begins late: poses up to a second earlier are placed by the first transform
    assert (recording.t_ns[0] - nav.simulated(100.0)(0)) / 1e9 == pytest.approx(0.5, abs=0.02)
    assert misaligned_s(recording).max() < 0.02


def test_receipt_by_choice(load):
    recording = load(time=TimeSource.LOG, **everywhere(nav.simulated(928.8)))
    assert np.abs((recording.t_ns - nav.unix(np.arange(400) / 20)) / 1e9).max() < 0.03
    assert recording.t_ns.min() > nav.START_NS
    check_aligned(recording, 0.03)


# jumps


@pytest.mark.parametrize("by_s", [5.0, -5.0, 3e5, -4e8])
def test_a_clock_that_jumps_is_made_to_continue(load, by_s):
    recording = load(**everywhere(jumping((8.0, by_s))))
    assert recording.notes == (stepped("/odom, /tf and /wrench", by_s, 8.0),)
    assert (recording.t_ns[-1] - recording.t_ns[0]) / 1e9 == pytest.approx(19.95, abs=0.01)
    check_aligned(recording, 0.01)


def test_a_simulation_that_is_started_twice_more(load):
    def shown(seconds):
        return nav.simulated(100.0)(seconds) - np.select([seconds < 7, seconds < 14], [0, 107 * 10**9], 114 * 10**9) + 1

    recording = load(**everywhere(shown))
    for note, by_s, at_s in zip(recording.notes, (-107, -7), (6.9, 14.0), strict=True):
        found = re.fullmatch(
            r"run.mcap: the clock that stamps \S+ \S+ and \S+ jumps by (\S+) s (\S+) s after the start; later times "
            "were shifted to continue",
            note,
        )
        assert float(found[1]) == pytest.approx(by_s, abs=0.02)
        assert float(found[2]) == pytest.approx(at_s, abs=0.1)
    check_aligned(recording, 0.01)


def test_a_clock_set_by_less_than_latency_varies_is_followed(load):
    recording = load(**everywhere(jumping((8.0, 0.3))))
    assert recording.t_ns.tolist() == jumping((8.0, 0.3))(np.arange(400) / 20).tolist()
    assert recording.notes == ()


# single wrong stamps


@pytest.mark.parametrize("row", ["r0", "r1", "r100", "e2", "e1"])
@pytest.mark.parametrize("to", [5, nav.START_NS - 60 * 10**9, 2 * 10**18])
def test_a_single_wild_stamp_counts_by_its_receipt(load, row, to):
    recording = load(odom=changed(nav.unix, **{row: to}))
    assert recording.notes == (WILD.format(topic="/odom"),)
    expected = nav.unix(np.arange(400) / 20)
    off = np.flatnonzero(recording.t_ns != expected)
    assert len(off) == 1
    assert np.abs(recording.t_ns - expected).max() < 15e6
    check_aligned(recording, 0.015)


@pytest.mark.parametrize("row", ["r0", "r1000", "e1"])
def test_a_single_wild_stamp_beside_the_odometry(load, row):
    recording = load(wrench_clock=changed(nav.unix, **{row: 5}))
    assert recording.notes == (WILD.format(topic="/wrench"),)
    check_aligned(recording, 0.015)


@pytest.mark.parametrize("by_s", [3.0, -60.0])
def test_a_clock_that_is_off_for_a_while(load, by_s):
    recording = load(wrench_clock=jumping((8.0, by_s), (12.0, -by_s)))
    assert recording.notes == (stepped("/wrench", by_s, 8.0), stepped("/wrench", -by_s, 12.0))
    check_aligned(recording, 0.03)


def test_a_clock_that_is_set_back_for_good_beside_the_odometry(load):
    recording = load(wrench_clock=jumping((12.0, -3.0)))
    assert recording.notes == (stepped("/wrench", -3.0, 12.0),)
    check_aligned(recording, 0.02)


def test_a_wild_stamp_in_tf_moves_no_pose(load):
    recording = load(tf_clock=changed(nav.unix, r100=5))
    assert recording.notes == ()
    check_aligned(recording, 1e-9)


# a recorder that is wrong, or stands still


@pytest.mark.parametrize("receipt", [0, nav.START_NS - 10**14, 2**63 - 1])
@pytest.mark.parametrize("topic", ["/odom", "/wrench", "/tf", "/map"])
def test_a_wild_time_of_receipt_moves_no_time(load, topic, receipt):
    log = nav.drive(8.0)
    rows = [row for row, one in enumerate(log.messages) if one.topic == topic]
    middle = rows[len(rows) // 2]
    log.messages[middle] = replace(log.messages[middle], log_time_ns=receipt)
    recording = load(log)
    (note,) = recording.notes
    assert note.startswith("run.mcap: the recorder's clock gives 1 time of receipt that cannot be true, such as ")
    assert recording.t_ns.tolist() == nav.unix(np.arange(160) / 20).tolist()
    assert recording.wrench.t_ns.tolist() == nav.unix(np.arange(800) / 100).tolist()
    check_aligned(recording, 1e-9, poses=160)


@pytest.mark.parametrize("stall", [(5.0, 5.8), (5.0, 8.0)])
def test_stamps_are_believed_when_the_recorder_stalls(load, stall):
    recording = load(stall=stall)
    assert recording.notes == ()
    check_aligned(recording, 1e-9)


def test_a_stall_beside_another_clock(load):
    recording = load(stall=(5.0, 7.0), wrench_clock=nav.off(3.0))
    assert recording.notes == (OTHER + "+3.000 s by the times of receipt; aligned",)
    check_aligned(recording, 0.02)
    drifting = load(stall=(5.0, 7.0), wrench_clock=nav.off(3.0, rate=1.01))
    assert not any("stands in" in note for note in drifting.notes)
    check_aligned(drifting, 0.05)


# another computer's clock


@pytest.mark.parametrize("by_s", [3.0, -3.0, 0.4, -0.4, 1e6])
def test_a_wrench_on_another_clock_is_aligned(load, by_s):
    recording = load(wrench_clock=nav.off(by_s))
    assert recording.notes == (OTHER + f"{by_s:+.3f} s by the times of receipt; aligned",)
    check_aligned(recording, 0.02)


@pytest.mark.parametrize("by_s", [0.0, 0.1, -0.2])
def test_less_may_be_the_time_that_messages_take(load, by_s):
    recording = load(wrench_clock=nav.off(by_s))
    assert recording.notes == ()
    assert recording.wrench.t_ns.tolist() == nav.off(by_s)(np.arange(2000) / 100).tolist()


@pytest.mark.parametrize("by_s", [3.0, 0.4])
def test_a_clock_that_drifts_by_50_ppm(load, by_s):
    recording = load(lasts_s=60.0, wrench_clock=nav.off(by_s, rate=1 + 50e-6))
    assert [note.startswith(f"{OTHER}{by_s:+.2f}") for note in recording.notes] == [True]
    check_aligned(recording, 0.02, poses=1200)


@pytest.mark.parametrize(
    ("by_s", "rate", "lasts_s"),
    [(3.0, 1.01, 20.0), (0.4, 1.01, 20.0), (0.0, 1.01, 20.0), (0.0, 0.99, 20.0), (0.4, 1.01, 60.0), (-0.2, 0.99, 60.0)],
)
def test_a_clock_that_drifts_by_a_hundredth(load, by_s, rate, lasts_s):
    recording = load(lasts_s=lasts_s, wrench_clock=nav.off(by_s, rate))
    (note,) = recording.notes
    assert note.startswith(OTHER)
    assert f"changing by {(rate - 1) * lasts_s:+.2f} s until the end; aligned" in note
    check_aligned(recording, 0.02, poses=round(20 * lasts_s))


def test_a_wrench_in_unix_time_beside_a_simulated_odometry(load):
    recording = load(odom=nav.simulated(928.8), tf_clock=nav.simulated(928.8))
    (note,) = recording.notes
    assert note.startswith(OTHER)
    check_aligned(recording, 0.02)


def test_tf_that_lies_ahead_counts_from_its_receipt_on(load):
    recording = load(tf_clock=nav.off(1.0))
    assert recording.notes == (AHEAD,)
    check_aligned(recording, 0.01)


# messages that are sent once


def test_a_goal_from_a_laptop_whose_clock_is_off(load):
    log = nav.drive()
    log.add("/goal_pose", nav.pose_stamped(nav.off(5.0)(3.0), 1.0, 2.0), nav.unix(3.0))
    log.add("/goal_pose", nav.pose_stamped(nav.unix(9.0), 1.0, 0.0), nav.unix(9.001))
    recording = load(log)
    assert recording.notes == (WILD.format(topic="/goal_pose"),)
    assert (recording.goal_t_ns - nav.unix(np.array([3.0, 9.0]))) / 1e9 == pytest.approx(0.0, abs=0.01)
    assert recording.goal_m.tolist() == [[1.0, 2.0], [1.0, 0.0]]


def test_latched_people_keep_their_old_stamps(load):
    log = nav.drive()
    long_ago = nav.START_NS - 3600 * 10**9
    log.add("/people", nav.pose_array(long_ago, [(1.0, 2.0)]), nav.START_NS)
    recording = load(log)
    assert recording.notes == ()
    assert recording.people_t_ns.tolist() == [long_ago]


# order


def test_messages_out_of_order_and_twice(load):
    log = nav.drive()
    wrenches = [one for one in log.messages if one.topic == "/wrench"]
    log.messages.remove(wrenches[500])
    for at, one in ((550, wrenches[500]), (899, wrenches[899])):
        log.messages.append(nav.Message(one.topic, one.typename, wrenches[at].log_time_ns, one.payload))
    recording = load(log)
    assert set(recording.notes) == {
        "run.mcap: 1 message on /wrench was received out of order; sorted by time",
        "run.mcap: 1 message on /wrench repeats the time of another; the first counts",
    }
    assert recording.wrench.t_ns.tolist() == nav.unix(np.arange(2000) / 100).tolist()
    check_aligned(recording, 1e-9)


def test_of_equal_times_the_first_counts():
    times = np.array([3, 1, 3, 2])
    ordered, late = in_order(Columns("/t", WRENCHES[1], times, np.arange(4), {"fx": np.arange(4)}, None))
    first, twice = without_repeats(ordered)
    assert first.t_ns.tolist() == [1, 2, 3]
    assert first["fx"].tolist() == [1, 3, 0]
    assert [str(one) for one in (*late, *twice)] == [
        "2 messages on /t were received out of order; sorted by time",
        "1 message on /t repeats the time of another; the first counts",
    ]


# the clock by itself


def stamped(stamp_ns, log_ns=None, topic="/odom"):
    stamp_ns = np.asarray(stamp_ns, dtype=np.int64)
    return Stamped(topic, stamp_ns if log_ns is None else np.asarray(log_ns, dtype=np.int64), stamp_ns)


def test_whether_a_clock_is_simulated():
    log_ns = nav.unix(np.arange(100) / 10)
    assert Clock(stamped(nav.simulated(3.0)(np.arange(100) / 10), log_ns)).simulated
    assert not Clock(stamped(log_ns + 10**9, log_ns)).simulated
    assert not Clock(stamped(np.arange(100) * 10**8)).simulated, "received in simulated time, too"
    assert not Clock(stamped(nav.simulated(3.0)(np.arange(100) / 10), log_ns), TimeSource.LOG).simulated
    late_recorder = np.r_[0, log_ns[1:]]
    assert Clock(stamped(nav.simulated(3.0)(np.arange(100) / 10), late_recorder)).simulated
    first_wild = nav.simulated(3.0)(np.arange(100) / 10)
    first_wild[0] = log_ns[0]
    assert Clock(stamped(first_wild, log_ns)).simulated


@pytest.mark.parametrize("n", [0, 1, 2, 4, 5, 6])
def test_few_messages_make_a_clock(n):
    times = nav.unix(np.arange(n) / 10)
    clock = Clock(stamped(times + 7, times))
    assert clock.times(clock.reference).tolist() == (times + 7).tolist()
    assert clock.times(Stamped("/cmd_vel", times, None)).tolist() == (times + 7).tolist()
    assert clock.findings == []


def test_a_recorder_that_gives_all_messages_one_time():
    stamps = nav.unix(np.arange(400) / 100)
    clock = Clock(stamped(stamps, np.full(400, stamps[-1])))
    assert clock.times(clock.reference).tolist() == stamps.tolist()


def test_stamps_of_0_and_old_ones_are_not_shifted():
    seconds = np.arange(400) / 20
    log_ns = nav.unix(seconds)
    clock = Clock(stamped(log_ns, log_ns))
    late = stamped(np.r_[0, log_ns[1] - 10**12, log_ns[2:4], log_ns[4:] - 5 * 10**9], log_ns)
    shifts = clock.nearest(late, np.array([0, 5 * 10**9]))
    assert shifts.tolist() == [0, 0, 0, 0, *([5 * 10**9] * 396)]


def test_messages_without_stamps_are_placed_by_their_receipt():
    seconds = np.arange(400) / 20
    clock = Clock(stamped(nav.simulated(928.8, rate=0.5)(seconds), nav.unix(seconds)))
    asked = np.array([-4.0, 0.0, 3.21, 19.0, 30.0])
    found = clock.times(Stamped("/cmd_vel", nav.unix(asked), None))
    assert (found - nav.simulated(928.8, rate=0.5)(asked)) / 1e9 == pytest.approx(0.0, abs=1e-6)


def test_late_messages_are_found_in_any_order_of_receipt():
    rng = np.random.default_rng(3)
    at_s, away_s = np.sort(rng.uniform(0, 60, 200)), -rng.exponential(0.3, 200)
    order = rng.permutation(200)
    expected = clocks._late(away_s, at_s)
    assert 0 < expected.sum() < 200
    np.testing.assert_array_equal(clocks._late(away_s[order], at_s[order]), expected[order])
