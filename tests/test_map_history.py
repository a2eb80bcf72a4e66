"""Maps that are replaced, updated or grow, and which of them a trial has."""

import tracemalloc

import nav_log as nav
import numpy as np
import pytest
import robot_scene as forge
from rosbags.typesys import get_types_from_msg
from shared_cases import case

from navirl_cli.demos.extract import ExtractSettings, extract
from navirl_cli.demos.grid import Grid
from navirl_cli.errors import GridError, LogError
from navirl_cli.logs.load import LoadOptions, load_recording

UPDATE = "map_msgs/msg/OccupancyGridUpdate"
nav.FOREIGN[UPDATE] = "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
nav.STORE.register(get_types_from_msg(nav.FOREIGN[UPDATE], UPDATE))


def update(second, cells, x, y, *, short_by=0):
    """Cells (rows, columns) that replace those from column x and row y on."""
    cells = np.asarray(cells, dtype=np.int8)
    rows, columns = cells.shape
    head = nav.header(forge.at(second), "map")
    return nav.build(
        UPDATE, header=head, x=x, y=y, width=columns, height=rows, data=cells.ravel()[: cells.size - short_by]
    )


def stamped(message, second):
    """A map with a stamp."""
    message.header.stamp = nav.time(forge.at(second))
    return message


@pytest.fixture
def loaded(tmp_path):
    def loaded_from(log, **options):
        return load_recording(log.write(tmp_path / "run.mcap"), LoadOptions(**options))

    return loaded_from


@pytest.fixture
def trial(loaded):
    """The only trial of a log."""

    def trial_of(log):
        (found,) = extract(loaded(log), ExtractSettings(robot_radius_m=0.0)).demonstrations
        return found

    return trial_of


WALL = np.full((30, 1), 100)


def occupied(grid):
    return int(grid.occupied.sum())


def test_the_same_map_again_and_again_is_one(loaded):
    log = forge.scene()
    for second in range(1, 16):
        log.add("/map", forge.free(), forge.at(second))
    recording = loaded(log)
    assert recording.maps is None
    assert recording.notes == ()


def test_a_map_that_is_replaced_after_the_trial_does_not_count(loaded, trial):
    log = forge.scene()
    log.add("/map", forge.free(value=100), forge.at(14))
    recording = loaded(log)
    assert recording.notes == (
        "run.mcap: /map changes: 2 different maps of 60 x 30 cells; each trial has the map in force at its end",
    )
    found = trial(log)
    assert occupied(found.grid) == 0
    assert not any("map" in note for note in found.notes)


def test_a_map_that_is_replaced_during_the_trial_counts_and_is_noted(trial):
    log = forge.scene(world=False)
    log.add("/map", forge.free(value=100), forge.at(0))
    log.add("/map", forge.free(), forge.at(6))
    found = trial(log)
    assert occupied(found.grid) == 0
    assert "the map changes once during the trial; the last one counts" in found.notes


def test_trials_of_one_log_have_their_own_maps(loaded):
    log = forge.scene()
    log.add("/map", forge.free(40, 60, origin=(-1.05, -2.05)), forge.at(13))
    log.add("/goal_pose", nav.pose_stamped(forge.at(13.5), 4.0, 1.0), forge.at(13.5))
    recording = loaded(log)
    assert recording.occupancy.data.shape == (40, 60)
    (first,) = extract(recording, ExtractSettings()).demonstrations
    assert first.grid.shape == (30, 60)


@pytest.mark.parametrize(("stamp_s", "counts"), [(-50.0, True), (15.9, False), (-(10**8), False)])
def test_a_map_that_is_delivered_late_counts_from_its_stamp(trial, stamp_s, counts):
    """An absurdly old stamp is another clock's."""
    log = forge.scene()
    log.add("/map", stamped(forge.free(value=50), stamp_s), forge.at(15.5))
    drawn = forge.free()
    drawn.data[0] = 100
    log.add("/map", stamped(drawn, stamp_s), forge.at(15.6))
    assert occupied(trial(log).grid) == counts


def test_the_first_map_counts_from_the_beginning(trial):
    log = forge.scene(world=False)
    log.add("/map", stamped(forge.free(), 15.0), forge.at(15.0))
    assert occupied(trial(log).grid) == 0


def test_updates_are_applied_from_when_they_were_sent(loaded, trial):
    log = forge.scene()
    log.add("/map_updates", update(4.0, WALL, 55, 0), forge.at(4.0))
    log.add("/map_updates", update(6.0, WALL[:10], 57, 20), forge.at(6.0))
    log.add("/map_updates", update(15.0, np.full((30, 60), 100), 0, 0), forge.at(15.0))
    recording = loaded(log)
    assert recording.notes == (
        "run.mcap: /map changes: one map of 60 x 30 cells, 3 updates; each trial has the map in force at its end",
    )
    found = trial(log)
    assert found.grid.occupied[:, 55].all()
    assert found.grid.occupied[20:, 57].all()
    assert occupied(found.grid) == 40
    assert "the map changes 2 times during the trial; the last one counts" in found.notes
    assert (recording.occupancy.data == 100).all()


