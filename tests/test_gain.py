"""How fast a robot gives way to a push: known gains are found again, with matching standard errors."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from robot_log import Run, force_n, velocity_m_s, write_run
from scipy.signal import lfilter
from truth import read_truth

from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.artefacts.store import read_json
from navirl_cli.demos.contact import PushSettings, pushes_of
from navirl_cli.demos.demonstration import Condition
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.demos.gain import Gain, gain_of, pooled
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.recording import Jump
from navirl_cli.simulation.driving import GAIN_S_KG

ROOT = Path(__file__).parent.parent
K = 0.02
#: Two pushes to the left and one to the right, with some of it forward.
PUSHED = Run(gain=K, pushes=((4.0, 5.5, 3.0, 12.0), (7.0, 8.5, 0.0, -15.0), (9.5, 10.5, -2.0, 9.0)))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return load_recording(write_run(tmp_path_factory.mktemp("log") / "run.mcap", PUSHED))


def of(recording):
    return extract(recording, ExtractSettings(gain=True)).gain


def sideways(recording, left_m_s):
    """The recording with a sideways velocity, at 100 a second, in its poses and without one of the odometry."""
    moved = np.cumsum(left_m_s) * 0.01
    seconds = (recording.t_ns - recording.t_ns[0]) / 1e9
    xy = recording.xy_m.copy()
    xy[:, 1] = np.interp(seconds, np.arange(len(moved)) * 0.01, moved)
    return replace(recording, xy_m=xy, velocity_m_s=None)


def pushed():
    """(1400,) N: the true sideways force at 100 a second."""
    return force_n(PUSHED, np.arange(1400) / 100)[:, 1]


@pytest.mark.parametrize("odometry", [True, False])
def test_a_robot_that_only_gives_way(recording, odometry):
    seconds = (recording.t_ns - recording.t_ns[0]) / 1e9
    gain = of(replace(recording, velocity_m_s=velocity_m_s(PUSHED, seconds) if odometry else None))
    assert gain.gain_m_s_n == pytest.approx(K, rel=0.01)
    assert gain.standard_error_m_s_n < 0.01 * K
    assert gain.pushes == 3
    assert gain.delay_s <= 0.02


def test_a_robot_that_turns_gives_way_to_its_own_left(recording):
    spun = replace(recording, yaw_rad=recording.yaw_rad + np.pi / 2, velocity_m_s=None)
    # ahead has become right: the base's left points back, along which the robot does not give way
    assert abs(of(spun).gain_m_s_n) < 0.2 * K


@pytest.mark.parametrize(("delay_s", "lag_s"), [(0.0, 0.0), (0.2, 0.0), (0.0, 0.2), (0.1, 0.15)])
def test_a_late_answer_is_found_and_does_not_make_the_gain_small(recording, delay_s, lag_s):
    keep = np.exp(-0.01 / lag_s) if lag_s else 0.0
    late = lfilter([1 - keep], [1, -keep], np.append(np.zeros(round(delay_s * 100)), pushed()))[:1400]
    gain = of(sideways(recording, K * late))
    assert gain.gain_m_s_n == pytest.approx(K, rel=0.03)
    assert gain.delay_s == pytest.approx(delay_s + lag_s, abs=0.03)


def test_a_navigation_that_pulls_back_does_not_make_the_gain_small(recording):
    force, moved, velocity = pushed(), 0.0, []
    for newtons in force:
        # As simulation/driving.py: in proportion to how far it is off, up to a limit.
        velocity.append(K * newtons + float(np.clip(-0.5 * moved, -0.2, 0.2)))
        moved += 0.01 * velocity[-1]
    gain = of(sideways(recording, np.array(velocity)))
    assert gain.gain_m_s_n == pytest.approx(K, rel=0.03)
    # The plain regression of the velocity on the force, which ignores it, fails.
    assert np.dot(force, velocity) / np.dot(force, force) < 0.9 * K


def test_standard_errors_match_the_errors(recording):
    rng = np.random.default_rng(7)
    misses = []
    pushes = pushes_of(recording, PushSettings())
    (d,) = extract(recording, ExtractSettings()).demonstrations
    for _ in range(40):
        # A navigation that changes its mind over some 0.7 s.
        mind = lfilter([0.02], [1, -0.98], lfilter([0.02], [1, -0.98], rng.normal(0, 1.0, 1400)))
        gain = gain_of(sideways(recording, K * pushed() + mind), pushes, [d], 3.0)
        misses.append((gain.gain_m_s_n - K) / gain.standard_error_m_s_n)
    # With three pushes an error is itself known to a third only, so that misses are wider than a normal distribution.
    assert abs(np.mean(misses)) < 0.5
    assert 0.7 < np.std(misses) < 1.8
    assert np.mean(np.abs(misses) < 2) > 0.75


def test_a_leap_of_the_localisation_is_left_out(recording):
    jump_ns = int(recording.t_ns[0]) + 10_200_000_000
    xy = recording.xy_m + np.outer(recording.t_ns >= jump_ns, [0.0, 0.3])
    leapt = replace(recording, xy_m=xy, velocity_m_s=None)
    assert of(replace(leapt, jumps=(Jump(jump_ns, 0.3),))).gain_m_s_n == pytest.approx(K, rel=0.02)
    assert of(leapt).standard_error_m_s_n > 0.1 * K


def test_rare_poses_suffice(recording):
    for every in (3, 10):
        rare = replace(
            recording,
            t_ns=recording.t_ns[::every],
            xy_m=recording.xy_m[::every],
            yaw_rad=recording.yaw_rad[::every],
            velocity_m_s=None,
        )
        assert of(rare).gain_m_s_n == pytest.approx(K, rel=0.03), every


@pytest.mark.parametrize("pushes", [(), ((5.0, 7.0, 14.0, 0.0),)], ids=["nobody", "forward"])
def test_without_a_push_to_the_side_there_is_no_number(tmp_path, pushes):
    loaded = load_recording(write_run(tmp_path / "run.mcap", Run(pushes=pushes)))
    extraction = extract(loaded, ExtractSettings(gain=True))
    assert extraction.gain is None
    assert extraction.notes[-1] == "run.mcap: the gain is unknown, because no trial holds a push to the side"
    stated = {"participant": "ann", "condition": Condition.FORCE, "cycle": 1}
    assert extract(loaded, ExtractSettings(**stated)).notes == ()


def test_joystick_trials_do_not_count(recording):
    pushes = pushes_of(recording, PushSettings())
    (d,) = extract(recording, ExtractSettings()).demonstrations
    assert gain_of(recording, pushes, [d], 3.0) is not None
    assert gain_of(recording, pushes, [replace(d, condition=Condition.JOYSTICK)], 3.0) is None


def test_gains_of_one_robot_are_pooled_by_their_errors():
    both = pooled([Gain(0.010, 0.001, 3, 0.1), Gain(0.020, 0.002, 5, 0.2)])
    assert both.gain_m_s_n == pytest.approx((4 * 0.010 + 0.020) / 5)
    assert both.standard_error_m_s_n == pytest.approx(1 / np.sqrt(1e6 + 0.25e6))
    assert (both.pushes, both.delay_s) == (8, pytest.approx(0.12))


def test_the_gain_of_the_simulated_robot_is_found_in_the_sample_logs():
    gains = []
    for log in sorted((ROOT / "sample_logs").glob("*.mcap")):
        assert any(true.force_n.any() for true in read_truth(log).trials)
        gain = of(load_recording(log))
        assert abs(gain.gain_m_s_n - GAIN_S_KG) < 2.5 * gain.standard_error_m_s_n, log
        assert gain.standard_error_m_s_n < 0.06 * GAIN_S_KG
        assert gain.delay_s <= 0.05
        gains.append(gain)
    both = pooled(gains)
    assert abs(both.gain_m_s_n - GAIN_S_KG) < 2.5 * both.standard_error_m_s_n
    assert both.standard_error_m_s_n < 0.02 * GAIN_S_KG


def test_extract_prints_and_writes_the_gain(navirl, tmp_path):
    one, two = write_run(tmp_path / "a.mcap", PUSHED), write_run(tmp_path / "b.mcap", replace(PUSHED, sensor_yaw=0.4))
    lines = navirl("extract", one, two, "-o", "demos.json", "--gain").stdout.splitlines()
    assert lines[3:5] == ["", "log     gain m/s/N  standard error m/s/N  pushes  delay s"]
    assert [line.split()[0] for line in lines[5:]] == ["a.mcap", "b.mcap", "all"]
    assert float(lines[-1].split()[1]) == pytest.approx(K, rel=0.02)
    assert lines[-1].split()[3] == "6"
    written = read_json(Path("demos.json"), "demonstrations")["gain"]
    assert [gain["log"] for gain in written["logs"]] == ["a.mcap", "b.mcap"]
    assert written["gain_m_s_n"] == pytest.approx(K, rel=0.02)
    assert len(read_demonstrations(Path("demos.json"))) == 2
    printed = json.loads(navirl("extract", one, two, "-o", "x.json", "--gain", "--json").stdout)
    assert printed["gain"] == written
    assert [row["trial"] for row in printed["trials"]] == ["a/1", "b/1"]
    single = navirl("extract", one, "-o", "y.json", "--gain").stdout.splitlines()
    assert [line.split()[0] for line in single[4:]] == ["a.mcap"]


def test_extract_without_a_push_reports_it(navirl, tmp_path):
    log = write_run(tmp_path / "run.mcap", Run(pushes=()))
    result = navirl("extract", log, "-o", "demos.json", "--gain")
    assert len(result.stdout.splitlines()) == 2
    assert "navirl: run.mcap: the gain is unknown, because no trial holds a push to the side\n" in result.stderr
    assert read_json(Path("demos.json"), "demonstrations")["gain"] is None
    navirl("extract", log, "-o", "plain.json")
    assert "gain" not in read_json(Path("plain.json"), "demonstrations")


def test_the_filter_is_the_users(navirl, tmp_path):
    log = write_run(tmp_path / "run.mcap", PUSHED)
    peaks = []
    for hz in ("0.3", "5"):
        shown = json.loads(navirl("extract", log, "-o", f"{hz}.json", "--wrench-filter", hz, "--json").stdout)
        (row,) = shown["trials"]
        peaks.append(row["peak_force_n"])
    assert peaks[0] < 0.9 * peaks[1]
    assert read_json(Path("0.3.json"), "demonstrations")["settings"]["push"]["cutoff_hz"] == 0.3
    assert "--wrench-filter" in navirl("extract", log, "-o", "z.json", "--wrench-filter", "0", code=2).stderr
