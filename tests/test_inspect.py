"""``navirl inspect``: the content of logs, intact or damaged, as text and as JSON."""

import json
from pathlib import Path

import log_factory as forge
import nav_log as nav
import numpy as np
import pytest
from jsonschema import Draft202012Validator

from navirl_cli.commands.usage import as_options
from navirl_cli.logs.roles.topics import ROLES

SAMPLES = Path(__file__).parent.parent / "sample_logs"

TEXT, NUMBER, COUNT = {"type": "string"}, {"type": "number"}, {"type": "integer", "minimum": 0}


def either(kind):
    return {"anyOf": [kind, {"type": "null"}]}


def keys(**properties):
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


def many(kind):
    return {"type": "array", "items": kind}


#: What --json prints.
SCHEMA = many(
    keys(
        log=TEXT,
        files=many(keys(file=TEXT, profile=TEXT, library=TEXT, size_bytes=COUNT)),
        start_ns=either(COUNT),
        end_ns=either(COUNT),
        topics=many(
            keys(
                topic=TEXT,
                type=TEXT,
                encoding=TEXT,
                messages=COUNT,
                start_ns=either(COUNT),
                end_ns=either(COUNT),
                rate_hz=either(NUMBER),
                gaps=either(COUNT),
                longest_gap_s=either(NUMBER),
                longest_gap_at_s=either(NUMBER),
                stamp_minus_receipt_s=either(NUMBER),
            )
        ),
        roles=keys(**{role.name: keys(topics=many(TEXT), reason=either(TEXT), problem=either(TEXT)) for role in ROLES}),
        findings=many(TEXT),
        frames=either(TEXT),
        needed=many(TEXT),
        refusals=many(TEXT),
        demonstrations=either(COUNT),
        summary_only={"type": "boolean"},
        left_out=many(TEXT),
        notes=many(TEXT),
        damage=many(TEXT),
    )
)


@pytest.fixture
def inspect(navirl):
    """Run the command; its JSON, which must match the schema, and its diagnostics."""

    def run(*words, code=0):
        result = navirl("inspect", "--json", *words, code=code)
        document = json.loads(result.stdout)["logs"]
        Draft202012Validator(SCHEMA).validate(document)
        return document, result.stderr

    return run


def topics_of(view):
    return {flow["topic"]: flow for flow in view["topics"]}


def rows_of(text, first):
    """The lines of a table by their first words."""
    lines = text.splitlines()
    start = next(number for number, line in enumerate(lines) if line.startswith(first))
    found = {}
    for line in lines[start + 1 :]:
        if not line:
            break
        found[line.split()[0]] = line
    return found


# intact logs


def test_a_sample_log_as_text(navirl):
    result = navirl("inspect", SAMPLES / "p01.mcap")
    lines = result.stdout.splitlines()
    assert lines[0].startswith("p01.mcap: 1.7 MB, navirl ")
    assert lines[1].endswith(" UTC, 223.0 s, 36148 messages")
    topics = rows_of(result.stdout, "topic")
    assert list(topics) == [
        *("/goal_pose", "/joy", "/map", "/odom", "/people", "/plan", "/tf", "/tf_static", "/wrench"),
    ]
    assert topics["/wrench"].split() == ["/wrench", "geometry_msgs/WrenchStamped", "22302", "100.00", "0", "0.000"]
    roles = rows_of(result.stdout, "role")
    assert list(roles) == [role.name for role in ROLES]
    assert roles["goal"].endswith("then the end of a plan; not /plan")
    assert result.stderr == ""


def test_a_sample_log_as_json(inspect):
    (view,), _ = inspect(SAMPLES / "p01.mcap")
    assert view["log"] == "p01.mcap"
    assert [file["size_bytes"] for file in view["files"]] == [(SAMPLES / "p01.mcap").stat().st_size]
    flow = topics_of(view)["/odom"]
    assert (flow["type"], flow["encoding"], flow["messages"]) == ("nav_msgs/msg/Odometry", "cdr", 6691)
    assert flow["rate_hz"] == pytest.approx(30.0, abs=0.1)
    assert (flow["end_ns"] - flow["start_ns"]) / 1e9 == pytest.approx(223.0, abs=0.1)
    assert (flow["gaps"], flow["longest_gap_s"]) == (0, None)
    assert flow["stamp_minus_receipt_s"] == pytest.approx(-0.002, abs=0.002)
    assert view["roles"]["wrench"] == {"topics": ["/wrench"], "reason": "the only one that fits", "problem": None}
    assert view["findings"] == view["notes"] == view["damage"] == []


