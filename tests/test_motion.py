"""Speeds, derivatives, time near people and contact, on motions whose answers are known."""

from dataclasses import replace

import factories as make
import numpy as np
import pytest
from path_values import drive_values
from scipy.signal import savgol_filter

from navirl_cli.demos.demonstration import Contact, PersonTrack
from navirl_cli.evaluation.motion import RATE_HZ, WINDOW, derivatives, touching_s

GRID = make.open_grid(60, 30, (-3.0, -1.5))


def values(demonstration):
    return drive_values(demonstration)[0]


def moving(xy_m, t_s, **fields):
    made = make.demonstration(GRID, [[2, 15], [3, 15]], fields.pop("people", make.NOBODY))
    return replace(made, t_s=t_s, xy_m=xy_m, yaw_rad=np.zeros(len(t_s)), **fields)


def test_derivatives_of_a_cubic_are_exact():
    t = np.linspace(0, 6, 181)  # at 30 Hz
    path = np.stack([0.2 * t**3 - t, 0.5 * t**2], axis=1)
    at = np.arange(0, 6 + 1e-9, 0.1)
    velocity, acceleration, jerk = derivatives(t, path)
    assert velocity == pytest.approx(np.stack([0.6 * at**2 - 1, at], axis=1), abs=0.01)
    assert acceleration == pytest.approx(np.stack([1.2 * at, np.ones_like(at)], axis=1), abs=0.02)
    assert jerk == pytest.approx(np.tile([1.2, 0.0], (len(at), 1)), abs=0.05)


def test_derivatives_are_those_of_savitzky_and_golay():
    rng = np.random.default_rng(3)
    t = np.linspace(0, 9, 91)
    path = np.cumsum(rng.normal(0, 0.02, (91, 2)), axis=0)
    for order, found in enumerate(derivatives(t, path), start=1):
        expected = savgol_filter(path, WINDOW, 3, deriv=order, delta=1 / RATE_HZ, axis=0)
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_uniform_motion_has_speed_and_nothing_else():
    t = np.sort(np.random.default_rng(0).uniform(0, 10, 400))
    found = values(moving(np.stack([0.4 * t, -0.3 * t], axis=1), t))
    assert found["speed_m_s"] == pytest.approx(0.5)
    assert found["acceleration_m_s2"] == pytest.approx(0.0, abs=1e-9)
    assert found["jerk_m_s3"] == pytest.approx(0.0, abs=1e-9)
    assert found["duration_s"] == pytest.approx(t[-1] - t[0])
    assert np.isnan(found["intimate_s"])


def test_a_circle_has_centripetal_acceleration_and_jerk():
    t = np.linspace(0, 20, 601)
    found = values(moving(2 * np.stack([np.cos(0.5 * t), np.sin(0.5 * t)], axis=1), t))
    assert found["speed_m_s"] == pytest.approx(1.0, rel=1e-3)
    assert found["acceleration_m_s2"] == pytest.approx(0.5, rel=0.01)
    assert found["jerk_m_s3"] == pytest.approx(0.25, rel=0.05)


def test_noise_of_a_centimetre_does_not_drown_the_speed():
    t = np.linspace(0, 20, 601)
    shaken = np.stack([0.4 * t, np.zeros(601)], axis=1) + np.random.default_rng(1).normal(0, 0.01, (601, 2))
    assert values(moving(shaken, t))["speed_m_s"] == pytest.approx(0.4, rel=0.02)


def test_time_in_zones_counts_standing_still():
    # Drives up to 0.5 m beside a person at 0.5 m/s and stands there for 5 s.
    t = np.array([0.0, 4.0, 9.0])
    d = moving(np.array([[-2.0, 0.0], [0.0, 0.0], [0.0, 0.0]]), t, people=[[0.0, 0.5]], robot_radius_m=0.25)
    found = values(d)
    reach = np.sqrt(0.7**2 - 0.5**2) / 0.5
    assert found["intimate_s"] == pytest.approx(5 + reach, abs=0.03)
    assert sum(found[f"{zone}_s"] for zone in ("intimate", "personal", "social", "public")) == pytest.approx(9.0)


def test_time_in_zones_and_entries_follow_people_who_walk_against_a_twin_step_by_step():
    rng = np.random.default_rng(5)
    t = np.linspace(2.0, 14.0, 121)
    tracks, radius = [], 0.2
    for number in range(2):  # one is lost after 9 s, and stays where it was last seen
        own = t[: 71 + 50 * number]
        tracks.append(PersonTrack(f"{number}", own, np.cumsum(rng.normal(0, 0.12, (len(own), 2)), axis=0)))
    people = [one.xy_m.mean(axis=0) for one in tracks]
    line = np.stack([0.25 * (t - 8), 0.1 * np.sin(t)], axis=1)
    found = values(replace(moving(line, t, people=people, robot_radius_m=radius), tracks=tuple(tracks)))
    entries, times, before = (
        dict.fromkeys(("intimate", "personal", "social"), 0),
        dict.fromkeys(("intimate", "personal", "social"), 0.0),
        set(),
    )
    for at in np.arange(2.005, 14.0, 0.01):
        here = np.array([np.interp(at, t, axis) for axis in line.T])
        away = min(np.hypot(*(here - [np.interp(at, one.t_s, axis) for axis in one.xy_m.T])) - radius for one in tracks)
        within = {zone for zone, limit in (("intimate", 0.45), ("personal", 1.2), ("social", 3.6)) if away < limit}
        for zone in within - before:
            entries[zone] += 1
        if within:
            times[min(within, key=["intimate", "personal", "social"].index)] += 0.01
        before = within
    assert {zone: found[f"{zone}_intrusions"] for zone in entries} == entries
    assert entries["personal"] > 1
    for zone, time in times.items():
        assert found[f"{zone}_s"] == pytest.approx(time, abs=0.1)
        assert found[f"{zone}_time_share"] == pytest.approx(time / 12, abs=0.01)


