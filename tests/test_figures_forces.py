"""The figure of a trial's forces: arrows to scale along the path, and forces over time with contacts."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from figure_checks import assert_no_overlap
from figure_factory import demonstration
from matplotlib.colors import to_hex

from navirl_cli.demos.demonstration import Condition, Contact
from navirl_cli.errors import DemonstrationError
from navirl_cli.figures.forces import draw_forces
from navirl_cli.figures.layout import settle
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLOURS, COLUMN_IN, PAGE_IN


def pushed(spans=((2.0, 4.0), (7.0, 8.0)), force_n=(-3.0, 12.0)):
    """A trial in which the person pushes with one force in some intervals."""
    one = demonstration(Condition.FORCE, 2)
    forces = np.zeros((101, 2))
    for start, end in spans:
        forces[(one.t_s >= start) & (one.t_s <= end)] = force_n
    impulses = [tuple(np.array(force_n) * (end - start)) for start, end in spans]
    contacts = tuple(Contact(*span, 12.37, impulse) for span, impulse in zip(spans, impulses, strict=True))
    return replace(one, force_n=forces, contacts=contacts, id="p01/3")


def drawn_of(one, width_in=COLUMN_IN, *, crop=False):
    figure, axes = new_figure(width_in, panels=2, columns=1)
    return figure, draw_forces(axes, one, crop=crop)


@cache
def both():
    return pushed(), *drawn_of(pushed())


def test_arrows_start_on_the_path_in_contact_and_are_the_force_to_scale():
    one, _, drawn = both()
    tails = np.asarray(drawn.arrows.get_offsets())
    poses = [int(np.argmin(np.hypot(*(one.xy_m - tail).T))) for tail in tails]
    np.testing.assert_allclose(tails, one.xy_m[poses])
    assert all(2.0 <= t <= 4.0 or 7.0 <= t <= 8.0 for t in one.t_s[poses])
    arrows_m = np.stack([drawn.arrows.U, drawn.arrows.V], axis=1)
    np.testing.assert_allclose(arrows_m, drawn.metres_per_newton * one.force_n[poses])
    assert (drawn.arrows.scale, drawn.arrows.scale_units, drawn.arrows.angles) == (1.0, "xy", "xy")
    apart = np.hypot(*np.diff(tails, axis=0).T) / 8.0 * COLUMN_IN  # the map is 8 m wide
    assert apart.min() > 0.069
    assert to_hex(drawn.arrows.get_facecolor()[0]) == COLOURS["force, cycle 2"].lower()


def test_an_arrow_of_a_round_force_shows_the_scale():
    _, _, drawn = both()
    (reference,) = [one for one in drawn.map.axes.collections if one is not drawn.arrows]
    assert drawn.reference_n == 10.0
    assert (reference.U[0], reference.V[0]) == (pytest.approx(10.0 * drawn.metres_per_newton), 0.0)
    assert {text.get_text() for text in drawn.map.axes.texts} == {"1 m", "10 N"}


@pytest.mark.parametrize(("force_n", "expected"), [((0.0, 3.0), 1.0), ((300.0, 0.0), 100.0), ((0.0, 79.0), 10.0)])
def test_the_round_force_fits_the_trial(force_n, expected):
    assert drawn_of(pushed(force_n=force_n))[1].reference_n == expected


def test_components_and_size_are_drawn_over_time_with_units():
    one, _, drawn = both()
    for line, values in zip(drawn.components, one.force_n.T, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), np.stack([one.t_s, values], axis=1))
    np.testing.assert_allclose(drawn.size.get_ydata(), np.hypot(*one.force_n.T))
    assert drawn.over_time.get_xlabel() == "time since start of trial [s]"
    assert drawn.over_time.get_ylabel() == "force [N]"
    assert drawn.over_time.get_xlim() == (0.0, 10.0)
    assert drawn.size.get_color() == COLOURS["force, cycle 2"]
    assert drawn.map.axes.get_title() == "p01/3: force, cycle 2"
    names = {text.get_text() for text in drawn.legend.get_texts()}
    shown = {"force along x (map)", "force along y (map)", "magnitude of force", "contact (peak, impulse)"}
    assert names == shown | {"start", "goal", "robot", "person", "obstacle, inflated"}


def test_contacts_are_shaded_from_start_to_end_and_named_above_the_curves():
    _, _, drawn = both()
    spans = [(box.get_x(), box.get_x() + box.get_width()) for box in drawn.contacts]
    np.testing.assert_allclose(spans, [(2.0, 4.0), (7.0, 8.0)])
    size = np.hypot(3.0, 12.0)
    assert [number.get_text() for number in drawn.numbers] == [
        f"12.4 N\n{seconds * size:.1f} N s" for seconds in (2, 1)
    ]
    assert [number.xy[0] for number in drawn.numbers] == [3.0, 7.5]
    assert min(number.xy[1] for number in drawn.numbers) > size
    assert drawn.over_time.get_ylim()[1] > max(number.xy[1] for number in drawn.numbers)


def test_without_measured_times_no_impulse_is_named():
    _, drawn = drawn_of(replace(pushed(), laid_out_m_s=0.4))
    assert [number.get_text() for number in drawn.numbers] == ["12.4 N"] * 2
    assert drawn.over_time.get_xlabel() == "time, laid out at 0.4 m/s [s]"
    assert "contact (peak)" in {text.get_text() for text in drawn.legend.get_texts()}


@pytest.mark.parametrize(
    ("width_in", "spans"),
    [
        (COLUMN_IN, ((0.0, 0.4), (0.5, 0.9), (1.0, 1.4), (1.5, 1.9), (9.6, 10.0))),
        (PAGE_IN, ((2.0, 4.0), (9.6, 10.0))),
    ],
)
def test_no_texts_overlap_with_contacts_near_each_other_and_both_panels_are_equally_wide(width_in, spans):
    figure, drawn = drawn_of(pushed(spans), width_in)
    settle(figure)
    assert_no_overlap(figure)
    widths = [part.get_window_extent().width for part in (drawn.map.axes, drawn.over_time)]
    assert widths[0] == pytest.approx(widths[1], rel=0.02)
    assert widths[0] > 0.8 * figure.bbox.width


def test_a_cropped_map_holds_path_and_arrows():
    one = pushed(force_n=(0.0, -12.0))
    _, drawn = drawn_of(one, crop=True)
    tips = np.asarray(drawn.arrows.get_offsets()) + np.stack([drawn.arrows.U, drawn.arrows.V], axis=1)
    low, high = drawn.map.axes.get_ylim()
    assert low < tips[:, 1].min()
    assert high - low < 3.0  # the whole is 4 m high


def test_a_trial_without_contact_has_an_axis_of_5_newtons():
    noise = np.random.default_rng(0).normal(0, 0.05, (101, 2))
    one = replace(demonstration(Condition.JOYSTICK), force_n=noise, contacts=())
    _, drawn = drawn_of(one)
    assert drawn.arrows is None
    assert drawn.contacts == drawn.numbers == []
    assert drawn.over_time.get_ylim()[1] == 5.0
    assert not any("contact" in text.get_text() for text in drawn.legend.get_texts())
    assert {text.get_text() for text in drawn.map.axes.texts} == {"1 m"}


def test_a_trial_without_a_wrench_is_refused():
    for unknown in (replace(pushed(), force_n=None), replace(pushed(), contacts=None)):
        with pytest.raises(
            DemonstrationError,
            match=r"^demonstration p01/3: no forces to draw, because its log holds no wrench; choose another with `",
        ):
            drawn_of(unknown)
