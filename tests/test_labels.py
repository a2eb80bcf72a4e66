"""Labels of trials from a table: what is read, to which trial it belongs, what is refused and how."""

import csv
import io
import json

import numpy as np
import pytest
from robot_log import START_NS, Run, write_run

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.demos.labels import log_names, read_labels
from navirl_cli.demos.recordings import extract_recordings
from navirl_cli.demos.trials import Split
from navirl_cli.errors import ArtefactError, LabelError, NavirlError
from navirl_cli.logs.load import LoadOptions, load_recording
from navirl_cli.logs.sources import sources_of

#: Two trials, at 1.5 s and at 7 s, which are 1.5 s and 7 s after the first pose.
TWO = Run(goals=((1.5, 2.0, 0.0), (7.0, 4.0, 0.0)))
HEADER = (
    "log,trial,start_s,duration_s,length_m,contact_s,participant,condition,cycle,set,robot_radius_m,people_m,nominal_m"
)


@pytest.fixture
def log(tmp_path):
    return write_run(tmp_path / "run.mcap", TWO)


@pytest.fixture
def table(tmp_path):
    """Write a table and read it."""

    def write(content, name="trials.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_labels(path)

    return write


def demos(labels, *logs, **settings):
    return extract_recordings(logs, ExtractSettings(**settings), LoadOptions(), labels=labels)


def test_a_row_states_everything_of_its_trial(log, table):
    rows = (
        "start_s,participant,condition,cycle,set,robot_radius_m,people_m,nominal_m\n"
        '1.6,anna,Joystick,3,corridor,0.25,"1,1; 2,-1.25","0,0; 1,0.5; 4,0"\n'
        "7.3,bert,force,1,,,none,\n"
    )
    first, second = demos(table(rows), log).demonstrations()
    assert (first.id, first.participant, first.condition.value) == ("anna/1", "anna", "joystick")
    assert (first.cycle, first.set, first.robot_radius_m) == (3, "corridor", 0.25)
    assert first.people_m.tolist() == [[1, 1], [2, -1.25]]
    assert first.nominal_m.tolist() == [[0, 0], [1, 0.5], [4, 0]]
    assert (second.id, second.condition.value, second.cycle, second.set) == ("bert/2", "force", 1, None)
    assert second.notes[-2:] == (
        "people by people_m: 0; in the log: 1; those of the log are ignored",
        "nobody was there",
    )
    assert (len(second.people_m), second.nominal_m, second.robot_radius_m) == (0, None, 0.25)


def test_empty_cells_keep_what_the_log_states(tmp_path, table):
    entry = {"t_ns": START_NS + 1_500_000_000, "cycle": 2, "condition": "joystick", "nominal_m": [[0, 0], [4, 0]]}
    session = {"participant": "carl", "trials": json.dumps([entry]), "robot_radius_m": "0.2"}
    log = write_run(tmp_path / "run.mcap", Run(session=session, goals=TWO.goals))
    first, second = demos(table("start_s,set,cycle\n1.5,corridor,\n7,,5\n"), log).demonstrations()
    assert (first.participant, first.condition.value, first.cycle, first.set) == ("carl", "joystick", 2, "corridor")
    assert first.nominal_m.tolist() == [[0, 0], [4, 0]]
    assert (second.participant, second.condition.value, second.cycle) == ("carl", "force", 5)
    assert {first.robot_radius_m, second.robot_radius_m} == {0.2}


def test_the_table_of_inspect_changes_nothing(navirl, tmp_path):
    entries = [
        {"t_ns": START_NS + 1_500_000_000, "cycle": 2, "condition": "joystick", "people_m": [[1.25, -1.1]]},
        {"t_ns": START_NS + 7_000_000_000, "participant": "dora", "set": "way, back", "people_m": []},
    ]
    session = {"participant": "carl", "trials": json.dumps(entries), "robot_radius_m": "0.2"}
    log = write_run(tmp_path / "run.mcap", Run(session=session, goals=TWO.goals))
    written = navirl("inspect", log, "--trials").stdout
    rows = list(csv.DictReader(io.StringIO(written)))
    assert written.splitlines()[0] == HEADER
    assert [row["participant"] for row in rows] == ["carl", "dora"]
    assert [row["people_m"] for row in rows] == ["1.25,-1.1", "none"]
    assert [row["condition"] for row in rows] == ["joystick", ""]
    assert [float(row["start_s"]) for row in rows] == [1.5, 7.0]
    (tmp_path / "trials.csv").write_text(written)
    navirl("extract", log, "-o", "a.json")
    done = navirl("extract", log, "--trials", "trials.csv", "-o", "b.json")
    a, b = (json.loads((tmp_path / name).read_text()) for name in ("a.json", "b.json"))
    assert a["demonstrations"] == b["demonstrations"]
    assert b["settings"]["trials"] == "trials.csv"
    assert b["inputs"][-1]["file"] == "trials.csv"
    assert "no row" not in done.stderr


@pytest.mark.parametrize(
    "content",
    [
        "start_s;cycle;participant;people_m\r\n1,48;2;Jürgen;1.5,-1\r\n".encode("utf-8-sig"),
        "start_s\tcycle\tparticipant\tpeople_m\n1.48\t2.0\tJürgen\t1.5,-1\n",
        'start_s,cycle,participant,people_m\n1.48,2,Jürgen,"\'1.5,-1"\n'.replace("'1.5", "1.5"),
        'start_s,cycle,participant,people_m\n1.48,2.0,Jürgen,"1.5 , -1;"\n\n,,,\n',
    ],
)
def test_tables_of_spreadsheets_in_any_language(table, content):
    (row,) = table(content).rows
    assert (row.start_s, row.cycle, row.participant) == (1.48, 2, "Jürgen")
    assert row.people_m.tolist() == [[1.5, -1]]


def test_the_mark_before_what_is_no_formula_is_no_part_of_a_text(table):
    (row,) = table("start_s,participant,people_m\n1,'=me,\"'-1,2\"\n").rows
    assert (row.participant, row.people_m.tolist()) == ("=me", [[-1, 2]])


def test_trials_without_a_row_keep_their_guesses_and_are_listed(log, table):
    found = demos(table("start_s,participant,condition,cycle\n7,anna,force,1\n"), log)
    first, second = found.demonstrations()
    assert (first.participant, second.participant) == ("run", "anna")
    assert "run.mcap: `trials` has no row for trial 1: what the log states of it counts" in found.notes([])
    (guessed,) = [note for note in found.notes([]) if "guessed" in note]
    assert guessed == (
        "run.mcap: guessed, because it is not stated: participant (the log's name), condition (from joystick and "
        "contacts); state it with `participant`, `condition`, or for each trial with `trials`"
    )


def test_a_log_with_all_labels_says_nothing_of_guesses(log, table):
    found = demos(table("start_s,participant,condition,cycle\n1.5,anna,force,1\n7,anna,force,\n"), log)
    assert [note for note in found.notes([]) if "guessed" in note or "row" in note] == []


def test_the_log_says_in_one_line_what_is_guessed(navirl, log):
    done = navirl("extract", log, "-o", "a.json")
    (line,) = [line for line in done.stderr.splitlines() if "guessed" in line]
    assert line == (
        "navirl: run.mcap: guessed, because it is not stated: participant (the log's name), condition (from joystick "
        "and contacts), cycle (none); state it with --participant, --condition, --cycle, or for each trial with "
        "--trials"
    )
    stated = ("--participant", "anna", "--condition", "force", "--cycle", "1")
    assert "guessed" not in navirl("extract", log, *stated, "-o", "b.json").stderr


def test_labels_of_whole_logs(navirl, tmp_path, log):
    words = ("--condition", "joystick", "--cycle", "4", "--set", "corridor", "-o", "a.json")
    navirl("extract", log, *words)
    for one in json.loads((tmp_path / "a.json").read_text())["demonstrations"]:
        assert (one["condition"], one["cycle"], one["set"]) == ("joystick", 4, "corridor")
    assert "'unknown'" in navirl("extract", log, "--condition", "unknown", "-o", "b.json", code=2).stderr
    assert "0 is not in the range" in navirl("extract", log, "--cycle", "0", "-o", "b.json", code=2).stderr


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            "4.2",
            r"line 2, .*: expected the start of a trial of run\.mcap, found 4\.2 s; near are the trials 1 at 1\.5 s, 2",
        ),
        ("1.5\n1.6", r"line 3: .* found a second for trial 1 of run\.mcap after that of line 2; remove one"),
        ("1e300", "column start_s: expected the trial's start in s, as inspect writes it, found '1e300'; correct it"),
        ("nan", "column start_s: expected the trial's start in s"),
    ],
)
def test_rows_that_fit_no_trial_are_refused(log, table, rows, message):
    with pytest.raises(LabelError, match=r"trials\.csv: " + f".*{message}"):
        demos(table(f"start_s\n{rows}\n"), log)


