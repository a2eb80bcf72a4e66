"""``navirl watch``: what is finished, what counts once, what is learnt, and what a kill leaves."""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import factories as make
import numpy as np
import pytest
from click.testing import CliRunner

from navirl_cli.artefacts.demonstrations import read_demonstrations
from navirl_cli.artefacts.plans import read_line, read_plan
from navirl_cli.artefacts.rewards import read_reward
from navirl_cli.cli import cli
from navirl_cli.demos.extract import ExtractSettings
from navirl_cli.demos.subset import Subset
from navirl_cli.errors import ArtefactError, DemonstrationError, LogError
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.log_scale import LogScale
from navirl_cli.irl.newcomer import Others
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.prior import Prior
from navirl_cli.irl.random_effects import Spread
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.selection import select
from navirl_cli.logs.container.records import FOOTER, MAGIC
from navirl_cli.logs.load import LoadOptions
from navirl_cli.planning import certainty
from navirl_cli.planning.certainty import Certainty, another_pass
from navirl_cli.planning.recommendation import Quantity, straight_passage
from navirl_cli.reports.watch import learnt_line
from navirl_cli.simulation.log import write_log
from navirl_cli.watching import loop
from navirl_cli.watching.folder import PAUSE_S, SHARE, Folder, pause_s
from navirl_cli.watching.learning import Choice, learn, next_trials
from navirl_cli.watching.visit import Visit

SAMPLES = sorted((Path(__file__).parent.parent / "sample_logs").glob("*.mcap"))
END = bytes([FOOTER]) + (20).to_bytes(8, "little") + bytes(20) + MAGIC


class Clock:
    """Seconds that pass when a test says so."""

    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def folder(tmp_path, clock):
    (tmp_path / "logs").mkdir()
    return Folder(tmp_path / "logs", 30.0, clock)


def ready(folder):
    return [one.key for one in folder.look().ready]


class TestFolder:
    def test_a_log_that_grows_is_left_alone_and_a_closed_one_is_ready_at_once(self, folder):
        log = folder.path / "a.mcap"
        log.write_bytes(MAGIC)
        assert folder.look().open == (("a.mcap", False),)
        log.write_bytes(MAGIC + bytes(100))
        look = folder.look()
        assert (look.ready, look.open) == ((), (("a.mcap", True),))
        log.write_bytes(MAGIC + bytes(100) + END)
        (one,) = folder.look().ready
        assert one.closed
        assert folder.take(one)
        assert ready(folder) == []

    def test_that_of_a_killed_recorder_is_ready_when_it_stops_growing(self, folder, clock):
        log = folder.path / "a.mcap"
        for size in (10, 20, 30):
            log.write_bytes(MAGIC + bytes(size))
            assert ready(folder) == []
            clock.now += 29
        assert ready(folder) == []
        clock.now += 1
        assert ready(folder) == ["a.mcap"]

    def test_one_that_grows_after_it_was_taken_comes_again(self, folder):
        log = folder.path / "a.mcap"
        log.write_bytes(MAGIC + END)
        (one,) = folder.look().ready
        log.write_bytes(MAGIC + bytes(5) + END)
        assert not folder.take(one)
        (one,) = folder.look().ready
        assert folder.take(one)
        log.write_bytes(MAGIC + bytes(6) + END)
        assert ready(folder) == ["a.mcap"]

    def test_a_bag_is_finished_by_its_metadata(self, folder):
        bag = folder.path / "visit" / "rec"
        bag.mkdir(parents=True)
        (bag / "rec_0.mcap").write_bytes(MAGIC + END)  # the recorder has begun the next piece
        assert folder.look().open == (("visit/rec", False),)
        (bag / "rec_1.mcap").write_bytes(MAGIC + END)
        assert ready(folder) == []
        (bag / "metadata.yaml").write_text(
            "rosbag2_bagfile_information:\n  storage_identifier: mcap\n"
            "  relative_file_paths: [rec_0.mcap, rec_1.mcap]\n"
        )
        assert ready(folder) == ["visit/rec"]

    def test_an_empty_folder_is_waited_for_and_a_missing_one_refused(self, folder):
        assert folder.look().ready == ()
        with pytest.raises(LogError, match=r"none: expected a folder of recordings, found none; create it"):
            Folder(folder.path / "none", 1.0).look()

    def test_looks_take_a_bounded_share_of_a_processor(self):
        assert pause_s(1e-5) == PAUSE_S
        for cost in (1e-3, 0.1, 3.0):
            assert cost / (cost + pause_s(cost)) <= SHARE <= 0.01


