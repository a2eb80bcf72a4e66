"""``navirl export --to mcap`` and ``--to table``: read back by mcap-ros2-support, and by the public code's formulas."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.reader import make_reader
from reward_files import write_reward

from navirl_cli.cli import cli
from navirl_cli.errors import LogError
from navirl_cli.export.conventions import conventions_table
from navirl_cli.export.scene_log import M_PER_N, write_scene
from navirl_cli.export.scene_view import view_of
from navirl_cli.irl.reward import Reward, parameters_of
from navirl_cli.irl.terms import TERMS
from navirl_cli.logs.messages.writer import LogWriter, message_type
from navirl_cli.logs.sources import sources_of
from navirl_cli.planning.problem import problem_of
from navirl_cli.planning.recommendation import straight_passage

ROOT = Path(__file__).parent.parent
LOG = ROOT / "sample_logs" / "p01.mcap"
OLD = Path(__file__).parent / "version1"
PAPER = Reward((-54.12586, -0.873514, -4.907188, 1.679499))
PASSAGE = straight_passage(0.3, 0.1)


def run(*words, code=0):
    done = CliRunner().invoke(cli, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done.stdout if code == 0 else done.output


def decoded(path):
    """(topic, log time) and message of every message, by mcap-ros2-support."""
    factory = pytest.importorskip("mcap_ros2.decoder").DecoderFactory()
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[factory])
        return [(channel.topic, raw.log_time, one) for _, channel, raw, one in reader.iter_decoded_messages()]


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """The first trial with contacts of a sample log."""
    from navirl_cli.artefacts.demonstrations import read_demonstrations

    demos = tmp_path_factory.mktemp("log") / "demos.json"
    run("extract", LOG, "-o", demos)
    return next(one for one in read_demonstrations(demos) if one.contacts)


@pytest.fixture(scope="module")
def view(trial):
    return view_of(problem_of(trial), PAPER, trial, 2, 0)


@pytest.fixture(scope="module")
def written(view, tmp_path_factory):
    path = tmp_path_factory.mktemp("written") / "scene.mcap"
    damage, topics = write_scene(path, view, force=False)
    assert damage == []
    found = decoded(path)
    assert {topic for topic, _, _ in found} == set(topics)
    return path, found


def first(found, topic):
    return next(one for name, _, one in found if name == topic)


@pytest.mark.parametrize("name", ["reward", "visits"])
def test_fields_are_equal_floats_and_whole_per_cent(written, view, name):
    _, found = written
    field, grid = getattr(view, name), view.problem.scene.lattice.grid
    one = first(found, f"/navirl/{name}_grid")
    (part,) = one.fields
    assert (part.name, part.offset, part.type) == (name, 0, 7)
    assert (one.column_count, one.cell_stride, one.row_stride) == (grid.shape[1], 4, 4 * grid.shape[1])
    assert (one.pose.position.x, one.pose.position.y) == grid.origin_m
    assert one.cell_size.x == one.cell_size.y == grid.resolution_m
    np.testing.assert_array_equal(np.frombuffer(one.data, "<f4").reshape(grid.shape), field.astype(np.float32))
    shown = first(found, f"/navirl/{name}")
    percent = np.array(shown.data).reshape(shown.info.height, shown.info.width)
    free = ~np.isnan(field)
    assert (percent[~free] == -1).all()
    assert (percent.max(), percent[free].min()) == (100, 0)
    assert np.abs(np.corrcoef(percent[free], field[free])[0, 1]) > 0.99
    np.testing.assert_array_equal(np.array(first(found, "/navirl/map").data).reshape(grid.shape) == 100, grid.occupied)


def test_lines_people_pushes_and_poses_are_in_the_frame_and_clock_of_the_trial(written, view, trial):
    _, found = written
    for name, line in view.lines.items():
        path = first(found, f"/navirl/{name}")
        placed = [(one.pose.position.x, one.pose.position.y) for one in path.poses]
        np.testing.assert_allclose(placed, line)
        assert {one.header.frame_id for one in path.poses} == {"map"}
        stamp = path.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == trial.start_ns
    assert set(view.lines) == {"nominal", "demonstrated", "sampled_1", "sampled_2"}
    people = first(found, "/navirl/people").markers
    np.testing.assert_allclose([(one.pose.position.x, one.pose.position.y) for one in people], trial.people_m)
    pushes = [(t_ns, one.markers[0]) for topic, t_ns, one in found if topic == "/navirl/pushes"]
    assert len(pushes) == len(trial.contacts)
    for (t_ns, arrow), contact in zip(pushes, trial.contacts, strict=True):
        assert t_ns == trial.start_ns + round(contact.start_s * 1e9)
        turn = arrow.pose.orientation
        assert np.cos(2 * np.arctan2(turn.z, turn.w) - contact.direction_rad) == pytest.approx(1)
        impulse = arrow.scale.x / M_PER_N * contact.duration_s
        assert impulse == pytest.approx(np.hypot(*contact.impulse_n_s))
    poses = [(t_ns, one.transforms[0]) for topic, t_ns, one in found if topic == "/tf"]
    for t_ns, one in poses[:: len(poses) // 5]:
        row = np.abs(trial.start_ns + trial.t_s * 1e9 - t_ns).argmin()
        move = one.transform.translation
        np.testing.assert_allclose((move.x, move.y), trial.xy_m[row])
        assert (one.header.frame_id, one.child_frame_id) == ("map", "base_link")


def test_a_scene_without_people_and_without_a_trial_is_written(tmp_path):
    problem = straight_passage(0.3, 0.1)
    empty = type(problem)(
        type(problem.scene)(problem.scene.lattice, problem.scene.start, problem.scene.goal, np.empty((0, 2))),
        *(problem.start_m, problem.goal_m, problem.nominal_m, 0.3),
    )
    _, topics = write_scene(tmp_path / "a.mcap", view_of(empty, PAPER, None, 0, 0), force=False)
    assert "/tf" not in topics
    assert first(decoded(tmp_path / "a.mcap"), "/navirl/people").markers == []


def raw_messages(path):
    with path.open("rb") as stream:
        return [
            (channel.topic, dict(channel.metadata), schema.name, schema.data, one.log_time, one.publish_time, one.data)
            for schema, channel, one in make_reader(stream).iter_messages()
        ]


def test_messages_of_a_recording_are_copied_as_they_are(view, tmp_path):
    bag = tmp_path / "bag.mcap"
    with LogWriter(bag) as writer:
        text = message_type("std_msgs/msg/String")
        for number in range(30):
            writer.message("/said", text(f"{number}"), 10**9 + number, 10**9 - number)
        writer.metadata("navirl.session", {"json": "{}"})
    original = raw_messages(bag)
    output = tmp_path / "both.mcap"
    write_scene(output, view, sources_of([bag])[0], force=False)
    both = raw_messages(output)
    assert [one for one in both if one[0] == "/said"] == original
    assert "/tf" not in {one[0] for one in both}
    with output.open("rb") as stream:
        assert "navirl.session" in {one.name for one in make_reader(stream).iter_metadata()}
    with pytest.raises(LogError, match="name the original in `with`"):
        write_scene(tmp_path / "again.mcap", view, sources_of([output])[0], force=False)
    assert not (tmp_path / "again.mcap").exists()


def test_a_damaged_recording_gives_the_rest_and_exit_code_3(tmp_path):
    broken = tmp_path / "broken.mcap"
    with LogWriter(broken, chunk_size=1000) as writer:
        for number in range(300):
            writer.message("/said", message_type("std_msgs/msg/String")(f"{number}" * 9), 10**9 + number)
    broken.write_bytes(broken.read_bytes()[:-6000])
    words = ("--to", "mcap", "--scene", OLD / "demonstrations.json", "--with", broken, "-o", tmp_path / "x.mcap")
    assert "broken.mcap: bytes " in run("export", write_reward(tmp_path / "reward.json", PAPER.theta), *words, code=3)
    assert len([one for one in raw_messages(tmp_path / "x.mcap") if one[0] == "/said"]) > 50


def test_the_table_gives_the_published_numbers_of_the_public_code():
    rows = {(one["convention"], one["quantity"]): one["value"] for one in conventions_table(PAPER, 0.1, 0.3).records()}
    cells = -5.412586, -0.873514, -4.907188
    assert [rows["public code", name] for name in ("path length", "deviation", "person")] == pytest.approx(cells)
    assert 1 / (2 * (0.1 * rows["public code", "width"]) ** 2) == pytest.approx(1.679499)
    k = 4.907188 / 5.412586
    assert rows["Nav2 NavFn", "amplitude"] == pytest.approx(62.5 * k)
    assert rows["Nav2 SmacPlanner2D", "amplitude"] == pytest.approx(252 * k)
    assert rows["Nav2", "covariance"] == pytest.approx(1 / (2 * 1.679499))
    scaled = rows["Nav2 SmacPlanner2D", "factor"] * 252 * k / rows["Nav2 SmacPlanner2D", "multiplier"]
    assert rows["Nav2 SmacPlanner2D", "scaled amplitude"] == pytest.approx(scaled)


@pytest.mark.parametrize(("names", "note"), [(("length", "anisotropic-space"), "Nav2: expected a reward of length")])
def test_the_table_of_other_terms_says_what_is_missing(names, note):
    terms = tuple(TERMS[name] for name in names)
    table = conventions_table(Reward(tuple(one.initial for one in parameters_of(terms)), terms), 0.1, 0.3)
    assert {row[0] for row in table.rows} == {"paper"}
    assert note in table.note
    assert "The public code has the paper's terms only" in table.note


def test_the_table_is_printed_and_written(tmp_path):
    reward = write_reward(tmp_path / "reward.json", PAPER.theta)
    assert "62.5 a_p / (c0 h)" in run("export", reward, "--to", "table", "-o", tmp_path / "t.csv")
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    printed = json.loads(run("export", reward, "--to", "table", "--json"))["parameters"]
    assert [float(one["value"]) for one in rows] == pytest.approx([one["value"] for one in printed])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("mcap", "-o", "x.mcap"), "--to mcap needs a scene"),
        (("mcap", "--scene", "d.json", "-o", "x.png"), "a name that ends in .mcap with --to mcap, found 'x.png'"),
        (("table", "--slow", "30"), "--slow goes with --to nav2"),
        (("nav2", "-o", "x", "--count", "3"), "--count goes with --to mcap"),
        (("table", "--scene", "d.json"), "--to table needs no scene"),
        (("nav2",), "--to nav2 needs -o"),
        (("nav2", "-o", "x", "--person", "1,2"), "--person needs a scene"),
    ],
)
def test_words_that_exclude_each_other(words, message):
    assert message in " ".join(run("export", "none.json", "--to", *words, code=2).split())