@pytest.mark.parametrize(
    ("column", "cell", "message"),
    [
        ("condition", "forec", "column condition: expected one of 'force', 'joystick', 'autonomous', 'unknown', found"),
        ("cycle", "0", "column cycle: expected a whole number from 1 on, found '0'; correct it"),
        ("cycle", "1.5", "column cycle: expected a whole number from 1 on, found '1.5'"),
        ("cycle", "first", "column cycle: expected a whole number from 1 on, found 'first'"),
        ("robot_radius_m", "0", "column robot_radius_m: expected a radius above 0 m, at most 10 m, found '0'"),
        ("robot_radius_m", "35", "column robot_radius_m: expected a radius above 0 m, at most 10 m, found '35'"),
        ("people_m", "1,2,3", "column people_m: expected points in m as x,y; x,y, found '1,2,3'"),
        ("people_m", "nobody", "column people_m: expected points in m as x,y; x,y, found 'nobody'"),
        ("people_m", "1,inf", "column people_m: expected points in m"),
        ("people_m", "1,2;" * 1001, "column people_m: expected points in m as x,y; x,y, at most 1000, found"),
        ("nominal_m", "1,2", "column nominal_m: expected 2 or more points in m"),
        ("nominal_m", "1,2; 1e9,3", "column nominal_m: expected 2 or more points in m"),
        ("start_s", "", "column start_s: expected the trial's start in s, as inspect writes it, found nothing"),
    ],
)
def test_cells_that_cannot_be_are_refused(table, column, cell, message):
    header = {"start_s": "1", "set": "x"} | {column: f'"{cell}"'}
    with pytest.raises(ArtefactError) as caught:
        table(f"{','.join(header)}\n{','.join(header.values())}\n")
    assert f"trials.csv: line 2, {message}" in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("trial,condition\n1,force\n", "found no column start_s but 'trial,condition'; name them so"),
        ("start_s,conditon\n1,force\n", "found an unknown column 'conditon'; name it condition, or remove it"),
        ("start_s\n", r"expected trials below the header, found none; add one line per trial"),
        ("start_s,people_m\n1,1,2\n", "expected 2 columns as in the header, found 3"),
        ("start_s,set\n1,Fl\xfcr\n".encode("latin1"), 'line 2: expected UTF-8, found the byte 0xfc; save it as "CSV'),
    ],
)
def test_other_tables_are_refused(table, content, message):
    with pytest.raises(ArtefactError, match=message):
        table(content)


