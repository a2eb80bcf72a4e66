"""Figures for light, dark, wide and narrow screens, and figures of several panels with one legend."""

from functools import partial

import numpy as np
import pytest
from figure_factory import PUBLISHED, demonstration, scene_and_visits
from matplotlib.colors import to_hex
from PIL import Image

from navirl_cli.evaluation.metrics import PAPER_METRICS
from navirl_cli.evaluation.ranks import GroupRanks, Rank
from navirl_cli.figures.answers import draw_answers
from navirl_cli.figures.layout import settle, settle_like
from navirl_cli.figures.plan import draw_plans
from navirl_cli.figures.properties import PropertyBar
from navirl_cli.figures.ranks import draw_rank_panels, rank_layout
from navirl_cli.figures.report import draw_conditions, draw_property_panels, draw_scenes
from navirl_cli.figures.screens import NARROW_DPI, Drawing, save_for_screens
from navirl_cli.figures.sheet import new_figure
from navirl_cli.figures.style import COLUMN_IN, DPI, LOOKS, PAGE_IN, styled
from navirl_cli.figures.times import draw_completion_times
from navirl_cli.irl.solved import SolvedScene
from navirl_cli.planning.paths import Planner
from navirl_cli.planning.problem import problem_of
from navirl_cli.study.questionnaire import Shares


def conditions():
    return [(name, [demonstration(aside_m=aside)]) for name, aside in (("up", 0.5), ("down", -0.5), ("far", 0.9))]


def scenes():
    one, visits = scene_and_visits()
    return [(name, SolvedScene(one, visits, PUBLISHED.by_cell(one))) for name in ("first", "second")]


def bars():
    values = {metric.name: value for metric, value in zip(PAPER_METRICS, (6.5, 0.5, 2.0), strict=True)}
    return [PropertyBar(f"force, cycle {n}", f"force, cycle {n}", values, values, 12) for n in (1, 2)]


DRAWN = {
    "paths": partial(draw_conditions, conditions()),
    "policies": lambda width_in: draw_scenes(scenes()[:1], 0.3, width_in),
    "properties": partial(draw_property_panels, bars()),
}


def test_every_screen_has_a_figure_that_is_as_wide_as_it_says(tmp_path):
    page = tmp_path / "page"
    page.mkdir()
    files = save_for_screens(Drawing(DRAWN["properties"]), "a", tmp_path, page, formats=("png", "pdf"))
    assert {name: path.relative_to(tmp_path).as_posix() for name, path in files.items()} == {
        "a": "a.png",
        "a_dark": "page/a_dark.png",
        "a_narrow": "page/a_narrow.png",
        "a_narrow_dark": "page/a_narrow_dark.png",
    }
    assert {path.name for path in tmp_path.iterdir()} == {"a.png", "a.pdf", "page"}
    sizes, corners = {}, {}
    for name, path in files.items():
        with Image.open(path) as image:
            sizes[name], corners[name] = image.size, to_hex(np.array(image.getpixel((0, 0))) / 255)
    assert sizes["a"] == sizes["a_dark"]
    assert sizes["a_narrow"] == sizes["a_narrow_dark"]
    assert (sizes["a"][0], sizes["a_narrow"][0]) == (int(PAGE_IN * DPI), int(COLUMN_IN * NARROW_DPI))
    assert corners == {name: LOOKS["dark" if "dark" in name else "paper"].paper.lower() for name in files}


def test_a_figure_of_a_column_is_narrow_already(tmp_path):
    assert set(save_for_screens(Drawing(DRAWN["properties"], COLUMN_IN), "a", tmp_path)) == {"a", "a_dark"}


@pytest.mark.parametrize("name", DRAWN)
def test_panels_are_stacked_on_narrow_screens_and_dark_figures_have_the_same_layout(name):
    wide, narrow = (DRAWN[name](width_in)[0] for width_in in (PAGE_IN, COLUMN_IN))
    assert wide.axes[0].get_subplotspec().get_gridspec().ncols > 1
    assert narrow.axes[0].get_subplotspec().get_gridspec().ncols == 1
    settle(narrow)
    with styled("dark", dpi=300):
        dark = DRAWN[name](COLUMN_IN)[0]
        settle_like(dark, narrow)
    assert dark.get_layout_engine() is None
    assert dark.get_size_inches().tolist() == narrow.get_size_inches().tolist()
    for one, other in zip(dark.axes, narrow.axes, strict=True):
        assert one.get_tightbbox().extents == pytest.approx(other.get_tightbbox().extents, abs=0.6)
        assert one.xaxis.label.get_color() == LOOKS["dark"].ink
    assert [text.get_text() for text in dark.texts] == [text.get_text() for text in narrow.texts]


