"""Trials of which poses are missing at the beginning, at the end or inside."""

from dataclasses import replace

import nav_log as nav
import numpy as np
import pytest
import robot_scene as forge
from factories import demonstration, open_grid
from robot_scene import Robot
from shared_cases import case

from navirl_cli.artefacts.demonstrations import demonstrations_document, demonstrations_of, read_demonstrations
from navirl_cli.artefacts.store import write_json
from navirl_cli.commands.study import _given
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.demos.trials import Split
from navirl_cli.errors import DemonstrationError, TruncatedError
from navirl_cli.irl.selection import select
from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import Source
from navirl_cli.reports.fit_remarks import remarks
from navirl_cli.reports.repeated import repeated

KEPT = ExtractSettings(keep_truncated=True)


@pytest.fixture
def extracted(tmp_path):
    """What is extracted from a log."""

    def extracted_from(log, **settings):
        return extract(load_recording(log.write(tmp_path / "run.mcap")), ExtractSettings(**settings))

    return extracted_from


CUT = [
    (
        {"odometry": [(0.0, 9.0)]},
        r"cut off: poses are missing for 7\.\d s until the log's end, and the last pose is 1\.2\d m from the goal",
    ),
    (
        {"tf": [(0.0, 8.0)]},
        r"cut off: poses are missing for 7\.\d s until the log's end \(tf does not place the odometry there\), and the",
    ),
    ({"odometry": [(5.0, 16.0)]}, r"cut off: poses are missing in its first 4\.0 s; keep it, marked as truncated"),
    (
        {"tf": [(6.0, 16.0)]},
        r"cut off: poses are missing in its first 4\.0 s \(tf does not place the odometry there\); keep",
    ),
]


@pytest.mark.parametrize(("spans", "reason"), CUT)
def test_a_trial_that_is_cut_off_is_left_out_or_kept_with_a_mark(extracted, spans, reason):
    log = forge.scene(Robot(**spans))
    with pytest.raises(TruncatedError, match=rf"^run.mcap: no trial became a demonstration: trial 1: {reason}"):
        extracted(log)
    (kept,) = extracted(log, keep_truncated=True).demonstrations
    assert kept.truncated
    assert kept.notes[0].startswith("truncated: poses are missing ")


@pytest.mark.parametrize(
    ("spans", "reason"),
    [
        ({"odometry": [(0.0, 6.0), (8.0, 16.0)]}, r"trial 1: poses are missing for 2\.1 s$"),
        (
            {"tf": [(0.0, 4.0), (11.0, 16.0)]},
            r"trial 1: poses are missing for 7\.\d s \(tf does not place the odometry",
        ),
    ],
)
def test_a_gap_inside_is_refused_whatever_the_user_keeps(extracted, spans, reason):
    for keep in (False, True):
        with pytest.raises(DemonstrationError, match=reason):
            extracted(forge.scene(Robot(**spans)), keep_truncated=keep)


def test_a_log_that_ends_while_the_robot_drives(extracted):
    log = forge.scene()
    log.messages = [one for one in log.messages if one.log_time_ns < forge.at(8.0)]
    with pytest.raises(
        TruncatedError, match=r"cut off: the log ends while the robot drives, and the last pose is 1\.\d"
    ):
        extracted(log)
    with pytest.raises(TruncatedError, match=r"cut off: the log ends while the robot drives; keep it"):
        extracted(log, split=Split.STOP)
    (whole,) = extracted(log, split=Split.NONE).demonstrations
    assert not whole.truncated


def test_a_short_pause_of_tf_and_a_stop_before_the_end_of_the_log_are_whole(extracted):
    (found,) = extracted(forge.scene(Robot(tf=[(0.0, 5.0), (8.0, 13.0)]))).demonstrations
    assert not found.truncated
    (found,) = extracted(forge.scene(Robot(odometry=[(0.0, 13.0)]))).demonstrations
    assert not found.truncated
    (found,) = extracted(forge.scene(Robot(odometry=[(1.9, 16.0)]))).demonstrations
    assert not found.truncated


def test_one_that_ends_far_from_its_goal_with_everything_present_stays_with_its_warning(extracted):
    (found,) = extracted(forge.scene(goal=(4.8, 0.0))).demonstrations
    assert not found.truncated
    assert found.notes[0] == "ended 0.80 m from its goal; its last cell stands for the goal"


def test_a_trial_whose_poses_end_before_the_next_goal(extracted):
    """The robot is lost at 9 s, on its way; the next goal comes at 12.5 s, when it is known again."""
    log = forge.scene(Robot(odometry=[(0.0, 9.0), (12.2, 16.0)]))
    log.add("/goal_pose", nav.pose_stamped(forge.at(12.5), 0.0, 0.0), forge.at(12.5))
    # within the goal's span the gap lies before an arrival
    with pytest.raises(DemonstrationError, match=r"trial 1: poses are missing for 3\.\d s"):
        extracted(log)
    log = forge.scene(Robot(odometry=[(0.0, 9.0)]))
    log.add("/goal_pose", nav.pose_stamped(forge.at(12.5), 0.0, 0.0), forge.at(12.5))
    with pytest.raises(
        DemonstrationError,
        match=r"until the log's end, .*; a goal was announced after the last pose, 8\.9 s into the log",
    ):
        extracted(log)