def test_a_log_has_one_robot(log, table):
    rows = table("start_s,robot_radius_m\n1.5,0.3\n7,0.4\n")
    with pytest.raises(
        LabelError, match=r"line 3, column robot_radius_m: expected 0\.3 as in line 2, found 0\.4; a log"
    ):
        demos(rows, log)


@pytest.mark.parametrize(
    ("column", "cell", "settings", "message"),
    [
        ("participant", "anna", {"participant": "bert"}, "expected bert, which `participant` states for all"),
        ("cycle", "2", {"cycle": 1}, "expected 1, which `cycle` states for all logs, found 2; state it in one place"),
        ("people_m", '"1,2"', {"people_m": ((0.0, 1.0),)}, "expected 0,1, which `person` states for all logs"),
        ("robot_radius_m", "0.2", {"robot_radius_m": 0.3}, "expected 0.3, which `robot_radius` states for all logs"),
    ],
)
def test_options_and_rows_do_not_contradict_each_other(log, table, column, cell, settings, message):
    rows = table(f"start_s,{column}\n1.5,{cell}\n")
    with pytest.raises(LabelError) as caught:
        demos(rows, log, **settings)
    assert f"trials.csv: line 2, column {column}: {message}" in str(caught.value)


@pytest.fixture
def folders(tmp_path):
    """Two logs of the same name in folders of their own."""
    for name in ("anna", "bert"):
        (tmp_path / "logs" / name).mkdir(parents=True)
        write_run(tmp_path / "logs" / name / "run.mcap", TWO if name == "anna" else Run())
    return tmp_path / "logs"


