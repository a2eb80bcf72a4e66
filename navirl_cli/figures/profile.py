"""Profile likelihoods: how the best log-likelihood falls on both sides of an estimate."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from navirl_cli.errors import ArtefactError
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import PAGE_IN, colour_of, house_style, look, panel_width_in
from navirl_cli.irl.profile import Profile, fall_at

#: The parameters as the paper writes them.
SYMBOLS = {"c0": "$c_0$", "a_g": "$a_g$", "a_p": "$a_p$", "sigma_p": r"$\sigma_p$"}
#: The curve is drawn down to so many times the fall at the interval's ends.
DEPTH = 1.6
#: Height over width of a panel, what a second line of the title and of the label adds, and the greatest height, inches.
ASPECT, MORE_IN, TALLEST_IN = 0.72, 0.6, 2.6
#: A panel narrower than the first cannot be read; one narrower than the second has fewer ticks and a smaller title, in.
NARROWEST_IN, NARROW_IN = 1.6, 2.2


def draw_profiles(profiles: Sequence[Profile], units: Mapping[str, str], width_in: float) -> Figure:
    """Draw profile likelihoods side by side.

    Args:
        profiles: The profiles, at least one, from left to right.
        units: Units of the parameters by name; a pure number's is empty or missing.
        width_in: Width of the figure, inches; COLUMN_IN or PAGE_IN for a paper.

    Returns:
        The figure, as high as it needs to be.

    Raises:
        ArtefactError: There are more than can be read at this width, or one has nothing to draw.
    """
    count = len(profiles)
    if width_in / count < NARROWEST_IN:
        wider = "use --wide, or" if PAGE_IN / count >= NARROWEST_IN else "use"
        raise ArtefactError(
            f"{count} profiles side by side cannot be read in {width_in:g} in, which has room for "
            f"{int(width_in / NARROWEST_IN)}: {wider} fewer --profile in navirl fit"
        )
    height_in = min(width_in / count * ASPECT + (MORE_IN if count > 1 else 0.0), TALLEST_IN)
    figure, axes = new_figure(width_in, height_in, count)
    for one, panel in zip(profiles, axes, strict=True):
        draw_profile(panel, one, units.get(one.name, ""))
        if panel is not axes[0]:
            panel.set_ylabel("")
            panel.tick_params(labelleft=panel.get_ylim() != axes[0].get_ylim())
    return figure


@house_style()
def draw_profile(axes: Axes, profile: Profile, unit: str) -> None:
    """Draw the profile likelihood of one parameter with its interval.

    Between the values that were followed, which are marked, the root of the fall is drawn straight. Where the interval
    is open, the likelihood never falls to the line.

    Args:
        axes: Where to draw.
        profile: The profile; the estimate is where it is highest.
        unit: The parameter's unit, empty for a pure number.

    Raises:
        ArtefactError: It falls nowhere, so that there is nothing to draw.
    """
    if float(profile.relative.max() - profile.relative.min()) <= 0:
        raise ArtefactError(f"the profile of {profile.name} is flat: there is nothing to draw")
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
    """Write title, labels and ticks: in a panel that has others beside it in two lines, and in a narrow one smaller."""
    spec = axes.get_subplotspec()
    alone = spec is None or spec.get_gridspec().ncols == 1
    narrow = panel_width_in(axes) < NARROW_IN
    left, right = axes.get_xlim()
    # An estimate near the left end has no room beside it there.
    side, reach = ("left", 3) if best - left < (right - left) / 4 else ("right", -3)
    label, at = f"{100 * profile.level:.4g} %", (best, -fall_at(profile.level))
    axes.annotate(label, at, (reach, 1.5), textcoords="offset points", ha=side, va="bottom", fontsize=7)
    symbol = SYMBOLS.get(profile.name, profile.name)
    axes.set_xlabel(symbol + (f" [{unit.replace('^2', '²')}]" if unit else ""), parse_math=True)
    axes.set_ylabel("relative log-likelihood [nats]" if alone else "relative\nlog-likelihood [nats]")
    ends = ["open" if end is None else f"{end:.3g}" for end in (profile.lower, profile.upper)]
    text = (" " if alone else "\n").join((f"{symbol} = {best:.3g}", f"({ends[0]} to {ends[1]})"))
    axes.set_title(text.replace("-", "\N{MINUS SIGN}"), parse_math=True, fontsize=7 if narrow else None)
    axes.xaxis.set_major_locator(MaxNLocator(3 if narrow else 5, steps=[1, 2, 5, 10]))
    axes.ticklabel_format(axis="x", scilimits=(-3, 4))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
