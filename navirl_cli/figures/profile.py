"""Profile likelihoods: the largest log-likelihood with one parameter fixed, on both sides of its estimate."""

import re
from collections.abc import Collection, Mapping, Sequence
from math import ceil, nan

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from navirl_cli.documents.numbers import evenly
from navirl_cli.errors import ArtefactError, unknown
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import colour_of, house_style, look, panel_width_in
from navirl_cli.irl.profile import Profile, fall_at

#: The curve is drawn down to this multiple of the fall at the interval's ends.
DEPTH = 1.6
#: Ratio of height to width of a panel; height of a second line of title and label, and largest height, inches.
ASPECT, MORE_IN, TALLEST_IN = 0.72, 0.6, 2.6
#: A panel narrower than the first is not legible; one narrower than the second has fewer ticks and a smaller title,
#: inches.
NARROWEST_IN, NARROW_IN = 1.6, 2.2


def symbol_of(name: str) -> str:
    """A parameter's name as mathematical text, as in the paper; names of other forms are unchanged."""
    parts = re.fullmatch(r"(sigma|[A-Za-z])(?:_?([0-9]+)|_([A-Za-z0-9]+))?", name)
    if parts is None:
        return name
    head, index = parts[1].replace("sigma", r"\sigma"), parts[2] or parts[3] or ""
    below = index if len(index) < 2 else rf"{{\mathrm{{{index}}}}}"
    return f"${head}_{below}$" if index else f"${head}$"


def chosen_profiles(profiles: Sequence[Profile], names: Collection[str]) -> list[Profile]:
    """The profiles of some parameters, or all where none is named.

    Raises:
        ArtefactError: A parameter has no profile.
    """
    known = {one.name: one for one in profiles}
    for name in names:
        if name not in known:
            raise ArtefactError(f"{unknown('`parameter`', name, known)}; fit again with `profile` for others")
    return [known[name] for name in dict.fromkeys(names)] or list(profiles)


def draw_profiles(profiles: Sequence[Profile], units: Mapping[str, str], width_in: float) -> Figure:
    """Draw profile likelihoods side by side, in as many rows as they need to be legible.

    Args:
        profiles: From left to right, row by row, at least one.
        units: Units of the parameters by name; empty or missing for a dimensionless parameter.
        width_in: Width of the figure, inches; COLUMN_IN or PAGE_IN for a paper.

    Returns:
        The figure, of the height that it needs.

    Raises:
        ArtefactError: A flat profile.
    """
    rows = ceil(len(profiles) / int(width_in / NARROWEST_IN))
    columns = ceil(len(profiles) / rows)
    height_in = min(width_in / columns * ASPECT + (MORE_IN if columns > 1 else 0.0), TALLEST_IN)
    figure, axes = new_figure(width_in, rows * height_in, len(profiles), columns)
    for number, (one, panel) in enumerate(zip(profiles, axes, strict=True)):
        draw_profile(panel, one, units.get(one.name, ""))
        if number % columns:
            first = axes[number - number % columns]
            panel.set_ylabel("")
            panel.tick_params(labelleft=panel.get_ylim() != first.get_ylim())
    return figure


@house_style()
def draw_profile(axes: Axes, profile: Profile, unit: str) -> None:
    """Draw the profile likelihood of one parameter with its interval.

    Computed values are marked. Between them, the square root of the fall is interpolated linearly. At an open end of
    the interval, the likelihood does not fall to the dashed line.

    Args:
        axes: Where to draw.
        profile: The profile; its maximum is the estimate.
        unit: The parameter's unit; empty for a dimensionless parameter.

    Raises:
        ArtefactError: The profile is flat.
    """
    if float(profile.relative.max() - profile.relative.min()) <= 0:
        raise ArtefactError(
            f"profile of {profile.name}: expected a log-likelihood with a maximum, found a flat one; the "
            f"demonstrations do not identify {profile.name}"
        )
    fall, colour = fall_at(profile.level), colour_of("learnt")
    top = int(np.argmax(profile.relative))
    best = float(profile.values[top])
    root = np.sqrt(profile.relative[top] - profile.relative) * np.sign(profile.values - best)
    dense = np.linspace(profile.values[0], profile.values[-1], 400)
    axes.plot(dense, -(np.interp(dense, profile.values, root) ** 2), color=colour, linewidth=1.2, zorder=3)
    axes.plot(profile.values, profile.relative, "o", color=colour, markersize=2.2, zorder=3)
    axes.axhline(-fall, color=look().ink, linewidth=0.6, linestyle=(0, (4, 2)))
    axes.axvline(best, color=look().ink, linewidth=0.6)
    low = profile.values[0] if profile.lower is None else profile.lower
    high = profile.values[-1] if profile.upper is None else profile.upper
    axes.axvspan(float(low), float(high), color=colour, alpha=0.15, linewidth=0)
    axes.set_ylim(-DEPTH * fall, 0.12 * fall)
    axes.set_xlim(*np.interp((-np.sqrt(DEPTH * fall), np.sqrt(DEPTH * fall)), root, profile.values))
    _write(axes, profile, best, unit)


def _write(axes: Axes, profile: Profile, best: float, unit: str) -> None:
    """Write title, labels and ticks. Panels side by side have titles in two lines; narrow ones a smaller font."""
    spec = axes.get_subplotspec()
    alone = spec is None or spec.get_gridspec().ncols == 1
    narrow = panel_width_in(axes) < NARROW_IN
    left, right = axes.get_xlim()
    # Left of an estimate near the left end is no room.
    side, reach = ("left", 3) if best - left < (right - left) / 4 else ("right", -3)
    label, at = f"{100 * profile.level:.4g} %", (best, -fall_at(profile.level))
    axes.annotate(label, at, (reach, 1.5), textcoords="offset points", ha=side, va="bottom", fontsize=7)
    symbol = symbol_of(profile.name)
    axes.set_xlabel(symbol + (f" [{unit.replace('^2', '²')}]" if unit else ""), parse_math=True)
    axes.set_ylabel("relative log-likelihood [nats]" if alone else "relative\nlog-likelihood [nats]")
    value, *ends = evenly([best, *(nan if end is None else end for end in (profile.lower, profile.upper))])
    low, high = ("open" if end == "nan" else end for end in ends)
    text = (" " if alone else "\n").join((f"{symbol} = {value}", f"({low} to {high})"))
    axes.set_title(text.replace("-", "\N{MINUS SIGN}"), parse_math=True, fontsize=7 if narrow else None)
    axes.xaxis.set_major_locator(MaxNLocator(3 if narrow else 5, steps=[1, 2, 5, 10]))
    axes.ticklabel_format(axis="x", scilimits=(-3, 4))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
