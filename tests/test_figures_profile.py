"""The figure of profile likelihoods."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import factories as make
import numpy as np
import pytest
from click.testing import CliRunner
from figure_checks import layouts

from navirl_cli.artefacts.analyses import profile_document
from navirl_cli.artefacts.rewards import Analyses, reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.cli import cli
from navirl_cli.errors import ArtefactError
from navirl_cli.figures.profile import NARROWEST_IN, chosen_profiles, draw_profile, draw_profiles, symbol_of
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLOURS, COLUMN_IN, PAGE_IN, house_style
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.profile import Profile, fall_at
from navirl_cli.irl.reward import Reward

FALL = fall_at(0.95)
UNITS = {"c0": "1/m", "a_g": "1/m^2", "sigma_p": "1/m^2"}
ORDERS = ["wordy", "common", "wordy, reversed"]
#: How many profiles have room, and where.
ROOM = [(4, PAGE_IN), (2, COLUMN_IN), (1, COLUMN_IN), (1, PAGE_IN), (2, PAGE_IN), (3, PAGE_IN)]
EVERY = layouts(*((order, *room) for order in ORDERS for room in ROOM))


def parabola(best=2.0, error=0.5, name="sigma_p", level=0.95):
    """A profile of a quadratic likelihood, at few values."""
    values = best + error * np.linspace(-2.8, 2.8, 9)
    relative = -(((values - best) / error) ** 2) / 2
    reach = error * np.sqrt(2 * fall_at(level))
    return Profile(name, values, relative, np.zeros((9, 4)), level, best - reach, best + reach)


def part_of(profile, keep, shift=0.0, **changes):
    """Some of the values of a profile, elsewhere."""
    arrays = {name: getattr(profile, name)[keep] for name in ("values", "relative", "theta")}
    arrays["values"] = arrays["values"] + shift
    return replace(profile, **{**arrays, **changes})


def drawn(profile, unit="1/m^2"):
    figure, (axes,) = new_figure(COLUMN_IN, COLUMN_IN * 0.72)
    draw_profile(axes, profile, unit)
    figure.draw_without_rendering()
    return axes


def common():
    """Four profiles of the usual size."""
    return [
        parabola(0.934, 0.28, "sigma_p"),
        parabola(-6.67, 1.7, "a_p"),
        parabola(-49.02, 3.47, "c0"),
        parabola(-1.83, 0.57, "a_g"),
    ]


def wordy():
    """Four profiles with long numbers, two of them with an open end."""
    return [
        parabola(-1.234e-5, 1.11e-6, "a_g"),
        parabola(-49220.0, 3470.0, "c0"),
        part_of(parabola(-0.00667, 0.00111, "a_p"), slice(4, None), lower=None),
        part_of(parabola(0.000934, 0.000111), slice(0, 6), upper=None),
    ]


def sheet(profiles, width_in):
    with house_style():
        figure = draw_profiles(profiles, UNITS, width_in)
        figure.draw_without_rendering()
    return figure


@cache
def laid_out(order, count, width_in):
    """The first profiles of :func:`common` or :func:`wordy`, or the last ones, drawn once for all tests that look."""
    profiles = {"common": common(), "wordy": wordy(), "wordy, reversed": wordy()[::-1]}[order]
    return sheet(profiles[:count], width_in)


def boxes(texts):
    """Where texts are drawn."""
    return [text.get_window_extent() for text in texts if text.get_visible() and text.get_text()]


def ticks(axis):
    """The labels of the ticks that are seen."""
    low, high = sorted(axis.get_view_interval())
    labels = [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    return [label for label in labels if label.get_visible() and label.get_text()]


def test_the_curve_is_the_parabola_and_every_value_is_marked():
    profile = parabola()
    axes = drawn(profile)
    curve, marks, threshold, best = axes.lines
    x, y = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    assert y == pytest.approx(-(((x - 2.0) / 0.5) ** 2) / 2, abs=1e-9), "between the values too"
    assert (x[0], x[-1]) == (profile.values[0], profile.values[-1])
    assert np.asarray(marks.get_xdata()) == pytest.approx(profile.values)
    assert np.asarray(marks.get_ydata()) == pytest.approx(profile.relative)
    assert (marks.get_marker(), marks.get_linestyle()) == ("o", "None")
    assert set(np.asarray(threshold.get_ydata()).tolist()) == {-FALL}
    assert set(np.asarray(best.get_xdata()).tolist()) == {2.0}
    assert curve.get_color() == COLOURS["learnt"]


def test_the_interval_is_shaded_from_end_to_end():
    profile = parabola()
    (band,) = drawn(profile).patches
    low, high = band.get_x(), band.get_x() + band.get_width()
    assert (low, high) == pytest.approx((profile.lower, profile.upper))
    assert band.get_alpha() == 0.15


def test_an_open_end_is_shaded_to_the_last_value_and_labelled_open():
    profile = parabola()
    cut = part_of(profile, slice(0, 6), upper=None)
    axes = drawn(cut)
    (band,) = axes.patches
    assert band.get_x() + band.get_width() == pytest.approx(cut.values[-1])
    assert axes.get_title() == rf"$\sigma_p$ = 2.00 ({profile.lower:.2f} to open)"
    both = drawn(part_of(cut, slice(2, None), lower=None))
    assert both.get_title().endswith("(open to open)")


def test_labels_name_symbol_unit_and_level():
    axes = drawn(parabola())
    assert axes.get_xlabel() == r"$\sigma_p$ [1/m²]"
    assert axes.get_ylabel() == "relative log-likelihood [nats]"
    assert [text.get_text() for text in axes.texts] == ["95 %"]
    assert axes.get_title() == rf"$\sigma_p$ = 2.00 ({2 - 0.98:.2f} to {2 + 0.98:.2f})"
    axes = drawn(parabola(-30.0, 3.0, "c0", 0.9), "1/m")
    assert axes.get_xlabel() == "$c_0$ [1/m]"
    assert axes.texts[0].get_text() == "90 %"
    assert axes.get_title().startswith("$c_0$ = \N{MINUS SIGN}30.0 (\N{MINUS SIGN}34.9 to")
    assert drawn(parabola(name="a_p"), "").get_xlabel() == "$a_p$"
    assert drawn(parabola(name="beta"), "s").get_xlabel() == "beta [s]"


def test_the_axes_end_a_little_below_the_interval():
    profile = parabola()
    axes = drawn(profile)
    low, high = axes.get_ylim()
    assert (low, high) == pytest.approx((-1.6 * FALL, 0.12 * FALL))
    left, right = axes.get_xlim()
    assert left < profile.lower < profile.upper < right
    assert (left, right) == pytest.approx((2 - 0.5 * np.sqrt(3.2 * FALL), 2 + 0.5 * np.sqrt(3.2 * FALL)), rel=1e-6)


def test_a_curve_on_one_side_of_a_bound():
    profile = parabola(name="a_g")
    one = part_of(profile, slice(0, 5), shift=-2.0, lower=profile.lower - 2.0, upper=None)
    axes = drawn(one)
    left, right = axes.get_xlim()
    assert left < one.lower < 0.0
    assert right == pytest.approx(0.0, abs=1e-9)
    assert axes.get_title() == f"$a_g$ = 0.000 ({one.lower:.3f} to open)".replace("-", "\N{MINUS SIGN}")


def test_a_flat_profile_is_refused():
    flat = replace(parabola(), relative=np.zeros(9))
    with pytest.raises(
        ArtefactError,
        match=r"^profile of sigma_p: expected a log-likelihood with a maximum, found a flat one; the demonstrations do",
    ):
        drawn(flat)


@pytest.mark.parametrize(("order", "count", "width_in"), EVERY)
def test_no_texts_overlap_or_are_clipped(order, count, width_in):
    figure = laid_out(order, count, width_in)
    assert len(figure.axes) == count
    assert figure.get_size_inches()[0] == width_in
    words = []
    for axes in figure.axes:
        across, up = (boxes(ticks(axis)) for axis in (axes.xaxis, axes.yaxis))
        more = [axes.title, axes.xaxis.label, axes.yaxis.label, axes.xaxis.offsetText, *axes.texts]
        words += across + up + boxes(more)
    for one, other in combinations(words, 2):
        assert not one.overlaps(other)
    for one in words:
        assert figure.bbox.x0 <= one.x0 < one.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= one.y0 < one.y1 <= figure.bbox.y1


@pytest.mark.parametrize(("count", "width_in"), layouts(*ROOM))
def test_panels_are_of_one_size_and_low_enough_for_a_paper(count, width_in):
    figure = laid_out("common", count, width_in)
    inches = [axes.bbox.size / figure.dpi for axes in figure.axes]
    assert np.ptp(inches, axis=0) == pytest.approx(0.0, abs=1e-6)
    wide, high = inches[0]
    assert wide > 1.2
    assert high > 1.0
    assert 1.5 < figure.get_size_inches()[1] <= 2.6


def test_titles_side_by_side_have_two_lines():
    figure = laid_out("common", 4, PAGE_IN)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[0] == "$\\sigma_p$ = 0.934\n(0.385 to 1.483)"
    assert titles[1] == "$a_p$ = -6.67\n(-10.00 to -3.34)".replace("-", "\N{MINUS SIGN}")
    assert all(title.count("\n") == 1 for title in titles)
    (alone,) = laid_out("common", 1, COLUMN_IN).axes
    assert alone.get_title() == "$\\sigma_p$ = 0.934 (0.385 to 1.483)"
    opened = sheet([part_of(common()[0], slice(0, 6), upper=None), common()[1]], COLUMN_IN).axes[0]
    assert opened.get_title() == "$\\sigma_p$ = 0.934\n(0.385 to open)"


@pytest.mark.parametrize(("count", "width_in"), layouts(*(case for case in ROOM if case[0] > 1)))
def test_only_the_first_panel_has_the_height_written_out(count, width_in):
    first, *others = laid_out("common", count, width_in).axes
    assert first.get_ylabel() == "relative\nlog-likelihood [nats]"
    assert [label.get_text().replace("\N{MINUS SIGN}", "-") for label in ticks(first.yaxis)] == ["-3", "-2", "-1", "0"]
    for axes in others:
        assert (axes.get_ylabel(), ticks(axes.yaxis)) == ("", [])
        assert axes.get_ylim() == first.get_ylim()
    units = ["$\\sigma_p$ [1/m²]", "$a_p$", "$c_0$ [1/m]", "$a_g$ [1/m²]"]
    assert [axes.get_xlabel() for axes in (first, *others)] == units[:count]


def test_long_numbers_are_short_at_the_ticks():
    small, large, _, _ = laid_out("wordy", 4, PAGE_IN).axes
    assert [axes.xaxis.offsetText.get_text().replace("\N{MINUS SIGN}", "-") for axes in (small, large)] == [
        "1e-5",
        "1e4",
    ]
    assert max(len(label.get_text()) for label in ticks(large.xaxis)) <= 5


def test_panels_of_different_levels_keep_their_own_ticks():
    first, same, other = sheet([parabola(), parabola(), parabola(level=0.9)], PAGE_IN).axes
    assert ticks(first.yaxis)
    assert not ticks(same.yaxis)
    assert ticks(other.yaxis)
    assert other.get_ylim() != first.get_ylim()


@pytest.mark.parametrize(("order", "count", "width_in"), EVERY)
def test_ticks_are_few(order, count, width_in):
    most = 4 if width_in / count < 2.2 else 6
    for axes in laid_out(order, count, width_in).axes:
        assert 2 <= len(ticks(axes.xaxis)) <= most
        assert len(axes.get_yticks()) <= 6


@pytest.mark.parametrize(
    ("count", "width_in", "rows"),
    [(2, COLUMN_IN, 1), (3, COLUMN_IN, 2), (5, COLUMN_IN, 3), (4, PAGE_IN, 1), (5, PAGE_IN, 2)],
)
def test_profiles_that_do_not_fit_beside_each_other_are_in_rows(count, width_in, rows):
    figure = draw_profiles([*common(), parabola()][:count], UNITS, width_in)
    grid = figure.axes[0].get_subplotspec().get_gridspec()
    assert (grid.nrows, len(figure.axes)) == (rows, count)
    assert width_in / grid.ncols >= NARROWEST_IN
    named = [bool(axes.get_ylabel()) for axes in figure.axes]
    assert named == [number % grid.ncols == 0 for number in range(count)]


def test_the_level_is_inside_the_panel_also_near_an_end():
    for keep, side in ((slice(4, None), "left"), (slice(0, 5), "right"), (slice(None), "right")):
        (axes,) = sheet([part_of(parabola(), keep)], COLUMN_IN).axes
        (label,) = axes.texts
        box = label.get_window_extent()
        assert label.get_ha() == side
        assert axes.bbox.x0 < box.x0 < box.x1 < axes.bbox.x1


def test_a_level_is_not_rounded_to_certainty():
    assert [drawn(parabola(level=level)).texts[0].get_text() for level in (0.9999, 0.6827)] == ["99.99 %", "68.27 %"]


@pytest.fixture(scope="module")
def content():
    """A reward file's content with one profile, forged: what the reward is does not matter here."""
    scene = make.scene_on(make.open_grid(8, 5), [0, 2], [7, 2], [[0.4, 0.3]])
    some = make.by_participants(scene, Reward((-32.0, -4.0, -4.0, 3.0)), 2, 3, seed=1)
    return reward_document(fit(evidence_of(some), Reward.named({})), some, [], 0.1, Analyses(profiles=(parabola(),)))