def test_short_trials_have_no_derivatives():
    found, missing = drive_values(
        moving(np.array([[0.0, 0.0], [0.3, 0.0]]), np.array([0.0, 0.9]), force_n=np.zeros((2, 2)))
    )
    assert np.isnan([found["speed_m_s"], found["jerk_m_s3"]]).all()
    assert missing["jerk_m_s3"] == missing["work_j"] == "shorter than 1.1 s"
    assert found["duration_s"] == 0.9


CONTACT = ("contact_share", "peak_force_n", "impulse_n_s", "work_j")


def test_times_that_were_laid_out_measure_nothing():
    t = np.linspace(0, 5, 100)
    d = moving(np.stack([0.4 * t, 0 * t], axis=1), t, laid_out_m_s=0.4)
    pushed = replace(d, contacts=(Contact(1.0, 2.0, 10.0, (0.0, 10.0)),), force_n=np.zeros((100, 2)))
    found, missing = drive_values(pushed)
    assert found["peak_force_n"] == 10.0
    timed = set(found) - {"peak_force_n"}
    assert np.isnan([found[name] for name in timed]).all()
    assert missing == dict.fromkeys(timed, "times not measured")


def test_work_is_force_along_the_path():
    # 12 N along the motion of 0.5 m/s for 2 s, and 7 N across it, which does no work.
    t = np.linspace(0, 10, 301)
    force = np.tile([12.0, 7.0], (301, 1))
    contacts = (Contact(3.0, 5.0, 13.9, (24.0, 14.0)),)
    d = moving(np.stack([0.5 * t, 0 * t], axis=1), t, force_n=force, contacts=contacts)
    found = values(d)
    assert found["work_j"] == pytest.approx(12 * 0.5 * 2)
    assert found["impulse_n_s"] == pytest.approx(np.hypot(24, 14))
    assert found["contact_share"] == pytest.approx(0.2)
    held_back = replace(d, force_n=-force)
    assert values(held_back)["work_j"] == pytest.approx(-12.0)


def test_without_a_push_forces_are_zero_and_without_a_wrench_unknown():
    t = np.linspace(0, 5, 100)
    d = moving(np.stack([0.4 * t, 0 * t], axis=1), t, force_n=np.zeros((100, 2)))
    found = values(d)
    assert [found[name] for name in CONTACT] == [0.0, 0.0, 0.0, 0.0]
    found, missing = drive_values(replace(d, contacts=None, force_n=None))
    assert np.isnan([found[name] for name in CONTACT]).all()
    assert [missing[name] for name in CONTACT] == ["no wrench in the log"] * 4


def test_time_to_collision_of_discs_that_keep_their_velocity():
    apart, towards = np.array([[3.0, 0.0]] * 4), np.array([[-0.5, 0.0], [0.5, 0.0], [-0.5, 0.2], [0.0, 0.0]])
    assert touching_s(apart, towards, 0.5) == pytest.approx([5.0, np.inf, np.inf, np.inf])
    assert touching_s(np.array([[0.3, 0.3]]), np.array([[1.0, 0.0]]), 0.5) == pytest.approx([0.0])
    # a slow twin: step until they touch
    rng = np.random.default_rng(1)
    p, v = rng.uniform(-3, 3, (50, 2)), rng.uniform(-1, 1, (50, 2))
    t = np.linspace(0, 20, 20001)
    for place, velocity, found in zip(p, v, touching_s(p, v, 0.5), strict=True):
        near = np.hypot(*(place[:, None] + velocity[:, None] * t)) <= 0.5
        stepped = t[near.argmax()] if near.any() else np.inf
        assert found == pytest.approx(stepped, abs=2e-3) or (found > 20 and np.isinf(stepped))


def test_a_drive_towards_a_person_and_a_stop():
    t = np.linspace(0, 10, 301)
    x = np.minimum(0.4 * t, 2.0)  # stops after 5 s, 1 m before the person
    found = values(moving(np.stack([x, 0 * t], axis=1), t, people=[[3.0, 0.0]]))
    assert found["not_moving_s"] == pytest.approx(5.0, abs=0.4)
    assert (found["personal_intrusions"], found["intimate_intrusions"]) == (1, 0)
    assert found["time_to_collision_s"] == pytest.approx((1.0 - 0.25 - 0.25) / 0.4, abs=0.4)
    assert found["personal_time_share"] == pytest.approx(found["personal_s"] / 10)
    away = values(moving(np.stack([-0.4 * t, 0 * t], axis=1), t, people=[[3.0, 0.0]]))
    assert np.isnan(away["time_to_collision_s"])
    # a person who walks towards the robot with the same speed halves the time
    track = PersonTrack("p", t, np.stack([3.0 - 0.1 * t, 0 * t], axis=1))
    made = moving(np.stack([0.1 * t, 0 * t], axis=1), t, people=[[2.5, 0.0]])
    found = values(replace(made, tracks=(track,)))
    assert found["time_to_collision_s"] == pytest.approx((1.0 - 0.25 - 0.25) / 0.2, abs=0.01)
