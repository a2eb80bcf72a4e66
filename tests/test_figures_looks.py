"""Looks of a figure on paper and on screens: inks, hues that stay, resolution, and sizes that do not change."""

from colorsys import rgb_to_hls
from itertools import combinations

import numpy as np
import pytest
from figure_checks import SIGHTS, lab
from figure_factory import PUBLISHED, demonstration, one_axes, scene, scene_and_visits
from matplotlib.colors import to_hex, to_rgb
from PIL import Image

from navirl_cli.figures.cells import draw_policy, draw_reward
from navirl_cli.figures.layout import settle
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.sheet import new_figure, save_figure
from navirl_cli.figures.style import COLOURS, COLUMN_IN, DARK_COLOURS, DPI, LOOKS, colour_of, look, styled

#: Least contrast of what is no text to its ground (WCAG 2.1, 1.4.11), and of text (1.4.3).
GRAPHICS, TEXT = 3.0, 4.5
GREYS = {"driven", "driven, on grid", "nominal"}


def luminance(colour):
    rgb = np.array(to_rgb(colour))
    return float(np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) @ (0.2126, 0.7152, 0.0722))


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_colours_keep_their_hue_in_the_dark_and_are_visible():
    assert set(DARK_COLOURS) == set(COLOURS)
    for key, colour in DARK_COLOURS.items():
        assert contrast(colour, LOOKS["dark"].paper) > GRAPHICS, key
        if key not in GREYS:
            hues = [360 * rgb_to_hls(*to_rgb(one))[0] for one in (colour, COLOURS[key])]
            assert abs(hues[0] - hues[1]) < 8, key


def test_groups_are_distinct_in_the_dark_for_every_colour_vision():
    groups = ["force, cycle 1", "force, cycle 2", "force, later cycles", "joystick", "autonomous", "learnt"]
    for one, other in combinations(groups, 2):
        for sight, matrix in SIGHTS.items():
            apart = np.linalg.norm(lab(DARK_COLOURS[one], matrix) - lab(DARK_COLOURS[other], matrix))
            assert apart > 18, (one, other, sight)


def test_special_sets_are_distinct_from_the_main_groups_for_every_colour_vision():
    for colours in (COLOURS, DARK_COLOURS):
        for other in ("force, cycle 1", "force, cycle 2", "force, later cycles", "joystick", "autonomous"):
            for sight, matrix in SIGHTS.items():
                apart = np.linalg.norm(lab(colours["set 1"], matrix) - lab(colours[other], matrix))
                assert apart > 18, (other, sight)


def test_letters_of_ieee_papers_are_drawn_on_request():
    with styled("paper", "times"):
        figure, (axes,) = new_figure(COLUMN_IN, 2.0)
        axes.set_xlabel("force\n[N]")
        axes.set_ylabel(r"$\sigma_p$", parse_math=True)
        settle(figure, trim=False)
        assert axes.xaxis.label.get_fontname() == "STIXGeneral"
        assert axes.xaxis.label._linespacing < 1.0, "its lines are high"
    assert one_axes().xaxis.label.get_fontname() == "DejaVu Sans"


def test_letters_are_legible_in_every_look():
    for name, one in LOOKS.items():
        assert contrast(one.ink, one.paper) > 2 * TEXT, name
        assert contrast(one.ink, one.obstacle) > TEXT, name  # a scale bar may stand on an obstacle


def test_a_look_lasts_as_long_as_its_context():
    with styled("dark"):
        assert look() is LOOKS["dark"]
        assert colour_of("joystick") == DARK_COLOURS["joystick"]
        assert colour_of("force, cycle 5") == DARK_COLOURS["force, later cycles"]
        assert colour_of("force, cycle 5, obstacle course") == DARK_COLOURS["set 1"]
    assert look() is LOOKS["paper"]
    assert colour_of("joystick") == COLOURS["joystick"]
    with pytest.raises(RuntimeError), styled("dark"):
        raise RuntimeError
    assert look() is LOOKS["paper"]


def test_paths_are_drawn_light_on_near_black():
    with styled("dark"):
        drawn = draw_paths(one_axes(), [demonstration()], title="paths")
        dark = LOOKS["dark"]
        assert to_hex(drawn.axes.figure.get_facecolor()) == to_hex(drawn.axes.get_facecolor()) == dark.paper
        assert drawn.lines[0].get_color() == DARK_COLOURS["force"]
        inked = [drawn.axes.title, drawn.axes.xaxis.label, *drawn.axes.get_legend().get_texts()]
        inked += drawn.axes.get_xticklabels()
        assert {to_hex(text.get_color()) for text in inked} == {dark.ink.lower()}
        assert {to_hex(one.get_edgecolor()) for one in (*drawn.people, *drawn.robots)} == {dark.ink.lower()}
        (image,) = drawn.obstacles
        assert to_hex(image.to_rgba(image.get_array())[0, 0]) == dark.obstacle
        assert to_hex(drawn.axes.spines["left"].get_edgecolor()) == dark.ink.lower()


def test_unlikely_cells_have_the_background_s_colour_and_likely_ones_stand_out():
    for name, one in LOOKS.items():
        with styled(name):
            image = draw_policy(one_axes(), *scene_and_visits()).image
            shades = [to_hex(image.to_rgba(np.ma.array([value]))[0]) for value in (1e-5, 2e-3, 0.03, 0.9)]
        assert shades[0] == one.paper.lower()
        apart = [contrast(shade, one.paper) for shade in shades]
        assert apart == sorted(apart)


def test_people_on_colours_have_a_border_of_the_background_s_colour():
    with styled("dark"):
        (person,) = draw_reward(one_axes(), scene(), PUBLISHED.by_cell(scene())).people
    (halo,) = person.get_path_effects()
    assert to_hex(person.get_edgecolor()) == LOOKS["dark"].ink.lower()
    assert halo._gc["foreground"] == LOOKS["dark"].paper


@pytest.mark.parametrize(("name", "times"), [("paper", 1), ("screen", 2), ("dark", 2)])
def test_screens_have_twice_the_pixels_of_the_same_size(tmp_path, name, times):
    with styled(name):
        figure, (axes,) = new_figure(COLUMN_IN, 1.0)
        axes.set_xlabel("x [m]")
        save_figure(figure, tmp_path / "a.png", trim=False)
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (COLUMN_IN * DPI * times, DPI * times)
        assert to_hex(np.array(image.convert("RGB").getpixel((0, 0))) / 255) == LOOKS[name].paper.lower()
    assert tuple(figure.get_size_inches()) == (COLUMN_IN, 1.0)


def test_fonts_are_embedded_as_outlines_and_cells_as_one_image(tmp_path):
    with styled("dark"):
        figure, (axes,) = new_figure(COLUMN_IN, 3.0)
        draw_policy(axes, *scene_and_visits(), robot_radius_m=0.3, title="policy")
        save_figure(figure, tmp_path / "a.pdf", trim=False)
    page = (tmp_path / "a.pdf").read_bytes()
    assert b"/Type3" not in page
    assert b"/FontFile2" in page
    assert 1 <= page.count(b"/Subtype /Image") <= 8  # cells, obstacles and colour bar, each with its mask
    assert len(page) < 100_000
