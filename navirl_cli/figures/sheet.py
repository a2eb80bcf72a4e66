"""Sheets of paper: figures opened without a display, and saved whole or not at all."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from types import MappingProxyType

from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from navirl_cli.errors import ArtefactError
from navirl_cli.figures.style import COLUMN_IN, DPI, house_style
from navirl_cli.files import check_writable, replacing

#: What writes each format; none of them needs a display.
CANVASES: Mapping[str, type[FigureCanvasBase]] = MappingProxyType(
    {"png": FigureCanvasAgg, "pdf": FigureCanvasPdf, "svg": FigureCanvasSVG}
)
#: What a file says of itself, by format: nothing that changes from day to day.
METADATA: Mapping[str, Mapping[str, None]] = MappingProxyType(
    {"png": {}, "pdf": {"CreationDate": None, "ModDate": None}, "svg": {"Date": None}}
)
#: White border around everything, and the waste of height that is tolerated, inches.
PAD_IN, SLACK_IN = 0.03, 0.02
_MOST_TRIMS = 10


@house_style()
def new_figure(
    width_in: float = COLUMN_IN, height_in: float | None = None, panels: int = 1
) -> tuple[Figure, list[Axes]]:
    """Open a figure with panels side by side.

    Args:
        width_in: Width, inches; COLUMN_IN or PAGE_IN for a paper.
        height_in: Height, inches; None leaves as much as maps need, :func:`save_figure` takes away what is empty.
        panels: Number of panels.

    Returns:
        The figure and its axes, from left to right.
    """
    height_in = width_in / panels * 1.3 + 1.0 if height_in is None else height_in
    layout = ConstrainedLayoutEngine(w_pad=PAD_IN, h_pad=PAD_IN, wspace=0.03)
    figure = Figure(figsize=(width_in, height_in), layout=layout)
    axes = figure.subplots(1, panels, squeeze=False)
    return figure, list(axes[0])


@house_style()
def trim_height(figure: Figure) -> None:
    """Take away height that maps of a fixed aspect leave empty; the width stays.

    Args:
        figure: Changed in place. Panels that fill their height keep it.
    """
    for _ in range(_MOST_TRIMS):
        figure.draw_without_rendering()
        width, height = figure.get_size_inches()
        empty = float(height) - figure.get_tightbbox().height - 2 * PAD_IN
        if empty <= SLACK_IN:
            return
        figure.set_size_inches(width, height - empty + SLACK_IN / 2)


def check_target(path: Path, *, force: bool = False) -> str:
    """The format in which a figure would be saved; refuse early what could not be saved later.

    Args:
        path: File to be written.
        force: An existing file may be replaced.

    Returns:
        png, pdf or svg.

    Raises:
        ArtefactError: The extension is unknown, the folder is missing or cannot be written, or the file exists.
    """
    extension = path.suffix.lower().removeprefix(".")
    if extension not in CANVASES:
        found = f'the extension "{path.suffix}"' if path.suffix else "no extension"
        raise ArtefactError(f"{path}: a figure is saved as .png, .pdf or .svg, found {found}; rename the output")
    check_writable(path, force=force)
    return extension


@house_style()
def save_figure(figure: Figure, path: Path, *, force: bool = False, trim: bool = True) -> None:
    """Save a figure in the format of its file's extension: the same figure gives the same bytes.

    The file appears whole or not at all.

    Args:
        figure: The figure.
        path: A .png, .pdf or .svg file.
        force: Replace an existing file.
        trim: Take away empty height first, as :func:`trim_height`.

    Raises:
        ArtefactError: As in :func:`check_target`, or writing fails.
    """
    extension = check_target(path, force=force)
    if trim:
        trim_height(figure)
    page = BytesIO()
    CANVASES[extension](figure).print_figure(page, format=extension, dpi=DPI, metadata=dict(METADATA[extension]))
    with replacing(path, force=force) as part:
        part.write_bytes(page.getvalue())
