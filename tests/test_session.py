"""The session of a log, from its metadata records."""

import json

import numpy as np
import pytest
from robot_log import LENGTH_M, START_NS, Run, position_m, write_run

from navirl_cli.demos.extract import ROBOT_RADIUS_M, ExtractSettings, extract
from navirl_cli.errors import LogError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import scan
from navirl_cli.logs.messages.writer import LogWriter
from navirl_cli.logs.recording import PUBLISHED_RECORD
from navirl_cli.logs.roles.session import session_of, session_values

GOAL_NS = 1_700_000_001_500_000_000


def told(tmp_path, session=None, published=None):
    path = tmp_path / "run.mcap"
    path.unlink(missing_ok=True)
    with LogWriter(path) as log:
        if session is not None:
            log.metadata("navirl.session", session)
        if published is not None:
            log.metadata(PUBLISHED_RECORD, published)
    return session_of("run.mcap", [scan(path)])


def test_a_record_with_every_key(tmp_path):
    entry = {"t_ns": 5, "cycle": 1, "condition": "force", "set": "s", "nominal_m": [[0, 1], [2, 3]]}
    session = told(
        tmp_path,
        {
            "participant": "ann",
            "trials": json.dumps([entry]),
            "robot_radius_m": "0.4",
            "laid_out_m_s": "0.5",
            "completion_s": json.dumps({"force": [18.8], "joystick": [17, 12.5]}),
        },
        {"cells": json.dumps([{"t_ns": 5, "name": "a/0", "cells": [[1, 2], [2, 2]]}])},
    )
    (declared,), (published,) = session.declared, session.published
    assert (declared.t_ns, declared.cycle, declared.condition, declared.set) == (5, 1, "force", "s")
    assert declared.nominal_m.tolist() == [[0.0, 1.0], [2.0, 3.0]]
    assert (published.t_ns, published.name, published.cells.tolist()) == (5, "a/0", [[1, 2], [2, 2]])
    assert (session.participant, session.robot_radius_m, session.laid_out_m_s) == ("ann", 0.4, 0.5)
    assert session.completion_s == {"force": (18.8,), "joystick": (17.0, 12.5)}


def test_a_log_without_records(tmp_path):
    session = told(tmp_path)
    assert (session.participant, session.declared, session.published) == (None, (), ())
    assert (session.robot_radius_m, session.laid_out_m_s, session.completion_s) == (None, None, {})


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("robot_radius_m", "0", "metres above 0"),
        ("robot_radius_m", '"0.4"', "metres above 0"),
        ("robot_radius_m", "true", "metres above 0"),
        ("laid_out_m_s", "NaN", "metres a second above 0"),
        ("laid_out_m_s", "fast", "metres a second above 0"),
        ("completion_s", "[1]", "a JSON object of lists of seconds by modality"),
        ("completion_s", '{"force": 18.8}', "a JSON object of lists of seconds by modality"),
        ("completion_s", '{"force": [-1]}', "a JSON object of lists of seconds by modality"),
        ("trials", '[{"t_ns": 1, "set": 3}]', "a JSON list of objects with t_ns"),
        ("trials", '[{"t_ns": 1, "nominal_m": [[0, 1]]}]', "a JSON list of objects with t_ns"),
        ("trials", '[{"t_ns": 1, "nominal_m": [[0, 1], [2]]}]', "a JSON list of objects with t_ns"),
        ("trials", '[{"t_ns": 1, "nominal_m": [[0, 1], [2, Infinity]]}]', "a JSON list of objects with t_ns"),
    ],
)
def test_what_is_not_as_it_should_be_is_named(tmp_path, key, value, expected):
    with pytest.raises(LogError, match=rf"run\.mcap: metadata record navirl\.session, key {key}: expected {expected}"):
        told(tmp_path, {key: value})


@pytest.mark.parametrize(
    "cells", ["{", '[{"t_ns": 1, "name": "a", "cells": [[1.5, 2]]}]', '[{"t_ns": 1, "cells": [[1, 2]]}]', "[[1]]"]
)
def test_broken_published_cells_are_named(tmp_path, cells):
    with pytest.raises(LogError, match=r"record navirl\.published, key cells: expected a JSON list of objects"):
        told(tmp_path, published={"cells": cells})


@pytest.mark.parametrize(
    ("said", "user", "radius"), [(None, None, ROBOT_RADIUS_M), ("0.2", None, 0.2), ("0.2", 0.0, 0.0)]
)
def test_the_users_radius_goes_before_the_logs(tmp_path, said, user, radius):
    session = None if said is None else {"robot_radius_m": said}
    recording = load_recording(write_run(tmp_path / "run.mcap", Run(session=session)))
    (one,) = extract(recording, ExtractSettings(robot_radius_m=user)).demonstrations
    assert one.robot_radius_m == radius


