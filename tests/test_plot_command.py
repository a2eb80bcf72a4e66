"""``navirl plot``: help, options of every figure, and refusals in one line."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from figure_factory import demonstration, one_axes, scene
from PIL import Image

from navirl_cli.artefacts.demonstrations import demonstrations_document
from navirl_cli.artefacts.rewards import reward_document
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.plot import FIGURES, plot
from navirl_cli.commands.plot.page import FONTS, FORMATS, STYLES
from navirl_cli.demos.demonstration import Condition
from navirl_cli.figures import sheet, style
from navirl_cli.figures.cells import draw_policy
from navirl_cli.figures.style import LOOKS
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.reward import Reward

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Demonstrations of one scene and what was learnt from them; few cells, for speed."""
    folder = tmp_path_factory.mktemp("plot")
    ones = [
        replace(demonstration(Condition.FORCE, 1, 0.5, contacts=[(2.0, 4.0)]), id="p01/1"),
        replace(demonstration(Condition.JOYSTICK, None, -0.5, people_m=[(0.0, 0.6)]), id="p01/2"),
    ]
    write_json(folder / "demos.json", "demonstrations", demonstrations_document(ones, [], {}), force=False)
    found = fit(evidence_of(ones), Reward.named({}), scan=False)
    document = reward_document(found, ones, [], 0.1)
    for parameter, value in zip(document["parameters"], (-20.0, -0.9, -4.9, 1.7), strict=True):
        parameter["value"] = value  # two paths alike would make a policy that knows but one
    write_json(folder / "reward.json", "reward", document, force=False)
    return folder


@pytest.fixture
def figure_of(navirl, monkeypatch):
    """Run ``navirl plot`` and give the figure in place of drawing its file."""

    def run(*words):
        saved = []
        monkeypatch.setattr(sheet, "save_figure", lambda figure, *_, **__: saved.append(figure) or [])
        assert navirl("plot", *words, "-o", "a.png").stdout == "a.png\n"
        return saved[0]

    return run


def entries(figure):
    """Texts of all legends."""
    legends = [panel.get_legend() for panel in figure.axes if panel.get_legend()] + figure.legends
    return [text.get_text() for legend in legends for text in legend.get_texts()]


@pytest.mark.parametrize("name", FIGURES)
def test_the_help_lists_each_figure_as_it_describes_itself(navirl, name):
    summary = FIGURES[name][1]
    assert plot.get_command(None, name).help.splitlines()[0] == summary
    assert f"{name} {summary}" in " ".join(navirl("plot", "--help").stdout.split())


def test_the_help_imports_nothing_heavy():
    code = "import sys; from navirl_cli.cli import cli; cli(sys.argv[1:], standalone_mode=False); print(*sys.modules)"
    words = [sys.executable, "-c", code, "plot", "--help"]
    modules = set(subprocess.run(words, capture_output=True, text=True, check=True).stdout.split())
    assert "navirl_cli.commands.plot" in modules
    assert not {"numpy", "scipy", "matplotlib", "jsonschema"} & modules


def test_an_unknown_figure_is_answered_with_the_known_ones(navirl):
    assert "command: expected one of 'paths', 'policy', 'reward'" in navirl("plot", "heat", code=2).stderr


def test_a_figure_for_a_screen_has_twice_the_pixels_in_the_dark(navirl, files):
    navirl("plot", "paths", files / "demos.json", "--style", "dark", "-o", "a.png")
    with Image.open("a.png") as image:
        assert image.size[0] == 2100
        assert image.getpixel((0, 0))[:3] == (20, 20, 20)


def test_a_figure_for_a_page_is_a_page_wide_with_outlines_of_letters(navirl, files):
    navirl("plot", "paths", files / "demos.json", "--wide", "--crop", "-o", "a.pdf")
    page = Path("a.pdf").read_bytes()
    assert b"/Type3" not in page
    assert b"/MediaBox [ 0 0 515.52 " in page  # 7.16 in


def test_every_map_can_be_cropped_and_shows_the_same(files, figure_of):
    learnt = (files / "demos.json", "--reward", files / "reward.json")
    windows = {}
    for kind in ("policy", "reward", "value", "actions"):
        axes = figure_of(kind, *learnt, "--crop", "--overlay", "demos").axes[0]
        windows[kind] = (*axes.get_xlim(), *axes.get_ylim())
        assert "force, cycle 1 (n = 1)" in entries(axes.figure)
    assert len(set(windows.values())) == 1
    whole = figure_of("policy", *learnt).axes[0]
    assert np.ptp(whole.get_ylim()) > np.ptp(windows["policy"][2:])
    assert figure_of("paths", files / "demos.json", "--wide").get_size_inches()[0] == 7.16


def test_paths_over_a_map_are_those_of_its_scene_and_repeat_with_the_seed(files, figure_of):
    words = ("policy", files / "demos.json", "--reward", files / "reward.json")
    both = ("--overlay", "demos", "--overlay", "samples", "--samples", "7")
    paths = []
    for seed in (1, 1, 2):
        figure = figure_of(*words, *both, "--seed", seed)
        shown = entries(figure)
        assert shown[:2] == ["force, cycle 1 (n = 1)", "sampled from the policy (n = 7)"]  # the other has another scene
        drawn = [line for line in figure.axes[0].lines if line.get_color() == "#CC79A7"]
        paths.append([line.get_xydata().tolist() for line in drawn])
        assert len(paths[-1]) == 7
    assert paths[0] == paths[1] != paths[2]


