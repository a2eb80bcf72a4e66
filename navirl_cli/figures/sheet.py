"""Figures: opened without a display, laid out, and saved completely or not at all."""

import re
import warnings
from collections.abc import Mapping, Sequence
from io import BytesIO
from math import ceil
from pathlib import Path
from types import MappingProxyType
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend
from matplotlib.text import Text

from navirl_cli.documents.inline import printable
from navirl_cli.errors import ArtefactError
from navirl_cli.figures.layout import PAD_IN, settle
from navirl_cli.figures.scale import SCALE
from navirl_cli.figures.style import COLUMN_IN, house_style, look
from navirl_cli.files import check_writable, replacing

#: Metadata of a file by format, without dates. matplotlib loads the writer of a format when it is needed; none needs a
#: display.
METADATA: Mapping[str, Mapping[str, None]] = MappingProxyType(
    {"png": {}, "pdf": {"CreationDate": None, "ModDate": None}, "svg": {"Date": None}}
)


@house_style()
def new_figure(
    width_in: float = COLUMN_IN,
    height_in: float | None = None,
    panels: int = 1,
    columns: int | None = None,
    *,
    managed: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Open a figure with panels in one row or in several.

    Args:
        width_in: Width, inches; COLUMN_IN or PAGE_IN for a paper.
        height_in: Height, inches; None: enough for maps, of which :func:`save_figure` removes the empty height.
        panels: Number of panels.
        columns: Panels in a row; the last row may have fewer. None puts all into one row.
        managed: Whether pyplot knows the figure, so that notebooks and ``matplotlib.pyplot.show()`` show it.

    Returns:
        The figure and its axes, row by row from left to right.
    """
    columns = panels if columns is None else columns
    rows = ceil(panels / columns)
    height_in = rows * (width_in / columns * 1.3) + 1.0 if height_in is None else height_in
    layout = ConstrainedLayoutEngine(w_pad=PAD_IN, h_pad=PAD_IN, wspace=0.03, hspace=0.0)
    if managed:
        from matplotlib import pyplot as plt

        figure = plt.figure(figsize=(width_in, height_in), layout=layout)
    else:
        figure = Figure(figsize=(width_in, height_in), layout=layout)
        FigureCanvasAgg(figure)
    grid = figure.add_gridspec(rows, columns)
    # Maps keep to the top of the room that they do not fill: taking it away then moves none of them.
    return figure, [figure.add_subplot(grid[divmod(panel, columns)], anchor="N") for panel in range(panels)]


def outer_labels(axes: Sequence[Axes]) -> None:
    """Keep labels, numbers and marks of the scale only on the outermost axes of panels with the same view.

    Args:
        axes: Row by row, as :func:`new_figure` gives them.
    """
    spec = axes[0].get_subplotspec()
    columns = 1 if spec is None else spec.get_gridspec().ncols
    for number, panel in enumerate(axes):
        if (number // columns + 2) * columns <= len(axes):  # a full row is below
            panel.set_xlabel("")
            panel.tick_params(labelbottom=False)
            for mark in panel.get_children():
                mark.set_visible(mark.get_visible() and mark.get_label() != SCALE)
        if number % columns:
            panel.set_ylabel("")
            panel.tick_params(labelleft=False)


@house_style()
def common_legend(axes: Sequence[Axes], handles: Sequence[Artist]) -> Legend:
    """Put one legend into a free place of the last row of panels, or below all panels.

    Below, it is ordered row by row, in as many columns as fit.

    Args:
        axes: All panels of a figure, row by row, as :func:`new_figure` gives them.
        handles: The entries.

    Returns:
        The legend.
    """
    figure, spec = axes[0].figure, axes[0].get_subplotspec()
    if spec is not None and spec.get_gridspec().nrows * spec.get_gridspec().ncols > len(axes):
        place = figure.add_subplot(spec.get_gridspec()[-1, -1])
        place.set_axis_off()
        return place.legend(handles=handles, loc="upper center")
    for rows in range(1, len(handles) + 1):
        columns = ceil(len(handles) / rows)
        # matplotlib fills column by column
        ordered = [handle for column in range(columns) for handle in handles[column::columns]]
        legend = figure.legend(handles=ordered, loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()
    return legend


def check_target(path: Path, *, force: bool = False) -> str:
    """The format of a figure's file; refuse early what could not be saved later.

    Args:
        path: File to be written.
        force: Whether an existing file may be replaced.

    Returns:
        png, pdf or svg.

    Raises:
        ArtefactError: The extension is unknown, the folder is missing or cannot be written, or the file exists.
    """
    extension = path.suffix.lower().removeprefix(".")
    if extension not in METADATA:
        found = f'the extension "{path.suffix}"' if path.suffix else "no extension"
        raise ArtefactError(
            f"{path}: expected a name that ends in .png, .pdf or .svg, found {found}; rename the output"
        )
    check_writable(path, force=force)
    return extension


#: A higher level takes twice the time for files of nine tenths of the size.
_COMPRESSION = 3
#: matplotlib's warning of a character that no font has.
_GLYPH = re.compile(r"Glyph (\d+) .*missing from font")


def _clean_texts(figure: Figure) -> None:
    """Replace characters that no file format of figures can hold."""
    for text in figure.findobj(Text):
        cleaned = printable(text.get_text())
        if cleaned != text.get_text():
            text.set_text(cleaned)


@house_style()
def save_figure(figure: Figure, path: Path, *, force: bool = False, trim: bool = True) -> list[str]:
    """Save a figure in the format of its file's extension: the same figure gives the same bytes.

    The figure is laid out first, as by :func:`settle`, unless it has a fixed layout. The file appears completely or not
    at all.

    Args:
        figure: The figure.
        path: A .png, .pdf or .svg file.
        force: Replace an existing file.
        trim: Remove empty height, as :func:`trim_height`.

    Returns:
        Notes: characters that no font of the figure has, which are drawn as boxes.

    Raises:
        ArtefactError: As in :func:`check_target`, or writing fails.
    """
    extension = check_target(path, force=force)
    _clean_texts(figure)
    page = BytesIO()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if figure.get_layout_engine() is not None:
            settle(figure, trim=trim)
        more: dict[str, Any] = {"pil_kwargs": {"compress_level": _COMPRESSION}} if extension == "png" else {}
        figure.canvas.print_figure(page, format=extension, dpi=look().dpi, metadata=dict(METADATA[extension]), **more)
    with replacing(path, force=force) as part:
        part.write_bytes(page.getvalue())
    missing, others = _missing_glyphs(caught)
    for one in others:
        warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
    if not missing:
        return []
    return [f"{path.name}: no font of the figure has {''.join(missing)}; drawn as boxes; choose other names"]


def _missing_glyphs(
    caught: Sequence[warnings.WarningMessage],
) -> tuple[list[str], list[warnings.WarningMessage]]:
    """The characters of which matplotlib warned that no font has them, and its other warnings."""
    found: dict[str, None] = {}
    others = []
    for one in caught:
        match = _GLYPH.match(str(one.message))
        if match:
            found[chr(int(match[1]))] = None
        else:
            others.append(one)
    return list(found), others
