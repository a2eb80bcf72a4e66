"""Whatever clocks do, a trial comes out as it was, and each step is reported once, with its time, size and clock."""

import re
from dataclasses import replace
from pathlib import Path

import clock_scene as scene
import numpy as np
import pytest

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import Source

COMPUTER = r"the clock of the computer \(stamps of .*, and times of receipt\)"
RECORDER = r"the recorder's clock \(times of receipt; not the stamps\)"
ROBOT = r"the clock that stamps /odom, /people, /tf and /wrench"


def extracted(path: Path):
    recording = load_recording(path)
    return recording, extract(recording, ExtractSettings(robot_radius_m=0.2)).demonstrations


@pytest.fixture(scope="session")
def base(tmp_path_factory):
    path = scene.write(tmp_path_factory.mktemp("base") / "run.mcap", scene.recorded())
    recording, (one,) = extracted(path)
    assert recording.notes == ()
    assert recording.damage == ()
    assert impulse(one) == pytest.approx(10.0, abs=0.5)
    return one


def impulse(one):
    return sum(float(np.hypot(*contact.impulse_n_s)) for contact in one.contacts)


def check_same(one, base, within_s=0.06):
    """The trial is that of the undisturbed scene."""
    assert one.duration_s == pytest.approx(base.duration_s, abs=within_s)
    assert impulse(one) == pytest.approx(impulse(base), rel=0.01)
    at_s = np.linspace(0.0, min(one.t_s[-1], base.t_s[-1]), 200)
    for axis in (0, 1):
        apart = np.interp(at_s, one.t_s, one.xy_m[:, axis]) - np.interp(at_s, base.t_s, base.xy_m[:, axis])
        assert np.abs(apart).max() < 0.02


def check_told(path, recording, whose, at_s, by_s):
    """extract and inspect report a step once."""
    view = overview(Source(path.name, (path,)), {})
    for notes in (recording.notes, view.findings):
        told = [re.search(rf"{whose} jumps by (\S+) s (\S+) s after the start; later times were", one) for one in notes]
        found = [(float(one[1]), float(one[2])) for one in told if one]
        assert len([one for one in notes if " jumps by " in one]) == len(found)
        assert found == [(pytest.approx(by_s, abs=0.06), pytest.approx(at_s, abs=0.25))]
    assert view.refusals == ()
    assert (view.end_ns - view.start_ns) / 1e9 == pytest.approx(scene.LASTS_S, abs=0.3)


def disturbed(tmp_path, change, **options):
    path = scene.write(tmp_path / "run.mcap", change(scene.recorded()), **options)
    recording, demonstrations = extracted(path)
    assert recording.damage == ()
    return path, recording, demonstrations


#: Size of a step, s, and when it is, s; at 10 s the push is at its peak.
STEPS = [(-40.0, 10.0), (-5.0, 5.0), (-0.7, 10.0), (0.7, 10.0), (5.0, 5.0), (40.0, 10.0)]


@pytest.mark.parametrize(("by_s", "at_s"), STEPS)
@pytest.mark.parametrize(
    ("clock", "whose"), [(scene.computer, COMPUTER), (scene.recorder, RECORDER), (scene.stamps, ROBOT)]
)
def test_a_clock_that_is_set(tmp_path, base, clock, whose, by_s, at_s):
    path, recording, (one,) = disturbed(tmp_path, clock(at_s, by_s))
    check_same(one, base)
    check_told(path, recording, whose, at_s, by_s)


@pytest.mark.parametrize("by_s", [-40.0, -0.7, 0.7, 40.0])
@pytest.mark.parametrize(
    ("nodes", "names"),
    [
        (("odom",), "/odom"),
        (("wrench",), "/wrench"),
        (("odom", "wrench", "tf"), r"/odom, /tf \(base_link -> wheel\) and /wrench"),
        (("localisation",), r"/tf \(map -> odom\)"),
        (("people",), "/people"),
    ],
)
def test_a_node_whose_clock_is_set(tmp_path, base, nodes, names, by_s):
    path, recording, (one,) = disturbed(tmp_path, scene.stamps(10.0, by_s, *nodes))
    check_same(one, base)
    check_told(path, recording, f"the clock that stamps {names}", 10.0, by_s)