def test_goals_after_the_last_pose_are_listed(extracted):
    log = forge.scene(Robot(odometry=[(0.0, 13.0)]))
    for second in (14.5, 15.5):
        log.add("/goal_pose", nav.pose_stamped(forge.at(second), 0.0, second / 20), forge.at(second))
    found = extracted(log)
    assert len(found.demonstrations) == 1
    assert found.skipped == ("run.mcap: 2 goals were announced after the last pose, 12.9 s into the log",)


@pytest.mark.parametrize(
    ("spans", "sentence"),
    [
        ({"tf": [(0.0, 8.0)]}, "poses end 7.2 s before the other measurements; a trial that has not arrived"),
        ({"odometry": [(5.0, 16.0)]}, "poses begin 5.0 s after the other measurements; a trial from before is cut off"),
    ],
)
def test_inspect_says_that_poses_begin_late_or_end_early(tmp_path, spans, sentence):
    path = forge.scene(Robot(**spans)).write(tmp_path / "run.mcap")
    assert any(one.startswith(sentence) for one in overview(Source(path.name, (path,)), {}).findings)


@pytest.mark.parametrize(("name", "driven_m"), [("odom_ends_early", 5.16), ("tf_ends", 5.57)])
def test_the_shared_cases_are_left_out_or_kept(name, driven_m):
    recording = load_recording(case(name))
    with pytest.raises(TruncatedError, match="cut off: poses are missing for"):
        extract(recording, ExtractSettings())
    (kept,) = extract(recording, KEPT).demonstrations
    assert kept.truncated
    assert np.hypot(*np.diff(kept.xy_m, axis=0).T).sum() == pytest.approx(driven_m, abs=0.1)


# what later commands make of them


def of(name, **changes):
    """A demonstration of another name."""
    return replace(DRIVEN, id=name, **changes)


DRIVEN = demonstration(open_grid(6, 4), [(1, 1), (2, 1), (3, 1)])


CUT = of("a/2", truncated=True, warnings=("the clock steps back",), notes=("truncated: poses are missing",))


def test_fit_leaves_truncated_trials_out_unless_asked():
    whole, cut = of("a/1"), of("a/2", truncated=True)
    assert [one.id for one in select([whole, cut]).demonstrations] == ["a/1"]
    assert [one.id for one in select([whole, cut], truncated=True).demonstrations] == ["a/1", "a/2"]
    with pytest.raises(DemonstrationError, match=r"expected demonstrations that are whole, found 1 that are cut off"):
        select([cut])


def test_a_study_leaves_truncated_trials_of_a_file_out(tmp_path):
    write_json(tmp_path / "d.json", "demonstrations", demonstrations_document([of("a/1"), CUT], [], {}), force=False)
    given = _given([tmp_path / "d.json"], LoadOptions(), None)
    assert [one.id for one in given.demonstrations] == ["a/1"]
    assert given.lost == ["left out: a/2 is cut off"]


def test_warnings_and_the_mark_are_kept_in_the_file(tmp_path):
    cut = CUT
    document = demonstrations_document([cut], [], {})
    write_json(tmp_path / "demos.json", "demonstrations", document, force=False)
    (read,) = read_demonstrations(tmp_path / "demos.json")
    assert (read.truncated, read.warnings, read.notes) == (True, cut.warnings, cut.notes)
    for name in ("truncated", "warnings"):
        del document["demonstrations"][0][name]
    (older,) = demonstrations_of(document, "demos.json")
    assert (older.truncated, older.warnings) == (False, ())


def test_what_extraction_warned_of_is_repeated_once_with_a_count():
    demos = [
        of(f"a/{number}", warnings=("the clock steps back",), notes=(f"ended 0.{number} m off",)) for number in range(5)
    ]
    demos.append(of("b/1", notes=("no people in the scene",)))
    assert repeated(demos) == [
        "5 of 6 demonstrations: ended 0.0 m off (a/0; with other numbers the others)",
        "5 of 6 demonstrations: the clock steps back",
        "b/1: no people in the scene",
    ]
    assert remarks(demos, None, chosen_by=("force",))[:3] == repeated(demos)


def test_warnings_of_the_recording_travel_with_its_trials(extracted):
    log = forge.scene()
    log.add("/tf_static", forge.mounting(0.0), forge.at(13))
    (found,) = extracted(log).demonstrations
    assert found.warnings[0].startswith("the static transform base_link -> ft is sent again with another value: ")