def taken(visit, path):
    """Add one recording of a folder of its own to a visit."""
    (one,) = (one for one in Folder(path.parent, 0.0).look().ready if one.source.files[0].name == path.name)
    return visit.add(one)


class TestVisit:
    @pytest.fixture
    def visit(self, tmp_path):
        visit = Visit(tmp_path, ExtractSettings(), LoadOptions())
        visit.open()
        return visit

    @pytest.fixture
    def logs(self, tmp_path):
        (tmp_path / "logs").mkdir()
        return tmp_path / "logs"

    def test_a_recording_counts_once_by_its_content_also_after_a_restart(self, visit, logs, tmp_path):
        shutil.copy(SAMPLES[0], logs / "a.mcap")
        assert taken(visit, logs / "a.mcap").changed
        assert not taken(visit, logs / "a.mcap").changed
        shutil.copy(SAMPLES[0], logs / "b.mcap")
        added = taken(visit, logs / "b.mcap")
        assert (added.changed, added.lost) == (
            False,
            ("left out: b.mcap: the same recording as a.mcap, which counts once",),
        )
        again = Visit(tmp_path, ExtractSettings(), LoadOptions())
        again.open()
        assert not taken(again, logs / "a.mcap").changed
        assert [one.id for one in again.demonstrations()] == [one.id for one in visit.demonstrations()]
        other = Visit(tmp_path, ExtractSettings(participant="x"), LoadOptions())
        other.open()
        assert "a.mcap: counted anew, because options" in taken(other, logs / "a.mcap").notes[0]
        assert {one.participant for one in other.demonstrations()} == {"x"}

    def test_a_repaired_copy_counts_once_and_a_longer_recording_replaces_what_it_was(self, visit, logs):
        data = SAMPLES[0].read_bytes()
        (logs / "a.mcap").write_bytes(data[:900_000])
        added = taken(visit, logs / "a.mcap")
        assert added.changed
        assert "the file ends inside a chunk" in added.lost[0]
        few = len(visit.demonstrations())
        (logs / "repaired.mcap").write_bytes(data)
        (line,) = taken(visit, logs / "repaired.mcap").lost
        assert "holds trials that a.mcap holds too" in line
        (logs / "a.mcap").write_bytes(data)
        added = taken(visit, logs / "a.mcap")
        assert "a.mcap: counted anew, because it has changed" in added.notes
        assert (visit.recordings, len(visit.demonstrations())) == (1, 7)
        assert few < 7

    def test_what_is_no_recording_is_left_out(self, visit, logs):
        (logs / "a.mcap").write_bytes(MAGIC + END)
        (line,) = taken(visit, logs / "a.mcap").lost
        assert line.startswith("left out: ")
        assert not visit

    def test_results_of_other_commands_are_not_replaced(self, tmp_path):
        (tmp_path / "demos.json").write_text("mine")
        with pytest.raises(ArtefactError, match=r"found demos.json of another command"):
            Visit(tmp_path, ExtractSettings(), LoadOptions()).open()

    def test_the_next_paths_are_those_of_the_last_recording_each_place_once(self, visit, logs):
        for number, log in enumerate(SAMPLES[:2]):
            shutil.copy(log, logs / f"{number}.mcap")
            taken(visit, logs / f"{number}.mcap")
        chosen = select(visit.demonstrations(), Subset(("force",))).demonstrations
        # two starts beside the line, and two from the line, of which the later one counts
        assert [one.id for one in next_trials(chosen)] == ["p02/1", "p02/2", "p02/4"]


def a_fit(count, prior=None):
    """A fit to normal data of known information."""
    of_one = np.array([[4.0, 1.0], [1.0, 3.0]])
    precision = count * of_one + (0 if prior is None else prior.precision)
    covariance = np.linalg.inv(precision)
    errors = np.sqrt(np.diag(covariance))
    found = SimpleNamespace(
        standard_errors=errors, correlation=covariance / np.outer(errors, errors), prior=prior, demonstrations=count
    )
    return found, of_one, covariance


@pytest.mark.parametrize("prior", [None, Prior.gaussian(np.zeros(2), np.diag([0.1, 2.0]))])
def test_another_pass_changes_a_normal_estimate_as_drawn_data_do(prior):
    fit, of_one, covariance = a_fit(3, prior)
    slope = np.array([0.7, -0.2])
    found = another_pass(fit, slope)
    rng = np.random.default_rng(0)
    theta = rng.multivariate_normal(np.zeros(2), covariance, 40_000)
    seen = theta + rng.multivariate_normal(np.zeros(2), np.linalg.inv(of_one), 40_000)
    after = np.linalg.inv(np.linalg.inv(covariance) + of_one)
    moved = seen @ of_one @ after @ slope
    assert found == pytest.approx(moved.std(), rel=0.02)
    assert another_pass(a_fit(30, prior)[0], slope) < found / 3


