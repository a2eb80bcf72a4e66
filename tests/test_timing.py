"""When the robot was in each cell, and which steps it was pushed through, against a naive twin and by hand."""

import factories as make
import numpy as np
import oracles
import pytest

from navirl_cli.demos.demonstration import Contact
from navirl_cli.demos.rasterize import Rule, rasterize
from navirl_cli.demos.timing import PIECE, cell_times_s, steps_in_contact
from navirl_cli.errors import DemonstrationError

GRID = make.open_grid(60, 60, (-3.0, -2.95))


def at(line, t_s, times):
    """Places of the line at times."""
    return np.stack([np.interp(times, t_s, axis) for axis in line.T], axis=1)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rule", Rule)
@pytest.mark.parametrize("curve", [make.smooth_curve, make.shaken])
def test_times_against_the_naive_twin(seed, rule, curve):
    line = curve(seed)
    t_s = np.cumsum(np.random.default_rng(seed).uniform(0.01, 0.1, len(line)))
    cells = rasterize(line, GRID, rule)
    centres = GRID.centres_of(cells)
    times = cell_times_s(line, t_s, cells, GRID)
    expected, least = oracles.nearest_times(line, t_s, centres, PIECE * GRID.resolution_m)
    assert times == pytest.approx(expected, abs=1e-9)
    found = ((at(line, t_s, times) - centres)[1:] ** 2).sum()
    assert found == pytest.approx(least, rel=1e-9)


@pytest.mark.parametrize("rule", Rule)
def test_on_a_smooth_curve_each_time_is_that_of_the_nearest_point(rule):
    line = make.smooth_curve(7)
    t_s = np.linspace(0, 10, len(line))
    cells = rasterize(line, GRID, rule)
    times = cell_times_s(line, t_s, cells, GRID)
    assert (times[0], times[-1]) == (0, 10)
    assert (np.diff(times) >= 0).all()
    everywhere = at(line, t_s, np.linspace(0, 10, 20_000))
    for place, centre in zip(at(line, t_s, times)[1:-1], GRID.centres_of(cells)[1:-1], strict=True):
        nearest = np.hypot(*(everywhere - centre).T).min()
        assert np.hypot(*(place - centre)) < nearest + 0.005


def test_a_straight_drive_by_hand():
    # Two poses, 0.1 m/s along a row: centres at 0.05, 0.15, ... m are passed every second.
    line, t_s = np.array([[0.05, 0.25], [0.65, 0.25]]), np.array([2.0, 8.0])
    cells = np.array([[c, 2] for c in range(7)])
    assert cell_times_s(line, t_s, cells, make.open_grid(7, 5)) == pytest.approx(np.arange(2.0, 9.0), abs=0.07)


def test_a_robot_that_waits_is_in_its_cell_until_it_goes_on():
    line = np.array([[0.05, 0.05], [0.25, 0.05], [0.25, 0.05], [0.45, 0.05]])
    cells = np.array([[c, 0] for c in range(5)])
    times = cell_times_s(line, np.array([0.0, 2.0, 12.0, 14.0]), cells, make.open_grid(5, 1))
    assert times == pytest.approx([0, 1, 2, 13, 14], abs=0.07)


def test_each_pass_of_a_crossing_has_its_own_time():
    # A full circle and a bit: the first quarter's cells are passed again at the end.
    angles = np.linspace(0, 2.5 * np.pi, 400)
    line = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    cells = rasterize(line, GRID, Rule.CROSSED)
    times = cell_times_s(line, angles, cells, GRID)
    centres = GRID.centres_of(cells)
    turns = np.unwrap(np.arctan2(centres[:, 1], centres[:, 0]))
    assert np.abs(times - turns).max() < 0.1


def test_steps_in_contact_by_hand():
    # The factory drives a cell in 0.25 s from centre to centre, so that step j lasts from j/4 s to (j + 1)/4 s.
    row = [[c, 0] for c in range(9)]

    def pushed(*spans):
        contacts = tuple(Contact(start, end, 5.0, (0.0, 1.0)) for start, end in spans)
        return np.flatnonzero(steps_in_contact(make.demonstration(make.open_grid(9, 1), row, contacts=contacts)))

    assert pushed().tolist() == []
    assert pushed((0.55, 0.70)).tolist() == [2]
    assert pushed((0.30, 0.60), (1.60, 9.0)).tolist() == [1, 2, 6, 7]
    assert pushed((0.0, 2.0)).tolist() == list(range(8))


@pytest.mark.parametrize(("poses", "times", "cells"), [(1, 1, 2), (3, 2, 2), (3, 3, 1)])
def test_what_cannot_be_timed_is_refused(poses, times, cells):
    with pytest.raises(DemonstrationError, match=f"as many times, and two cells; found {poses}, {times} and {cells}"):
        cell_times_s(np.zeros((poses, 2)), np.arange(times), np.zeros((cells, 2), dtype=int), GRID)