def test_a_new_map_ends_the_updates_of_the_one_before(trial):
    log = forge.scene()
    log.add("/map_updates", update(4.0, WALL, 55, 0), forge.at(4.0))
    log.add("/map", forge.free(), forge.at(6.0))
    assert occupied(trial(log).grid) == 0


def test_updates_that_do_not_fit_are_listed(loaded):
    log = forge.scene()
    for wrong in (
        update(4, WALL, 60, 0),
        update(4, WALL, 5, 1),
        update(4, WALL, -1, 0),
        update(4, WALL, 5, 0, short_by=1),
    ):
        log.add("/map_updates", wrong, forge.at(4))
    recording = loaded(log)
    assert recording.maps is None
    assert recording.damage == ("run.mcap: 4 updates on /map_updates do not lie within the map before them; left out",)


def test_updates_of_another_map_do_not_count(loaded):
    log = forge.scene()
    log.add("/local_costmap/costmap_updates", update(4.0, WALL, 55, 0), forge.at(4.0))
    assert loaded(log).maps is None


def test_a_map_that_grows_is_that_at_the_trials_end(loaded, trial):
    """As slam sends it: every second more columns, also to the left."""
    log = forge.scene(world=False)
    for second in range(16):
        log.add("/map", forge.free(30, 15 + 4 * second, origin=(-1.05 - 0.1 * second, -1.55)), forge.at(second))
    found = trial(log)
    assert found.grid.shape[1] in (15 + 4 * 11, 15 + 4 * 12)
    assert found.grid.origin_m[0] == pytest.approx(-1.05 - 0.1 * ((found.grid.shape[1] - 15) / 4))
    assert loaded(log).notes == (
        (
            "run.mcap: /map changes: 16 different maps of 15 x 30 to 75 x 30 cells; each trial has the map in force at "
            "its end"
        ),
    )


def test_maps_over_time_fit_into_memory(tmp_path):
    log = forge.scene(world=False)
    data = np.zeros((300, 400), dtype=np.int8)
    for number in range(300):
        message = nav.grid(300, 400, resolution=0.1, origin=(-1.05, -10.0))
        data[number, : number + 50] = 100
        message.data = data.ravel().copy()
        log.add("/map", message, forge.at(0.05 * number))
    path = log.write(tmp_path / "run.mcap")
    log.messages.clear()
    tracemalloc.start()
    recording = load_recording(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(recording.maps.sheets) == 300
    assert peak < 25e6, "all of them are 36 MB"
    assert (recording.maps.occupancy(100).data == 100).sum() == sum(range(50, 151))


def test_one_map_that_cannot_be_used_among_others_is_listed(loaded, trial):
    log = forge.scene()
    broken = forge.free()
    broken.info.resolution = 0.0
    log.add("/map", broken, forge.at(5))
    assert loaded(log).damage == (
        (
            "run.mcap: 1 map on /map cannot be used (expected cells of 0.001 to 100 m, found 0 m; record the map "
            "again, or give it with `map`); left out"
        ),
    )
    assert occupied(trial(log).grid) == 0


def test_only_updates_are_no_map(loaded):
    log = forge.scene(world=False)
    log.add("/map_updates", update(4.0, WALL, 55, 0), forge.at(4.0))
    with pytest.raises(LogError, match=r"no map: expected a topic of type nav_msgs/OccupancyGrid; give the map"):
        loaded(log)


def test_cells_without_bound_are_refused():
    with pytest.raises(
        GridError, match=r"a map of 60 x 30 cells of 100 m: expected at most \d+ cells of 0.1 m, found 60000"
    ):
        Grid(np.zeros((30, 60), dtype=bool), 100.0, (0.0, 0.0)).resampled(0.1)


def test_the_shared_case_of_a_map_replaced_at_the_end():
    recording = load_recording(case("map_replaced_at_end"))
    (found,) = extract(recording, ExtractSettings()).demonstrations
    assert len(found.cells) == 72
    assert any("/map changes: 2 different maps" in note for note in recording.notes)


def test_the_shared_case_of_updates():
    recording = load_recording(case("map_updates"))
    (found,) = extract(recording, ExtractSettings()).demonstrations
    assert any("driven cells that are occupied on the map were freed" in note for note in found.notes)
    assert any("/map changes: one map of 100 x 60 cells, 1 update;" in note for note in recording.notes)