def test_wrong_outputs_are_refused_before_any_work(navirl, files, tmp_path):
    for name in ("a.gif", "a", "a.svg.gz"):
        message = (
            f"Invalid value for '-o' / '--output': expected a name that ends in .png, .pdf or .svg, found '{name}'"
        )
        assert message in navirl("plot", "paths", "none.json", "-o", name, code=2).stderr
    words = ("policy", "none.json", "--reward", "none.json", "-o", "no/a.png")
    assert "no/a.png: expected an existing folder" in navirl("plot", *words, code=1).stderr
    assert (
        "'paper', 'screen', 'dark'"
        in navirl("plot", "paths", files / "demos.json", "-o", "a.png", "--style", "loud", code=2).stderr
    )
    assert list(tmp_path.iterdir()) == []
    assert json.loads((files / "reward.json").read_text())["format"] == "navirl/reward"


def test_the_options_offer_all_styles_and_formats():
    assert list(STYLES) == list(LOOKS)
    assert list(FORMATS) == [f".{extension}" for extension in sheet.METADATA]


@pytest.mark.parametrize(("kind", "label"), [("value", "soft value [nats]"), ("actions", "most likely move")])
def test_values_and_moves_are_those_of_the_chosen_trial(files, figure_of, kind, label):
    words = (kind, files / "demos.json", "--reward", files / "reward.json", "--trial", "p01/2")
    (map_axes,) = figure_of(*words, "--overlay", "demos").axes
    assert "joystick (n = 1)" in entries(map_axes.figure)
    (bar,) = map_axes.child_axes
    assert label in (bar.get_ylabel() + bar.get_xlabel()).replace("\n", " ")


def test_forces_are_drawn_and_a_trial_without_forces_is_refused(navirl, files, figure_of):
    document = json.loads((files / "demos.json").read_text())
    count = len(document["demonstrations"][0]["t_s"])
    document["demonstrations"][0] |= {"force_x_n": [0.0] * count, "force_y_n": [9.0] * count}
    Path("forced.json").write_text(json.dumps(document))
    assert figure_of("forces", "forced.json").axes[0].get_title() == "p01/1: force, cycle 1"
    message = navirl("plot", "forces", "forced.json", "--trial", "p01/2", "-o", "b.png", code=1).stderr
    assert (
        "demonstration p01/2: no forces to draw, because its log holds no wrench; choose another with --trial"
        in message
    )


def test_convergence_is_that_of_the_file(files, figure_of):
    kept = json.loads((files / "reward.json").read_text())["search"]
    assert len(kept["log_likelihood"]) == len(kept["theta"]) > 1
    figure = figure_of("convergence", files / "reward.json")
    drawn = [panel.lines[0].get_ydata().tolist() for panel in figure.axes]
    assert drawn == [kept["log_likelihood"], *map(list, zip(*kept["theta"], strict=True))]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda content: content.pop("search"),
            "reward.json: expected iterations of a fit, found none; fit again with this version",
        ),
        (lambda content: content["search"]["theta"].pop(), "search/theta: expected"),
        (lambda content: content["search"]["theta"][0].pop(), "rows of 4 numbers, as search/log_likelihood"),
        (lambda content: content["search"].pop("theta"), "breaks the schema of navirl reward at search"),
        (lambda content: content["search"].update(log_likelihood=[]), "breaks the schema of navirl reward at search"),
    ],
)
def test_a_file_without_valid_iterations_is_refused(navirl, files, change, message):
    content = json.loads((files / "reward.json").read_text())
    change(content)
    Path("reward.json").write_text(json.dumps(content))
    assert message in navirl("plot", "convergence", "reward.json", "-o", "a.png", code=1).stderr


def test_ranks_are_those_of_the_chosen_groups(navirl, files, figure_of):
    content = json.loads((files / "reward.json").read_text())
    Path("force.json").write_text(json.dumps({**content, "demonstrations": ["p01/1"], "groups": ["force, cycle 1"]}))
    words = ("ranks", files / "demos.json", "--reward", "force.json", "--samples", "50")
    (learnt,) = figure_of(*words).axes
    assert learnt.get_title().startswith("force, cycle 1\nn = 1, p "), "the joystick was not learnt from"
    (other,) = figure_of(*words, "--group", "joystick").axes
    assert other.get_title().startswith("joystick\nn = 1, p ")
    both = figure_of(*words, "--group", "joystick", "--group", "force, cycle 1").axes
    assert [one.get_title().split("\n")[0] for one in both] == ["joystick", "force, cycle 1"]
    assert both[0].get_position().y0 > both[1].get_position().y1, "in a narrow page below each other"
    message = navirl("plot", *words, "--group", "joystik", "-o", "c.svg", code=1).stderr
    assert "--group: expected one of 'force, cycle 1', 'joystick', found 'joystik'; did you mean 'joystick'?" in message