@pytest.mark.slow
def test_another_pass_changes_a_fit_as_much_as_predicted():
    """People drawn from the prior, four paths of each, then a fifth: 0.020 m predicted, 0.017 m found."""
    scene = straight_passage(0.3, 0.1).scene
    mean, scatter = np.array([-54.0, -0.9, -4.9, 1.7]), np.array([0.1, 0.25, 0.25, 0.2])
    prior, rng = Prior.gaussian(mean, np.diag((mean * scatter) ** 2)), np.random.default_rng(0)
    ratios = []
    for _ in range(12):
        person = Reward(tuple((mean * np.exp(rng.normal(0, scatter))).tolist()))
        drawn = sample_paths(policy_of(person, scene), scene.start, 5, rng)
        cells = [scene.lattice.cells[drawn.path(number)] for number in range(5)]
        paths = [
            make.demonstration(scene.lattice.grid, one, scene.people_m, number) for number, one in enumerate(cells, 1)
        ]
        four, five = (
            fit(evidence_of(some), Reward(tuple(mean.tolist())), prior=prior, scan=False) for some in (paths[:4], paths)
        )
        sure = certainty.certainty(four, 0.3, 0.1)
        ratios.append((certainty.passing_m(five.reward, 0.3, 0.1) - sure.passing_m.value) / sure.another_m)
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_the_line_says_what_is_learnt_and_whether_to_go_on():
    sure = Certainty(Quantity(0.43, 0.31, 0.52), 0.061)
    assert learnt_line(sure, 0.5, 4, 1) == (
        "4 demonstrations of 1 recording: pass people at 0.43 m, -0.07 m; 95 % interval 0.31 to 0.52 m; another pass "
        "would change it by about 0.061 m: go on"
    )
    assert learnt_line(Certainty(sure.passing_m, 0.049), float("nan"), 1, 2).endswith("0.049 m: enough")
    unknown = Certainty(Quantity(0.43), float("nan"))
    assert "how sure is unknown" in learnt_line(unknown, 0.5, 4, 1)
    assert "another pass is needed" in learnt_line(Certainty(Quantity(float("nan")), float("nan")), 0.5, 4, 1)


@pytest.fixture
def quick(monkeypatch):
    """Without the search for other maxima and with few draws."""
    monkeypatch.setattr(loop, "confirmed", lambda learnt, _choice: (learnt, ""))
    monkeypatch.setattr(certainty, "DRAWS", 6)


def watch(folder, *words, code=0):
    words = ["watch", "logs", "--condition", "force", "-o", "visit", "--once", "--settle", "0", *words]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert done.exit_code == code, done.output
    return done


def interrupted(*_):
    raise KeyboardInterrupt


