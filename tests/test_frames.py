import re

import log_factory as forge
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navirl_cli.errors import FrameError
from navirl_cli.logs.frames import Link, TransformTree

S = 1_000_000_000
#: Far from zero, where a double no longer resolves nanoseconds.
T0 = 1_700_000_000 * S


def turn(yaw_rad):
    return (0.0, 0.0, np.sin(yaw_rad / 2), np.cos(yaw_rad / 2))


def link(parent, child, *rows):
    """Rows of (t_ns, (x, y, z), yaw)."""
    t_ns, translations, yaws = zip(*rows, strict=True)
    return Link(
        parent, child, np.array(t_ns), np.array(translations, dtype=float), np.array([turn(yaw) for yaw in yaws])
    )


@pytest.fixture
def tree():
    quarter = np.pi / 2
    static = [
        link("base_link", "laser", (0, (0.5, 0, 0.2), quarter)),
        link("/base_link", "/imu", (0, (0, 0, 0.1), 0.0)),
    ]
    moving = [
        link("odom", "base_link", (T0, (0, 0, 0), 0.0), (T0 + 2 * S, (4, 0, 0), quarter)),
        link("map", "odom", (T0, (10, 20, 0), quarter), (T0 + 4 * S, (10, 20, 0), quarter)),
    ]
    return TransformTree(static, moving)


def test_a_quarter_turn(tree):
    """odom is turned by 90 degrees in map: x of odom is y of map."""
    found = tree.lookup("map", "odom", [T0]).apply((1.0, 2.0, 3.0))
    np.testing.assert_allclose(found, [[8.0, 21.0, 3.0]], atol=1e-12)


