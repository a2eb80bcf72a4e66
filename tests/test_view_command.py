"""``navirl view`` against a fake of Rerun, and without it."""

import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rerun_fake import fake_rerun
from reward_files import write_reward

from navirl_cli.cli import cli
from navirl_cli.errors import MissingPackageError
from navirl_cli.export.rerun_scene import show_scene
from navirl_cli.export.scene_log import M_PER_N
from navirl_cli.export.scene_view import view_of
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.problem import problem_of
from navirl_cli.planning.recommendation import straight_passage

OLD = Path(__file__).parent / "version1"
PAPER = Reward((-54.1, -0.87, -4.91, 1.68))


@pytest.fixture
def rerun(monkeypatch):
    module = fake_rerun()
    monkeypatch.setitem(sys.modules, "rerun", module)
    return module


def test_cells_are_squares_in_place_with_the_colour_of_their_value(rerun, tmp_path):
    view = view_of(straight_passage(0.3, 0.1), PAPER, None, 1, 0)
    show_scene(view, tmp_path / "scene.rrd")
    (stream,) = rerun.streams
    logged = {entity: what for entity, _, what in stream.logged}
    mesh = logged["world/visits"]
    field = view.visits
    rows, columns = np.nonzero(field / np.nanmax(field) > 0.01)
    grid = view.problem.scene.lattice.grid
    middle = mesh.vertex_positions.reshape(-1, 4, 3).mean(axis=1)[:, :2]
    np.testing.assert_allclose(middle, grid.centres_of(np.column_stack([columns, rows])), atol=1e-5)
    assert mesh.triangle_indices.max() == len(mesh.vertex_positions) - 1
    brightness = mesh.vertex_colors.reshape(-1, 4, 3)[:, 0, 0].astype(int)
    assert (np.diff(brightness[np.argsort(field[rows, columns])]) <= 1).all()
    assert len(logged["world/map"].vertex_positions) == 4 * grid.occupied.sum()
    np.testing.assert_allclose(logged["world/nominal"].strips[0][:, :2], view.lines["nominal"], atol=1e-6)
    assert "world/robot" not in logged
    assert not stream.open


def test_forces_are_arrows_on_the_clock_of_the_log(rerun, tmp_path):
    from navirl_cli.artefacts.demonstrations import read_demonstrations

    trial = next(one for one in read_demonstrations(OLD / "demonstrations.json") if one.force_n is not None)
    view = view_of(problem_of(trial), PAPER, trial, 0, 0)
    show_scene(view, tmp_path / "scene.rrd")
    (stream,) = rerun.streams
    arrows = [(t_ns, what) for entity, t_ns, what in stream.logged if entity == "world/robot/force"]
    assert len(arrows) > 5
    for t_ns, arrow in arrows:
        row = np.abs(trial.start_ns + trial.t_s * 1e9 - t_ns).argmin()
        np.testing.assert_allclose(arrow.vectors[0, :2], trial.force_n[row] * M_PER_N, atol=1e-5)
        np.testing.assert_allclose(arrow.origins[0, :2], trial.xy_m[row], atol=1e-5)
    assert sum(entity.startswith("world/pushes/") for entity, _, _ in stream.logged) == len(trial.contacts or ())


def test_the_command_opens_the_viewer_or_writes_a_file(rerun, tmp_path):
    reward_file = write_reward(tmp_path / "reward.json", PAPER.theta)
    words = ["view", str(reward_file), "--scene", str(OLD / "demonstrations.json")]
    done = CliRunner().invoke(cli, words)
    assert done.exit_code == 0, done.output
    assert rerun.streams[-1].spawned
    done = CliRunner().invoke(cli, [*words, "-o", str(tmp_path / "a.rrd")])
    assert done.exit_code == 0, done.output
    assert [one.name for one in tmp_path.glob("*.rrd")] == ["a.rrd"]
    assert "Name the scene" in CliRunner().invoke(cli, words[:2]).output


def test_without_rerun_one_line_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    view = view_of(straight_passage(0.3, 0.1), PAPER, None, 0, 0)
    with pytest.raises(MissingPackageError, match=r"install it with pip install 'navirl\[view\]'"):
        show_scene(view, tmp_path / "scene.rrd")
    assert list(tmp_path.iterdir()) == []
