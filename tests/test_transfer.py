"""A short version of benchmarks/transfer.py: planners on exported costs drive as the policy does."""

import sys
from pathlib import Path

import numpy as np
import pytest

from navirl_cli.planning.recommendation import straight_passage

# At the end of the path: benchmarks and tests have modules of the same names.
sys.path.append(str(Path(__file__).parent.parent / "benchmarks"))
import transfer


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[] if case.scene == "two people" else [pytest.mark.slow])
        for case in transfer.CASES
        if case.factor is None
    ],
    ids=lambda case: f"{case.scene}, {case.planner}",
)
def test_planner_and_most_probable_path_pass_people_on_the_same_side_within_15_cm(case):
    for row in transfer.rows_of(case):
        person, planner, likely = row[4:7]
        assert abs(planner - likely) <= transfer.BAR_M
        assert (planner - person) * (likely - person) > 0


def test_offsets_are_those_of_the_line():
    x = np.arange(-4, 4.05, 0.1)
    line = np.column_stack([x, np.where(np.abs(x) < 1, 0.5, 0.0)])
    assert transfer.offset_at(line, 0.0) == pytest.approx(0.5)
    assert transfer.offset_at(line, 3.0) == pytest.approx(0.0)
    assert straight_passage(0.3, 0.1).scene.people_m.tolist() == [[0.0, 0.0]]
