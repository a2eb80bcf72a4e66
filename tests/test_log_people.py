"""People as every kind of message tells them, through files and into the map's frame."""

import json

import nav_log as nav
import numpy as np
import pytest

from navirl_cli.logs.load import load_recording

#: How fast the walker goes along x, m/s, and the frames' offset that moves under it.
WALK_M_S = 0.5
SEEN_S = np.arange(0.0, 8.0, 0.5)


@pytest.fixture
def load(tmp_path):
    def loaded(say, seconds=SEEN_S, late_ns=3_000_000, **changes):
        log = nav.drive(8.0, **changes)
        for second in seconds.tolist():
            at = int(nav.unix(second))
            for topic, message in say(at, second).items():
                log.add(topic, message, at + late_ns)
        return load_recording(log.write(tmp_path / "run.mcap"))

    return loaded


def walker(second):
    return 1.0 + WALK_M_S * second, 2.0


def check_walker(track, times=SEEN_S):
    assert track.t_ns.tolist() == nav.unix(times).tolist()
    assert track.xy_m == pytest.approx(np.column_stack([1.0 + WALK_M_S * times, np.full(len(times), 2.0)]))


def check_still(track, xy_m=(3.0, 1.0), times=SEEN_S):
    assert track.t_ns.tolist() == nav.unix(times).tolist()
    assert track.xy_m == pytest.approx(np.tile(xy_m, (len(times), 1)))


