"""The sensor's bias and the pushes in a wrench: on forces whose every newton is known."""

from dataclasses import replace

import numpy as np
import pytest
from robot_log import PUSH_N, START_NS, Run, write_run

from navirl_cli.demos.bias import bias_of, quiet_bias
from navirl_cli.demos.contact import PushSettings, contacts_within, hysteresis, pushes_of
from navirl_cli.logs.load import load_recording

RATE_HZ = 100
BIAS_N = np.array([1.8, -2.6, -6.5])
DIRECTION = np.array([0.6, -0.7, 0.4])
#: What the bias adds along a direction, N, at times t of a recording of so many seconds.
DRIFTS = {
    "constant": lambda t, _: 0 * t,
    "2 N a minute": lambda t, _: 2 * t / 60,
    "warming up": lambda t, _: 5 * (1 - np.exp(-t / 60)),
    "loaded": lambda t, whole: 5.0 * (t > 0.51 * whole),
}
#: Pushes: seconds between their starts, how long they last, and how long they take to build up.
PUSHES = {"pushes": (8, 2.5, 0.15), "steady pushes": (30, 8, 0.15), "leaning": (70, 20, 1.5), "half": (60, 30, 0.5)}


def forged(drift: str, pushes: str, whole_s: float = 480.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n,) s, (n, 3) N measured, and (n, 3) N of bias; for three quarters of the time the robot drives and shakes."""
    rng = np.random.default_rng(3)
    t = np.arange(round(whole_s * RATE_HZ)) / RATE_HZ
    bias = BIAS_N + DRIFTS[drift](t, whole_s)[:, None] * DIRECTION
    force = bias + rng.normal(0, 0.25, bias.shape) + (t % 40 > 10)[:, None] * rng.normal(0, 0.5, bias.shape)
    every, lasts, builds = PUSHES[pushes]
    for start in np.arange(10, whole_s - lasts - 10, every):
        shape = np.clip((t - start) / builds, 0, 1) * np.clip((start + lasts - t) / builds, 0, 1)
        way = rng.uniform(0, 2 * np.pi)
        force += np.outer(rng.uniform(4, 25) * shape, [np.cos(way), np.sin(way), 0.0])
    return t, np.round(force * 32) / 32, bias


@pytest.mark.parametrize("pushes", PUSHES)
@pytest.mark.parametrize("drift", DRIFTS)
def test_the_bias_is_followed_and_pushes_are_not(drift, pushes):
    t, force, bias = forged(drift, pushes)
    found, quiet = bias_of(t, force, 3.0)
    away = np.sqrt(((found - bias) ** 2).sum(axis=1))
    assert np.sqrt((away**2).mean()) < (0.06 if drift == "constant" else 0.15)
    assert (away > 1.0).sum() <= (0.5 * RATE_HZ if drift == "loaded" else 0)
    assert np.abs((force - bias)[quiet]).max() < 2.0
    if drift != "constant":
        constant, _ = quiet_bias(force, RATE_HZ)
        assert np.sqrt(((constant - bias) ** 2).sum(axis=1)).max() > 2.0


@pytest.mark.parametrize(("lasts_s", "followed"), [(20, False), (40, False), (150, True), (1000, True)])
def test_a_load_that_stays_is_bias_and_one_that_soon_goes_is_a_push(lasts_s, followed):
    t, force, bias = forged("constant", "pushes")
    load = np.outer((t > 104) & (t < 104 + lasts_s), [4.0, 0.0, -3.0])
    found, _ = bias_of(t, force + load, 3.0)
    away = np.sqrt(((found - bias - load * followed) ** 2).sum(axis=1))
    assert (away > 0.3).sum() <= RATE_HZ * followed


def test_small_forces_with_a_small_threshold_are_the_same_problem():
    t, force, _ = forged("warming up", "leaning")
    found, quiet = bias_of(t, force, 3.0)
    small, the_same = bias_of(t, force / 16, 3.0 / 16)
    assert small * 16 == pytest.approx(found, abs=1e-9)
    assert (the_same == quiet).all()


def test_a_short_recording_has_one_bias():
    t, force, _ = forged("2 N a minute", "pushes", 50.0)
    found, quiet = bias_of(t, force, 3.0)
    constant, the_same = quiet_bias(force, RATE_HZ)
    assert (found == constant).all()
    assert (quiet == the_same).all()


def test_a_sensor_without_noise_has_a_bias():
    t = np.arange(9000) / RATE_HZ
    force = np.tile(BIAS_N, (9000, 1))
    force[4000:4300, 1] += 8.0
    found, _ = bias_of(t, force, 3.0)
    assert found == pytest.approx(np.tile(BIAS_N, (9000, 1)), abs=1e-9)


def test_the_bias_is_found_beside_long_pushes():
    rng = np.random.default_rng(2)
    force = rng.normal(0, 0.2, (6000, 3)) + np.array([4.0, -1.0, -7.0])
    for start in (500, 2000, 4000):  # a quarter of the time under steady pushes
        force[start : start + 500] += (20.0, 5.0, 0.0)
    bias, quiet = quiet_bias(force, 100.0)
    assert bias == pytest.approx([4.0, -1.0, -7.0], abs=0.03)
    assert not quiet[600:900].any()


def test_hysteresis_by_hand():
    size = np.array([0, 2, 1, 4, 2, 0.5, 2, 2, 0, 5.0])
    assert hysteresis(size, 3.0, 0.9).tolist() == [[1, 4], [9, 9]]
    assert hysteresis(size, 9.0, 1.0).shape == (0, 2)
    assert hysteresis(np.array([5.0, 5.0]), 3.0, 1.0).tolist() == [[0, 1]]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return load_recording(write_run(tmp_path_factory.mktemp("log") / "run.mcap"))


def test_the_filter_takes_what_is_faster(recording):
    wrench = recording.wrench
    seconds = (wrench.t_ns - START_NS) / 1e9
    shaken = replace(
        recording, wrench=replace(wrench, force_n=wrench.force_n + 4 * np.sin(16 * np.pi * seconds)[:, None])
    )
    calm = {}
    for cutoff_hz in (1.0, 5.0, 20.0, 1000.0):
        pushes = pushes_of(shaken, PushSettings(cutoff_hz=cutoff_hz))
        still = (seconds > 9) & (seconds < 13)
        calm[cutoff_hz] = np.abs(pushes.force_n[still]).max()
    assert calm[1.0] < 0.2 < calm[5.0] < 1.5
    assert 3.5 < calm[20.0] < calm[1000.0]


def test_a_sensor_that_turns_on_the_robot_feels_the_same_push(recording, tmp_path):
    # Its bias stays in the sensor's frame, which a frame that turns must not turn along.
    turning = load_recording(write_run(tmp_path / "run.mcap", Run(sensor_turns=0.3)))
    assert turning.wrench.to_base.shape == (1400, 3, 3)
    fixed, turned = (pushes_of(one, PushSettings()) for one in (recording, turning))
    assert turned.force_n == pytest.approx(fixed.force_n, abs=0.8)
    assert turned.base_n[:, 1].mean() == pytest.approx(12.0 * 2 / 14, abs=0.02)
    (contact,) = contacts_within(turned, START_NS, START_NS + 14 * 10**9)
    assert contact.impulse_n_s == pytest.approx(tuple(PUSH_N * 2.0), abs=0.6)


def test_a_log_whose_sensor_drifts_holds_the_same_push(tmp_path):
    drifting = Run(lasts_s=150.0, drift_n_min=(2.0, -1.0, 3.0))
    pushes = pushes_of(load_recording(write_run(tmp_path / "run.mcap", drifting)), PushSettings())
    (contact,) = contacts_within(pushes, START_NS, START_NS + 150 * 10**9)
    assert contact.impulse_n_s == pytest.approx(tuple(PUSH_N * 2.0), abs=0.6)
    assert pushes.noise_n < 0.1
