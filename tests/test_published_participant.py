"""The published data of a participant, checked: invalid data are left out and reported by file, list and number."""

import numpy as np
import published_factory as forge
import pytest
from published_factory import DATA, GRID, Message, Old, demonstration, nav_map

from navirl_cli.demos.demonstration import Condition
from navirl_cli.errors import ArtefactError
from navirl_cli.published import fields
from navirl_cli.published.participant import Part, participant_of
from navirl_cli.published.runs import DEMONSTRATIONS, Run

ORDER = [
    ("force_demos/passing_1/1", Part(Condition.FORCE, cycle=1)),
    ("force_demos/passing_1/2", Part(Condition.FORCE, cycle=1)),
    ("force_demos/passing_2/1", Part(Condition.FORCE, cycle=2)),
    ("force_demos/passing_2/2", Part(Condition.FORCE, cycle=2)),
    ("force_demos/replay/1", Part(Condition.AUTONOMOUS, set="replay of the learnt policy")),
    ("force_demos/obstacle_course/1", Part(Condition.FORCE, set="obstacle course")),
    ("joystick_demos/passing/1", Part(Condition.JOYSTICK)),
    ("joystick_demos/passing/2", Part(Condition.JOYSTICK)),
    ("joystick_demos/replay/1", Part(Condition.AUTONOMOUS, set="replay of the joystick")),
    ("obs_avoidance_demos/replay/1", Part(Condition.AUTONOMOUS, set="obstacle avoidance")),
]
NAMES = [name for name, _ in ORDER]


def read(changed=None, **lists):
    """A participant of whose files some are exchanged, or removed where the exchange is None."""
    files = forge.participant(**lists) | (changed or {})
    return participant_of(Run("7", "runs/7", {name: data for name, data in files.items() if data is not None}))


def names(found):
    return [path.name for path in found.paths]


def test_a_complete_participant():
    found = read()
    assert found.lost == ()
    assert [(path.name, path.part) for path in found.paths] == ORDER
    assert found.completion_s == {"force": (18.7999985218,), "joystick": (16.9999983311,)}
    assert (found.occupancy.data == DATA).all()
    assert (found.occupancy.resolution_m, found.occupancy.origin_m) == (0.1, (-3.0, -1.0))
    assert (found.grid.occupied == GRID.occupied).all()
    first, course = found.paths[0], found.paths[5]
    assert first.xy_m.tolist() == forge.positions(0.3).tolist(), "bit for bit, equal positions in a row too"
    assert first.people.tolist() == [[25, 9]]
    assert first.cells[0].tolist() == [45, 10]
    assert first.cells.dtype == np.int64
    assert course.people.shape == (0, 2)


@pytest.mark.parametrize("field", ["world_poses", "people_pos", "grid_path"])
def test_arrays_in_place_of_lists(field):
    state = demonstration(0.3).state
    rows = np.array([[float(x), float(y)] if field == "world_poses" else [int(x), int(y)] for x, y in state[field]])
    for form in (rows, list(rows), [tuple(row) for row in rows]):
        found = read(passing_1=demonstration(0.3, **{field: form}))
        assert found.lost == ()
        plain, other = read(passing_1=demonstration(0.3)).paths[0], found.paths[0]
        assert (plain.xy_m == other.xy_m).all()
        assert (plain.people == other.people).all()
        assert (plain.cells == other.cells).all()


def test_lists_and_single_demonstrations_under_any_key():
    found = read(
        passing_1=demonstration(0.2),
        passing_2=None,
        replay=[demonstration(0.2)] * 2,
        passing_3=[demonstration(0.2)],
        extra_run=[demonstration(0.1)],
    )
    assert found.lost == ()
    assert names(found)[:4] == [
        f"force_demos/{name}" for name in ("passing_1/1", "replay/1", "replay/2", "obstacle_course/1")
    ]
    added = {path.name: path.part for path in found.paths[8:]}
    assert added == {
        "force_demos/extra_run/1": Part(Condition.FORCE, set="extra run"),
        "force_demos/passing_3/1": Part(Condition.FORCE),
    }


