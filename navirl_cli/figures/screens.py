"""One figure for every screen: light and dark, wide and narrow."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from matplotlib.figure import Figure

from navirl_cli.figures.layout import settle, settle_like
from navirl_cli.figures.sheet import save_figure
from navirl_cli.figures.style import COLUMN_IN, DPI, PAGE_IN, styled

#: Draws a figure of a width, inches, in the current look; and says whether to remove its empty height.
Draw: TypeAlias = Callable[[float], tuple[Figure, bool]]
#: Resolution of figures for narrow screens, dots per inch: with 2 dots a pixel, 394 pixels wide, as wide as phones are.
NARROW_DPI = 225


@dataclass(frozen=True)
class Drawing:
    """A figure, and how wide it is on paper and on wide screens."""

    draw: Draw
    width_in: float = PAGE_IN

    @property
    def widths_in(self) -> Mapping[str, float]:
        """Widths by ending of the file's name; narrow screens have a figure of their own where this one is wider."""
        return {"": self.width_in, **({"_narrow": COLUMN_IN} if self.width_in > COLUMN_IN else {})}


def save_for_screens(
    drawing: Drawing,
    name: str,
    folder: Path,
    page: Path | None = None,
    *,
    formats: Sequence[str] = ("png",),
    force: bool = False,
) -> dict[str, Path]:
    """Draw a figure for light and dark, for wide and narrow screens.

    The dark figure has the layout of the light one.

    Args:
        drawing: What to draw.
        name: Of the files, without extension.
        folder: Where to write NAME.png for paper and light screens, in all formats.
        page: Where to write the others, which are for pages only; None for the same folder.
        formats: Extensions of the figure for paper, png among them.
        force: Replace existing files.

    Returns:
        The files by name: NAME, NAME_dark, and NAME_narrow and NAME_narrow_dark of a figure wider than a column.
    """
    files = {}
    for ending, width_in in drawing.widths_in.items():
        dpi = NARROW_DPI if ending else DPI
        with styled("paper", dpi=dpi):
            light, trim = drawing.draw(width_in)
            settle(light, trim=trim)
            files[name + ending] = (page or folder if ending else folder) / f"{name}{ending}.png"
            for extension in ("png",) if ending else formats:
                save_figure(light, files[name + ending].with_suffix(f".{extension}"), force=force, trim=False)
        with styled("dark", dpi=dpi):
            dark, _ = drawing.draw(width_in)
            settle_like(dark, light)
            files[f"{name}{ending}_dark"] = (page or folder) / f"{name}{ending}_dark.png"
            save_figure(dark, files[f"{name}{ending}_dark"], force=force, trim=False)
    return files
