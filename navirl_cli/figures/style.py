"""What all figures share: sizes of a page, fonts, and one colour for one thing."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

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

#: Grey levels and colours of what is no condition.
OBSTACLE_COLOUR = "#D4D4D4"
PERSON_COLOUR = "#F0E442"
INK = "#000000"
#: Colour of whatever is none of COLOURS.
OTHER_COLOUR = "#8C8C8C"

#: Colours by key (Okabe and Ito, Color Universal Design: apart for every common kind of colour vision; force's cycles
#: differ in lightness, so that grey print keeps them apart). A replay has a darker shade of what it replays.
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
    }
)

#: Colours of a scale from disagreement over neutral to agreement, and how far from the middle its ends lie: the dark
#: end of agreement is the darker one, so that grey print keeps the two sides apart.
_LEVELS_MAP, _LEVELS_FROM, _LEVELS_TO = "PuOr", 0.14, 0.95

_STYLE: Mapping[Any, Any] = MappingProxyType(
    {
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans"],
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
        "savefig.dpi": DPI,
        "pdf.fonttype": 42,
        "ps.fonttype": 42,
        "svg.fonttype": "none",
        "svg.hashsalt": "navirl",
    }
)


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib's own defaults with the house's on top, for as long as the context or the decorated call lasts.

    A matplotlibrc of the user does not change the figures; what was set before is set again afterwards.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def colour_of(key: str) -> str:
    """The colour of a group of demonstrations or of a kind of path.

    Args:
        key: A group as :func:`navirl_cli.evaluation.compare.group_of` names it, or a kind of path. Force's third and
            later cycles share a colour; other conditions' cycles, and special sets, have their condition's; whatever is
            unknown is grey.

    Returns:
        The colour as #RRGGBB.
    """
    condition, *rest = key.split(", ")
    if condition == Condition.FORCE and rest and rest[0].startswith("cycle "):
        return COLOURS.get(f"{condition}, {rest[0]}", COLOURS["force, later cycles"])
    return COLOURS.get(key, COLOURS.get(condition, OTHER_COLOUR))


def level_colours(levels: int) -> list[str]:
    """The colours of a scale's levels from "strongly disagree" to "strongly agree".

    Args:
        levels: Number of levels; an odd number has a neutral one in the middle, which is nearly white.

    Returns:
        Colours as #RRGGBB, orange to purple, apart for every common kind of colour vision and the darker the farther
        from the middle; up to five differ in lightness.
    """
    aside = np.linspace(-1.0, 1.0, levels)
    places = np.where(aside < 0, 0.5 + (0.5 - _LEVELS_FROM) * aside, 0.5 + (_LEVELS_TO - 0.5) * aside)
    return [to_hex(colour) for colour in colormaps[_LEVELS_MAP](places)]


def panel_width_in(axes: Axes) -> float:
    """The width that a panel has of its figure, labels included, inches."""
    spec = axes.get_subplotspec()
    panels = 1 if spec is None else spec.get_gridspec().ncols
    return float(axes.figure.bbox.width / axes.figure.dpi / panels)
