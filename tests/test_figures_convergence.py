"""The figure of a fit's convergence: log-likelihood and parameters over the iterations."""

import numpy as np
import pytest
from figure_checks import assert_no_overlap, layouts

from navirl_cli.figures.convergence import ROW_IN, columns_for, draw_convergence
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLOURS, COLUMN_IN, PAGE_IN
from navirl_cli.irl.reward import Reward

PARAMETERS = Reward.named({}).parameters


def search(count=8):
    """A search in (count,) log-likelihoods and (count, 4) parameters."""
    at = 1 - 0.5 ** np.arange(count)
    return -307.75 + 41.88 * at, np.array([-30.0, -1.0, -2.0, 2.0]) + np.outer(at, [-19.0, -0.8, -4.7, -1.1])


def drawn_of(count=8, width_in=COLUMN_IN, theta=None):
    columns = columns_for(width_in)
    figure, axes = new_figure(width_in, -(-5 // columns) * ROW_IN, 5, columns)
    nats, path = search(count)
    return figure, draw_convergence(axes, nats, path if theta is None else theta, PARAMETERS)


def test_every_iteration_is_drawn_from_the_start_on():
    _, drawn = drawn_of()
    nats, theta = search()
    for line, values in zip(drawn.lines, [nats, *theta.T], strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.stack([np.arange(8), values], axis=1))
        assert (line.get_color(), line.get_marker()) == (COLOURS["learnt"], "o")
    assert drawn_of(2000)[1].lines[0].get_marker() == ""


def test_titles_give_the_final_values_with_units():
    _, drawn = drawn_of()
    titles = [panel.get_title().replace("\N{MINUS SIGN}", "-") for panel in drawn.axes]
    assert titles[0] == "log-likelihood = -266.2 nats"
    assert titles[1:] == ["$c_0$ = -48.85 1/m", "$a_g$ = -1.794 1/m²", "$a_p$ = -6.663", r"$\sigma_p$ = 0.9086 1/m²"]
    assert [panel.get_xlabel() for panel in drawn.axes] == ["", "", "", "iteration", "iteration"]


def test_the_axis_counts_whole_iterations():
    figure, drawn = drawn_of(3)
    figure.draw_without_rendering()
    ticks = [label.get_text() for label in drawn.axes[0].get_xticklabels()]
    assert {"0", "1", "2"} <= set(ticks)
    assert all(tick.lstrip("\N{MINUS SIGN}").isdigit() for tick in ticks)


@pytest.mark.parametrize(("count", "width_in"), layouts((1, COLUMN_IN), (8, PAGE_IN), (2000, COLUMN_IN)))
def test_no_texts_overlap(width_in, count):
    figure, _ = drawn_of(count, width_in)
    assert_no_overlap(figure)


def test_a_constant_parameter_is_a_straight_line():
    theta = search()[1]
    theta[:, 3] = 1.5
    figure, drawn = drawn_of(theta=theta)
    assert_no_overlap(figure)
    low, high = drawn.axes[4].get_ylim()
    assert low < 1.5 < high
    assert drawn.axes[4].get_title() == r"$\sigma_p$ = 1.5 1/m²"
