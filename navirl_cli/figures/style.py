"""Style of all figures: sizes of a page, fonts, looks for paper and screen, and colours."""

import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any
from zlib import crc32

import matplotlib as mpl
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

from navirl_cli.demos.demonstration import Condition

#: Width of one and of two columns of an IEEE page, inches.
COLUMN_IN, PAGE_IN = 3.5, 7.16
#: Resolution of bitmaps, and of images inside vector files, dots per inch.
DPI = 300

#: Ink on paper. Figures that other looks have too take the ink of :func:`look`.
INK = "#000000"
#: Parts of a group's name behind its condition that name no special set.
_NO_SET = r"cycle \d+|no cycle|main task|no people"
#: Colour of any other key.
OTHER_COLOUR = "#8C8C8C"

#: Colours by key (Okabe and Ito, Color Universal Design: distinct for every common type of colour vision). Cycles of
#: force differ in lightness and stay distinct in grey print. A replay has a darker shade of what it replays.
COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "force": "#0072B2",
        "force, cycle 1": "#56B4E9",
        "force, cycle 2": "#0072B2",
        "force, later cycles": "#00304D",
        "joystick": "#D55E00",
        "autonomous": "#009E73",
        "learnt": "#CC79A7",
        "replay of the learnt policy": "#8F3A69",
        "replay of the joystick": "#5A2300",
        "avoidance": "#E69F00",
        "obstacle avoidance": "#E69F00",
        "driven": "#404040",
        "driven, on grid": "#7A7A7A",
        "nominal": "#BFBFBF",
        "set 1": "#544C00",
        "set 2": "#A0522D",
        "set 3": "#AA3377",
    }
)

#: The same hues on near-black: light instead of dark, with the cycles of force from light to dark as on paper.
DARK_COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "force": "#45A3E8",
        "force, cycle 1": "#C2E4F9",
        "force, cycle 2": "#45A3E8",
        "force, later cycles": "#1A679F",
        "joystick": "#F47B20",
        "autonomous": "#22E0AA",
        "learnt": "#DE86B9",
        "replay of the learnt policy": "#B9508E",
        "replay of the joystick": "#A9581F",
        "avoidance": "#F3B63A",
        "obstacle avoidance": "#F3B63A",
        "driven": "#D6D6D6",
        "driven, on grid": "#A6A6A6",
        "nominal": "#7D7D7D",
        "set 1": "#DCD678",
        "set 2": "#CD8260",
        "set 3": "#E06EAF",
    }
)


@dataclass(frozen=True)
class Look:
    """Look of figures on paper or on a screen; sizes in inches do not depend on it."""

    #: Colours of lines and letters, of the background, of obstacles and of people.
    ink: str
    paper: str
    obstacle: str
    person: str
    #: Colours by key, as :data:`COLOURS`.
    colours: Mapping[str, str]
    #: Colour map of intensities.
    intensity: str
    #: Resolution of bitmaps, and of images inside vector files, dots per inch.
    dpi: int


#: For print, for a light screen (twice the pixels), and for dark slides.
LOOKS: Mapping[str, Look] = MappingProxyType(
    {
        "paper": Look(INK, "#FFFFFF", "#D4D4D4", "#F0E442", COLOURS, "viridis_r", DPI),
        "screen": Look(INK, "#FFFFFF", "#D4D4D4", "#F0E442", COLOURS, "viridis_r", 2 * DPI),
        "dark": Look("#E8E8E8", "#141414", "#454545", "#8A8200", DARK_COLOURS, "viridis", 2 * DPI),
    }
)
_LOOK: ContextVar[Look] = ContextVar("look", default=LOOKS["paper"])

#: matplotlib's distance of lines of a text, in heights of a line.
SPACING = 1.2
#: Fonts by name, each with the family of mathematical text that goes with it and the distance of its lines. matplotlib
#: brings them all, so that a figure looks alike everywhere.
FONTS: Mapping[str, tuple[str, str, float]] = MappingProxyType(
    {"sans": ("DejaVu Sans", "dejavusans", SPACING), "times": ("STIXGeneral", "stix", 0.86)}
)
_FONT: ContextVar[str] = ContextVar("font", default="sans")

#: Look and font that matplotlib's settings have at present.
_SET: ContextVar[tuple[Look, str] | None] = ContextVar("set", default=None)

#: Colour map of a scale from disagreement over neutral to agreement, and its ends. The end of agreement is darker: the
#: two sides stay distinct in grey print.
_LEVELS_MAP, _LEVELS_FROM, _LEVELS_TO = "PuOr", 0.14, 0.95