@pytest.mark.parametrize("way", ["zstd", "no summary", "no summary, no chunks", "uncompressed chunks"])
def test_every_encoding_gives_the_same_overview(inspect, tmp_path, way):
    views = []
    for name, options in (("a.mcap", {}), ("b.mcap", forge.WAYS[way])):
        (view,), _ = inspect(nav.drive(8.0).write(tmp_path / name, **options))
        views.append({key: value for key, value in view.items() if key not in {"log", "files"}})
    assert views[0] == views[1]


def test_stamps_are_found_without_a_summary(inspect, tmp_path):
    log = nav.Log()
    for number in range(20):
        at = int(nav.unix(number / 10))
        log.add(f"/pose{number}", nav.pose_stamped(at - 2 * 10**9, 1.0, 1.0), at)
    (view,), _ = inspect(log.write(tmp_path / "run.mcap", **forge.WAYS["no summary"]))
    assert [flow["stamp_minus_receipt_s"] for flow in view["topics"]] == [-2.0] * 20


def test_what_extract_would_take_follows_the_users_choice(inspect, navirl, tmp_path):
    log = nav.drive(4.0)
    for number in range(5):
        log.add("/other_wrench", nav.wrench(nav.START_NS + number, 1.0), nav.START_NS + number)
    path = log.write(tmp_path / "run.mcap")
    (view,), _ = inspect(path)
    problem = (
        "several topics could be the wrench (geometry_msgs/WrenchStamped): /other_wrench, /wrench; choose one with "
    )
    assert view["roles"]["wrench"] == {
        "topics": [],
        "reason": None,
        "problem": problem + "`topic` wrench=/other_wrench",
    }
    assert problem in navirl("inspect", path).stdout
    (view,), _ = inspect(path, "--topic", "wrench=/other_wrench")
    assert view["roles"]["wrench"] == {"topics": ["/other_wrench"], "reason": "named by `topic`", "problem": None}
    error = navirl("inspect", path, "--topic", "wrench=/odom", code=1).stderr
    assert error == (
        "navirl: run.mcap: --topic wrench: expected a topic of type geometry_msgs/WrenchStamped or "
        "geometry_msgs/Wrench, found '/odom' of type nav_msgs/Odometry\n"
    )


def test_missing_topics_are_reported_with_the_remedy(inspect, navirl, tmp_path):
    log = nav.Log()
    log.messages = [nav.Message("/scan", "sensor_msgs/msg/LaserScan", nav.START_NS, b"")]
    path = log.write(tmp_path / "run.mcap")
    (view,), _ = inspect(path)
    remedies = {
        "wrench": "record the force-torque sensor's topic",
        "odometry": "record the robot's odometry, usually /odom",
        "map": "give the map's file with `map`, or record it, usually /map",
        "people": "give their places with `person` x,y",
        "goal": "give it with `goal` x,y, or choose `split` stop or `split` none",
        "joystick": "name the topic of manual velocities with `topic` joystick=/name",
        "tf": "record /tf where poses or people are not in the map's frame",
        "tf_static": "record /tf_static where the sensor is not in the robot's frame",
    }
    text = navirl("inspect", path).stdout
    for role, remedy in remedies.items():
        assert view["roles"][role]["topics"] == []
        assert view["roles"][role]["problem"].startswith(f"no {role}: expected a topic of type ")
        assert remedy in view["roles"][role]["problem"]
        assert as_options(view["roles"][role]["problem"]) in text


def test_no_messages_at_all(inspect, navirl, tmp_path):
    path = nav.Log().write(tmp_path / "run.mcap")
    (view,), _ = inspect(path)
    assert (view["start_ns"], view["end_ns"], view["topics"], view["findings"]) == (None, None, [], [])
    text = navirl("inspect", path).stdout
    assert text.startswith("run.mcap: 0.0 MB, forged\n- no messages\n")
    assert "no wrench: expected a topic of type geometry_msgs/WrenchStamped" in text


# gaps


def test_gaps_of_regular_topics_are_reported(inspect, navirl, tmp_path):
    log = nav.drive(20.0)
    quiet = [(5.0, 8.5), (12.0, 12.7)]
    log.messages = [
        one
        for one in log.messages
        if one.topic != "/odom" or not any(a < (one.log_time_ns - nav.START_NS) / 1e9 < b for a, b in quiet)
    ]
    for second in (1.0, 2.0, 3.0, 19.0):  # an irregular topic has no gaps
        log.add("/goal_pose", nav.pose_stamped(nav.unix(second), 1.0, 1.0), nav.unix(second))
    path = log.write(tmp_path / "run.mcap")
    (view,), _ = inspect(path)
    flows = topics_of(view)
    assert {topic: flow["gaps"] for topic, flow in flows.items() if flow["gaps"]} == {"/odom": 2}
    assert flows["/odom"]["longest_gap_s"] == pytest.approx(3.5, abs=0.1)
    assert flows["/wrench"]["rate_hz"] == pytest.approx(100.0, abs=0.5)
    assert flows["/map"]["rate_hz"] is None
    shown = rows_of(navirl("inspect", path).stdout, "topic")
    assert shown["/odom"].split()[-4:-1] == ["2", "3.6", "5.0"]
    assert shown["/wrench"].split()[-4:-1] == ["0", "-", "-"]


