"""Layout of figures: nothing clipped, no height empty, the same in every format."""

import numpy as np
from matplotlib.artist import Artist
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
    _space_lines(figure)
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


def _space_lines(figure: Figure) -> None:
    """Give all texts the distance of lines of the current font."""
    if line_spacing() != SPACING:
        for text in figure.findobj(Text):
            text.set_linespacing(line_spacing())


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
    return sum(high - low + 2 * PAD_IN for low, high in _rows_of(boxes))


def _rows_of(boxes: FloatArray) -> list[list[float]]:
    """Lower and upper borders of the rows of (n, 4) boxes from below, inches."""
    touching = 2 * PAD_IN  # rows may be that near before the layout is final
    rows: list[list[float]] = []
    for low, high in sorted(boxes[:, [1, 3]].tolist()):
        if rows and low < rows[-1][1] - touching:
            rows[-1][1] = max(rows[-1][1], high)
        else:
            rows.append([low, high])
    return rows


@house_style()
def settle(figure: Figure, *, trim: bool = True) -> None:
    """Lay out a figure for its resolution in the current look, and fix this layout for all formats.

    Args:
        figure: Changed in place.
        trim: Remove empty height, as :func:`trim_height`.
    """
    figure.set_dpi(look().dpi)
    if not (trim and _closed_up(figure)):
        _lay_out(figure, trim=trim)
    figure.set_layout_engine(None)


def settle_like(figure: Figure, other: Figure) -> None:
    """Give a figure the layout of another one that shows the same in another look: no layout is computed again.

    Args:
        figure: Changed in place; as drawn.
        other: The settled one.
    """
    figure.set_dpi(other.dpi)
    _space_lines(figure)
    figure.set_layout_engine(None)
    figure.set_size_inches(*other.get_size_inches())
    for axes, known in zip(figure.axes, other.axes, strict=True):
        axes.set_position(known.get_position())
        for axis, ticks in ((axes.xaxis, known.xaxis), (axes.yaxis, known.yaxis)):
            if isinstance(axis.get_major_locator(), AutoLocator):
                axis.set_major_locator(FixedLocator(list(ticks.get_majorticklocs())))
    for text, place in zip(figure.texts, other.texts, strict=True):
        text.set_position(place.get_position())


def _closed_up(figure: Figure) -> bool:
    """Lay out once, and move the rows of panels together: as :func:`_lay_out` with ``trim``, for less work.

    Returns:
        Whether there was empty height and nothing was clipped; if not, the layout is not settled.
    """
    layout = figure.get_layout_engine()
    if layout is None:
        return False
    _space_lines(figure)
    layout.execute(figure)
    width, height = map(float, figure.get_size_inches())
    boxes = _boxes_in(figure)
    rows = _rows_of(boxes)
    if not rows or not _inside(boxes, width, height):
        return False
    # A legend of the figure keeps its distance from the lower border.
    lowest = max(PAD_IN, rows[0][0]) if figure.legends else PAD_IN
    highs = np.cumsum([high - low + 2 * PAD_IN for low, high in rows]) + lowest - 2 * PAD_IN
    total = float(highs[-1]) + PAD_IN
    if height - total <= SLACK_IN:
        return False

    def shift_of(artist: Artist) -> float:
        box = artist.get_window_extent()
        middle = (box.y0 + box.y1) / 2 / figure.dpi
        return next((to - row[1] for to, row in zip(highs, rows, strict=True) if row[0] <= middle <= row[1]), 0.0)

    moved = [(axes, shift_of((axes if axes.axison else axes.get_legend()) or axes)) for axes in figure.axes]
    texts = [(text, shift_of(text)) for text in figure.texts]
    for axes, shift in moved:
        x, y, wide, high = axes.get_position().bounds
        axes.set_position((x, (y * height + shift) / total, wide, high * height / total))
    for text, shift in texts:
        text.set_y((text.get_position()[1] * height + shift) / total)
    figure.set_size_inches(width, total)
    return True
