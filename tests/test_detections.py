"""People from detectors and trackers: every type gives the same tracks, and only people count."""

import json

import detections
import nav_log as nav
import numpy as np
import pytest
from detections import NOW, THEN
from log_factory import Message, forge

from navirl_cli.logs.load import load_recording

SEEN_S = np.arange(0.0, 4.0, 0.5)


def walker(second):
    return 1.0 + 0.5 * second, 2.0


def header(t_ns, frame="map"):
    return {"stamp": {"sec": t_ns // 10**9, "nanosec": t_ns % 10**9}, "frame_id": frame}


def at(x, y, z=0.0):
    return {"x": float(x), "y": float(y), "z": float(z)}


def vision(t_ns, listed):
    """Entries as (id, x, y, ((class, score), ...))."""
    return {
        "header": header(t_ns),
        "detections": [
            {
                "id": name,
                "bbox": {"center": {"position": at(x, y)}},
                "results": [{"hypothesis": {"class_id": label, "score": score}} for label, score in labels],
            }
            for name, x, y, labels in listed
        ],
    }


def old_vision(t_ns, listed):
    return {
        "header": header(t_ns),
        "detections": [
            {
                "bbox": {"center": {"position": at(x, y)}},
                "results": [{"id": label, "score": score} for label, score in labels],
            }
            for x, y, labels in listed
        ],
    }


def objects(t_ns, listed, *, wrap=lambda pose: pose):
    """Entries as (id, x, y, class)."""
    return {
        "header": header(t_ns),
        "objects": [
            {"id": name, "classification": label, "pose": wrap({"position": at(x, y)})} for name, x, y, label in listed
        ],
    }


def zed(t_ns, listed):
    return {
        "header": header(t_ns),
        "objects": [{"label": label, "label_id": name, "position": [x, y, 0.9]} for name, x, y, label in listed],
    }


def autoware(t_ns, listed):
    return {
        "header": header(t_ns),
        "objects": [
            {
                "classification": [{"label": label, "probability": 0.6}, {"label": 1, "probability": 0.4}],
                "kinematics": {"pose_with_covariance": {"pose": {"position": at(x, y)}}},
            }
            for x, y, label in listed
        ],
    }


def yolo(t_ns, listed):
    return {
        "header": header(t_ns, "camera"),
        "detections": [
            {"id": name, "class_name": label, "bbox3d": {"frame_id": "map", "center": {"position": at(x, y)}}}
            for name, x, y, label in listed
        ],
    }


def listing(sequence, **made):
    """A message that lists people, each by a function of id, x and y."""
    (key, make), *_ = made.items()
    return lambda t_ns, listed: {"header": header(t_ns), sequence: [{**make(*one), key: one[0]} for one in listed]}


def posed(_, x, y):
    return {"pose": {"position": at(x, y)}}


def covariant(_, x, y):
    return {"pose": {"pose": {"position": at(x, y)}}}


#: By case: store, type, message with a walker, a person who stands, and things that are no people; the people's names.
TYPES = {
    "vision": (
        NOW,
        "vision_msgs/msg/Detection3DArray",
        lambda t, s: vision(
            t,
            [
                ("a", *walker(s), (("chair", 0.1), ("Person", 0.8), ("dog", 0.1))),
                ("x", 9, 9, (("person", 0.2), ("chair", 0.7))),
                ("b", 3, 1, (("pedestrian", 0.5),)),
            ],
        ),
        ("a", "b"),
    ),
    "derived": (
        NOW,
        "derived_object_msgs/msg/ObjectArray",
        lambda t, s: objects(t, [(7, *walker(s), 4), (8, 9, 9, 6), (9, 3, 1, 4)]),
        ("7", "9"),
    ),
    "derived with covariance": (
        NOW,
        "derived_object_msgs/msg/ObjectWithCovarianceArray",
        lambda t, s: objects(t, [(7, *walker(s), 4), (8, 9, 9, 0), (9, 3, 1, 4)], wrap=lambda pose: {"pose": pose}),
        ("7", "9"),
    ),
    "zed": (
        NOW,
        "zed_msgs/msg/ObjectsStamped",
        lambda t, s: zed(t, [(7, *walker(s), "Person"), (8, 9, 9, "Vehicle"), (9, 3, 1, "Body_9")]),
        ("7", "9"),
    ),
    "older zed": (
        NOW,
        "zed_interfaces/msg/ObjectsStamped",
        lambda t, s: zed(t, [(7, *walker(s), "Person"), (8, 9, 9, "Bag"), (9, 3, 1, "PERSON")]),
        ("7", "9"),
    ),
    **{
        f"{package} {kind}": (
            NOW,
            f"{package}/msg/{kind}Objects",
            lambda t, s: autoware(t, [(*walker(s), 7), (3, 1, 7), (9, 9, 1)]),
            ("1", "2"),
        )
        for package in ("autoware_perception_msgs", "autoware_auto_perception_msgs")
        for kind in ("Tracked", "Detected")
    },
    "yolo": (
        NOW,
        "yolo_msgs/msg/DetectionArray",
        lambda t, s: yolo(t, [("7", *walker(s), "person"), ("8", 9, 9, "cup"), ("9", 3, 1, "person")]),
        ("7", "9"),
    ),
    **{
        package: (
            NOW,
            f"{package}/msg/PersonArray",
            lambda t, s: listing("people", id=posed)(t, [(7, *walker(s)), (9, 3, 1)]),
            ("7", "9"),
        )
        for package in ("leg_tracker", "leg_detector_msgs")
    },
    "measurements": (
        NOW,
        "people_msgs/msg/PositionMeasurementArray",
        lambda t, s: {
            "header": header(t, ""),
            "people": [
                {"header": header(t), "object_id": name, "pos": at(x, y)}
                for name, x, y in (("7", *walker(s)), ("9", 3, 1))
            ],
        },
        ("7", "9"),
    ),
    "pedsim": (
        NOW,
        "pedsim_msgs/msg/AgentStates",
        lambda t, s: {
            "header": header(t),
            "agent_states": [
                {"id": name, "type": kind, "pose": {"position": at(x, y)}}
                for name, kind, x, y in ((7, 0, *walker(s)), (8, 2, 8, 8), (9, 1, 3, 1))
            ],
        },
        ("7", "9"),
    ),
    "older pedsim": (
        THEN,
        "pedsim_msgs/msg/AgentStates",
        lambda t, s: {
            "header": header(t),
            "agent_states": [
                {"id": name, "type": kind, "position": at(x, y)}
                for name, kind, x, y in ((7, 0, *walker(s)), (8, 2, 8, 8), (9, 1, 3, 1))
            ],
        },
        ("7", "9"),
    ),
    "pedsim tracks": (
        NOW,
        "pedsim_msgs/msg/TrackedPersons",
        lambda t, s: listing("tracks", track_id=covariant)(t, [(7, *walker(s)), (9, 3, 1)]),
        ("7", "9"),
    ),
    "spencer detections": (
        NOW,
        "spencer_tracking_msgs/msg/DetectedPersons",
        lambda t, s: listing("detections", detection_id=covariant)(t, [(7, *walker(s)), (9, 3, 1)]),
        ("7", "9"),
    ),
}


@pytest.fixture
def load(tmp_path):
    def loaded(store, name, say, topic="/seen_3d", **options):
        log = nav.drive(5.0)
        for second in SEEN_S.tolist():
            t_ns = int(nav.unix(second))
            message = detections.made(store, name, say(t_ns, second))
            data = bytes(store.serialize_cdr(message, name))
            log.messages.append(Message(topic, name, t_ns + 3_000_000, data))
        definitions = {name: ("ros2msg", detections.definition(store, name))}
        definitions |= {known: ("ros2msg", nav.STORE.generate_msgdef(known, ros_version=2)[0]) for known in nav.FOREIGN}
        return load_recording(forge_log(log, tmp_path / "run.mcap", definitions, **options))

    return loaded


def forge_log(log, path, definitions, **options):
    messages = sorted(log.messages, key=lambda one: one.log_time_ns)
    return forge(path, messages, definitions=definitions, **options)


@pytest.mark.parametrize("case", TYPES)
def test_every_detector_gives_tracks_of_people_only(load, case):
    store, name, say, names = TYPES[case]
    recording = load(store, name, say)
    assert recording.damage == ()
    walking, standing = recording.people
    assert (walking.name, standing.name) == names
    assert walking.xy_m == pytest.approx(np.array([walker(second) for second in SEEN_S]))
    assert standing.xy_m == pytest.approx(np.tile((3.0, 1.0), (len(SEEN_S), 1)))
    assert walking.t_ns.tolist() == nav.unix(SEEN_S).tolist()
    ignored = [note for note in recording.notes if "are not people and are ignored" in note]
    others = "class" in case or any(word in case for word in ("vision", "derived", "zed", "autoware", "yolo"))
    assert len(ignored) == others
    assert len(recording.notes) == others


def test_the_classes_that_are_ignored_are_told(load):
    store, name, say, _ = TYPES["vision"]
    (note,) = load(store, name, say).notes
    assert note == "run.mcap: 8 entries of /seen_3d are not people and are ignored: 'chair' (8)"


def test_entries_of_an_older_release_have_numbers_as_classes(load):
    name = "vision_msgs/msg/Detection3DArray"
    recording = load(THEN, name, lambda t, s: old_vision(t, [(*walker(s), ((17, 0.9),)), (3, 1, ((1, 0.3),))]))
    assert recording.people == ()
    assert recording.notes == ("run.mcap: 16 entries of /seen_3d are not people and are ignored: '17' (8), '1' (8)",)


def test_entries_without_any_class_count_as_people(load):
    recording = load(NOW, "vision_msgs/msg/Detection3DArray", lambda t, s: vision(t, [("a", *walker(s), ())]))
    assert recording.notes == ("run.mcap: no entry of /seen_3d has a class; all count as people",)
    assert [track.name for track in recording.people] == ["a"]


def test_some_entries_without_a_class_are_not_people(load):
    def say(t, s):
        return vision(t, [("a", *walker(s), ()), ("b", 3, 1, (("person", 0.5),))])

    recording = load(NOW, "vision_msgs/msg/Detection3DArray", say)
    assert recording.notes == ("run.mcap: 8 entries of /seen_3d are not people and are ignored: 'no class' (8)",)
    assert [track.name for track in recording.people] == ["b"]


def test_detections_as_json(tmp_path):
    log = nav.drive(5.0)
    for second in SEEN_S.tolist():
        t_ns = int(nav.unix(second))
        text = json.dumps(vision(t_ns, [("a", *walker(second), (("chair", 0.1), ("person", 0.8)))]))
        log.messages.append(Message("/seen", "vision_msgs/msg/Detection3DArray", t_ns, text.encode()))
    path = forge_log(
        log,
        tmp_path / "run.mcap",
        {"vision_msgs/msg/Detection3DArray": ("jsonschema", "{}")},
        encodings={"/seen": "json"},
    )
    recording = load_recording(path)
    assert recording.damage == recording.notes == ()
    (track,) = recording.people
    assert track.xy_m == pytest.approx(np.array([walker(second) for second in SEEN_S]))


def test_people_seen_by_a_camera_are_placed_through_tf(tmp_path):
    log = nav.drive(5.0)
    name = "zed_msgs/msg/ObjectsStamped"
    log.add("/tf_static", nav.tf(nav.transform(0, "map", "camera", 1.0, 2.0, np.pi / 2)), int(nav.unix(0.0)))
    for second in SEEN_S.tolist():
        t_ns = int(nav.unix(second))
        given = {"header": header(t_ns, "camera"), "objects": [{"label": "Person", "position": [1.0, 0.0, 1.2]}]}
        message = detections.made(NOW, name, given)
        log.messages.append(Message("/zed/objects", name, t_ns, bytes(NOW.serialize_cdr(message, name))))
    path = forge_log(log, tmp_path / "run.mcap", {name: ("ros2msg", detections.definition(NOW, name))})
    (track,) = load_recording(path).people
    assert track.xy_m == pytest.approx(np.tile((1.0, 3.0), (len(SEEN_S), 1)))