#: Messages that tell of a walker and of one who stands, and what the two are called.
KINDS = {
    "people_msgs": (lambda t, s: nav.people(t, [("ann", *walker(s)), ("bob", 3, 1)]), "ann", "bob"),
    "spencer": (lambda t, s: nav.tracked(t, [(7, *walker(s)), (2**53 + 1, 3, 1)]), "7", "9007199254740993"),
    "hunav": (lambda t, s: nav.agents(t, [(4, 1, *walker(s)), (9, 2, 8, 8), (5, 1, 3, 1)]), "4", "5"),
    "pose_array": (lambda t, s: nav.pose_array(t, [walker(s), (3, 1)]), "1", "2"),
    "markers": (lambda t, s: nav.markers([nav.marker(t, 1, *walker(s)), nav.marker(t, 2, 3, 1)]), "p/1", "p/2"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_list_of_people_becomes_tracks(load, kind):
    make, walking, standing = KINDS[kind]
    recording = load(lambda t, s: {"/people": make(t, s)})
    assert recording.damage == recording.notes == ()
    assert [track.name for track in recording.people] == [walking, standing]
    check_walker(recording.people[0])
    check_still(recording.people[1])
    assert recording.people_t_ns.tolist() == nav.unix(SEEN_S).tolist()


@pytest.mark.parametrize("make", [nav.pose_stamped, nav.amcl_pose])
def test_a_topic_for_each_person(load, make):
    recording = load(lambda t, s: {"/person/ann": make(t, *walker(s)), "/person/bob": make(t, 3.0, 1.0)})
    assert recording.damage == recording.notes == ()
    assert [track.name for track in recording.people] == ["/person/ann", "/person/bob"]
    check_walker(recording.people[0])
    check_still(recording.people[1])
    assert len(recording.people_t_ns) == 2 * len(SEEN_S)


def test_a_single_topic_of_one_person(load):
    recording = load(lambda t, s: {"/human_pose": nav.pose_stamped(t, *walker(s))})
    assert [track.name for track in recording.people] == ["1"]
    check_walker(recording.people[0])


def test_who_comes_and_goes_keeps_the_name(load):
    def say(t, s):
        named = [("ann", *walker(s))] * (2 <= s < 5) + [("bob", 3, 1)] * (s < 4)
        return {"/people": nav.people(t, named)}

    recording = load(say)
    assert [track.name for track in recording.people] == ["bob", "ann"]
    check_still(recording.people[0], times=SEEN_S[SEEN_S < 4])
    check_walker(recording.people[1], SEEN_S[(SEEN_S >= 2) & (SEEN_S < 5)])
    # messages that name nobody say that nobody is there
    assert recording.people_t_ns.tolist() == nav.unix(SEEN_S).tolist()


def test_nobody_is_somebody_too(load):
    recording = load(lambda t, _: {"/people": nav.people(t, [])})
    assert recording.people == ()
    assert recording.people_t_ns.tolist() == nav.unix(SEEN_S).tolist()
    assert recording.damage == recording.notes == ()


@pytest.mark.parametrize("names", [("", ""), ("ann", ""), ("person", "person")])
def test_names_that_tell_nobody_apart_are_replaced_by_places(load, names):
    recording = load(lambda t, s: {"/people": nav.people(t, [(names[0], *walker(s)), (names[1], 3, 1)])})
    assert [track.name for track in recording.people] == ["1", "2"]
    check_walker(recording.people[0])
    check_still(recording.people[1])


def test_people_as_json_keep_long_numbers_apart(tmp_path):
    log = nav.drive(8.0)
    for second in SEEN_S.tolist():
        at = int(nav.unix(second))
        stamp = {"sec": at // 10**9, "nanosec": at % 10**9}
        tracks = [
            {"track_id": number, "pose": {"pose": {"position": {"x": x, "y": y, "z": 0.0}}}}
            for number, (x, y) in ((1234567, walker(second)), (1234568, (3.0, 1.0)))
        ]
        text = json.dumps({"header": {"stamp": stamp, "frame_id": "map"}, "tracks": tracks})
        log.messages.append(
            nav.Message("/tracks", "spencer_tracking_msgs/msg/TrackedPersons", at + 3_000_000, text.encode())
        )
    recording = load_recording(log.write(tmp_path / "run.mcap", encodings={"/tracks": "json"}))
    assert recording.damage == ()
    assert [track.name for track in recording.people] == ["1234567", "1234568"]
    check_walker(recording.people[0])
    check_still(recording.people[1])


# markers


def test_only_markers_of_bodies_that_are_added_are_people(load):
    def say(t, s):
        listed = [
            nav.marker(0, 0, 0, 0, frame="", action=3),  # first of all, RViz is told to forget everything
            nav.marker(t, 1, *walker(s), kind=3),
            nav.marker(t, 1, *walker(s), kind=9, space="name"),
            nav.marker(t, 1, *walker(s), kind=0, space="velocity"),
            nav.marker(t, 1, 0, 0, kind=4, space="trail"),
            nav.marker(t, 6, 5, 5, action=2),
            nav.marker(t, 2, 3, 1, kind=10),
        ]
        return {"/pedestrians": nav.markers(listed)}

    recording = load(say)
    assert recording.damage == recording.notes == ()
    assert [track.name for track in recording.people] == ["p/1", "p/2"]
    check_walker(recording.people[0])
    check_still(recording.people[1])


def test_each_marker_has_its_own_frame(load):
    # map -> odom: y is a tenth of the time
    def say(t, s):
        x, y = walker(s)
        listed = [
            nav.marker(t, 1, x, y - s / 10, frame="/odom"),
            nav.marker(t, 2, 3, 1),
            nav.marker(t, 3, 1, 1, "moon"),
        ]
        return {"/people_markers": nav.markers(listed)}

    recording = load(say, SEEN_S[SEEN_S < 7.5])
    (lost,) = recording.damage
    assert lost.startswith(
        "run.mcap: 15 places on /people_markers left out: transform from 'moon' to 'map': expected con"
    )
    assert [track.name for track in recording.people] == ["p/1", "p/2"]
    check_walker(recording.people[0], SEEN_S[SEEN_S < 7.5])
    check_still(recording.people[1], times=SEEN_S[SEEN_S < 7.5])


# frames


def test_people_seen_from_a_frame_that_moves(load):
    def say(t, s):
        x, y = walker(s)
        return {"/people": nav.people(t, [("ann", x, y - s / 10)], frame="odom")}

    recording = load(say, SEEN_S[SEEN_S < 7.5])
    check_walker(recording.people[0], SEEN_S[SEEN_S < 7.5])


@pytest.mark.parametrize("frame", ["/map", "map"])
def test_slashes_before_frames_do_not_matter(load, frame):
    recording = load(lambda t, s: {"/people": nav.people(t, [("ann", *walker(s))], frame=frame)})
    check_walker(recording.people[0])


def test_who_was_seen_before_tf_spoke_is_placed_by_its_first_word(load):
    seconds = np.array([-3600.0, 0.0])
    recording = load(
        lambda t, _: {"/people": nav.people(t, [("ann", 2.0, 1.0)], frame="odom")}, seconds, late_ns=3601 * 10**9
    )
    check_still(recording.people[0], (2.0, 1.0), seconds)
    assert recording.damage == recording.notes == ()


def test_people_without_stamps_count_from_their_receipt(load):
    recording = load(lambda _, s: {"/people": nav.people(0, [("ann", *walker(s))])}, late_ns=0)
    assert recording.notes == ("run.mcap: 16 messages on /people are stamped 0; their times of receipt are used",)
    assert (recording.people[0].t_ns - nav.unix(SEEN_S)) / 1e9 == pytest.approx(0.0, abs=0.01)
    assert recording.people[0].xy_m[:, 0] == pytest.approx(1.0 + WALK_M_S * SEEN_S)


def test_a_message_that_repeats_a_time_says_nothing_new(load):
    seconds = np.repeat(SEEN_S, 2)
    recording = load(lambda t, s: {"/people": nav.people(t, [("ann", *walker(s))])}, seconds)
    check_walker(recording.people[0])


# goals


def test_a_goal_and_a_plan_in_another_frame(load):
    goal = load(lambda t, s: {"/goal_pose": nav.pose_stamped(t, 4.0, 1.0 - s / 10, frame="odom")}, SEEN_S[[4, 9]])
    assert goal.goal_t_ns.tolist() == nav.unix(SEEN_S[[4, 9]]).tolist()
    assert goal.goal_m == pytest.approx(np.array([[4.0, 1.0]] * 2))

    def say(t, s):
        ways = {2.0: [], 2.5: [(0.0, 0.0), (4.0, 1.0 - s / 10)], 4.5: [(5.0, 1.0 - s / 10)]}
        return {"/plan": nav.path(t, ways[s], frame="odom")}

    plan = load(say, SEEN_S[[4, 5, 9]])
    assert plan.goal_t_ns.tolist() == nav.unix(SEEN_S[[5, 9]]).tolist()
    assert plan.goal_m == pytest.approx(np.array([[4.0, 1.0], [5.0, 1.0]]))
    assert plan.damage == ()
