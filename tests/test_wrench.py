"""Forces: axes that are missing, and units."""

import nav_log as nav
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navirl_cli.errors import LogError
from navirl_cli.logs.load import LoadOptions, load_recording

NAN, INF = float("nan"), float("inf")


@pytest.fixture
def load(tmp_path):
    """A drive whose force in the robot's frame is (s, 2 s, 5) N, measured by a sensor that is mounted as given."""

    def loaded(missing, *, mounted=(0.0, 0.0, 0.0, 1.0), value=NAN, until_s=INF, **options):
        log = nav.drive(5.0, skip=["/wrench"])
        turn = nav.build("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", mounted, strict=True)))
        link = nav.transform(0, "base_link", "ft")
        link.transform.rotation = turn
        log.add("/tf_static", nav.tf(link), nav.START_NS)
        for second in np.arange(0.0, 5.0, 0.02).tolist():
            force = inverse(mounted) @ np.array([second, 2 * second, 5.0])
            if second < until_s:
                force["xyz".index(missing)] = value
            log.add("/ft", nav.wrench(int(nav.unix(second)), *force, frame="ft"), int(nav.unix(second)))
        return load_recording(log.write(tmp_path / "run.mcap"), LoadOptions(**options))

    return loaded


def inverse(turn):
    return Rotation.from_quat(turn).as_matrix().T


HALF = np.sqrt(0.5)
#: A sensor turned about z, upside down about x, and one on its side, whose y points up.
LEVEL, ABOUT_Z, UPSIDE_DOWN, ON_ITS_SIDE = (0, 0, 0, 1), (0, 0, HALF, HALF), (1, 0, 0, 0), (HALF, 0, 0, HALF)


@pytest.mark.parametrize(("mounted", "missing"), [(LEVEL, "z"), (ABOUT_Z, "z"), (UPSIDE_DOWN, "z"), (ON_ITS_SIDE, "y")])
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_an_axis_out_of_the_plane_may_be_missing(load, mounted, missing, value):
    recording = load(missing, mounted=mounted, value=value)
    in_plane = recording.wrench.force_n @ recording.wrench.to_base[:2].T
    seconds = np.arange(0.0, 5.0, 0.02)
    assert in_plane == pytest.approx(np.column_stack([seconds, 2 * seconds]), abs=1e-9)
    assert recording.damage == ()
    (note,) = recording.notes
    assert note.startswith(f"run.mcap: force {missing} of /ft is never finite, so it is missing; ")


@pytest.mark.parametrize(
    ("mounted", "missing", "share"),
    [(LEVEL, "x", 100), (LEVEL, "y", 100), (ON_ITS_SIDE, "z", 100), ((0.05, 0, 0, np.sqrt(1 - 0.0025)), "z", 10)],
)
def test_an_axis_in_the_plane_may_not(load, mounted, missing, share):
    message = (
        rf"^run.mcap: topic /ft: force {missing} is never finite, and the sensor's mounting 'ft' on 'base_link' turns "
        rf"{share}% of it into the robot's plane; record all axes$"
    )
    with pytest.raises(LogError, match=message):
        load(missing, mounted=mounted)


def test_an_axis_that_is_missing_for_a_while_loses_those_messages(load):
    recording = load("z", until_s=1.0)
    assert len(recording.wrench.t_ns) == 200
    assert recording.damage == ("run.mcap: 50 messages on /ft hold implausible values (50 not finite); left out",)


@pytest.mark.parametrize("scale", [1000.0, 0.001])
def test_forces_in_other_units(load, scale):
    plain, scaled = load("z", value=5.0), load("z", value=5.0, force_scale=scale)
    assert scaled.wrench.force_n == pytest.approx(scale * plain.wrench.force_n)


def test_no_force_at_all(tmp_path):
    log = nav.drive(3.0, skip=["/wrench"])
    for second in np.arange(0.0, 3.0, 0.02).tolist():
        log.add("/ft", nav.wrench(int(nav.unix(second)), NAN, NAN, NAN), int(nav.unix(second)))
    with pytest.raises(LogError, match=r"^run.mcap: topic /ft: expected forces, found none that are finite$"):
        load_recording(log.write(tmp_path / "run.mcap"))
