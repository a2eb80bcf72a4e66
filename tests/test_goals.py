"""Goals of navigation actions, whose messages do not say where the goals are."""

import detections
import nav_log as nav
import numpy as np
import pytest
from detections import NOW
from log_factory import Message, forge

from navirl_cli.logs.load import load_recording

STATUS = "action_msgs/msg/GoalStatusArray"
FEEDBACK = "nav2_msgs/action/{}_FeedbackMessage"
EXECUTING, SUCCEEDED, CANCELED, ABORTED = 2, 4, 5, 6
ACTION = "/navigate_to_pose/_action/"


@pytest.fixture
def load(tmp_path):
    """A drive along x at 0.1 m/s whose map -> odom cancels y, with messages (topic, type, seconds, fields)."""

    def loaded(*said, others=()):
        log = nav.drive(20.0)
        for topic, name, second, fields in said:
            data = bytes(NOW.serialize_cdr(detections.made(NOW, name, fields), name))
            log.messages.append(Message(topic, name, int(nav.unix(second)), data))
        for topic, message, second in others:
            log.add(topic, message, int(nav.unix(second)))
        definitions = {name: ("ros2msg", detections.definition(NOW, name)) for _, name, _, _ in said}
        messages = sorted(log.messages, key=lambda one: one.log_time_ns)
        return load_recording(forge(tmp_path / "run.mcap", messages, definitions=definitions))

    return loaded


def statuses(second, *listed, action="navigate_to_pose"):
    """Goals as (when accepted, status)."""
    goals = [
        {"goal_info": {"stamp": {"sec": 1_750_000_000 + accepted}}, "status": status} for accepted, status in listed
    ]
    return f"/{action}/_action/status", STATUS, second, {"status_list": goals}


def feedback(second, number, left, kind="NavigateToPose"):
    action = "navigate_to_pose" if kind == "NavigateToPose" else "navigate_through_poses"
    fields = {"goal_id": {"uuid": [number] * 16}, "feedback": {"distance_remaining": left}}
    return f"/{action}/_action/feedback", FEEDBACK.format(kind), second, fields


def check(recording, begins_s, goals_x_m):
    assert (recording.goal_t_ns - nav.START_NS) / 1e9 == pytest.approx(np.array(begins_s), abs=0.05)
    assert recording.goal_m == pytest.approx(np.column_stack([goals_x_m, np.zeros(len(goals_x_m))]), abs=0.01)


def test_goals_by_the_status_of_the_action(load):
    recording = load(
        statuses(1.0, (1, EXECUTING)),
        statuses(8.0, (1, SUCCEEDED)),
        statuses(10.0, (1, SUCCEEDED), (10, EXECUTING)),
        statuses(17.0, (1, SUCCEEDED), (10, SUCCEEDED)),
    )
    check(recording, [1.0, 10.0], [0.8, 1.7])
    (note,) = recording.notes
    assert note == (
        f"run.mcap: {ACTION}status does not say where goals are; each is placed where the robot was when it was reached"
    )
    assert recording.damage == ()


@pytest.mark.parametrize("end", [CANCELED, ABORTED, None])
def test_goals_that_were_not_reached_are_left_out_and_told(load, end):
    said = [statuses(1.0, (1, EXECUTING)), statuses(8.0, (1, SUCCEEDED)), statuses(10.0, (1, SUCCEEDED), (10, 2))]
    recording = load(*said, *([] if end is None else [statuses(12.0, (1, SUCCEEDED), (10, end))]))
    check(recording, [1.0], [0.8])
    assert recording.damage == (
        f"run.mcap: 1 goal of {ACTION}status was not reached, and the action does not say where it is; left out",
    )


@pytest.mark.parametrize("kind", ["NavigateToPose", "NavigateThroughPoses"])
def test_goals_by_the_feedback_of_the_action(load, kind):
    recording = load(
        *(feedback(second, 1, 8.0 - second, kind) for second in np.arange(1.0, 8.0, 0.5)),
        *(feedback(second, 2, 17.0 - second, kind) for second in np.arange(10.0, 17.0, 0.5)),
        *(feedback(second, 3, 5.0, kind) for second in np.arange(17.5, 19.0, 0.5)),
    )
    check(recording, [1.0, 10.0], [0.75, 1.65])
    assert "1 goal of" in recording.damage[0]


def test_places_go_before_actions(load):
    said = [statuses(1.0, (1, EXECUTING)), statuses(8.0, (1, SUCCEEDED)), feedback(2.0, 1, 1.0)]
    goal = load(*said, others=[("/goal_pose", nav.pose_stamped(int(nav.unix(1.0)), 5.0, 0.0), 1.0)])
    assert goal.goal_m.tolist() == [[5.0, 0.0]]
    plan = load(*said, others=[("/plan", nav.path(int(nav.unix(1.0)), [(0.0, 0.0), (4.0, 0.0)]), 1.1)])
    assert plan.goal_m.tolist() == [[4.0, 0.0]]


def test_other_actions_set_no_goals(load):
    recording = load(statuses(1.0, (1, EXECUTING), action="spin"), statuses(8.0, (1, SUCCEEDED), action="follow_path"))
    assert len(recording.goal_t_ns) == 0