def test_half_way_between_two_stamps(tree):
    found = tree.lookup("odom", "base_link", [T0, T0 + S, T0 + 2 * S])
    np.testing.assert_allclose(found.translation_m, [[0, 0, 0], [2, 0, 0], [4, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(found.yaw_rad, [0, np.pi / 4, np.pi / 2], atol=1e-12)


def test_chain_through_the_common_ancestor(tree):
    """Laser and imu meet in base_link: the moving transforms above do not matter, nor the time."""
    found = tree.lookup("imu", "laser", [0, T0])
    np.testing.assert_allclose(found.translation_m, [[0.5, 0, 0.1]] * 2, atol=1e-12)
    np.testing.assert_allclose(found.apply((1.0, 0, 0)), [[0.5, 1, 0.1]] * 2, atol=1e-12)
    assert tree.span("imu", "laser") is None


def test_down_the_chain_is_the_inverse(tree):
    times = T0 + np.arange(0, 2 * S, S // 7)
    points = np.random.default_rng(5).normal(size=(len(times), 3))
    there = tree.lookup("map", "laser", times).apply(points)
    np.testing.assert_allclose(tree.lookup("laser", "map", times).apply(there), points, atol=1e-9)
    np.testing.assert_allclose(tree.lookup("map", "laser", times).inverse().apply(there), points, atol=1e-9)


def test_a_frame_in_itself(tree):
    np.testing.assert_allclose(tree.lookup("odom", "/odom", [5]).apply((1.0, 2, 3)), [[1, 2, 3]])


def test_by_hand_through_the_whole_chain(tree):
    """At T0 + 1 s: base at (2, 0) in odom with 45 degrees, laser 0.5 m ahead; odom at (10, 20) with 90 degrees."""
    found = tree.lookup("map", "laser", [T0 + S])
    half = 0.5 / np.sqrt(2)
    np.testing.assert_allclose(found.translation_m, [[10 - half, 20 + 2 + half, 0.2]], atol=1e-12)
    np.testing.assert_allclose(np.cos(found.yaw_rad - 1.25 * np.pi), [1.0], atol=1e-12)


def test_held_outside_up_to_the_limit(tree):
    found = tree.lookup("odom", "base_link", [T0 - S, T0 + 3 * S])
    np.testing.assert_allclose(found.translation_m[:, 0], [0, 4])
    with pytest.raises(
        FrameError,
        match=rf"transform odom -> base_link: expected times between {T0} and {T0 + 2 * S} ns \(held {S} ns "
        rf"beyond\), found {T0 + 4 * S} ns and 0 more outside",
    ):
        tree.lookup("map", "laser", [T0, T0 + 4 * S])
    assert tree.lookup("map", "laser", [T0 + 4 * S], hold_ns=2 * S).translation_m.shape == (1, 3)
    assert tree.span("map", "laser") == (T0, T0 + 2 * S)


def test_no_times(tree):
    assert tree.lookup("map", "laser", np.empty(0, dtype=np.int64)).apply(np.empty((0, 3))).shape == (0, 3)


def test_a_missing_link_names_all(tree):
    with pytest.raises(
        FrameError,
        match=re.escape(
            "transform from 'camera' to 'map': expected frames that connect, found map -> odom -> base_link -> "
            "(imu, laser); camera stands alone; record /tf"
        ),
    ):
        tree.lookup("map", "camera", [T0])
    two = TransformTree([link("map", "odom", (0, (0, 0, 0), 0.0)), link("base", "laser", (0, (0, 0, 0), 0.0))], [])
    with pytest.raises(
        FrameError,
        match=re.escape(
            "from 'laser' to 'map': expected frames that connect, found base -> laser; map -> odom; record"
        ),
    ):
        two.lookup("map", "laser", [T0])
    with pytest.raises(FrameError, match="found no frames; laser stands alone; map stands alone"):
        TransformTree([], []).lookup("map", "laser", [T0])
    assert tree.frames == ("base_link", "imu", "laser", "map", "odom")


def test_two_parents_and_circles_are_refused_only_where_they_matter():
    row = (T0, (0, 0, 0), 0.0)
    tree = TransformTree([link("base", "laser", row)], [link("odom", "base", row), link("map", "base", row)])
    assert len(tree.lookup("base", "base", [T0]).translation_m) == 1
    with pytest.raises(
        FrameError, match=re.escape("frame 'base': expected one parent all the time, found 2 (odom, map); remap")
    ):
        tree.lookup("map", "laser", [T0])
    circle = TransformTree([link("a", "b", row), link("b", "a", row)], [])
    with pytest.raises(FrameError, match="found a circle"):
        circle.lookup("c", "a", [T0])


def test_order_duplicates_zero_stamps_and_nonsense():
    good = link(
        "odom", "base", (T0 + S, (1, 0, 0), 0.0), (0, (99, 0, 0), 0.0), (T0, (7, 0, 0), 0.0), (T0, (0, 0, 0), 0.0)
    )
    bad = Link(
        "odom",
        "base",
        np.array([T0, T0]),
        np.array([[np.nan, 0, 0], [0, 0, 0]]),
        np.array([[0, 0, 0, 1.0], [0, 0, 0, 0]]),
    )
    tree = TransformTree([], [good, bad])
    np.testing.assert_allclose(tree.lookup("odom", "base", [T0 + S // 2]).translation_m, [[0.5, 0, 0]])
    assert tree.ignored == {("odom", "base"): 3}
    assert tree.span("odom", "base") == (T0, T0 + S)


def test_links_of_wrong_shapes_are_refused():
    with pytest.raises(FrameError, match=r"transform a -> b: expected stamps \(k,\)"):
        Link("a", "b", np.array([1, 2]), np.zeros((1, 3)), np.zeros((1, 4)))


def test_from_messages():
    def message(parent, child, t_ns, x):
        turned = forge.build("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        pose = forge.build("geometry_msgs/msg/Transform", translation=forge.vector(x, 0.0, 0.0), rotation=turned)
        stamped = forge.build(
            "geometry_msgs/msg/TransformStamped",
            header=forge.header(t_ns, parent),
            child_frame_id=child,
            transform=pose,
        )
        return forge.build("tf2_msgs/msg/TFMessage", transforms=[stamped])

    moving = [message("/odom", "base", T0, 0.0), message("odom", "base", T0 + S, 2.0)]
    tree = TransformTree.from_messages([message("base", "laser", 0, 0.5)], moving)
    np.testing.assert_allclose(tree.lookup("odom", "laser", [T0 + S // 4]).translation_m, [[1.0, 0, 0]])


@settings(max_examples=30, deadline=None, derandomize=True)
@given(yaws=st.lists(st.floats(-3, 3), min_size=2, max_size=6), share=st.floats(0, 1))
def test_turning_by_less_than_half_a_circle_is_linear_in_yaw(yaws, share):
    rows = [(T0 + number * S, (number, 0, 0), yaw) for number, yaw in enumerate(yaws)]
    found = TransformTree([], [link("odom", "base", *rows)]).lookup("odom", "base", [T0 + round(share * S)])
    step = (yaws[1] - yaws[0] + np.pi) % (2 * np.pi) - np.pi
    if abs(abs(step) - np.pi) > 1e-3:
        np.testing.assert_allclose(np.cos(found.yaw_rad - (yaws[0] + round(share * S) / S * step)), [1.0], atol=1e-9)
