"""Whether demonstrations start where the robot will."""

import factories as make
import pytest

from navirl_cli.demos.starts import starts_aside_m
from navirl_cli.reports.evidence import evidence_remarks

GRID = make.open_grid(30, 11)


def from_row(row, number, cycle=1):
    """A trial from a row of cells to the middle of the far side."""
    back = 5 if row >= 5 else -5
    turn = range(row, 5, -1) if back > 0 else range(row, 5)
    cells = [[column, row] for column in range(2, 22)]
    cells += [[22 + k, r] for k, r in enumerate(turn)]
    cells += [[column, 5] for column in range(cells[-1][0] + 1, 29)]
    return make.demonstration(GRID, cells, number=number, cycle=cycle)


ASIDE = [from_row(9, 1), from_row(1, 2)]


def test_starts_on_both_sides_leave_the_middle_out():
    assert starts_aside_m(ASIDE, ASIDE) == pytest.approx(0.4)
    assert starts_aside_m([from_row(5, 1), *ASIDE], ASIDE) is None
    assert starts_aside_m([from_row(6, 1), from_row(4, 2)], []) is None, "one cell aside is no other place"
    assert starts_aside_m([], ASIDE) is None


def test_other_trials_of_the_file_show_where_a_robot_starts():
    later = [from_row(5, 3, cycle=2), from_row(5, 4, cycle=2)]
    assert starts_aside_m(ASIDE[:1], [*ASIDE, *later]) == pytest.approx(0.4, abs=0.01)
    assert starts_aside_m(ASIDE[:1], [ASIDE[0], from_row(9, 5, cycle=2)]) is None
    assert starts_aside_m(ASIDE[:1], ASIDE[:1]) is None, "one start is its own middle"


def test_only_a_first_cycle_alone_is_warned_of():
    both = [*ASIDE, from_row(5, 3, cycle=2)]
    assert starts_aside_m(both, both) is None
    (line,) = evidence_remarks(ASIDE, both)
    assert line.startswith(
        "all 2 demonstrations are of cycle 1 and start 0.40 m or more aside of where the robot starts"
    )
    assert evidence_remarks(both, both) == []
