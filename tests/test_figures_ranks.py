"""The figure of ranks: their distribution, the uniform one, and the band around it."""

import numpy as np
import pytest
from figure_checks import assert_no_overlap, legend_texts
from figure_factory import one_axes
from scipy.stats import kstest

from navirl_cli.errors import DemonstrationError
from navirl_cli.figures.layout import settle
from navirl_cli.figures.ranks import draw_ranks
from navirl_cli.figures.style import COLUMN_IN

RANKS = np.array([0.7, 0.1, 0.4, 0.45])


def test_steps_rise_by_one_share_at_every_rank():
    drawn = draw_ranks(one_axes(), RANKS, 0.5)
    x, y = drawn.steps.get_xydata().T
    assert x.tolist() == [0.0, 0.1, 0.4, 0.45, 0.7, 1.0]
    assert y.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 1.0]
    assert drawn.steps.get_drawstyle() == "steps-post"
    assert drawn.uniform.get_xydata().tolist() == [[0, 0], [1, 1]]
    assert drawn.axes.get_xlabel() == "rank among the policy's paths"
    assert drawn.axes.get_ylabel() == "share of demonstrations"


def test_the_band_contains_nineteen_of_twenty_sets_of_uniform_ranks_completely():
    rng = np.random.default_rng(0)
    reach = draw_ranks(one_axes(), rng.uniform(size=25), 0.5).reach
    within = [kstest(rng.uniform(size=25), "uniform").statistic <= reach for _ in range(500)]
    assert np.mean(within) == pytest.approx(0.95, abs=0.03)
    assert draw_ranks(one_axes(), rng.uniform(size=25), 0.5, level=0.5).reach < reach
    assert draw_ranks(one_axes(), rng.uniform(size=400), 0.5).reach < reach / 3


@pytest.mark.parametrize("count", [1, 4, 500])
def test_the_band_is_a_reach_around_the_diagonal_and_within_0_and_1(count):
    drawn = draw_ranks(one_axes(), np.linspace(0, 1, count), 0.5)
    (path,) = drawn.band.get_paths()
    for x, y in path.vertices:
        assert y in (pytest.approx(np.clip(x - drawn.reach, 0, 1)), pytest.approx(np.clip(x + drawn.reach, 0, 1)))
    assert path.contains_point((0.5, 0.5))
    assert legend_texts(drawn.axes) == ["demonstrations", "uniform", "95 % band of uniform ranks"]


def test_the_title_gives_number_and_p_value():
    drawn = draw_ranks(one_axes(), RANKS, 0.5678)
    assert drawn.axes.get_title() == "n = 4, p = 0.57 (Kolmogorov-Smirnov)"
    crowded = draw_ranks(one_axes(), np.linspace(0.0, 0.1, 50), 0.000999)
    assert crowded.axes.get_title() == "n = 50, p < 0.001 (Kolmogorov-Smirnov)"


def test_no_texts_overlap():
    axes = one_axes(COLUMN_IN)
    draw_ranks(axes, RANKS, 0.5)
    settle(axes.figure)
    assert_no_overlap(axes.figure)


def test_no_ranks_and_numbers_that_are_no_shares_are_refused():
    with pytest.raises(DemonstrationError, match=r"^no ranks to draw$"):
        draw_ranks(one_axes(), np.array([]), 0.5)
    for wrong in (-0.1, 1.1, np.nan):
        with pytest.raises(DemonstrationError, match=r"ranks: expected shares from 0 to 1, found "):
            draw_ranks(one_axes(), np.array([0.5, wrong]), 0.5)