_STYLE: Mapping[Any, Any] = MappingProxyType(
    {
        "font.size": 8,
        "axes.titlesize": 8,
        "axes.labelsize": 8,
        "xtick.labelsize": 7,
        "ytick.labelsize": 7,
        "legend.fontsize": 7,
        "axes.linewidth": 0.6,
        "axes.axisbelow": True,
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "xtick.major.size": 2.5,
        "ytick.major.size": 2.5,
        "xtick.minor.size": 1.5,
        "ytick.minor.size": 1.5,
        "axes.labelpad": 2.0,
        "legend.frameon": False,
        "legend.handlelength": 1.4,
        "legend.columnspacing": 0.9,
        "legend.handletextpad": 0.4,
        "legend.labelspacing": 0.35,
        "text.parse_math": False,
        "figure.dpi": 100,
        "pdf.fonttype": 42,
        "ps.fonttype": 42,
        "svg.fonttype": "none",
        "svg.hashsalt": "navirl",
    }
)
#: Settings with the colour of the ink and of the background.
_COLOURED: Mapping[str, tuple[Any, ...]] = MappingProxyType(
    {
        "ink": ("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color", "patch.edgecolor"),
        "paper": ("figure.facecolor", "axes.facecolor"),
    }
)


def look() -> Look:
    """The current look."""
    return _LOOK.get()


@contextmanager
def styled(name: str, font: str = "sans", dpi: int | None = None) -> Iterator[None]:
    """Open, draw and save figures in one of LOOKS within the context. The default is paper, without serifs.

    Args:
        name: A key of LOOKS.
        font: A key of FONTS.
        dpi: Resolution in place of that of the look, dots per inch.
    """
    chosen = LOOKS[name] if dpi is None else replace(LOOKS[name], dpi=dpi)
    tokens = _LOOK.set(chosen), _FONT.set(font)
    try:
        yield
    finally:
        _LOOK.reset(tokens[0])
        _FONT.reset(tokens[1])


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's defaults with this style on top, within the context or the decorated call.

    A matplotlibrc of the user does not change the figures. Earlier settings are restored afterwards. Within another
    such context with the same look and font nothing is to do.
    """
    wanted = look(), _FONT.get()
    if _SET.get() == wanted:
        yield
        return
    token = _SET.set(wanted)
    with mpl.rc_context(), warnings.catch_warnings():
        # of a character without a glyph save_figure gives one note, in place of a warning at every measuring
        warnings.filterwarnings("ignore", r"Glyph \d+ ")
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        family, mathematics, _ = FONTS[_FONT.get()]
        mpl.rcParams.update({"font.family": [family], "mathtext.fontset": mathematics})
        for part, colour in (("ink", look().ink), ("paper", look().paper)):
            mpl.rcParams.update(dict.fromkeys(_COLOURED[part], colour))
        try:
            yield
        finally:
            _SET.reset(token)


def line_spacing() -> float:
    """Distance of lines of a text in the current font, for :meth:`matplotlib.text.Text.set_linespacing`."""
    return FONTS[_FONT.get()][2]


def colour_of(key: str) -> str:
    """The colour of a group of demonstrations or of a type of path.

    Args:
        key: A group as :func:`navirl_cli.evaluation.groups.group_of` names it, or a type of path. The third and later
            cycles of force share a colour. Cycles of other conditions have their condition's. Special sets have colours
            of their own, whatever their condition and cycle. Unknown keys are grey.

    Returns:
        The colour as #RRGGBB, the same hue in every look.
    """
    colours, (condition, *rest) = look().colours, key.split(", ")
    if key in colours:
        return colours[key]
    if rest and condition in colours and not re.fullmatch(_NO_SET, rest[-1]):
        return colours[_set_key(rest[-1])]
    if condition == Condition.FORCE and rest and rest[0].startswith("cycle "):
        return colours.get(f"{condition}, {rest[0]}", colours["force, later cycles"])
    return colours.get(condition, OTHER_COLOUR)


def _set_key(name: str) -> str:
    """The key of a special set's colour: that of the study's obstacle course, or one that depends on the name alone."""
    return "set 1" if name == "obstacle course" else f"set {1 + crc32(name.encode()) % 3}"


def level_colours(levels: int) -> list[str]:
    """Colours of the levels of a scale from "strongly disagree" to "strongly agree".

    Args:
        levels: Number of levels. An odd number has a neutral one in the middle, which is nearly white.

    Returns:
        Colours as #RRGGBB, orange to purple, distinct for every common type of colour vision. They darken away from the
        middle; up to five differ in lightness.
    """
    aside = np.linspace(-1.0, 1.0, levels)
    places = np.where(aside < 0, 0.5 + (0.5 - _LEVELS_FROM) * aside, 0.5 + (_LEVELS_TO - 0.5) * aside)
    return [to_hex(colour) for colour in colormaps[_LEVELS_MAP](places)]


def panel_width_in(axes: Axes) -> float:
    """Width of a panel including its labels, inches."""
    spec = axes.get_subplotspec()
    panels = 1 if spec is None else spec.get_gridspec().ncols
    return float(axes.figure.bbox.width / axes.figure.dpi / panels)
