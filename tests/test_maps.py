"""The map of a recording is brought into the fixed frame without resampling, or refused."""

import tracemalloc
from dataclasses import replace

import nav_log as nav
import numpy as np
import pytest

from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.load import LoadOptions, load_recording

NO_TF = {"skip": ["/map", "/tf"]}


def drawn(**changes):
    """A grid whose cells are all different."""
    message = nav.grid(**changes)
    return replace(message, data=np.arange(len(message.data), dtype=np.int8))


@pytest.fixture
def load(tmp_path):
    def loaded(message, *, frame=None, links=(), moving=(), **changes):
        log = nav.drive(4.0, **{"skip": ["/map"], **changes})
        log.add("/map", message, nav.START_NS)
        if links:
            log.add("/tf_static", nav.tf(*links), nav.START_NS)
        for at, link in moving:
            log.add("/tf", nav.tf(link), at)
        return load_recording(log.write(tmp_path / "run.mcap"), LoadOptions(frame=frame))

    return loaded


def test_a_map_in_its_own_frame_defines_the_fixed_one(load):
    occupancy = load(drawn()).occupancy
    assert occupancy.data.dtype == np.int8
    assert occupancy.data.tolist() == np.arange(24).reshape(4, 6).tolist()
    assert (occupancy.resolution_m, occupancy.origin_m) == (0.05, (-1.0, -2.0))


def test_unknown_and_inflated_cells_are_kept(load):
    message = nav.grid()
    message.data[:3] = (-1, 99, 100)
    assert load(message).occupancy.data[0, :3].tolist() == [-1, 99, 100]


def test_a_map_in_another_frame_that_is_only_shifted(load):
    message = drawn(frame="/floor")
    link = nav.transform(0, "map", "floor", 3.0, -1.0)
    recording = load(message, frame="map", links=[link])
    assert recording.occupancy.origin_m == pytest.approx((2.0, -3.0))
    assert recording.occupancy.data.tolist() == np.arange(24).reshape(4, 6).tolist()
    assert recording.xy_m[-1] == pytest.approx([0.395, 0.0], abs=0.011)
    own = load(message, links=[link])
    assert own.occupancy.origin_m == (-1.0, -2.0)
    assert own.xy_m[-1] == pytest.approx([0.395 - 3.0, 1.0], abs=0.011)


TURNED = (
    r"^run.mcap: the map's frame 'floor' is rotated against 'map' or moves in it, so that its cells cannot be kept; "
    r"choose `frame` floor, or give a map in 'map' with `map`$"
)


def test_a_map_in_a_frame_that_is_turned_or_moves_is_refused(load):
    message = drawn(frame="floor")
    with pytest.raises(LogError, match=TURNED):
        load(message, frame="map", links=[nav.transform(0, "map", "floor", 3.0, -1.0, 0.1)])
    moving = [(int(nav.unix(s)), nav.transform(nav.unix(s), "map", "floor", s, 0.0)) for s in (0.0, 2.0, 4.0)]
    with pytest.raises(LogError, match=TURNED):
        load(message, frame="map", moving=moving)


def test_a_frame_that_tf_repeats_without_moving_is_no_other(load):
    moving = [(int(nav.unix(s)), nav.transform(nav.unix(s), "map", "floor", 3.0, 0.0)) for s in (0.0, 2.0, 4.0)]
    assert load(drawn(frame="floor"), frame="map", moving=moving).occupancy.origin_m == pytest.approx((2.0, -2.0))


def test_a_map_in_an_unknown_frame(load):
    message = (
        r"^run.mcap: the map is given in frame 'floor': transform from 'floor' to 'map': expected connected frames, "
        r"found map -> odom; floor is in no transform; record /tf"
    )
    with pytest.raises(FrameError, match=message):
        load(drawn(frame="floor"), frame="map")


def test_a_map_whose_own_cells_are_turned(load):
    with pytest.raises(
        LogError, match=r"run.mcap: topic /map: expected a map whose cells run along .* found one rotated by 11.5 deg"
    ):
        load(drawn(yaw=0.2))
    message = drawn()
    message.info.origin.orientation.w = 0.0  # some tools leave the rotation empty
    recording = load(message)
    assert recording.occupancy.origin_m == (-1.0, -2.0)
    assert recording.notes == (
        "run.mcap: 1 map on /map has an origin with a quaternion of zeros; taken as not rotated",
    )
    message.info.origin.orientation.w = -1.0
    assert load(message).occupancy.origin_m == (-1.0, -2.0)


@pytest.mark.parametrize(
    ("numbers", "reason"),
    [
        ({"w": 3.0}, r"expected an origin with a rotation, found one with a quaternion of length 3, not 1; record the"),
        (
            {"w": np.nan},
            r"found one with a quaternion that is not finite; record the map again, or give it with `map`$",
        ),
        ({"x": 0.1, "w": 0.995}, r"in the plane of its frame, found one tilted by roll 11\.5 and pitch 0\.0 degrees"),
        ({"y": 1.0, "w": 0.0}, r"found one tilted by roll -?180\.0 and pitch 0\.0 degrees"),
    ],
)
def test_an_origin_that_is_no_rotation_in_the_plane(load, numbers, reason):
    message = drawn()
    for name, value in numbers.items():
        setattr(message.info.origin.orientation, name, value)
    with pytest.raises(LogError, match=rf"^run.mcap: topic /map: .*{reason}"):
        load(message)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("width", 7, r"^run.mcap: topic /map: expected a map of 4 x 7 cells, found 24; record the map again$"),
        ("height", 0, r"^run.mcap: topic /map: expected a map of 0 x 6 cells, found 24; record the map again$"),
        (
            "width",
            2**32 - 1,
            r"^run.mcap: topic /map: expected a map of 4 x 4294967295 cells, found 24; record the map again$",
        ),
        (
            "resolution",
            -0.05,
            r"expected cells of 0.001 to 100 m, found -0.05 m; record the map again, or give it with `map`$",
        ),
        (
            "resolution",
            np.inf,
            r"expected cells of 0.001 to 100 m, found inf m; record",
        ),
    ],
)
def test_numbers_that_contradict_each_other(load, field, value, message):
    grid = drawn()
    setattr(grid.info, field, value)
    with pytest.raises(LogError, match=message):
        load(grid)


def test_an_infinite_origin_and_a_map_without_cells(load):
    grid = drawn(origin=(np.nan, 0.0))
    with pytest.raises(
        LogError,
        match=r"topic /map: expected a finite origin within 1e\+06 m, found \(nan, 0\) m; record the map again",
    ):
        load(grid)
    with pytest.raises(
        LogError, match=r"^run.mcap: topic /map: expected a map of 0 x 0 cells, found 0; record the map again$"
    ):
        load(nav.grid(0, 0))


def test_of_a_map_that_is_sent_again_and_again_the_last_counts_and_fits_into_memory(tmp_path):
    log = nav.drive(4.0, skip=["/map"])
    log.add("/map", nav.grid(200, 300), nav.START_NS)
    first = log.messages.pop()
    for number in range(1000):
        data = first.payload[:-60_000] + bytes([number % 100]) + first.payload[-59_999:]
        log.messages.append(nav.Message("/map", first.typename, nav.START_NS + number * 4_000_000, data))
    path = log.write(tmp_path / "run.mcap")
    log.messages.clear()
    tracemalloc.start()
    occupancy = load_recording(path).occupancy
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert occupancy.data.shape == (200, 300)
    assert occupancy.data[0, 0] == 99
    assert peak < 25e6, "all of them are 60 MB"
