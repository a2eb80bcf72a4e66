"""``navirl plan``: scenes by three ways, files in four formats, figure, and refusals."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from navirl_cli.artefacts.plans import Planned, plan_document, read_plan
from navirl_cli.cli import cli
from navirl_cli.irl.reward import Reward
from navirl_cli.planning.paths import Mode, Planner
from navirl_cli.planning.recommendation import straight_passage
from navirl_cli.reports import recommendation
from navirl_cli.reports.plan import plan_warnings

LOG = Path(__file__).parent.parent / "sample_logs" / "p01.mcap"


def run(*words, code=0):
    done = CliRunner().invoke(cli, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    run("extract", LOG, "-o", folder / "demos.json")
    run("fit", folder / "demos.json", "--cycle", 2, "--intervals", "wald", "-o", folder / "reward.json")
    return folder


@pytest.fixture
def scene(folder):
    return folder / "reward.json", "--scene", f"{folder / 'demos.json'}:p01/3"


def test_the_table_compares_the_path_with_the_nominal_one(scene):
    text = run("plan", *scene, "--mode", "expected")
    assert "expected" in text
    assert "nominal" in text
    assert "personal space" in text
    assert "The nominal path touches a person; the reward allows that, and planned paths do not." in text


def test_a_name_given_as_a_position_is_told_the_option_for_names(scene):
    message = run("plan", *scene, "--person", "p02", code=2)
    assert "expected two numbers in m as x,y, found 'p02'; --person-name takes a name" in message
    assert "--person-name" not in run("extract", LOG, "-o", "x.json", "--person", "p02", code=2)


def test_the_likely_path_warns_where_the_policy_passes_farther_away():
    planner = Planner(straight_passage(0.3, 0.1), Reward((-54.1, -0.87, -4.91, 1.68)))
    for mode, expected in ((Mode.LIKELY, 1), (Mode.EXPECTED, 0)):
        content = plan_document(planner, [Planned(one) for one in planner.plan(mode)], mode, 0, [])
        lines = plan_warnings(planner, content)
        assert len(lines) == expected
        assert all("many longer paths together are more probable; `mode` expected follows" in line for line in lines)


def test_json_holds_what_is_printed_and_reads_back(scene, tmp_path):
    output = tmp_path / "plan.json"
    printed = json.loads(run("plan", *scene, "--mode", "expected", "--smooth", "--json", "-o", output))
    content = read_plan(output)
    assert {name: content[name] for name in printed} == printed
    (path,) = content["paths"]
    assert path["log_probability"] == pytest.approx(sum(path["reward_by_term"].values()), abs=1000)
    assert len(path["xy_m"]) == len(path["yaw_rad"]) == len(path["t_s"]) == len(path["speed_m_s"])
    assert np.allclose(path["xy_m"][0], content["start_m"])


def test_csv_has_a_row_for_each_point_of_each_path(scene, tmp_path):
    output = tmp_path / "plan.csv"
    run("plan", *scene, "--mode", "sample", "--count", 3, "-o", output)
    rows = list(csv.DictReader(output.read_text().splitlines()))
    assert {row["path"] for row in rows} == {"1", "2", "3"}
    assert set(rows[0]) == {"path", "x_m", "y_m", "yaw_rad"}


def test_yaml_holds_the_fields_of_a_path_message(scene, tmp_path):
    output = tmp_path / "path.yaml"
    plan = json.loads(run("plan", *scene, "--mode", "expected", "--json", "-o", output))
    message = YAML(typ="safe").load(output)
    types = get_typestore(Stores.ROS2_HUMBLE).types
    fields = types["nav_msgs/msg/Path"].__dataclass_fields__
    assert set(message) <= set(fields)
    poses = message["poses"]
    np.testing.assert_allclose(
        [(one["pose"]["position"]["x"], one["pose"]["position"]["y"]) for one in poses],
        plan["paths"][0]["xy_m"],
        atol=1e-6,
    )
    assert {one["header"]["frame_id"] for one in poses} == {"map"}
    for one in poses:
        assert set(one["pose"]["orientation"]) == set("xyzw")
        assert sum(value**2 for value in one["pose"]["orientation"].values()) == pytest.approx(1)


def test_a_log_holds_a_path_on_a_topic_for_each(scene, tmp_path):
    output = tmp_path / "plan.mcap"
    plan = json.loads(run("plan", *scene, "--mode", "sample", "--count", 2, "--json", "-o", output))
    store = get_typestore(Stores.ROS2_HUMBLE)
    with output.open("rb") as stream:
        found = {
            channel.topic: store.deserialize_cdr(message.data, schema.name)
            for schema, channel, message in make_reader(stream).iter_messages()
        }
    assert list(found) == ["/plan", "/plan_2"]
    for message, path in zip(found.values(), plan["paths"], strict=True):
        placed = [(one.pose.position.x, one.pose.position.y) for one in message.poses]
        np.testing.assert_allclose(placed, path["xy_m"])
        assert {one.header.frame_id for one in message.poses} == {"map"}


def test_a_recording_gives_map_people_pose_and_goal(folder):
    plan = json.loads(run("plan", folder / "reward.json", "--log", LOG, "--json"))
    assert len(plan["people_m"]) == 1
    later = json.loads(run("plan", folder / "reward.json", "--log", LOG, "--at", 6, "--json"))
    assert later["start_m"] != plan["start_m"]
    assert "expected a time within its poses" in run("plan", folder / "reward.json", "--log", LOG, "--at", 1e5, code=1)


def test_a_map_with_start_goal_and_people(folder, tmp_path):
    (tmp_path / "map.pgm").write_bytes(b"P5\n120 60\n255\n" + bytes([254]) * 7200)
    (tmp_path / "map.yaml").write_text(
        "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    words = (
        "plan",
        folder / "reward.json",
        "--map",
        tmp_path / "map.yaml",
        "--start",
        "0.5,1.5,0",
        "--goal",
        "5.5,1.5",
    )
    plan = json.loads(run(*words, "--person", "3,1.5", "--mode", "expected", "--json"))
    assert plan["paths"][0]["min_distance_m"] > 0.2
    assert plan["start_yaw_rad"] == 0
    assert json.loads(run(*words, "--json"))["paths"][0]["min_distance_m"] is None


def test_the_figure_and_the_recommendation(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(recommendation, "DRAWS", 6)
    text = run("plan", *scene, "--recommend", "--plot", tmp_path / "plan.svg")
    assert (tmp_path / "plan.svg").read_text().startswith("<?xml")
    assert re.search(r"Pass the person at \d\.\d\d m \(95 % interval -?\d\.\d\d to \d\.\d\d m\)", text)
    assert "In this scene:" in text


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([], 2, "Name the scene: --scene, --log, or --map with --start and --goal."),
        (["--scene", "DEMOS", "--goal", "1,2"], 2, "--scene gives map, people, start and goal"),
        (["--at", "3"], 2, "--at goes with --log."),
        (["--scene", "DEMOS", "--count", "3"], 2, "--count goes with --mode sample."),
        (["--scene", "DEMOS", "--seed", "3"], 2, "--seed goes with --mode sample or --recommend."),
        (["--scene", "DEMOS", "--tolerance", "0.1"], 2, "--tolerance goes with --smooth."),
        (["--map", "m.yaml", "--start", "1,2,3,4", "--goal", "1,2"], 2, "expected two or three finite numbers"),
        (["--scene", "DEMOS:p9/9"], 1, "trial: expected one of 'p01/1'"),
        (["--scene", "DEMOS", "-o", "REWARD.json"], 2, "expected another file than the input"),
    ],
)
def test_refusals(folder, words, code, message):
    given = [
        word.replace("DEMOS", str(folder / "demos.json")).replace("REWARD.json", str(folder / "reward.json"))
        for word in words
    ]
    assert message in run("plan", folder / "reward.json", *given, code=code)
