"""The page of a figure that is drawn from Python: on your axes, or on a new figure."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from navirl_cli.api.arguments import one_of
from navirl_cli.api.given import PathLike
from navirl_cli.errors import ArgumentError
from navirl_cli.figures.layout import trim_height
from navirl_cli.figures.sheet import check_target, new_figure, save_figure
from navirl_cli.figures.style import COLUMN_IN, FONTS, LOOKS, PAGE_IN, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class PageOptions(TypedDict, total=False):
    """Options of every figure."""

    #: Width of a page with two columns (7.16 in) instead of one column (3.5 in).
    wide: bool
    #: "paper", "screen" (twice the pixels) or "dark".
    style: str
    #: "sans", or "times" for letters like those of an IEEE paper.
    font: str
    #: File to write: .png, .pdf or .svg, with embedded fonts. The figure is then not shown.
    output: PathLike | None
    #: Replace an existing file.
    force: bool


def own(axes: "Axes | None") -> "list[Axes] | None":
    """The user's axes as the only ones of a figure; None for a new figure."""
    return None if axes is None else [axes]


def width_in(page: PageOptions) -> float:
    """Width of one column or of a page of two, inches."""
    return PAGE_IN if page.get("wide") else COLUMN_IN


def drawn(
    draw: Callable[["list[Axes]"], object],
    axes: "list[Axes] | None",
    page: PageOptions,
    *,
    panels: int = 1,
    columns: int | None = None,
    height_in: float | None = None,
) -> "list[Axes]":
    """Draw on given axes, or on a new figure that is shown or written."""
    output, style = page.get("output"), one_of(tuple(LOOKS), page.get("style", "paper"), "style")
    font = one_of(tuple(FONTS), page.get("font", "sans"), "font")
    if axes is not None and output is not None:
        raise ArgumentError("`output` is for new figures: save the figure of your `axes` yourself")
    if output is not None:
        check_target(Path(output), force=page.get("force", False))
    with styled(style, font):
        if axes is not None:
            draw(axes)
            return axes
        figure, axes = new_figure(width_in(page), height_in, panels, columns, managed=output is None)
        draw(axes)
        if output is not None:
            save_figure(figure, Path(output), force=page.get("force", False), trim=height_in is None)
        elif height_in is None:
            trim_height(figure)
    return axes