@pytest.fixture
def plot(tmp_path, content):
    """Run ``navirl plot profile`` on a file with these profiles."""

    def run(profiles, *options):
        documents = [profile_document(one) for one in profiles]
        write_json(tmp_path / "reward.json", "reward", {**content, "profiles": documents}, force=True)
        words = ["plot", "profile", str(tmp_path / "reward.json"), "-o", str(tmp_path / "x.png"), "--force", *options]
        result = CliRunner().invoke(cli, words)
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        assert (tmp_path / "x.png").exists() == (result.exit_code == 0)
        return result

    return run


@pytest.mark.parametrize("level", layouts(1e-4, 0.9999, 0.5, 0.95))
def test_levels_that_can_be_drawn_are(plot, level):
    assert plot([replace(parabola(), level=level)]).exit_code == 0


@pytest.mark.parametrize("level", [0.0, -0.5, 0.99991, 0.9999999999999999, 1.0, 95.0])
def test_levels_without_an_interval_are_refused_by_the_schema(plot, level):
    result = plot([replace(parabola(), level=level)])
    assert result.exit_code == 1
    expected = "more than 0" if level <= 0 else "0.9999 or less"
    assert f"reward at profiles/0/level: expected {expected}, found {level}\n" in result.stderr


def test_the_command_draws_all_profiles_or_those_named(plot):
    assert plot(common()).exit_code == 0
    assert plot(common(), "--wide").exit_code == 0
    name = common()[2].name
    assert plot(common(), "--parameter", name, "--parameter", common()[0].name).exit_code == 0
    assert [one.name for one in chosen_profiles(common(), [name])] == [name]
    assert [one.name for one in chosen_profiles(common(), [])] == [one.name for one in common()]
    with pytest.raises(
        ArtefactError, match="`parameter`: expected 'sigma_p', found 'mass'; fit again with `profile` for others"
    ):
        chosen_profiles(common()[:1], ["mass"])
    assert plot(common()[:2]).exit_code == 0


@pytest.mark.parametrize(
    ("name", "symbol"),
    [
        ("c0", "$c_0$"),
        ("a_g", "$a_g$"),
        ("sigma_p", r"$\sigma_p$"),
        ("sigma_before", r"$\sigma_{\mathrm{before}}$"),
        ("a_turn", r"$a_{\mathrm{turn}}$"),
        ("w", "$w$"),
        ("my_own_weight", "my_own_weight"),
        ("weight", "weight"),
    ],
)
def test_parameters_have_symbols(name, symbol):
    assert symbol_of(name) == symbol