@pytest.mark.parametrize("by_s", [-5.0, 5.0])
@pytest.mark.parametrize("clock", [scene.computer, scene.recorder, scene.stamps])
@pytest.mark.parametrize("at_s", [0.6, 20.3])
def test_a_step_near_the_ends(tmp_path, base, clock, at_s, by_s):
    path, recording, (one,) = disturbed(tmp_path, clock(at_s, by_s))
    check_same(one, base, within_s=0.06 if clock is not scene.computer or by_s < 0 else 6.0)
    told = [note for note in recording.notes if " jumps by " in note or " pause for " in note]
    assert len(told) == 1
    assert set(told) <= {f"run.mcap: {line}" for line in overview(Source(path.name, (path,)), {}).findings}


@pytest.mark.parametrize("second_s", [5.0, -5.0, -12.0])
@pytest.mark.parametrize("clock", [scene.computer, scene.recorder, scene.stamps])
def test_a_clock_that_is_set_twice(tmp_path, base, clock, second_s):
    _, recording, (one,) = disturbed(tmp_path, scene.both(clock(6.0, -5.0), clock(12.0, second_s)))
    check_same(one, base)
    told = [re.search(r" jumps by (\S+) s (\S+) s after", note) for note in recording.notes]
    assert [(float(one[1]), float(one[2])) for one in told] == [
        (pytest.approx(-5.0, abs=0.05), pytest.approx(6.0, abs=0.2)),
        (pytest.approx(second_s, abs=0.05), pytest.approx(12.0, abs=0.2)),
    ]


@pytest.mark.parametrize("by_s", [-5.0, 0.7, 40.0])
@pytest.mark.parametrize(("clock", "whose"), [(scene.recorder, RECORDER), (scene.stamps, ROBOT)])
def test_a_step_beside_simulated_time(tmp_path, base, clock, whose, by_s):
    path, recording, (one,) = disturbed(tmp_path, scene.both(scene.simulated, clock(10.0, by_s)))
    check_same(one, base)
    check_told(path, recording, whose, 10.0, by_s)


@pytest.mark.parametrize("value", [0, 2**63 - 1, 2**64 - 1])
@pytest.mark.parametrize(("begin_s", "end_s"), [(-1.0, 9.0), (5.0, 12.0), (12.0, 1e9), (8.0, 8.02), (-1.0, 1e9)])
def test_times_of_receipt_that_cannot_be_true(tmp_path, base, value, begin_s, end_s):
    path, recording, (one,) = disturbed(tmp_path, scene.receipts(value, begin_s, end_s))
    check_same(one, base)
    (note,) = recording.notes
    words = "gives no usable times" if (begin_s, end_s) == (-1.0, 1e9) else "that cannot be true, such as"
    assert words in note
    view = overview(Source(path.name, (path,)), {})
    assert note in [f"run.mcap: {line}" for line in view.findings]
    assert (view.end_ns - view.start_ns) / 1e9 == pytest.approx(scene.LASTS_S, abs=0.3)


@pytest.mark.parametrize("by_s", [-40.0, -3.0, -0.7, 0.7, 3.0, 40.0])
def test_a_localisation_by_another_computer(tmp_path, base, by_s):
    _, recording, (one,) = disturbed(tmp_path, scene.off(by_s, "localisation"))
    check_same(one, base)
    (note,) = recording.notes
    how = r"stamped (\S+) s ahead, as AMCL" if by_s == 0.7 else r"stamped by another clock than /odom: (\S+) s"
    found = re.match(rf"run.mcap: /tf \(map -> odom\) is {how}", note)
    assert float(found[1]) == pytest.approx(by_s, abs=0.01)


HONEST = {
    "a stall": scene.stall(8.0, 8.8),
    "a long stall": scene.stall(8.0, 11.0),
    "stalls": scene.both(scene.stall(4.0, 5.0), scene.stall(6.0, 7.5), scene.stall(12.0, 14.0)),
    "dropped messages": scene.dropped(0.3),
    "latency": scene.latency(0.03),
    "a slow network": scene.latency(0.1, "people", "localisation"),
    "an exchanged half": scene.shuffled(2),
    "pieces in another order": scene.shuffled(9),
    "topic by topic": scene.by_topic,
    "a short pause": scene.pause(12.0, 12.45),
    "simulated": scene.simulated,
}


@pytest.mark.parametrize("way", HONEST)
def test_what_is_honest_is_no_step(tmp_path, base, way):
    path, recording, (one,) = disturbed(tmp_path, HONEST[way])
    assert not [note for note in recording.notes if "received out of order" not in note]
    check_same(one, base)
    view = overview(Source(path.name, (path,)), {})
    assert not [line for line in view.findings if "simulated time" not in line and "received out of order" not in line]


