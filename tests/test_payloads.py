"""Definitions that are missing and payloads that cannot be decoded: inspect and extract give the same reason."""

from dataclasses import replace

import nav_log as nav
import numpy as np
import pytest
from log_factory import forge

from navirl_cli.errors import NavirlError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.overview import overview
from navirl_cli.logs.sources import Source

NO_DEFINITION = ("", "")
TYPES = {
    "/odom": "nav_msgs/msg/Odometry",
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/map": "nav_msgs/msg/OccupancyGrid",
}


def both(path):
    """The refusals of inspect, and the error of extract."""
    view = overview(Source(path.name, (path,)), {})
    with pytest.raises(NavirlError) as caught:
        load_recording(path)
    assert view.refusals or view.needed
    return view.refusals, str(caught.value)


def test_without_any_definition_nothing_can_be_decoded(tmp_path):
    messages = sorted(nav.drive(3.0).messages, key=lambda one: one.log_time_ns)
    path = forge(tmp_path / "run.mcap", messages, definitions=dict.fromkeys(TYPES.values(), NO_DEFINITION))
    (refusal,), error = both(path)
    assert error == refusal
    assert refusal.startswith("run.mcap: none of its 4 topics has a definition of its messages, so that nothing can")


@pytest.mark.parametrize("topic", ["/odom", "/wrench", "/map"])
def test_a_needed_topic_without_a_definition(tmp_path, topic):
    messages = sorted(nav.drive(3.0).messages, key=lambda one: one.log_time_ns)
    refusals, error = both(forge(tmp_path / "run.mcap", messages, definitions={TYPES[topic]: NO_DEFINITION}))
    role = {"/odom": "odometry"}.get(topic, topic[1:])
    expected = f"run.mcap: no message on the {role} topic {topic} could be read: {TYPES[topic]} has no definition in"
    assert refusals[0].startswith(expected)
    assert error.startswith(expected)
    assert error.count("has no definition") == 1


@pytest.mark.parametrize(
    ("harm", "why"),
    [
        (lambda data: b"\0\7" + data[2:], "found XCDR2, 0x0007"),
        (lambda data: b"\0\x0b" + data[2:], "found XCDR2, 0x000b"),
        (lambda _: b"no payload", "found 0x6e6f"),
        (lambda data: data[:20], "do not decode as"),
    ],
)
def test_payloads_that_cannot_be_decoded(tmp_path, harm, why):
    log = nav.drive(3.0)
    log.messages = [replace(one, payload=harm(one.payload)) if one.topic == "/odom" else one for one in log.messages]
    refusals, error = both(log.write(tmp_path / "run.mcap"))
    assert refusals[0].startswith("run.mcap: no message on the odometry topic /odom could be read: all 60 messages of")
    assert why in refusals[0]
    assert error.startswith(refusals[0])


def test_a_topic_of_many_fields_beside_the_others(tmp_path):
    """With code for every definition this took seconds, and minutes for ten times the fields."""
    log = nav.drive(3.0)
    payload = b"\0\1\0\0" + np.zeros(7000).tobytes()
    log.messages.append(nav.Message("/huge", "x_msgs/msg/Huge", int(nav.unix(1.0)), payload))
    path = forge(
        tmp_path / "run.mcap",
        sorted(log.messages, key=lambda one: one.log_time_ns),
        definitions={"x_msgs/msg/Huge": ("ros2msg", "".join(f"float64 field_{number}\n" for number in range(7000)))},
    )
    view = overview(Source(path.name, (path,)), {})
    assert view.refusals == ()
    assert len(load_recording(path).t_ns) == 60


def test_too_few_forces_are_known_to_inspect(tmp_path):
    log = nav.drive(3.0)
    forces = [one for one in log.messages if one.topic == "/wrench"]
    log.messages = [one for one in log.messages if one.topic != "/wrench" or one in forces[:30]]
    (refusal,), error = both(log.write(tmp_path / "run.mcap"))
    assert error == refusal == "run.mcap: expected a wrench of at least 50 messages, found 30"
