"""Layout of figures: nothing clipped, no height empty, the same in every format."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import AutoLocator, FixedLocator

from navirl_cli.arrays import FloatArray
from navirl_cli.figures.style import SPACING, house_style, line_spacing, look

#: White border around everything; empty height, and movement of a panel by another layout, that are tolerated, inches.
PAD_IN, SLACK_IN = 0.03, 0.02
#: Largest number of layouts, and the number after which ticks are kept.
_MOST_LAYOUTS, _FREE_LAYOUTS = 10, 4


@house_style()
def trim_height(figure: Figure) -> None:
    """Remove height that maps of a fixed aspect ratio leave empty. The width stays.

    Args:
        figure: Changed in place. Panels that fill their height keep it.
    """
    _lay_out(figure, trim=True)


def _lay_out(figure: Figure, *, trim: bool) -> None:
    """Lay out until no panel moves any more, nothing is clipped and, with ``trim``, no height is empty."""
    if line_spacing() != SPACING:
        for text in figure.findobj(Text):
            text.set_linespacing(line_spacing())
    layout, at = figure.get_layout_engine(), _places_in(figure)
    for number in range(_MOST_LAYOUTS):
        if number == _FREE_LAYOUTS:
            _fix_ticks(figure)
        if layout is not None:
            layout.execute(figure)
        before, at, boxes = at, _places_in(figure), _boxes_in(figure)
        width, height = map(float, figure.get_size_inches())
        empty = height - _filled_in(boxes) if trim else 0.0
        if empty > SLACK_IN:
            figure.set_size_inches(width, height - empty + SLACK_IN / 2)
        elif np.abs(at - before).max(initial=0.0) < SLACK_IN and _inside(boxes, width, height):
            return


def _places_in(figure: Figure) -> FloatArray:
    """(n, 4) borders of panels, from the left and from the top, inches."""
    boxes = [axes.get_position() for axes in figure.axes]
    borders = np.array([(box.x0, box.x1, 1 - box.y0, 1 - box.y1) for box in boxes]).reshape(-1, 4)
    width, height = figure.get_size_inches()
    places: FloatArray = borders * (width, width, height, height)
    return places


def _fix_ticks(figure: Figure) -> None:
    """Keep the present ticks: ticks that depend on the size of a panel can keep its layout from settling."""
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if isinstance(axis.get_major_locator(), AutoLocator):
            axis.set_major_locator(FixedLocator(list(axis.get_majorticklocs())))


def _boxes_in(figure: Figure) -> FloatArray:
    """(n, 4) borders x0, y0, x1, y1 of panels with their labels, of legends and of texts, inches."""
    # a legend in a free place is smaller than its hidden axes
    panels = (axes if axes.axison else axes.get_legend() for axes in figure.axes)
    # without a renderer handed in, matplotlib makes one for every part
    canvas = figure.canvas
    renderer = canvas.get_renderer() if isinstance(canvas, FigureCanvasAgg) else None  # type: ignore[no-untyped-call]
    extents = (part.get_tightbbox(renderer) for part in (*panels, *figure.legends, *figure.texts) if part is not None)
    boxes: FloatArray = np.array([extent.extents for extent in extents if extent is not None]).reshape(-1, 4)
    return boxes / figure.dpi


def _inside(boxes: FloatArray, width: float, height: float) -> bool:
    """Whether (n, 4) boxes are within a figure, inches."""
    return bool((boxes[:, :2] >= 0).all() and (boxes[:, 2:] <= (width, height)).all())


def _filled_in(boxes: FloatArray) -> float:
    """Height of rows of (n, 4) boxes with the border around each row, inches."""
    touching = 2 * PAD_IN  # rows may be that near before the layout is final
    rows: list[list[float]] = []
    for y0, y1 in sorted(boxes[:, [1, 3]].tolist()):
        if rows and y0 < rows[-1][1] - touching:
            rows[-1][1] = max(rows[-1][1], y1)
        else:
            rows.append([y0, y1])
    return sum(y1 - y0 + 2 * PAD_IN for y0, y1 in rows)


@house_style()
def settle(figure: Figure, *, trim: bool = True) -> None:
    """Lay out a figure for its resolution in the current look, and fix this layout for all formats.

    Args:
        figure: Changed in place.
        trim: Remove empty height, as :func:`trim_height`.
    """
    figure.set_dpi(look().dpi)
    _lay_out(figure, trim=trim)
    figure.set_layout_engine(None)