def test_completion_times_of_several_courses():
    found = read({"force_parcours_times.txt": b"18.5\n 21.25\r\n", "voice_parcours_times.txt": b"30"})
    assert found.completion_s == {"force": (18.5, 21.25), "joystick": (16.9999983311,), "voice": (30.0,)}


@pytest.mark.parametrize("data", [b"", b"fast\n", b"12.5 -1\n", b"nan", b"inf", b"0", b"\xff\xfe1", b"1 " * 9999])
def test_invalid_completion_times_are_reported(data):
    found = read({"force_parcours_times.txt": data})
    assert found.completion_s == {"joystick": (16.9999983311,)}
    (line,) = found.lost
    assert (
        line
        == f"runs/7/force_parcours_times.txt: expected seconds above 0, found {data[:40]!r}; download the file again"
    )


def test_missing_files_are_reported_and_the_rest_is_used():
    found = read({"joystick_demos.pkl": None, "joystick_parcours_times.txt": None})
    assert names(found) == [name for name in NAMES if not name.startswith("joystick")]
    (lost,) = found.lost
    assert lost == (
        "runs/7: expected joystick_demos.pkl, joystick_parcours_times.txt too, found no such files; their data are "
        "left out"
    )


def test_a_missing_map_is_taken_from_the_demonstrations():
    first = demonstration(0.3, nav_map=None)
    found = read({"nav_map.pkl": None}, passing_1=[first, demonstration(0.35)])
    assert names(found) == NAMES
    assert (found.occupancy.data == DATA).all()
    assert found.lost == ("runs/7: expected nav_map.pkl too, found no such files; their data are left out",)
    broken = read({"nav_map.pkl": b"hello"})
    assert names(broken) == NAMES
    (line,) = broken.lost
    assert line.startswith("runs/7/nav_map.pkl: expected a pickle of protocol 0")


def test_a_broken_file_is_reported_and_the_rest_is_used():
    found = read({"force_demos.pkl": forge.participant()["force_demos.pkl"][:-1]})
    assert names(found) == NAMES[6:]
    (line,) = found.lost
    assert line.startswith(
        "runs/7/force_demos.pkl: expected a pickle of protocol 0, as the study is published, found its"
    )


@pytest.mark.parametrize("files", [{}, {"nav_map.pkl": forge.participant()["nav_map.pkl"]}, {"force_demos.pkl": b"x"}])
def test_without_demonstrations_there_is_no_participant(files):
    with pytest.raises(
        ArtefactError,
        match=r"^runs/7: expected demonstrations and a map, found none: runs/7(: expected .* too|/force_demos\.pkl: )",
    ):
        participant_of(Run("7", "runs/7", files))


def test_empty_lists_make_no_participant():
    empty = forge.dumped({"passing_1": []})
    files = forge.participant() | dict.fromkeys(DEMONSTRATIONS, empty)
    with pytest.raises(
        ArtefactError, match=r"^runs/7: expected demonstrations and a map, found empty lists; download the files again$"
    ):
        participant_of(Run("7", "runs/7", files))


def test_without_a_map_there_is_no_participant():
    files = {"force_demos.pkl": forge.dumped({"passing_1": [demonstration(0.3, nav_map=None)]})}
    with pytest.raises(
        ArtefactError, match=r"found none: runs/7: expected nav_map\.pkl, joystick_demos\.pkl, obs_avoidance"
    ):
        participant_of(Run("7", "runs/7", files))


LIST = "expected lists of demonstrations by their names, found something else; download the file again"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], LIST),
        ({}, LIST),
        (demonstration(0.3), LIST),
        ({1: demonstration(0.3)}, LIST),
        ({"a\nb": demonstration(0.3)}, LIST),
        ({"a" * 101: demonstration(0.3)}, LIST),
        ({"passing_1": [None] * 101}, "expected at most 100 demonstrations, found more; download the file again"),
        (
            {"a": [None] * 60, "b": [None] * 41},
            "expected at most 100 demonstrations, found more; download the file again",
        ),
    ],
)
def test_a_file_of_something_else_is_reported(content, message):
    found = read({"force_demos.pkl": forge.dumped(content)})
    assert names(found) == NAMES[6:]
    assert found.lost == (f"runs/7/force_demos.pkl: {message}",)