def test_stacked_properties_name_their_bars_in_every_panel():
    panels = draw_property_panels(bars(), COLUMN_IN)[0].axes
    expected = ["force, cycle\N{NO-BREAK SPACE}1\n(n\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}12)"]
    for panel in panels:
        labels = [label.get_text() for label in panel.get_yticklabels()]
        assert len(labels) == 2
        assert labels[0].replace("\n", " ") == expected[0].replace("\n", " ")
    beside = draw_property_panels(bars(), PAGE_IN)[0].axes
    assert [[bool(label.get_text()) for label in panel.get_yticklabels()] for panel in beside] == [
        [True, True],
        [False, False],
        [False, False],
    ]


def test_lines_of_dark_times_and_answers_are_light():
    with styled("dark"):
        times = draw_completion_times(new_figure()[1][0], {"force": (18.0, 19.0, 25.0)})
        answers = draw_answers(new_figure()[1][0], [Shares("safe", "force", np.array([1, 2, 3, 4, 5]))])
    ink = LOOKS["dark"].ink.lower()
    assert {to_hex(line.get_color()) for line in (*times.medians, *times.whiskers)} == {ink}
    assert to_hex(times.dots[0].get_markeredgecolor()) == to_hex(times.boxes[0].get_edgecolor()) == ink
    assert to_hex(times.dots[0].get_markerfacecolor()) == LOOKS["dark"].paper.lower()
    assert to_hex(answers.levels[0][0].get_edgecolor()) == to_hex(answers.axes.lines[0].get_color()) == ink


def test_robots_on_colours_have_a_border_of_the_background_s_colour():
    with styled("dark"):
        figure, _ = draw_scenes(scenes()[:1], 0.3, PAGE_IN)
    robots = [patch for axes in figure.axes for patch in axes.patches if getattr(patch, "radius", 0) == 0.3]
    assert len(robots) == 2
    for robot in robots:
        (halo,) = robot.get_path_effects()
        assert halo._gc["foreground"] == LOOKS["dark"].paper


def test_ranks_of_several_groups_have_one_legend():
    ranks = tuple(Rank("a", "g", -1.0, at, at, at, None) for at in (0.1, 0.4, 0.7))
    layout = rank_layout(3, COLUMN_IN)
    figure, axes = new_figure(COLUMN_IN, layout["height_in"], layout["panels"], layout["columns"])
    draw_rank_panels(axes, [GroupRanks(name, None, ranks) for name in "abc"])
    assert [panel.get_legend() for panel in axes] == [None, None, None]
    assert len(figure.legends) == 1
    (alone,) = new_figure(COLUMN_IN)[1]
    draw_rank_panels([alone], [GroupRanks("a", None, ranks)])
    assert alone.get_legend() is not None


def test_plans_of_several_scenes_share_colours_and_legend(tmp_path):
    one = demonstration()
    planner = Planner(problem_of(one), PUBLISHED)
    plans = [(f"scene {n}", planner, [one.xy_m]) for n in range(3)]
    drawn = draw_plans(tmp_path / "paths.png", plans, force=False)
    figure = drawn[0].axes.figure
    assert len({one.colour_bar for one in drawn}) == 1
    assert len({one.image.get_clim() for one in drawn}) == 1
    legends = [axes.get_legend() for axes in figure.axes if axes.get_legend() is not None]
    assert len(legends) + len(figure.legends) == 1
    names = [text.get_text() for text in legends[0].get_texts()]
    assert names == ["planned", "nominal path", "start", "goal", "robot", "person", "obstacle, inflated"]
    alone = draw_plans(tmp_path / "path.png", plans[:1], force=False)
    assert alone[0].axes.get_legend() is not None