def test_logs_of_one_name_are_known_by_their_folders(navirl, folders, tmp_path):
    assert log_names(sources_of([folders])) == ["anna/run.mcap", "bert/run.mcap"]
    written = navirl("inspect", folders, "--trials").stdout
    assert [line.split(",")[0] for line in written.splitlines()[1:]] == [
        "anna/run.mcap",
        "anna/run.mcap",
        "bert/run.mcap",
    ]
    rows = [dict(row, participant=row["log"].split("/")[0]) for row in csv.DictReader(io.StringIO(written))]
    with (tmp_path / "trials.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    navirl("extract", folders, "--trials", "trials.csv", "-o", "a.json")
    found = json.loads((tmp_path / "a.json").read_text())["demonstrations"]
    assert [one["id"] for one in found] == ["anna/1", "anna/2", "bert/1"]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("run.mcap,1.5", r"found 'run\.mcap', which fits 2 of the logs; name one of anna/run\.mcap, bert/run\.mcap"),
        (",1.5", r"line 2, column log: expected the name of one log, found nothing, which fits 2 of the logs"),
        ("p9.mcap,1.5", r"expected rows of anna/run\.mcap, bert/run\.mcap, found rows of p9\.mcap; correct the"),
        ("anna/run.mcap,7\nbert/run.mcap,7", r"line 3, column start_s: expected the start of a trial of"),
    ],
)
def test_rows_of_no_certain_log_are_refused(folders, table, rows, message):
    with pytest.raises(LabelError, match=message):
        demos(table(f"log,start_s\n{rows}\n"), folders)


def test_rows_of_logs_that_are_not_read_are_counted(folders, table):
    found = demos(table("log,start_s\nanna/run.mcap,7\nbert\\run.mcap,1.5\n"), folders / "anna")
    assert found.notes([])[0] == "trials.csv: rows of logs that were not read: 1 (bert\\run.mcap)"


def test_an_entry_of_a_session_record_belongs_to_one_trial(tmp_path):
    """The second trial begins within the length of the first one's entry, and is not the one that it means."""
    entry = {"t_ns": START_NS + 4_000_000_000, "cycle": 2}
    session = {"trials": json.dumps([entry])}
    log = write_run(tmp_path / "run.mcap", Run(session=session, goals=TWO.goals))
    first, second = extract(load_recording(log), ExtractSettings()).demonstrations
    assert (first.cycle, second.cycle) == (2, None)


def test_a_session_record_on_another_clock_is_reported(tmp_path):
    session = {"trials": json.dumps([{"t_ns": 2_500_000_000, "cycle": 2}, {"t_ns": 3_000_000_000}])}
    log = write_run(tmp_path / "run.mcap", Run(session=session))
    notes = extract(load_recording(log), ExtractSettings()).notes
    (note,) = [note for note in notes if "session record" in note]
    assert (
        "run.mcap: its session record labels no trial: of its 2 entries, the nearest to the first trial is 16999"
        in note
    )
    assert note.endswith(" s away; correct t_ns, or choose another `time`")


def test_trials_between_stops_are_labelled_too(log, table):
    found = demos(table("start_s,cycle\n2.1,7\n"), log, split=Split.STOP)
    assert [one.cycle for one in found.demonstrations()] == [7]


def test_a_log_without_goals_and_map_is_listed_with_a_goal(navirl, tmp_path):
    log = write_run(tmp_path / "run.mcap", Run(goals=(), map=False, wrench_topics=()))
    error = navirl("inspect", log, "--trials", code=1).stderr
    assert "give one with --goal x,y, or choose --split stop or --split none" in error
    (row,) = csv.DictReader(io.StringIO(navirl("inspect", log, "--trials", "--goal", "4,0").stdout))
    assert (float(row["start_s"]), row["contact_s"]) == (0, "")
    assert float(row["length_m"]) == pytest.approx(4, abs=0.02)