KIND = "expected Demonstration with its attributes, found "
POSES = "world_poses: expected pairs of numbers (m), at least 2, found "
PEOPLE = "people_pos: expected pairs of integers (cells), found "
PATH = "grid_path: expected pairs of integers (cells), at least 1, found "
FINITE = "world_poses: expected finite numbers of at most 1e+06 m, found others"
LENGTH = "world_poses: expected a path of at most 1000 m, found one of "
INSIDE = "grid_path: expected cells of the map (50 x 20), found others"
OTHER = (
    "nav_map: expected the participant's map (cells of 0.1 m from (-3.0, -1.0) m), found another (cells of 0.1 m from "
)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([1, 2], KIND + "a list"),
        (5, KIND + "5"),
        (Old("nav_map.NavMap", {}), KIND + "nav_map.NavMap"),
        (Old("demonstration.Demonstration", [1]), KIND + "demonstration.Demonstration"),
        (demonstration(world_poses=False), POSES + "False"),
        (demonstration(world_poses=[(1.0, 2.0)]), POSES + "1"),
        (demonstration(world_poses=[(1.0, 2.0), (1.0, 2.0, 3.0)]), POSES + "something else at place 1"),
        (demonstration(world_poses=[(1.0, 2.0), (1.0, "2")]), POSES + "something else at place 1"),
        (demonstration(world_poses=[(1.0, 2.0), 3.0]), POSES + "something else at place 1"),
        (demonstration(world_poses=[(1.0, True), (1.0, 2.0)]), POSES + "something else at place 0"),
        (demonstration(world_poses=[(1.0, float("nan")), (1.0, 2.0)]), FINITE),
        (demonstration(world_poses=[(1e308, 0.0), (-1e308, 0.0)]), FINITE),
        (demonstration(world_poses=[(1.0, 2.0)] * 3), LENGTH + "0 m"),
        (demonstration(world_poses=[(0, 0), (2000, 0)]), LENGTH + "2000 m"),
        (demonstration(people_pos=[[1.5, 2.0]]), PEOPLE + "something else at place 0"),
        (demonstration(people_pos=[[10**9, 2]]), PEOPLE + "a number beyond 100000"),
        (demonstration(people_pos=[[3, 2]] * 101), "people_pos: expected at most 100 people, found 101"),
        (demonstration(grid_path=[]), PATH + "0"),
        (demonstration(grid_path="cells"), PATH + "'cells'"),
        (demonstration(grid_path=[(50, 3)]), INSIDE),
        (demonstration(grid_path=[(3, -1)]), INSIDE),
        (demonstration(nav_map=5), "expected NavMap with its attributes, found 5"),
        (demonstration(nav_map=nav_map(origin=(-3.0, 1.0))), OTHER + "(-3.0, 1.0) m)"),
    ],
)  # fmt: skip
def test_a_demonstration_of_something_else_is_reported(value, message):
    found = read(passing_1=[demonstration(0.3), value])
    assert names(found) == [name for name in NAMES if name != "force_demos/passing_1/2"]
    assert found.lost == (f"runs/7/force_demos.pkl/passing_1/2: {message}; download the file again",)


@pytest.mark.parametrize("field", ["world_poses", "people_pos", "grid_path"])
def test_a_demonstration_without_a_field_is_reported(field):
    (line,) = read(passing_1=[demonstration(0.3, **{field: None}), demonstration(0.3)]).lost
    assert line.startswith(f"runs/7/force_demos.pkl/passing_1/1: {field}: expected pairs of ")
    assert line.endswith(", found none; download the file again")