def test_cells_are_held_against_those_published(tmp_path):
    path = write_run(tmp_path / "run.mcap")
    cells = extract(load_recording(path), ExtractSettings()).demonstrations[0].cells.tolist()
    entries = [
        {"t_ns": GOAL_NS, "name": "this", "cells": cells},
        {"t_ns": GOAL_NS + 60_000_000_000, "name": "another trial", "cells": cells},
    ]
    for name, listed, same in (("same", cells, True), ("other", cells[:-1], False)):
        entries[0]["cells"] = listed
        log = tmp_path / f"{name}.mcap"
        write_run(log, Run(published=json.dumps(entries)))
        assert extract(load_recording(log), ExtractSettings()).published == {"this": same, "another trial": False}


def test_a_trial_ends_at_the_time_in_the_record(tmp_path):
    entry = {"t_ns": GOAL_NS + 300_000_000, "stop_ns": GOAL_NS + 6_000_000_000}
    recording = load_recording(write_run(tmp_path / "run.mcap", Run(session={"trials": json.dumps([entry])})))
    (one,) = extract(recording, ExtractSettings()).demonstrations
    last = one.start_ns + round(one.t_s[-1] * 1e9)
    assert entry["stop_ns"] - 50_000_000 < last <= entry["stop_ns"]
    left = LENGTH_M - position_m(np.array([(last - START_NS) / 1e9]))[0, 0]
    assert f"ended {left:.2f} m from its goal" in "".join(one.notes)


@pytest.mark.parametrize("stop", [GOAL_NS, "late", 1.5])
def test_an_end_before_the_goal_is_refused(tmp_path, stop):
    with pytest.raises(LogError, match=r"stop_ns .* must be a whole number after t_ns"):
        told(tmp_path, {"trials": json.dumps([{"t_ns": GOAL_NS, "stop_ns": stop}])})


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ('{"t_ns": 1e300}', "must be whole numbers"),
        (f'{{"t_ns": {2**63}}}', "must be times of 64 bits"),
        (f'{{"t_ns": 1, "stop_ns": {2**63}}}', "must be times of 64 bits"),
        ('{"t_ns": 1, "cycle": 1000001}', "must be whole numbers"),
        ('{"t_ns": 1, "participant": 3}', "participant 3 must be a text"),
        ('{"t_ns": 1, "nominal_m": [[0, 0], [1e308, 0]]}', "must be points of two numbers, at most 1e.08 m from 0"),
        ('{"t_ns": 1, "people_m": [[0, 1e9]]}', "must be points of two numbers, at most 1e.08 m from 0"),
        ('{"t_ns": 1, "people_m": [[0]]}', "must be points of two numbers"),
        ('{"t_ns": 1, "people_m": "x"}', "could not convert"),
        (f'{{"t_ns": 1, "people_m": {[[0, 0]] * 1001}}}', "people_m has 1001 points, where 0 to 1000 are possible"),
        (f'{{"t_ns": 1, "nominal_m": {[[0, 0]] * 10001}}}', "nominal_m has 10001 points, where 2 to 10000"),
    ],
)
def test_numbers_out_of_range_are_refused(tmp_path, entry, why):
    with pytest.raises(LogError, match=why) as caught:
        told(tmp_path, {"trials": f"[{entry}]"})
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(("key", "value"), [("robot_radius_m", "1e300"), ("laid_out_m_s", "1e9")])
def test_a_robot_is_neither_huge_nor_that_fast(tmp_path, key, value):
    with pytest.raises(LogError, match=f"key {key}: expected .* is not a number above 0, at most"):
        told(tmp_path, {key: value})


def test_halves_of_characters_are_replaced(tmp_path):
    values = {
        "trials": r'[{"t_ns": 1, "set": "a\ud800b", "participant": "\ud83d\ude00"}]',
        "completion_s": r'{"\udc00": [1]}',
    }
    session = told(tmp_path, values)
    assert (session.declared[0].set, session.declared[0].participant) == ("a\ufffdb", "\U0001f600")
    assert list(session.completion_s) == ["\ufffd"]


def test_a_session_and_its_record_are_the_same(tmp_path):
    entries = [
        {"t_ns": 5, "stop_ns": 9, "participant": "ä", "cycle": 1, "condition": "force", "set": "s", "people_m": []},
        {"t_ns": 6, "nominal_m": [[0.1, 1 / 3], [2, 3]], "people_m": [[1e-9, -7.25]]},
    ]
    values = {
        "participant": "ann",
        "trials": json.dumps(entries),
        "robot_radius_m": "0.4",
        "laid_out_m_s": "0.5",
        "completion_s": json.dumps({"force": [18.8]}),
    }
    session = told(tmp_path, values)
    again = told(tmp_path, session_values(session))
    assert again == session
    assert session_values(again) == session_values(session)
    assert session_values(told(tmp_path)) == {}
