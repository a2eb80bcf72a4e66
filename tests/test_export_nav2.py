"""``navirl export --to nav2``: the mask as map_server reads it, fragments against Nav2's names, and the node."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from reward_files import write_reward
from ruamel.yaml import YAML

from navirl_cli.cli import cli
from navirl_cli.commands import export as command
from navirl_cli.export.costs import CostModel, Passing, mask_costs, matched, navfn, smac2d
from navirl_cli.export.folder import FILES, write_nav2
from navirl_cli.export.fragments import Distro
from navirl_cli.export.nav2 import Field, Nav2Export, lost, nav2_export
from navirl_cli.export.readme import numbers
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.recommendation import straight_passage

PAPER = Reward((-54.1, -0.87, -4.91, 1.68))
PASSAGE = straight_passage(0.3, 0.1)
#: Parameters that the plugins declare (nav2_costmap_2d, nav2_map_server, nav2_navfn_planner, nav2_smac_planner,
#: nav2_social_costmap_plugin), as far as an export may set them.
FILTER = {"plugin", "enabled", "filter_info_topic", "transform_tolerance"}
PARAMETERS = {
    "nav2_costmap_2d::KeepoutFilter": FILTER,
    "nav2_costmap_2d::SpeedFilter": FILTER | {"speed_limit_topic"},
    "nav2_navfn_planner::NavfnPlanner": {"plugin", "tolerance", "use_astar", "allow_unknown"},
    "nav2_smac_planner::SmacPlanner2D": {"plugin", "tolerance", "allow_unknown", "cost_travel_multiplier"},
    "nav2_social_costmap_plugin::SocialLayer": {
        *("plugin", "enabled", "cutoff", "amplitude", "covariance_when_still", "use_passing", "use_vel_factor"),
        *("speed_factor_multiplier", "publish_occgrid"),
        *(f"covariance_{side}_{size}" for side in ("front", "rear", "right") for size in ("height", "width")),
    },
}
SERVERS = [
    {"topic_name", "frame_id"},
    {"type", "filter_info_topic", "mask_topic", "base", "multiplier"},
]


def exported(folder, *, name="navfn", reward=PAPER, factor=None, **more):
    one = nav2_export(reward, 0.1, 0.3, name, factor, **{"distro": Distro.JAZZY, "problem": PASSAGE, **more})
    write_nav2(folder, one)
    return one


def as_map_server_reads(yaml):
    """Occupancies by the rules of map_io.cpp for mode raw, (rows, columns) with the lowest y first; -1 unknown."""
    content = YAML(typ="safe").load(yaml)
    assert set(content) >= {"image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"}
    assert content["mode"] == "raw"
    magic, size, most, data = (yaml.parent / content["image"]).read_bytes().split(b"\n", 3)
    assert (magic, most) == (b"P5", b"255")
    columns, rows = map(int, size.split())
    pixels = np.frombuffer(data, dtype=np.uint8).reshape(rows, columns)
    if content["negate"]:
        pixels = 255 - pixels
    return content, np.where(pixels > 100, -1, pixels.astype(int))[::-1]


@pytest.mark.parametrize("field", Field)
def test_the_mask_holds_the_costs_to_half_a_percent(tmp_path, field):
    one = exported(tmp_path, field=field, factor=1.3)
    content, occupancy = as_map_server_reads(tmp_path / "mask.yaml")
    grid = PASSAGE.scene.lattice.grid
    assert content["resolution"] == pytest.approx(grid.resolution_m)
    assert content["origin"] == pytest.approx([*grid.origin_m, 0.0], abs=1e-6)
    assert occupancy.shape == grid.shape
    rows, columns = np.indices(grid.shape)
    x, y = grid.origin_m[0] + (columns + 0.5) * 0.1, grid.origin_m[1] + (rows + 0.5) * 0.1
    k = 62.5 / (54.1 * 0.1)
    people = one.mask_model.people_factor * k * 4.91 * np.exp(-1.68 * (x**2 + y**2))
    # the nominal path is the straight row of cells
    line = k * 0.87 * ((y - 0.0) ** 2 + np.maximum(np.abs(x) - 4.0, 0) ** 2)
    costs = {"people": people, "line": line, "both": people + line}[field.value]
    near = np.abs(x) < 3.9  # beyond its ends the line ends in a cell's centre
    expected = np.clip(np.round(costs / 2.54), 0, 99)
    shown = np.where(occupancy < 0, 0, occupancy)
    assert np.abs(shown - expected)[near].max() <= 1
    assert occupancy.max() <= 99
    assert 0 not in occupancy


def test_planner_and_policy_pass_a_person_alike():
    for name in ("navfn", "smac2d"):
        found = matched(name, PAPER, 0.1, 0.3, line=True)
        assert found.planner_m == pytest.approx(found.policy_m, abs=0.1)
        assert found.model.people_factor > 1
        # without the cost off the line fewer costs suffice, and no path is nearer that does not lead through the person
        alone = matched(name, PAPER, 0.1, 0.3, costs=found.model.planner)
        assert alone.model.people_factor < 1
        assert 0 < alone.planner_m < found.policy_m + 0.2
        assert alone.model.planner is found.model.planner
    assert matched("navfn", PAPER, 0.1, 0.3, 1.0, line=True).planner_m < 0
    assert found.model.planner.multiplier > 1
    assert found.model.amplitude <= 251


def test_the_live_mask_has_the_costs_of_people_alone(tmp_path):
    one = exported(tmp_path, field=Field.BOTH)
    node = YAML(typ="safe").load(tmp_path / "people_mask.yaml")["people_mask"]["ros__parameters"]
    assert node["amplitude"] == pytest.approx(one.model.amplitude, rel=1e-5)
    assert one.model.amplitude < one.mask_model.amplitude
    assert one.model.planner is one.mask_model.planner
    assert [row[0] for row in numbers(one).rows] == ["people", "people and line"]


def test_costs_go_through_the_mask_as_through_keepout_filter():
    costs = np.array([0.0, 1.0, 2.0, 100.0, 251.0, 400.0])
    assert mask_costs(costs).tolist() == [0, 0, 3, 99, 251, 251]


def test_speeds_fall_towards_people_and_zero_is_no_limit(tmp_path):
    exported(tmp_path, slow_percent=40, factor=1.3)
    _, mask = as_map_server_reads(tmp_path / "speed_mask.yaml")
    server = YAML(typ="safe").load(tmp_path / "servers.yaml")["people_speed_info_server"]["ros__parameters"]
    limit = server["base"] + server["multiplier"] * mask
    assert (server["type"], limit.min(), limit.max()) == (1, 40, 100)
    middle = mask[mask.shape[0] // 2]
    assert middle.max() == 60
    assert (np.diff(middle[: middle.argmax()]) >= 0).all()
    assert mask.min() == 0  # no cell is unknown, which SpeedFilter refuses


@pytest.mark.parametrize("distro", Distro)
@pytest.mark.parametrize("name", ["navfn", "smac2d"])
def test_fragments_have_names_that_nav2_declares(tmp_path, distro, name):
    exported(tmp_path, name=name, factor=2.0, distro=distro, slow_percent=30)
    found = {file.stem: YAML(typ="safe").load(file) for file in tmp_path.glob("*.yaml")}
    assert ("social_layer" in found) == (distro is Distro.HUMBLE)
    plugins = [found["planner"]["planner_server"]["ros__parameters"]["GridBased"]]
    for fragment, listed in (("costmap", "filters"), ("social_layer", "plugins")):
        if fragment in found:
            parameters = found[fragment]["global_costmap"]["global_costmap"]["ros__parameters"]
            own = {key: value for key, value in parameters.items() if isinstance(value, dict)}
            assert set(own) <= set(parameters[listed])
            plugins += own.values()
    for plugin in plugins:
        kind = plugin["plugin"]
        assert ("/" in kind) == (distro is Distro.HUMBLE and "planner" in kind)
        assert set(plugin) <= PARAMETERS[kind.replace("/", "::")]
        assert 0 < plugin.get("cutoff", 1) < plugin.get("amplitude", 252) <= 252
    nodes = found["servers"]
    assert [set(one["ros__parameters"]) for one in nodes.values()] == SERVERS * 2
    launch = (tmp_path / "mask.launch.py").read_text()
    compile(launch, "mask.launch.py", "exec")
    assert all(f'"{node}"' in launch for node in nodes)
    node = found["people_mask"]["people_mask"]["ros__parameters"]
    info = nodes["people_info_server"]["ros__parameters"]
    assert (node["mask_topic"], node["info_topic"]) == (info["mask_topic"], info["filter_info_topic"])
    readme = (tmp_path / "README.md").read_text()
    assert ("keepout_mask:=" in readme) == (distro in {Distro.KILTED, Distro.LYRICAL})


def test_files_of_an_older_export_go_and_others_stay(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    exported(tmp_path, factor=2.0, slow_percent=30, distro=Distro.HUMBLE)
    assert {one.name for one in tmp_path.iterdir()} == {*FILES, "notes.txt"}
    exported(tmp_path, factor=2.0, problem=None)
    assert not {"mask.pgm", "servers.yaml", "social_layer.yaml"} & {one.name for one in tmp_path.iterdir()}
    assert (tmp_path / "notes.txt").exists()


NODE = """
import sys, numpy, json
sys.argv = ["x"]
import test_people_mask_node as fake
from people_mask_node import mask_of
given = json.load(sys.stdin)
numpy.save("live.npy", mask_of(*given))
"""


def test_the_node_passes_its_own_test_and_makes_the_same_mask(tmp_path):
    one = exported(tmp_path, factor=1.3)
    done = subprocess.run(
        [sys.executable, "test_people_mask_node.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    grid = PASSAGE.scene.lattice.grid
    node = YAML(typ="safe").load(tmp_path / "people_mask.yaml")["people_mask"]["ros__parameters"]
    given = [[[0.0, 0.0]], grid.shape, 0.1, grid.origin_m, node["amplitude"], node["covariance_m2"]]
    subprocess.run([sys.executable, "-c", NODE], cwd=tmp_path, input=json.dumps(given), text=True, check=True)
    _, static = as_map_server_reads(tmp_path / "mask.yaml")
    assert np.abs(np.load(tmp_path / "live.npy").astype(int) - static).max() <= 1 + 1  # unknown is -1, the least cost 1
    assert one.model.amplitude == pytest.approx(node["amplitude"], rel=1e-5)


@pytest.mark.parametrize(
    ("reward", "planner", "field", "message"),
    [
        (Reward((-10.0, -0.87, -8.0, 1.68)), navfn(), Field.PEOPLE, "would reach 500, above the 251"),
        (Reward((-54.1, -0.87, 2.0, 1.68)), navfn(), Field.PEOPLE, "no cost can attract: people cost nothing"),
        (Reward((-54.1, -40.0, -4.91, 1.68)), smac2d(), Field.BOTH, "costs of the mask would reach"),
    ],
)
def test_what_costs_cannot_hold_is_said(reward, planner, field, message):
    model = CostModel(reward, planner, 0.1)
    passing = Passing(model, 0.5, 0.5)
    beside = passing if field is Field.BOTH else None
    lines = lost(Nav2Export(passing, Distro.JAZZY, 0.3, PASSAGE, field, beside_line=beside))
    assert message in lines[0]
    apart = lost(Nav2Export(Passing(CostModel(PAPER, navfn(), 0.1), 0.5, 0.1), Distro.JAZZY, 0.3))
    assert apart == [
        (
            "with costs of people the planner passes a person on its line at 0.10 m, paths of the policy at 0.50 m: "
            "by these alone its path of least cost has a distance of its own"
        )
    ]


def test_the_words_of_the_command_are_those_of_the_export():
    assert list(command.DISTROS) == [one.value for one in Distro]
    assert list(command.FIELDS) == [one.value for one in Field]


OLD = Path(__file__).parent / "version1"
DEMOS = OLD / "demonstrations.json"


def run(*words, code=0):
    done = CliRunner().invoke(cli, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done.stdout if code == 0 else done.output


def test_the_command_writes_a_folder_once(tmp_path):
    reward_file = write_reward(tmp_path / "reward.json", PAPER.theta)
    words = ("export", reward_file, "--to", "nav2", "--scene", DEMOS, "-o", tmp_path / "nav2")
    printed = json.loads(run(*words, "--json"))
    assert printed["files"] == sorted(one.name for one in (tmp_path / "nav2").iterdir())
    assert printed["costs"][0]["amplitude"] > 0
    assert "replace them with --force" in run(*words, code=1)
    assert "navfn" in run(*words, "--force")
    for word in ("--mask", "both"), ("--slow", "30"):
        assert f"{word[0]} needs a scene" in run(
            "export", reward_file, "--to", "nav2", "-o", tmp_path / "new", *word, code=2
        )
    assert "found a file" in run("export", reward_file, "--to", "nav2", "-o", DEMOS, code=1)
    assert not (tmp_path / "new").exists()
    (tmp_path / "nav2" / "README.md").write_text("mine")
    run("export", reward_file, "--to", "nav2", "-o", tmp_path / "nav2", "--force")
    assert (tmp_path / "nav2" / "mask.yaml").exists()  # of no export that it knows
    within = ("--map", tmp_path / "nav2" / "mask.yaml", "--start", "0,0", "--goal", "1,0")
    words = ("export", reward_file, "--to", "nav2", *within, "-o", tmp_path / "nav2", "--force")
    assert "expected another file than the input" in run(*words, code=2)