def test_very_long_lists_are_reported(monkeypatch):
    monkeypatch.setattr(fields, "MOST_ROWS", 70)
    found = read(passing_1=[demonstration(0.3, world_poses=[(0.0, 0.1 * i) for i in range(71)]), demonstration(0.3)])
    assert found.lost == (f"runs/7/force_demos.pkl/passing_1/1: {POSES}71 of them; download the file again",)


def slots(place, value):
    """The map with a field of its message exchanged."""
    changed = nav_map()
    changed.state["ros_occupancy_map"].slots[place] = value
    return changed


ROTATED = "found them rotated"
SIDES = "ros_occupancy_map: expected cells of 0.01 to 2.0 m and a finite origin, found "
SIZE = "expected a map of {} x {} cells, found {}"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (5, "expected NavMap with its attributes, found 5"),
        (Old("nav_map.NavMap", {}), "ros_occupancy_map: expected OccupancyGrid of 3 fields, found None"),
        (Old("nav_map.NavMap", {"ros_occupancy_map": Message("genpy.rostime.Time", [1, 2, 3])}),
         "ros_occupancy_map: expected OccupancyGrid of 3 fields, found genpy.rostime.Time"),
        (slots(1, None), "ros_occupancy_map: expected MapMetaData of 5 fields, found None"),
        (nav_map(width=51), "ros_occupancy_map: " + SIZE.format(51, 20, "1000 cells")),
        (nav_map(width=-50, height=-20), "ros_occupancy_map: " + SIZE.format(-50, -20, "1000 cells")),
        (nav_map(width=50.0), "ros_occupancy_map: " + SIZE.format("50.0", 20, "1000 cells")),
        (nav_map("map"), "ros_occupancy_map: " + SIZE.format(50, 20, "'map'")),
        (nav_map([101] * 1000), "ros_occupancy_map: expected occupancy from -1 to 100, found something else"),
        (nav_map([-2] * 1000), "ros_occupancy_map: expected occupancy from -1 to 100, found something else"),
        (nav_map([0.5] * 1000), "ros_occupancy_map: expected occupancy from -1 to 100, found something else"),
        (nav_map(resolution=0.0), SIDES + "0 m and [-3.0, -1.0, 0.0]"),
        (nav_map(resolution=1e300), SIDES + "1e+300 m and [-3.0, -1.0, 0.0]"),
        (nav_map(origin=(float("inf"), 0.0)), SIDES + "0.1 m and [inf, 0.0, 0.0]"),
        (nav_map(resolution="fine"), "ros_occupancy_map: expected a number, found 'fine'"),
        (nav_map(turned=0.5), "ros_occupancy_map: expected cells along the axes of the map's frame, " + ROTATED),
    ],
)  # fmt: skip
def test_a_map_of_something_else_is_reported(value, message):
    found = read({"nav_map.pkl": forge.dumped(value)})
    assert names(found) == NAMES, "the demonstrations' own map serves"
    assert found.lost == (f"runs/7/nav_map.pkl: {message}; download the file again",)


def test_a_map_as_an_array():
    found = read({"nav_map.pkl": forge.dumped(nav_map(DATA.astype("i1").ravel()))})
    assert found.lost == ()
    assert (found.occupancy.data == DATA).all()


def test_wrong_bytes_give_a_participant_or_an_expected_error():
    rng = np.random.default_rng(1)
    files = {"nav_map.pkl": forge.participant()["nav_map.pkl"]}
    whole = np.frombuffer(forge.dumped({"passing_1": demonstration(0.3, nav_map=None)}), dtype=np.uint8)
    letters = np.frombuffer(b"(INFSVltdaspgcRib.0123456789-'\n\\", dtype=np.uint8)
    lost = 0
    for _ in range(150):
        data = whole.copy()
        places = rng.integers(0, len(data), size=rng.integers(1, 4))
        data[places] = rng.choice(letters, size=len(places))
        try:
            found = participant_of(Run("7", "runs/7", files | {"force_demos.pkl": data.tobytes()}))
        except ArtefactError:
            lost += 1
        else:
            assert all(name.startswith("force_demos/") for name in names(found))
    assert 30 < lost < 150