@pytest.mark.usefixtures("quick")
def test_from_a_recording_to_reward_paths_and_figure_and_on_from_there(tmp_path):
    (tmp_path / "logs").mkdir()
    shutil.copy(SAMPLES[0], tmp_path / "logs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "write_reward", interrupted)
        assert watch(tmp_path, code=130).stderr == "navirl: interrupted\n"
    assert not (tmp_path / "visit" / "reward.json").exists()
    (line,) = watch(tmp_path).stdout.splitlines()
    assert line.startswith("4 demonstrations of 1 recording: pass people at 0.")
    visit = tmp_path / "visit"
    assert read_reward(visit / "reward.json").demonstrations == ("p01/1", "p01/2", "p01/3", "p01/4")
    plan = read_plan(visit / "path_3.json")
    assert plan["paths"][0]["min_distance_m"] > 0.2
    assert all((visit / f"path_{k}.{kind}").exists() for k in (1, 2, 3) for kind in ("json", "csv", "yaml"))
    assert (visit / "paths.png").read_bytes().startswith(b"\x89PNG")
    first = json.loads((visit / "reward.json").read_text())
    # a log that still grows, the same log again, and a path of an older cycle
    (tmp_path / "logs" / "b.mcap").write_bytes(SAMPLES[0].read_bytes())
    (visit / "path_9.csv").write_text("old")
    said = watch(tmp_path, code=3)
    assert ", +0.00 m;" in said.stdout
    assert "b.mcap: the same recording as p01.mcap, which counts once" in said.stderr
    assert json.loads((visit / "reward.json").read_text()) == first
    assert not (visit / "path_9.csv").exists()


def test_the_earlier_reward_is_no_output(tmp_path):
    (tmp_path / "visit").mkdir()
    (tmp_path / "visit" / "reward.json").write_text("{}")
    assert "expected another file than the input" in watch(tmp_path, "--reward", "visit/reward.json", code=2).stderr


def waited(condition, what, seconds=120):
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def hash_of(visit):
    reward = visit / "reward.json"
    return reward.read_bytes() if reward.exists() else b""


@pytest.mark.slow
def test_a_visit_of_two_cycles_that_is_killed_in_the_middle(tmp_path):
    """The second cycle drives the path that the first one taught; nothing is lost, and nothing counts twice."""
    visit, logs = tmp_path / "visit", tmp_path / "logs"
    logs.mkdir()
    words = [sys.executable, "-m", "navirl_cli", "watch", "logs", "--condition", "force", "-o", "visit"]

    def start():
        return subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    first = start()
    write_log(1, 3, logs / "first.mcap", force=False)
    waited(lambda: any((visit / "recordings").glob("*.json")), "no recording counts")
    first.kill()
    first.communicate()
    second = start()
    waited(lambda: read_intervals(visit), "the first cycle is not learnt")
    learnt = hash_of(visit)
    write_log(1, 3, logs / "second.mcap", driven_m=read_line(visit / "path_3.csv"), force=False)
    waited(lambda: hash_of(visit) != learnt and read_intervals(visit), "the second cycle is not learnt")
    second.send_signal(signal.SIGINT)
    stdout, stderr = second.communicate(timeout=60)
    assert second.returncode == 130
    assert stderr.endswith("navirl: interrupted\n")
    one, two = stdout.splitlines()
    assert one.startswith("4 demonstrations of 1 recording: ")
    assert two.startswith("6 demonstrations of 2 recordings: ")
    assert sorted(path.name for path in visit.iterdir() if path.name.startswith(".")) == []
    # as without a kill, and as by hand
    watch(tmp_path, "-o", "other")
    CliRunner().invoke(
        cli, ["fit", str(visit / "demos.json"), "--condition", "force", "-o", str(tmp_path / "hand.json")]
    )
    own, other, hand = (
        read_reward(path).reward.theta
        for path in (visit / "reward.json", tmp_path / "other" / "reward.json", tmp_path / "hand.json")
    )
    assert own == other == hand
    # the second cycle drove where it was planned, so that the person had less to correct
    impulses = {
        one.id: sum(np.hypot(*contact.impulse_n_s) for contact in one.contacts)
        for one in read_demonstrations(visit / "demos.json")
    }
    assert max(impulses["p01/8"], impulses["p01/9"]) < min(impulses["p01/1"], impulses["p01/2"])


def read_intervals(visit):
    """The intervals of a visit's reward, which the confirmed fit has."""
    reward = visit / "reward.json"
    return read_reward(reward).intervals if reward.exists() else ()


def test_earlier_people_are_a_prior_with_their_scatter_and_teach_one_person_at_a_time():
    typical = Reward((-50.0, -1.0, -5.0, 2.0))
    others = Others(
        LogScale(typical, np.array([True, True, True, False])),
        Spread(np.log([50.0, 1.0, 5.0]), np.array([0.1, 0.2, 0.3])),
    )
    choice = Choice(earlier=SimpleNamespace(others=others, reward=typical))
    np.testing.assert_allclose(np.diag(choice.prior.precision), [1 / 25, 25, 1 / 2.25, 0.0])
    np.testing.assert_allclose(choice.prior.gradient(np.array(typical.theta)), 0.0, atol=1e-9)
    two = [
        make.demonstration(make.open_grid(8, 4), [(x, 1) for x in range(1, 6)], participant=name) for name in ("a", "b")
    ]
    with pytest.raises(DemonstrationError, match=r"expected recordings of one participant, found a, b"):
        learn(two, choice)


@pytest.mark.slow
def test_the_next_person_is_learnt_from_how_earlier_people_differ(tmp_path):
    (tmp_path / "logs").mkdir()
    shutil.copy(SAMPLES[0], tmp_path / "logs")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path)
        for words in (
            ["extract", *map(str, SAMPLES[1:]), "-o", "demos.json"],
            ["fit", "demos.json", "--condition", "force", "--pool", "persons", "-o", "persons.json"],
        ):
            done = CliRunner().invoke(cli, words, catch_exceptions=False)
            assert done.exit_code == 0, done.output
    said = watch(tmp_path, "--reward", "persons.json").stdout.splitlines()
    assert said[0].startswith("4 demonstrations of 1 recording: pass people at 0.")
    assert all(line.startswith("refined by the mean over all rewards that the person may have: ") for line in said[1:])
    assert read_reward(tmp_path / "visit" / "reward.json").intervals