def test_the_table_leaves_out_what_extract_leaves_out(navirl, tmp_path):
    log = write_run(tmp_path / "run.mcap", Run(goals=((0.2, 0.1, 0.0), (1.5, 4.0, 0.0))))
    done = navirl("inspect", log, "--trials")
    assert [row["trial"] for row in csv.DictReader(io.StringIO(done.stdout))] == ["2"]
    assert "run.mcap: trial 1 left out, because the robot hardly moves; extract leaves it out too" in done.stderr


def test_a_log_whose_goal_comes_after_its_last_pose_has_no_trials(navirl, tmp_path):
    late = write_run(tmp_path / "late.mcap", Run(goals=((20.0, 4.0, 0.0),)))
    good = write_run(tmp_path / "run.mcap", TWO)
    error = navirl("inspect", late, "--trials", code=1).stderr
    assert "late.mcap: no trial: no goal is announced while poses are recorded" in error
    done = navirl("inspect", late, good, "--trials", code=3)
    assert len(done.stdout.splitlines()) == 3
    assert "left out: late.mcap: no trial" in done.stderr
    done = navirl("extract", late, good, "-o", "a.json", code=3)
    assert "late.mcap: no trial became a demonstration: a goal was announced after the last pose" in done.stderr


@pytest.mark.parametrize(
    "words", [("--check", "--trials"), ("--split", "stop"), ("--goal", "1,2"), ("--frame", "odom")]
)
def test_options_of_the_table_need_it(navirl, log, words):
    assert "--trials" in navirl("inspect", log, *words, code=2).stderr


def test_the_same_labels_from_python(log, tmp_path):
    import navirl_cli

    (tmp_path / "trials.csv").write_text("start_s,participant\n1.5,anna\n7,bert\n")
    found = navirl_cli.extract(log, trials=tmp_path / "trials.csv", condition="force", cycle=2, set="corridor")
    assert [(one.id, one.condition, one.cycle, one.set) for one in found] == [
        ("anna/1", "force", 2, "corridor"), ("bert/2", "force", 2, "corridor")
    ]  # fmt: skip
    with pytest.raises(
        NavirlError, match="`condition`: expected one of 'force', 'joystick', 'autonomous', found 'unknown'"
    ):
        navirl_cli.extract(log, condition="unknown")
    with pytest.raises(NavirlError, match="`cycle`: expected a number from 1"):
        navirl_cli.extract(log, cycle=0)


def test_many_trials_take_time_in_proportion(tmp_path):
    """Every entry finds its trial by bisection; a slow twin agrees."""
    from navirl_cli.demos.trials import Trial, entries_by_trial
    from navirl_cli.logs.recording import Declared

    rng = np.random.default_rng(4)
    recording = load_recording(write_run(tmp_path / "run.mcap", Run()))
    firsts = np.sort(rng.choice(len(recording.t_ns) - 30, 12, replace=False))
    trials = [Trial(int(first), int(first) + 20, None) for first in firsts]
    entries = [Declared(int(recording.t_ns[0] + rng.integers(0, 14_000_000_000))) for _ in range(40)]
    starts = [int(recording.t_ns[trial.first]) for trial in trials]
    expected = {}
    for number, trial in enumerate(trials):
        length = int(recording.t_ns[trial.stop - 1]) - starts[number]
        own = [one for one in entries if min(starts, key=lambda t, one=one: abs(t - one.t_ns)) == starts[number]]
        near = min(own, key=lambda one: abs(one.t_ns - starts[number]), default=None)
        if near is not None and abs(near.t_ns - starts[number]) < length:
            expected[number] = near
    assert entries_by_trial(entries, recording, trials) == expected


def test_people_of_a_table_are_checked_as_those_of_the_option(log, table):
    found = demos(table('start_s,people_m\n1.5,"1,0.9"\n7,"3,0.1"\n'), log)
    first, second = found.demonstrations()
    assert "people_m 1.00,0.90 contradicts the log, whose nearest person is 1.00 m from there" in " ".join(first.notes)
    assert "the robot drove through people_m 3.00,0.10" in " ".join(second.notes)
    (lost,) = demos(table('start_s,people_m\n1.5,"2,0.9"\n7,"4,0"\n'), log).lost
    assert "trial 2: people_m 4.00,0.00 stands where the path ends" in lost
