"""``inspect`` never promises what ``extract`` refuses, and reports all that is lost."""

from pathlib import Path

import log_factory as forge
import nav_log as nav
import pytest

from navirl_cli.errors import NavirlError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.messages.reader import check
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import Source

SHARED = Path(__file__).resolve().parent.parent.parent / "shared"
#: Logs of the folders beside the project.
LOGS = sorted(SHARED.glob("[ac]*/*.mcap"))


def check_agreement(path: Path) -> None:
    source = Source(path.name, (path,))
    try:
        view = overview(source, {})
    except NavirlError as refused:
        with pytest.raises(type(refused)):
            load_recording(source)
        return
    if view.line.recording is None:
        assert view.needed or view.refusals
        with pytest.raises(NavirlError):
            load_recording(source)
    else:
        recording = load_recording(source)
        assert set(recording.damage) <= set(view.damage)
        assert bool(view.needed or view.refusals) == bool(recording.goal_problem)


@pytest.mark.skipif(not LOGS, reason=f"no logs in {SHARED / 'cases'} and {SHARED / 'attack'}")
@pytest.mark.parametrize("path", LOGS, ids=lambda path: path.stem)
def test_inspect_and_extract_agree_on_logs_beside_the_project(path):
    check_agreement(path)


def without(*topics):
    log = nav.drive(8.0)
    log.messages = [one for one in log.messages if one.topic not in topics]
    return log


def unplaced(frame):
    log = without("/wrench")
    for number in range(100):
        at = int(nav.unix(number / 20))
        log.add("/wrench", nav.wrench(at, 1.0, frame=frame), at)
    return log


def rotated_map():
    log = without("/map")
    log.add("/map", nav.grid(yaw=0.5), nav.START_NS)
    return log


def not_finite():
    log = without("/odom")
    for number in range(100):
        at = int(nav.unix(number / 20))
        log.add("/odom", nav.odometry(at, float("nan"), 0.0), at)
    return log


def sound():
    log = without("/map")
    log.add("/map", nav.grid(80, 80), nav.START_NS)
    return log


REFUSED = {
    "a map in which the robot did not drive": lambda: nav.drive(8.0),
    "no wrench": lambda: without("/wrench"),
    "no map": lambda: without("/map"),
    "no tf": lambda: without("/tf"),
    "a wrench in an unknown frame": lambda: unplaced("nowhere"),
    "a rotated map": rotated_map,
    "poses that are not finite": not_finite,
}


@pytest.mark.parametrize("way", [*REFUSED, "sound"])
def test_inspect_and_extract_agree(navirl, tmp_path, way):
    log = REFUSED.get(way, sound)()
    log.add("/goal_pose", nav.pose_stamped(nav.START_NS, 0.8, 0.0), nav.START_NS)
    path = log.write(tmp_path / "run.mcap")
    check_agreement(path)
    shown = navirl("inspect", path).stdout
    assert ("extract has what it needs" in shown) == (way == "sound")


def test_all_reasons_are_reported(tmp_path, navirl):
    log = unplaced("nowhere")
    log.messages = [one for one in log.messages if one.topic != "/map"]
    log.add("/map", nav.grid(yaw=0.5), nav.START_NS)
    shown = navirl("inspect", log.write(tmp_path / "run.mcap")).stdout
    assert "extract refuses this log\n" in shown
    assert "expected a map whose cells run along its frame's axes" in shown
    assert "the wrench is given in frame 'nowhere'" in shown


@pytest.mark.parametrize("topic", ["/odom", "/wheels"])
def test_a_check_holds_statistics_and_indexes_against_all_messages(tmp_path, topic):
    log = nav.drive(4.0)
    for number in range(80):
        at = int(nav.unix(number / 20))
        log.add("/wheels", nav.twist_stamped(at, 1.0), at)
    path = log.write(tmp_path / "run.mcap", compression=forge.CompressionType.NONE)
    assert check(path) == []
    data = bytearray(path.read_bytes())
    message = [one for one in sorted(log.messages, key=lambda one: one.log_time_ns) if one.topic == topic][40]
    listed = message.log_time_ns.to_bytes(8, "little")
    # the time stands twice in the message and once in the index
    place = data.rindex(listed)
    data[place : place + 8] = (message.log_time_ns + 10**9).to_bytes(8, "little")
    path.write_bytes(data)
    assert any("other times" in one.reason and topic in one.reason for one in check(path))