def test_two_rewards_or_two_groups_are_side_by_side(files, figure_of):
    words, one = ("compare", files / "demos.json"), ("--reward", files / "reward.json")
    Path("other.json").write_text((files / "reward.json").read_text())
    figure = figure_of(*words, *one, "--reward", "other.json", "--trial", "p01/2", "--crop")
    assert [panel.get_title(loc="left") for panel in figure.axes[:4]] == ["reward", "", "other", ""]
    assert len({(*panel.get_xlim(), *panel.get_ylim()) for panel in figure.axes[:4]}) == 1
    figure = figure_of(*words, *one, *one)  # equal names are shown with their folders
    assert figure.axes[0].get_title(loc="left").replace("\n", "") == str(files / "reward.json")
    figure = figure_of(*words, "--group", "joystick", "--group", "force, cycle 1")
    titles = [" ".join(panel.get_title().split()) for panel in figure.axes]
    assert titles == ["joystick (n = 1)", "force, cycle 1 (n = 1)"]


def test_what_cannot_be_compared_is_refused(navirl, files):
    words, one = ("plot", "compare", files / "demos.json", "-o", "c.png"), ("--reward", files / "reward.json")
    needs = "compare needs two or more --reward, or two or more --group"
    for wrong in ((), one, ("--group", "joystick"), (*one, *one, "--group", "joystick")):
        assert needs in navirl(*words, *wrong, code=2).stderr
    both = ("--group", "joystick", "--group", "force, cycle 1", "--trial", "p01/1")
    assert "--trial selects the scene of --reward" in navirl(*words, *both, code=2).stderr
    assert "found 'x'" in navirl(*words, "--group", "x", "--group", "y", code=1).stderr


def test_options_that_would_change_nothing_are_refused(navirl, files):
    learnt = (files / "demos.json", "--reward", files / "reward.json", "-o", "a.png")
    for option in ("--samples", "--seed"):
        answer = navirl("plot", "policy", *learnt, "--overlay", "demos", option, "3", code=2).stderr
        assert f"Error: {option} goes with --overlay samples." in answer
        answer = navirl("plot", "properties", files / "demos.json", "-o", "a.png", option, "3", code=2).stderr
        assert f"Error: {option} goes with --reward." in answer


def test_properties_can_be_bars_and_letters_those_of_ieee(files, figure_of):
    words = ("properties", files / "demos.json")
    assert not figure_of(*words).axes[0].containers
    figure = figure_of(*words, "--bars", "--font", "times")
    assert len(figure.axes[0].patches) == 2
    assert figure.axes[0].xaxis.label.get_fontname() == "STIXGeneral"


def test_more_than_forty_paths_have_a_map_for_each_group(figure_of):
    ones = [
        replace(demonstration(condition, cycle, 0.02 * n), id=f"p01/{condition}{cycle}{n}")
        for condition, cycle in ((Condition.FORCE, 1), (Condition.FORCE, 2), (Condition.JOYSTICK, None))
        for n in range(14)
    ]
    write_json(Path("many.json"), "demonstrations", demonstrations_document(ones, [], {}), force=False)
    figure = figure_of("paths", "many.json")
    assert [panel.get_title().replace("\N{NO-BREAK SPACE}", " ").replace("\n", " ") for panel in figure.axes[:3]] == [
        "force, cycle 1 (n = 14)",
        "force, cycle 2 (n = 14)",
        "joystick (n = 14)",
    ]
    assert not [text for text in entries(figure) if "force" in text], "titles name the groups"
    (alone,) = figure_of("paths", "many.json", "--together").axes
    paths = [line for line in alone.lines if len(line.get_xdata()) > 50]
    assert len(paths) == 42
    assert max(line.get_linewidth() for line in paths) < 0.5
    assert "force, cycle 1 (n = 14)" in entries(alone.figure)


def test_fonts_are_those_of_the_styles():
    assert list(FONTS) == list(style.FONTS)


def test_the_example_in_front_is_made_by_the_command_that_it_shows():
    command = next(line for line in (ROOT / "README.md").read_text().splitlines() if "navirl plot policy" in line)
    assert "--crop --overlay all --wide" in command
    demo = (ROOT / "sample_logs" / "demo.sh").read_text().replace("demo/policy", "policy")
    assert command.split("--trial")[1] in demo
    with Image.open(ROOT / "docs" / "policy.png") as image:
        assert image.size[0] == 2148, "a page wide, at 300 dpi"
        colours = {image.convert("RGB").getpixel((x, image.size[1] // 2)) for x in range(0, 2148, 4)}
    assert len(colours) > 20


def test_people_are_filled_where_that_hides_no_visits():
    a_scene = scene()
    near = np.hypot(*(a_scene.lattice.xy_m - a_scene.people_m[0]).T) < 0.25
    for visits, filled in ((np.where(near, 0.0, 0.01), True), (np.full(a_scene.lattice.size, 0.01), False)):
        marks = draw_policy(one_axes(), a_scene, visits).marks
        assert marks.discs is filled