def test_a_pause_between_files_is_a_gap(inspect, tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    whole = nav.drive(20.0)
    for number, (begin, end) in enumerate(((0.0, 8.0), (11.0, 20.1))):
        part = nav.Log()
        part.messages = [one for one in whole.messages if begin <= (one.log_time_ns - nav.START_NS) / 1e9 < end]
        part.write(folder / f"bag_{number}.mcap")
    (view,), _ = inspect(folder)
    assert view["log"] == "bag"
    assert [file["file"] for file in view["files"]] == ["bag_0.mcap", "bag_1.mcap"]
    assert {topic: flow["gaps"] for topic, flow in topics_of(view).items()} == {
        "/map": 0,
        "/odom": 1,
        "/tf": 1,
        "/wrench": 1,
    }
    assert topics_of(view)["/wrench"]["longest_gap_s"] == pytest.approx(3.0, abs=0.05)


# clocks


def clocks_of(inspect, tmp_path, **clocks):
    (view,), _ = inspect(nav.drive(20.0, **clocks).write(tmp_path / "run.mcap"))
    return view["findings"], {topic: flow["stamp_minus_receipt_s"] for topic, flow in topics_of(view).items()}


def test_intact_clocks_give_no_notes(inspect, tmp_path):
    notes, offsets = clocks_of(inspect, tmp_path)
    assert notes == []
    assert offsets == {
        "/map": None,
        "/odom": pytest.approx(0, abs=0.005),
        "/tf": pytest.approx(0, abs=0.005),
        "/wrench": pytest.approx(0, abs=0.005),
    }


def test_simulated_stamps_are_reported(inspect, navirl, tmp_path):
    clock = nav.simulated(928.8)
    notes, offsets = clocks_of(inspect, tmp_path, odom=clock, wrench_clock=clock, tf_clock=clock)
    (note,) = notes
    assert "/odom begins at 928.80 s; extract goes by the stamps, unless `time` log" in note
    assert offsets["/wrench"] == pytest.approx(928.8 - nav.START_NS / 1e9, abs=0.01)
    assert f"\n- {as_options(note)}\n" in navirl("inspect", tmp_path / "run.mcap").stdout


def test_another_computers_clock_is_reported(inspect, tmp_path):
    notes, offsets = clocks_of(inspect, tmp_path, wrench_clock=nav.off(3.0))
    (note,) = notes
    assert note.startswith("/wrench is stamped by another clock than /odom: +3.000 s by the times of receipt")
    assert offsets["/wrench"] == pytest.approx(3.0, abs=0.01)


def test_a_recorder_whose_clock_is_off_is_reported(inspect, tmp_path):
    clock = nav.off(-7.5)
    notes, _ = clocks_of(inspect, tmp_path, odom=clock, wrench_clock=clock, tf_clock=clock)
    (note,) = notes
    assert note.startswith("header stamps of /odom differ by -7.50")
    assert note.endswith(" s from the recorder's clock; extract goes by the stamps, unless `time` log")


def test_stamps_of_0_are_reported(inspect, tmp_path):
    notes, offsets = clocks_of(inspect, tmp_path, odom=nav.never, wrench_clock=nav.never, tf_clock=nav.never)
    assert notes == [
        "no message on /odom has a stamp; times of receipt are used",
        "7 messages on /wrench repeat the time of another; the first counts",
    ]
    assert set(offsets.values()) == {None}


def test_clocks_are_distinguished_though_every_chunk_holds_few_messages(inspect, tmp_path):
    log = nav.drive(20.0, wrench_clock=nav.off(3.0))
    path = log.write(tmp_path / "run.mcap", chunk_size=3000)
    assert len(forge.chunk_starts(path)) > 100
    (view,), _ = inspect(path)
    assert [note.partition(" by the times")[0] for note in view["findings"]] == [
        "/wrench is stamped by another clock than /odom: +3.000 s"
    ]


# damage


def test_a_log_that_was_cut_off(inspect, navirl, tmp_path):
    path = nav.drive(20.0).write(tmp_path / "run.mcap", chunk_size=4000)
    start, _ = forge.chunk_starts(path)[30]
    forge.cut(path, start + 300)
    (view,), errors = inspect(path, code=3)
    (lost,) = view["damage"]
    assert lost in errors
    assert f"run.mcap: bytes {start} to {start + 300} (" in lost
    assert "the file ends inside a" in lost
    assert 100 < topics_of(view)["/wrench"]["messages"] < 1990
    assert topics_of(view)["/wrench"]["stamp_minus_receipt_s"] is not None
    result = navirl("inspect", path, code=3)
    assert result.stderr == f"navirl: {lost}\n"
    assert rows_of(result.stdout, "role")["wrench"].split()[:2] == ["wrench", "/wrench"]


def test_damage_inside_of_chunks_that_extract_reads(inspect, tmp_path):
    path = nav.drive(20.0).write(tmp_path / "run.mcap", chunk_size=4000)
    start, size = forge.chunk_starts(path)[20]
    forge.overwrite(path, start + size - 60, b"\xff" * 30)
    (view,), errors = inspect(path, code=3)
    (lost,) = view["damage"]
    assert lost in errors
    assert f"run.mcap: bytes {start} to " in lost
    assert "messages lost: " in lost
    assert topics_of(view)["/wrench"]["messages"] == 2000


def test_only_a_check_looks_inside_of_other_chunks(inspect, tmp_path):
    log = nav.drive(20.0)
    for second in np.arange(21.0, 40.0, 0.05).tolist():  # after the run, so that their chunks hold nothing else
        log.add("/wheels", nav.twist_stamped(int(nav.unix(second)), 1.0), nav.unix(second))
    path = log.write(tmp_path / "run.mcap", chunk_size=4000)
    start, size = forge.chunk_starts(path)[-2]
    forge.overwrite(path, start + size - 60, b"\xff" * 30)
    (view,), errors = inspect(path)
    assert (view["damage"], errors) == ([], "")
    (checked,), errors = inspect(path, "--check", code=3)
    (lost,) = checked["damage"]
    assert lost in errors
    assert topics_of(checked) == topics_of(view)


def test_a_check_of_an_intact_log_finds_no_damage(inspect, tmp_path):
    path = nav.drive(8.0).write(tmp_path / "run.mcap")
    assert inspect(path, "--check") == inspect(path)


# several logs


def test_several_logs_and_a_folder(inspect, navirl, tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    for name in ("b.mcap", "a.mcap"):
        nav.drive(4.0).write(folder / name)
    other = nav.drive(4.0).write(tmp_path / "z.mcap")
    views, _ = inspect(other, folder)
    assert [view["log"] for view in views] == ["z.mcap", "a.mcap", "b.mcap"]
    parts = navirl("inspect", other, folder).stdout.split("\n\n")
    assert [part.partition(":")[0] for part in parts if ".mcap:" in part] == ["z.mcap", "a.mcap", "b.mcap"]


def test_an_invalid_log_does_not_hide_the_others(inspect, navirl, tmp_path):
    good = nav.drive(4.0).write(tmp_path / "good.mcap")
    (tmp_path / "bad.mcap").write_bytes(b"\x89MCA")
    views, errors = inspect(tmp_path / "bad.mcap", good, code=3)
    assert [view["log"] for view in views] == ["good.mcap"]
    assert "bad.mcap: expected an MCAP file, found only its first 4 bytes; nothing was recorded" in errors
    alone = navirl("inspect", tmp_path / "bad.mcap", code=1)
    assert "bad.mcap: expected an MCAP file" in alone.stderr
    assert alone.stdout == ""


def test_what_is_no_log(navirl, tmp_path):
    error = navirl("inspect", tmp_path / "none.mcap", code=1).stderr
    assert "none.mcap" in error
    assert error.count("\n") == 1
    assert "Missing argument 'LOG..." in navirl("inspect", code=2).stderr


def test_a_time_that_is_not_a_date(inspect, navirl, tmp_path):
    log = nav.Log()
    for t_ns in (5 * 10**9, 7 * 10**9):
        log.add("/odom", nav.odometry(t_ns, 0.0, 0.0), t_ns)
    path = log.write(tmp_path / "run.mcap")
    assert "\n- from 5.00 s on, 2.0 s, 2 messages\n" in navirl("inspect", path).stdout
    (view,), _ = inspect(path)
    assert view["findings"] == []


# a real robot


@nav.needs_real
def test_a_real_logs_clocks_are_distinguished(inspect, navirl):
    text = navirl("inspect", nav.REAL).stdout
    assert "\n- 2026-05-08 09:59:13 UTC, 97.4 s, 8197 messages\n" in text
    assert "/odom begins at 928.80 s; extract goes by the stamps" in text
    (view,), _ = inspect(nav.REAL)
    counts = {topic: flow["messages"] for topic, flow in topics_of(view).items()}
    assert counts == {"/amcl_pose": 135, "/odom": 2639, "/tf": 5422, "/tf_static": 1}
    assert [name for name, role in view["roles"].items() if role["topics"]] == ["odometry", "tf", "tf_static"]
    assert np.allclose(topics_of(view)["/odom"]["stamp_minus_receipt_s"], -1778233424.927, atol=0.1)
