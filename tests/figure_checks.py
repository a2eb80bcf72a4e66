"""Checks of a drawn figure: its texts, its cells, its colours."""

from contextlib import contextmanager
from itertools import combinations
from unittest.mock import patch

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.text import Text

from navirl_cli.figures.cells import DrawnCells
from navirl_cli.figures.layout import settle
from navirl_cli.figures.style import house_style
from navirl_cli.irl.scene import Scene

#: Linear RGB as people with colour blindness see it (Machado, Oliveira and Fernandes 2009, severity 1).
SIGHTS = {
    "all colours": np.eye(3),
    "no red": np.array([[0.1523, 1.0526, -0.2049], [0.1145, 0.7863, 0.0992], [-0.0039, -0.0481, 1.0521]]),
    "no green": np.array([[0.3673, 0.8606, -0.2280], [0.2801, 0.6725, 0.0474], [-0.0118, 0.0429, 0.9689]]),
    "no blue": np.array([[1.2555, -0.0767, -0.1788], [-0.0784, 0.9308, 0.1476], [0.0047, 0.6914, 0.3039]]),
}


def layouts(*cases):
    """Cases of one layout: the first two always, the others with ``-m slow``."""
    always, others = cases[:2], cases[2:]
    values = (case if isinstance(case, tuple) else (case,) for case in others)
    return [*always, *(pytest.param(*value, marks=pytest.mark.slow) for value in values)]


def legend_texts(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def labelled(axes, label):
    (line,) = [line for line in axes.lines if line.get_label() == label]
    return line


@contextmanager
def drawn_texts():
    """Every text that is drawn within the context, with its box when it was drawn last."""
    drawn = {}
    draw = Text.draw

    def note(text, renderer):
        draw(text, renderer)
        if text.get_visible() and text.get_text().strip():
            drawn[text] = text.get_window_extent()

    with patch.object(Text, "draw", note):
        yield drawn


def assert_no_overlap(figure):
    """No texts of a figure overlap, and none is clipped, with the layout in which it is saved."""
    if figure.get_layout_engine() is not None:
        settle(figure, trim=False)
    with house_style(), drawn_texts() as boxes:
        figure.draw_without_rendering()
    drawn = [(text.get_text(), box) for text, box in boxes.items()]
    assert len(drawn) > 3
    paper = figure.bbox
    assert [text for text, box in drawn if box.x0 < 0 or box.x1 > paper.x1 or box.y0 < 0 or box.y1 > paper.y1] == []
    assert [(one, other) for (one, box), (other, also) in combinations(drawn, 2) if box.overlaps(also)] == []


def assert_cells(drawn: DrawnCells, a_scene: Scene, values) -> None:
    grid = a_scene.lattice.grid
    image = drawn.image
    assert tuple(image.get_extent()) == grid.extent_m
    assert image.origin == "lower"
    np.testing.assert_array_equal(image.get_array().mask, grid.occupied)
    columns, rows = a_scene.lattice.cells.T
    np.testing.assert_array_equal(image.get_array()[rows, columns], values)
    np.testing.assert_array_equal(drawn.obstacles.get_array().mask, ~grid.occupied)
    assert image.get_zorder() < drawn.obstacles.get_zorder() < drawn.nominal.get_zorder()
    np.testing.assert_array_equal(drawn.nominal.get_xydata(), a_scene.nominal_line_m())
    np.testing.assert_allclose(labelled(drawn.axes, "start").get_xydata(), a_scene.lattice.xy_m[[a_scene.start]])
    np.testing.assert_allclose(labelled(drawn.axes, "goal").get_xydata(), a_scene.lattice.xy_m[[a_scene.goal]])
    assert [circle.center for circle in drawn.people] == [tuple(person) for person in a_scene.people_m]
    assert (drawn.axes.get_xlabel(), drawn.axes.get_ylabel()) == ("x [m]", "y [m]")


def lab(colour, sight=SIGHTS["all colours"]):
    """CIE L*a*b* of a colour in daylight (D65)."""
    rgb = np.array(to_rgb(colour))
    linear = np.clip(sight @ np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4), 0.0, 1.0)
    xyz = np.array([[0.4125, 0.3576, 0.1804], [0.2127, 0.7152, 0.0722], [0.0193, 0.1192, 0.9503]]) @ linear
    f = np.cbrt(xyz / (0.9505, 1.0, 1.0888))
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])
