"""Where the people of a trial are: standing, walking, lost and numbered again, or no people."""

import numpy as np
import pytest
from robot_log import Run, write_run

from navirl_cli.demos.demonstration import PersonTrack
from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.demos.people import people_during
from navirl_cli.errors import DemonstrationError
from navirl_cli.logs.load import load_recording
from navirl_cli.logs.recording import Occupancy, Recording, Track

S = 1_000_000_000
#: The trial of these tests, ns.
TRIAL = (100 * S, 110 * S)


def recording(tracks, messages_s=None):
    """Tracks: name -> rows of seconds, x, y. Messages come when somebody is seen, unless their times are given."""
    rows = {name: np.array(track, dtype=float).reshape(-1, 3) for name, track in tracks.items()}
    times = np.unique(np.concatenate([np.zeros(0), *(track[:, 0] for track in rows.values())]))
    return Recording(
        log="run.mcap",
        t_ns=np.array(TRIAL),
        xy_m=np.zeros((2, 2)),
        yaw_rad=np.zeros(2),
        wrench=None,
        occupancy=Occupancy(np.zeros((1, 1), dtype=np.int8), 0.1, (0.0, 0.0)),
        goal_t_ns=np.zeros(0, dtype=np.int64),
        goal_m=np.zeros((0, 2)),
        people_t_ns=ns(times if messages_s is None else messages_s),
        people=tuple(Track(name, ns(track[:, 0]), track[:, 1:]) for name, track in rows.items()),
        command_t_ns=np.zeros(0, dtype=np.int64),
        command=np.zeros(0),
    )


def ns(seconds):
    return np.round(np.asarray(seconds) * 1e9).astype(np.int64)


def standing(x, y, since=100, until=110, hz=10):
    return [(t, x, y) for t in np.arange(since, until, 1 / hz)]


def walking(start, stop, since=100, until=110, hz=10):
    t = np.arange(since, until + 1e-9, 1 / hz)
    share = ((t - since) / (until - since))[:, None]
    return np.column_stack([t, (1 - share) * start + share * np.array(stop)])


def seen(tracks, messages_s=None):
    return people_during(recording(tracks, messages_s), *TRIAL)


def test_who_stands_still_has_a_place_and_no_track():
    shaking = [(t, 2 + 0.02 * (-1) ** i, 1.0) for i, (t, *_) in enumerate(standing(2, 1, 95, 115))]
    found = seen({"1": shaking, "2": standing(-1, 0)})
    assert found.people_m == pytest.approx(np.array([[2.0, 1.0], [-1.0, 0.0]]), abs=1e-3)
    assert (found.tracks, found.notes) == ((), ())


def test_who_walks_has_a_track_and_the_mean_over_time_stands_for_them():
    # Seen ten times more often in the second half than in the first: that must not draw the mean.
    way = walking((0, 1), (4, 1), hz=20)
    rare = np.concatenate([way[:100:10], way[100:]])
    found = seen({"ann": rare, "bob": standing(5, 5)})
    assert found.people_m == pytest.approx(np.array([[2.0, 1.0], [5.0, 5.0]]), abs=0.01)
    ann, bob = found.tracks
    assert (ann.name, bob.name, len(bob.t_s), bob.spread_m) == ("ann", "bob", 0, 0.0)
    assert ann.t_s == pytest.approx(rare[:, 0] - 100)
    assert ann.xy_m == pytest.approx(rare[:, 1:])
    assert ann.spread_m == pytest.approx(2.0, abs=0.01)
    (note,) = found.notes
    assert (
        note == "person ann moves: up to 2.00 m from the mean place over the trial, which represents them in the scene"
    )


@pytest.mark.parametrize(("width", "tracks", "notes"), [(0.08, 0, 0), (0.3, 1, 0), (0.7, 1, 1)])
def test_notes_depend_on_how_far_a_person_moves(width, tracks, notes):
    found = seen({"1": walking((0, 0), (width, 0))})
    assert (len(found.tracks), len(found.notes)) == (tracks, notes)


def test_only_messages_during_the_trial_count():
    found = seen({"1": [*standing(0, 0, 80, 100), *standing(3, 3), *standing(9, 9, 111, 130)]})
    assert found.people_m.tolist() == [[3.0, 3.0]]


def test_a_topic_that_speaks_once_holds_for_later_trials():
    assert seen({"1": [(10, 1, 2)], "2": [(10, 3, 4)]}).people_m.tolist() == [[1, 2], [3, 4]]
    # of the messages before the trial the last one counts, also without people
    assert seen({"1": [(10, 1, 2)], "2": [(20, 3, 4)]}).people_m.tolist() == [[3, 4]]
    assert seen({"1": [(10, 1, 2)]}, messages_s=[10, 20]).people_m.shape == (0, 2)
    assert seen({"1": [(200, 1, 2), (201, 8, 8)]}).people_m.tolist() == [[1, 2]]
    assert seen({}).people_m.shape == (0, 2)


