"""People whom the user places: what contradicts the log, the path or the map is said."""

from dataclasses import replace

import pytest
from robot_log import Run, write_run

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.errors import DemonstrationError
from navirl_cli.logs.load import load_recording


@pytest.fixture
def notes(tmp_path):
    """Notes of the only trial, from (0, 0) to (4, 0), beside a person at (2, 0.9)."""

    def extracted(*people, **changes):
        path = tmp_path / "run.mcap"
        path.unlink(missing_ok=True)
        recording = load_recording(write_run(path, replace(Run(), **changes)))
        (demonstration,) = extract(recording, ExtractSettings(people_m=people)).demonstrations
        assert demonstration.people_m.tolist() == [list(one) for one in people]
        return demonstration.notes

    return extracted


def test_the_logs_own_person_placed_again_is_no_news(notes):
    assert notes((2.1, 1.0)) == ()


def test_without_people_in_the_log_nothing_contradicts(notes):
    assert notes((3.0, 1.0), people=None) == ()


def test_a_person_whom_the_log_has_elsewhere(notes):
    assert notes((2.0, -1.0)) == (
        (
            "`person` 2.00,-1.00 contradicts the log, whose nearest person is 1.90 m from there, at x 2.00 m, y 0.90 "
            "m; the log's people are ignored"
        ),
    )


def test_more_people_than_the_log_has(notes):
    count, place = notes((2.0, 0.9), (3.0, -1.0))
    assert count == "people by `person`: 2; in the log: 1; those of the log are ignored"
    assert place.startswith("`person` 3.00,-1.00 contradicts the log")


def test_people_where_the_log_shows_nobody(notes):
    assert notes((2.0, 0.9), people=()) == ("people by `person`: 1; in the log: 0; those of the log are ignored",)


def test_a_person_on_the_path(notes):
    assert notes((2.0, 0.2), people=None) == (
        (
            "the robot drove through `person` 2.00,0.20: its centre passed 0.20 m from there, radius 0.30 m; correct "
            "the place"
        ),
    )
    assert notes((2.0, 0.35), people=None) == ()


def test_a_person_in_an_obstacle_or_off_the_map(notes):
    assert notes((1.98, 1.2), (90.0, 0.0), people=None, obstacles=((30, 27),)) == (
        "a person at x 1.98 m, y 1.20 m stands in a wall of the map",
        "a person at x 90.00 m, y 0.00 m stands off the map",
    )


@pytest.mark.parametrize(
    ("person", "message"),
    [
        ((0.1, 0.0), r"a person at x 0.10 m, y 0.00 m stands on the path's start \(0.\d\d m from"),
        ((4.1, 0.0), r"`person` 4.10,0.00 stands where the path ends, which is its goal \(0.\d\d m from the robot's"),
    ],
)
def test_a_person_at_the_start_or_the_goal_makes_no_scene(notes, person, message):
    with pytest.raises(DemonstrationError, match=message):
        notes(person)
