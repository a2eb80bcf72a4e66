"""The forces of one trial, over time and as arrows along its path."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.quiver import Quiver
from matplotlib.text import Annotation

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Contact, Demonstration
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.groups import group_of
from navirl_cli.figures.ground import Window, cropped_to, window_around
from navirl_cli.figures.paths import DrawnPaths, draw_paths
from navirl_cli.figures.scale import SCALE, below, write_beside
from navirl_cli.figures.sheet import common_legend
from navirl_cli.figures.style import colour_of, house_style, look, panel_width_in

#: Ratio of height to width of the panel over time in a column and on a page; least width of a page, inches.
_ASPECT, _WIDE_ASPECT, _WIDE_IN = 0.5, 0.3, 5.0
#: Width of the labels beside the panel and of a contact's numbers, and height of the numbers' two lines, inches.
_BESIDE_IN, _NUMBERS_IN, _LINES_IN = 0.5, 0.44, 0.27
#: Length of the largest force's arrow as a share of the map's width; least distance between arrows, inches.
_LONGEST, _APART_IN = 0.12, 0.07
#: Force of the reference arrow, N, and the range of a trial's largest force for which it is used, N.
_REFERENCE_N, _FROM_N, _TO_N = 10.0, 8.0, 80.0
#: Least upper end of the axis, N: noise of a sensor must not look like pushes.
_LEAST_N = 5.0
_OPACITY = 0.18


@dataclass(frozen=True)
class DrawnForces:
    """The artists of :func:`draw_forces`."""

    map: DrawnPaths
    #: None without contact.
    arrows: Quiver | None
    #: Length of an arrow of one newton on the map, m, and the force of the reference arrow, N.
    metres_per_newton: float
    reference_n: float
    #: Components along x and y of the map frame, and magnitude, over time.
    over_time: Axes
    components: list[Line2D]
    size: Line2D
    #: One for each contact.
    contacts: list[Rectangle]
    numbers: list[Annotation]
    legend: Legend


@house_style()
def draw_forces(axes: Sequence[Axes], one: Demonstration, *, crop: bool = False) -> DrawnForces:
    """Draw the horizontal forces of a trial: all over time, and those in contact as arrows along the path.

    Arrows start at the robot's centre. Contacts are shaded, with peak and impulse above.

    Args:
        axes: Two: of the map, and of the forces over time.
        one: The trial.
        crop: Show only the surroundings of path and arrows.

    Returns:
        The artists.

    Raises:
        DemonstrationError: Forces and contacts are unknown.
    """
    if one.force_n is None or one.contacts is None:
        raise DemonstrationError(
            f"demonstration {one.id}: no forces to draw, because its log holds no wrench; choose another with `trial`, "
            "or extract a log of a robot with a force sensor"
        )
    peak = float(np.hypot(*one.force_n.T).max())
    whole = window_around([one.grid], np.concatenate([one.xy_m, [one.goal_m]]))
    scale = _LONGEST * (whole[1] - whole[0]) / (peak or 1.0)
    window = cropped_to([one.grid], _with_tips(one, one.force_n * scale), one.people_m) if crop else whole
    title = f"{one.id}: {group_of(one)}"
    drawn = draw_paths(axes[0], [one], window_m=window, title=title, legend=False)
    arrows = _arrows(axes[0], one, one.force_n, scale, window)
    reference_n = _REFERENCE_N if _FROM_N <= peak <= _TO_N else 10.0 ** np.floor(np.log10(peak or 1.0))
    if arrows is not None:
        _reference(axes[0], window, reference_n, scale)
    spans = [_shade(axes[1], contact, colour_of(group_of(one))) for contact in one.contacts]
    *components, size = _over_time(axes[1], one, one.force_n)
    numbers = _name_contacts(axes[1], one)
    _share_height(axes, window)
    shown = [*components, size, *_contact_handles(one), *drawn.marks.handles()]
    legend = common_legend(axes, shown)
    return DrawnForces(drawn, arrows, scale, reference_n, axes[1], components, size, spans, numbers, legend)


def _share_height(axes: Sequence[Axes], window: Window) -> None:
    """Give the map the width of the panel over time."""
    spec = axes[0].get_subplotspec()
    if spec is not None and spec.get_gridspec().nrows == len(axes):
        spec.get_gridspec().set_height_ratios([(window[3] - window[2]) / (window[1] - window[0]), _aspect(axes[1])])


def _aspect(axes: Axes) -> float:
    """Ratio of height to width of the panel over time."""
    return _WIDE_ASPECT if panel_width_in(axes) >= _WIDE_IN else _ASPECT


def _with_tips(one: Demonstration, arrows_m: FloatArray) -> FloatArray:
    """(k, 2) m: a path, and the tips of the arrows of its points in contact."""
    return np.concatenate([one.xy_m, (one.xy_m + arrows_m)[_in_contact(one)]])


def _in_contact(one: Demonstration) -> IntArray:
    """(k,) numbers of the poses in contact."""
    within = np.zeros(len(one.t_s), dtype=bool)
    for contact in one.contacts or ():
        within |= (one.t_s >= contact.start_s) & (one.t_s <= contact.end_s)
    found: IntArray = np.flatnonzero(within)
    return found


def _arrows(axes: Axes, one: Demonstration, force_n: FloatArray, scale: float, window: Window) -> Quiver | None:
    """Draw arrows at poses in contact, as dense as they can be distinguished."""
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(one.xy_m, axis=0).T))])
    apart = _APART_IN * (window[1] - window[0]) / panel_width_in(axes)
    chosen: list[int] = []
    for pose in _in_contact(one):
        if not chosen or along_m[pose] - along_m[chosen[-1]] >= apart:
            chosen.append(int(pose))
    if not chosen:
        return None
    x, y, u, v = *one.xy_m[chosen].T, *(scale * force_n[chosen]).T
    return axes.quiver(x, y, u, v, color=colour_of(group_of(one)), zorder=3.5, **_arrow())


def _arrow() -> dict[str, Any]:
    """Look of an arrow whose length on the map is proportional to its force."""
    size = {"width": 0.008, "headwidth": 4.0, "headlength": 4.5, "headaxislength": 4.0}
    return {"angles": "xy", "scale_units": "xy", "scale": 1.0, "units": "inches", **size}


def _reference(axes: Axes, window: Window, newtons: float, scale: float) -> None:
    """Draw an arrow of a round force below the left end of the map, with its number."""
    length = newtons * scale
    look_of: dict[str, Any] = {"color": look().ink, "clip_on": False, "label": SCALE, **_arrow()}
    axes.quiver(window[0], 0.0, length, 0.0, transform=below(axes), **look_of)
    write_beside(axes, f"{newtons:g} N", window[0] + length, left=False)


def _over_time(axes: Axes, one: Demonstration, force_n: FloatArray) -> list[Line2D]:
    """Draw both components and the magnitude, with axes and limits."""
    lines = []
    thin: dict[str, Any] = {"color": look().ink, "linewidth": 0.7}
    for values, name, kind in zip(force_n.T, "xy", ("--", (0, (1, 1))), strict=True):
        lines += axes.plot(one.t_s, values, linestyle=kind, label=f"force along {name} (map)", zorder=3, **thin)
    colour = colour_of(group_of(one))
    lines += axes.plot(one.t_s, np.hypot(*force_n.T), color=colour, linewidth=1.2, label="magnitude of force", zorder=3)
    axes.axhline(0.0, color=look().ink, linewidth=0.4, zorder=1)
    axes.set_xlim(one.t_s[0], one.t_s[-1])
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -_LEAST_N / 5), max(high, _LEAST_N))
    axes.set_xlabel("time since start of trial [s]" if one.timed else f"time, laid out at {one.laid_out_m_s:g} m/s [s]")
    axes.set_ylabel("force [N]")
    axes.set_box_aspect(_aspect(axes))
    return lines


def _shade(axes: Axes, contact: Contact, colour: str) -> Rectangle:
    """Shade the time of a contact."""
    return axes.axvspan(contact.start_s, contact.end_s, color=colour, alpha=_OPACITY, linewidth=0, zorder=0)


def _name_contacts(axes: Axes, one: Demonstration) -> list[Annotation]:
    """Write peak and impulse of every contact above the curves, in as many rows as needed to avoid overlap."""
    contacts = one.contacts or ()
    width_in = panel_width_in(axes) - _BESIDE_IN
    number_s = _NUMBERS_IN / width_in * one.duration_s
    first, last = one.t_s[0] + number_s / 2, one.t_s[-1] - number_s / 2
    ends: list[float] = []
    places = []
    for contact in contacts:
        at = min(max((contact.start_s + contact.end_s) / 2, first), last)
        row = next((row for row, end in enumerate(ends) if at - number_s / 2 >= end), len(ends))
        ends[row : row + 1] = [at + number_s / 2]
        places.append((at, row))
    low, high = axes.get_ylim()
    height_in = _aspect(axes) * width_in
    row_n = (high - low) * _LINES_IN / max(height_in - len(ends) * _LINES_IN, _LINES_IN)
    axes.set_ylim(low, high + len(ends) * row_n)
    style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": 6.5, "linespacing": 1.0}
    return [
        axes.annotate(_numbers(contact, timed=one.timed), (at, high + row * row_n), **style)
        for contact, (at, row) in zip(contacts, places, strict=True)
    ]


def _numbers(contact: Contact, *, timed: bool) -> str:
    """Peak force and impulse as text; no impulse where times were not measured."""
    impulse = f"\n{np.hypot(*contact.impulse_n_s):.1f} N s" if timed else ""
    return f"{contact.peak_force_n:.1f} N{impulse}"


def _contact_handles(one: Demonstration) -> list[Patch]:
    """Legend entry of contacts; none without contact."""
    look_of: dict[str, Any] = {"facecolor": colour_of(group_of(one)), "alpha": _OPACITY, "linewidth": 0}
    label = "contact (peak, impulse)" if one.timed else "contact (peak)"
    return [Patch(label=label, **look_of)] if one.contacts else []