def test_messages_without_people_mean_that_the_scene_is_empty():
    found = seen({"1": standing(1, 1, 80, 99)}, messages_s=np.arange(80, 112, 0.5))
    assert found.people_m.shape == (0, 2)


def test_a_false_track_does_not_count():
    found = seen({"1": standing(1, 1), "7": standing(4, 4, 103, 104.5), "9": standing(2, 4, 106, 106.4)})
    assert found.people_m.tolist() == [[1.0, 1.0], [4.0, 4.0]]
    assert found.notes == ("left out, because seen in less than 20% of the time: person 9",)
    both = seen({"1": standing(1, 1), "7": standing(4, 4, 103, 103.5), "9": standing(2, 4, 106, 106.4)})
    assert both.notes == ("left out, because seen in less than 20% of the time: person 7, 9",)


def test_topics_about_one_person_each_give_no_false_tracks():
    names = [f"/person{number}" for number in range(8)]
    found = seen({name: standing(number, 2, 100 + 0.01 * number) for number, name in enumerate(names)})
    assert len(found.people_m) == 8
    assert found.notes == ()


def test_a_person_with_a_new_number_is_one_person():
    way = walking((0, 1), (4, 1))
    found = seen({"3": way[:40], "8": way[42:70], "12": way[70:]})
    (track,) = found.tracks
    assert track.name == "3"
    assert len(track.t_s) == len(way) - 2
    assert found.people_m == pytest.approx(np.array([[2.0, 1.0]]), abs=0.01)
    assert found.notes[0] == "person 3 continues as 8, 12: taken as one person"


def test_who_coexists_or_comes_from_elsewhere_is_another():
    assert len(seen({"1": standing(0, 0, 100, 106), "2": standing(0.3, 0, 105, 110)}).people_m) == 2
    assert len(seen({"1": standing(0, 0, 100, 105), "2": standing(0.6, 0, 105, 110)}).people_m) == 2
    assert len(seen({"1": standing(0, 0, 100, 105), "2": standing(0.4, 0, 105, 110)}).people_m) == 1


def test_people_who_swap_places_in_a_list_stay_who_they_are():
    left, right = standing(0, 1), standing(0, -1)
    swapped = {"1": [*left[:40], *right[40:]], "2": [*right[:40], *left[40:]]}
    found = seen(swapped)
    assert found.people_m.tolist() == [[0.0, 1.0], [0.0, -1.0]]
    assert found.tracks == ()
    # When the first of a list leaves, the others move up.
    found = seen({"1": [*left[:40], *right[40:]], "2": right[:40]})
    assert found.people_m.tolist() == [[0.0, 1.0], [0.0, -1.0]]


def test_one_wrong_sight_does_not_part_a_person():
    rows = standing(2, 1)
    rows[50] = (rows[50][0], 9.0, 9.0)
    found = seen({"1": rows})
    assert found.people_m.tolist() == [[2.0, 1.0]]
    assert found.notes == ("left out, because seen in less than 20% of the time: person 1",)


def test_invalid_tracks_are_refused():
    for times, places, message in (
        (
            [0.0, 1.0],
            np.zeros((3, 2)),
            r"track of person eve: t_s and xy_m need the shapes .* found \(2,\) and \(3, 2\)",
        ),
        ([1.0, 1.0], np.zeros((2, 2)), "track of person eve: needs finite places at increasing times"),
        ([0.0, 1.0], np.full((2, 2), np.nan), "track of person eve: needs finite places"),
    ):
        with pytest.raises(DemonstrationError, match=message):
            PersonTrack("eve", np.array(times), places)


def test_a_log_with_walkers_becomes_a_demonstration_with_tracks(tmp_path):
    # From before the trial to beyond it; and one who passes by for a moment.
    walker, passer = ((0.0, 2.0, 0.8), (14.0, 2.0, 1.36)), ((5.0, 3.0, 1.2), (5.4, 3.0, 1.2))
    path = write_run(tmp_path / "run.mcap", Run(people=((1.0, 1.1),), walks=(walker, passer)))
    loaded = load_recording(path)
    (d,) = extract(loaded, ExtractSettings()).demonstrations
    middle_s = 1.5 + d.duration_s / 2
    assert d.people_m == pytest.approx(np.array([[1.0, 1.1], [2.0, 0.8 + 0.04 * middle_s]]), abs=0.01)
    still, moving = d.tracks
    assert len(still.t_s) == 0
    assert moving.xy_m[:, 1] == pytest.approx(0.8 + 0.04 * (1.5 + moving.t_s), abs=0.005)
    assert d.notes == ("left out, because seen in less than 20% of the time: person 3",)
    (said,) = extract(loaded, ExtractSettings(people_m=((2.0, 1.0),))).demonstrations
    assert (said.people_m.tolist(), said.tracks) == ([[2.0, 1.0]], ())
    assert said.notes == ("people by `person`: 1; in the log: 2; those of the log are ignored",)