@pytest.mark.parametrize(("begin_s", "end_s"), [(9.0, 13.0), (5.0, 6.2)])
def test_a_pause_while_the_robot_drives_is_a_gap(tmp_path, begin_s, end_s):
    path = scene.write(tmp_path / "run.mcap", scene.pause(begin_s, end_s)(scene.recorded()))
    recording = load_recording(path)
    assert recording.notes == ()
    assert np.diff(recording.t_ns).max() / 1e9 == pytest.approx(end_s - begin_s, abs=0.1)


def test_a_pause_while_the_robot_stands_still_is_reported(tmp_path, base):
    _, recording, (one,) = disturbed(tmp_path, scene.pause(18.5, 20.0))
    assert recording.notes == (
        (
            "run.mcap: all topics pause for 1.50 s 18.5 s after the start, while the robot stands still: the recording "
            "paused, or a clock jumped"
        ),
    )
    check_same(one, base)


def test_pauses_between_trials_are_how_it_was_recorded(tmp_path):
    path, recording, _ = disturbed(tmp_path, scene.both(scene.pause(18.0, 18.8), scene.pause(19.5, 20.2)))
    assert recording.notes == ()
    (line,) = overview(Source(path.name, (path,)), {}).findings
    assert line == "all topics pause 2 times while the robot stands still, by up to 0.80 s, first at 18.0 s"


@pytest.mark.parametrize("options", [{"use_chunking": False}, {"chunk_size": 1 << 12}])
def test_the_order_in_the_file_is_known_in_every_container(tmp_path, base, options):
    path, recording, (one,) = disturbed(tmp_path, scene.computer(10.0, -40.0), **options)
    check_same(one, base)
    check_told(path, recording, COMPUTER, 10.0, -40.0)


def noise(seed, share, *, of_stamps, of_receipts):
    def disturbed(seen):
        rng = np.random.default_rng(seed)
        hit = rng.random(len(seen.row)) < share
        stamps = rng.integers(-(2**31), 2**31, len(hit)) * 10**9
        receipts = rng.integers(0, 2**64, len(hit), dtype=np.uint64)
        return replace(
            seen,
            stamp_ns=np.where(hit & of_stamps, stamps, seen.stamp_ns),
            received_ns=np.where(hit & of_receipts, receipts, seen.received_ns.astype(np.uint64)),
        )

    return disturbed


@pytest.mark.parametrize(("of_stamps", "of_receipts"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("share", [0.01, 0.3, 1.0])
def test_times_that_are_noise_end_in_a_recording_or_in_one_line(tmp_path, share, of_stamps, of_receipts):
    seen = noise(7, share, of_stamps=of_stamps, of_receipts=of_receipts)(scene.recorded())
    path = scene.write(tmp_path / "run.mcap", seen)
    view = overview(Source(path.name, (path,)), {})
    if view.line.recording is None:
        assert view.refusals
        assert all("\n" not in line for line in view.refusals)
    else:
        assert view.line.recording.notes
        assert view.findings


CASES = Path(__file__).resolve().parent.parent.parent / "shared" / "cases"
SAID = {
    "robot_clock_back_40s": r"the clock of the computer .* jumps by -40.00 s 9.0 s after",
    "robot_clock_back_5s": r"the clock of the computer .* jumps by -5.00 s 9.0 s after",
    "recorder_step_back": r"the recorder's clock .* jumps by -40.00 s 9.0 s after",
    "recorder_step_forward_3s": r"the recorder's clock .* jumps by \+3.00 s 9.0 s after",
    "log_time_zero_9s": r"gives 632 times of receipt that cannot be true, such as 0;",
    "log_time_max": r"gives 1 time of receipt that cannot be true, such as 18446744073709551615 ns;",
    "tf_clock_off_+3s": r"/tf .map -> odom. is stamped by another clock than /odom: \+3.000 s",
}


@pytest.mark.skipif(not CASES.exists(), reason=f"no {CASES}")
@pytest.mark.parametrize("name", SAID)
def test_a_case_beside_the_project(name):
    (base,), (one,) = (
        extract(load_recording(CASES / f"{case}.mcap"), ExtractSettings()).demonstrations for case in ("base", name)
    )
    check_same(one, base)
    recording = load_recording(CASES / f"{name}.mcap")
    (note,) = recording.notes
    assert re.search(SAID[name], note)
    view = overview(Source("run", (CASES / f"{name}.mcap",)), {})
    assert note.partition(": ")[2] in view.findings
    assert (view.end_ns - view.start_ns) / 1e9 == pytest.approx(21.0, abs=0.2)
    assert view.start_ns // 10**9 == 1_700_000_000
