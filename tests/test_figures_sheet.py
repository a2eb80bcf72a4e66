"""Figures as files: formats, refusals, the same bytes, no display."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from figure_checks import drawn_texts
from figure_factory import demonstration, one_axes
from matplotlib.figure import Figure

import navirl_cli.figures
from navirl_cli.demos.demonstration import Condition
from navirl_cli.errors import ArtefactError
from navirl_cli.figures.paths import draw_paths
from navirl_cli.figures.sheet import check_target, new_figure, save_figure
from navirl_cli.figures.style import COLUMN_IN, LOOKS, house_style, styled

MODULES = sorted(path.stem for path in Path(navirl_cli.figures.__file__).parent.glob("*.py") if path.stem != "__init__")


def figure() -> Figure:
    made, (axes,) = new_figure(2.0, 1.5)
    axes.imshow(np.arange(6.0).reshape(2, 3), rasterized=True)
    axes.set_xlabel("x [m]")
    return made


@pytest.mark.parametrize(("name", "magic"), [("a.png", b"\x89PNG"), ("a.pdf", b"%PDF-1.4"), ("a.SVG", b"<?xml")])
def test_the_extension_chooses_the_format(tmp_path, name, magic):
    save_figure(figure(), tmp_path / name)
    assert (tmp_path / name).read_bytes().startswith(magic)
    assert list(tmp_path.iterdir()) == [tmp_path / name]


@pytest.mark.parametrize("extension", ["png", "pdf", "svg"])
def test_the_same_figure_gives_the_same_bytes(tmp_path, extension):
    one, other = tmp_path / f"one.{extension}", tmp_path / f"other.{extension}"
    save_figure(figure(), one)
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "svg.hashsalt": "else"}):
        save_figure(figure(), other)
    assert one.read_bytes() == other.read_bytes()
    assert b"Date" not in one.read_bytes()


def test_text_stays_text(tmp_path):
    save_figure(figure(), tmp_path / "a.svg")
    save_figure(figure(), tmp_path / "a.pdf")
    assert ">x [m]</text>" in (tmp_path / "a.svg").read_text()
    assert b"/FontFile2" in (tmp_path / "a.pdf").read_bytes()  # a TrueType font program
    assert b"/Type3" not in (tmp_path / "a.pdf").read_bytes()


def test_dollars_in_a_title_are_dollars(tmp_path):
    made, (axes,) = new_figure()
    with house_style():
        axes.set_title("a$b_c$ $")
    save_figure(made, tmp_path / "a.svg")
    assert "a$b_c$ $</text>" in (tmp_path / "a.svg").read_text()


@pytest.mark.parametrize(
    ("name", "found"),
    [("map.jpg", r'the extension "\.jpg"'), ("map", "no extension"), ("m.svg.gz", r'extension "\.gz"')],
)
def test_an_unknown_extension_is_refused(tmp_path, name, found):
    with pytest.raises(
        ArtefactError, match=rf"{name}: expected a name that ends in \.png, \.pdf or \.svg, found .*{found}"
    ):
        save_figure(figure(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_refused_and_kept(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(b"mine")
    with pytest.raises(ArtefactError, match=r"a\.png: exists already.*`force`"):
        save_figure(figure(), path)
    assert path.read_bytes() == b"mine"


def test_an_existing_file_is_replaced_by_force(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(b"mine")
    save_figure(figure(), path, force=True)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(ArtefactError, match=r"nowhere.a\.png: expected an existing folder.*create it"):
        save_figure(figure(), tmp_path / "nowhere" / "a.png")


def test_a_folder_that_cannot_be_written_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(ArtefactError, match=r"a\.png: the folder .* cannot be written"):
        save_figure(figure(), tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_left_behind_when_writing_fails(tmp_path, monkeypatch):
    def full(self, _data):
        self.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ArtefactError, match=r"a\.png: cannot be written: No space left on device"):
        save_figure(figure(), tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_a_target_can_be_checked_before_the_work(tmp_path):
    assert check_target(tmp_path / "a.PDF") == "pdf"
    with pytest.raises(ArtefactError, match="expected a name that ends in"):
        check_target(tmp_path / "a.txt")
    assert list(tmp_path.iterdir()) == []


def test_empty_height_is_removed_and_the_width_stays(tmp_path):
    made, (axes,) = new_figure(COLUMN_IN)
    axes.imshow(np.zeros((10, 50)))
    before = made.get_size_inches()[1]
    save_figure(made, tmp_path / "a.png")
    width, height = made.get_size_inches()
    assert width == COLUMN_IN
    assert height < 0.35 * before
    shape = axes.get_window_extent()
    assert shape.width / shape.height == pytest.approx(5.0, rel=1e-3)
    assert made.get_tightbbox().height == pytest.approx(height, abs=0.1)


def test_a_figure_that_fills_its_height_keeps_it(tmp_path):
    made, (axes,) = new_figure(COLUMN_IN, 2.0)
    axes.bar([0, 1], [1.0, 2.0])
    save_figure(made, tmp_path / "a.png")
    assert tuple(made.get_size_inches()) == (COLUMN_IN, 2.0)


def test_trimming_can_be_declined(tmp_path):
    made = figure()
    before = tuple(made.get_size_inches())
    save_figure(made, tmp_path / "a.png", trim=False)
    assert tuple(made.get_size_inches()) == before


@pytest.mark.parametrize(("low_m", "high_m"), [(-1.6, 1.73), (-1.56, 1.74)])
def test_no_label_is_clipped_where_the_size_of_the_map_changes_its_ticks(tmp_path, low_m, high_m):
    ones = [demonstration(cycle=1), demonstration(Condition.JOYSTICK, 3)]
    with styled("dark"), drawn_texts() as boxes:
        axes = draw_paths(one_axes(), ones, window_m=(-3.65, 3.65, low_m, high_m)).axes
        save_figure(axes.figure, tmp_path / "a.png")
    assert min(box.x0 for box in boxes.values()) >= 0
    assert max(box.x1 for box in boxes.values()) <= COLUMN_IN * LOOKS["dark"].dpi


def test_a_saved_figure_keeps_its_layout_in_every_format(tmp_path):
    made, (axes,) = new_figure(COLUMN_IN)
    axes.imshow(np.zeros((10, 50)))
    save_figure(made, tmp_path / "a.png")
    before = axes.get_position().bounds, tuple(made.get_size_inches())
    save_figure(made, tmp_path / "a.pdf")
    assert (axes.get_position().bounds, tuple(made.get_size_inches())) == before


def test_no_setting_of_the_process_changes(tmp_path):
    before = dict(mpl.rcParams)
    save_figure(figure(), tmp_path / "a.svg")
    assert dict(mpl.rcParams) == before


#: Names that figures import from the rooms that solve: types and constants, nothing that computes a policy.
TAKEN = {
    "navirl_cli.irl.profile": {"Profile", "fall_at"},
    "navirl_cli.irl.scene": {"Scene"},
    "navirl_cli.irl.solved": {"SolvedScene"},
    "navirl_cli.irl.terms.term": {"Parameter"},
    "navirl_cli.evaluation.compare": {"DRIVEN", "LEARNT", "ON_GRID", "PERSON_RADIUS_M"},
    "navirl_cli.evaluation.groups": {"GroupMetrics", "by_group", "group_of"},
    "navirl_cli.evaluation.motion": {"PERSON_RADIUS_M"},
    "navirl_cli.evaluation.metric": {"Metric", "Values"},
    "navirl_cli.evaluation.metrics": {"PAPER_METRICS"},
    "navirl_cli.evaluation.ranks": {"GroupRanks"},
    "navirl_cli.study.pipeline": {"Study"},
    "navirl_cli.study.questionnaire": {"Shares"},
    "navirl_cli.study.unseen": {"PooledPolicy"},
}


@pytest.mark.parametrize("module", MODULES)
def test_figures_only_draw_what_other_rooms_solve(module):
    tree = ast.parse((Path(navirl_cli.figures.__file__).parent / f"{module}.py").read_text())
    rooms = ("navirl_cli.irl", "navirl_cli.evaluation", "navirl_cli.study")
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(rooms):
            assert {alias.name for alias in node.names} <= TAKEN.get(node.module, set())


def test_neither_a_display_nor_what_writes_other_formats_is_loaded(tmp_path):
    imports = "; ".join(f"import navirl_cli.figures.{name}" for name in MODULES)
    program = (
        f"import sys; from pathlib import Path; {imports}\n"
        "from navirl_cli.figures.sheet import new_figure, save_figure\n"
        f"save_figure(new_figure()[0], Path({str(tmp_path / 'a.png')!r}))\n"
        "print(*sys.modules)"
    )
    top = Path(navirl_cli.figures.__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", program], cwd=top, check=True, capture_output=True, text=True)
    modules = set(done.stdout.split())
    assert "matplotlib.backends.backend_agg" in modules
    assert not {"matplotlib.pyplot", "matplotlib.backends.backend_pdf", "matplotlib.backends.backend_svg"} & modules
    assert not {"scipy.stats", "scipy.interpolate", "scipy.ndimage", "scipy.signal", "shapely"} & modules
