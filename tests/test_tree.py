"""Transforms between frames: by hand, with several parents, with gaps, and against a slow twin."""

import contextlib
import functools
import itertools
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from navirl_cli.errors import FrameError
from navirl_cli.logs.tf.transforms import Link, links_of
from navirl_cli.logs.tf.tree import TransformTree

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


def ignored(tree):
    """What is ignored, in words, by pair of frames."""
    return {pair: ", ".join(map(str, some)) for pair, some in tree.faults.items()}


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


def test_a_missing_link_names_all_frames(tree):
    with pytest.raises(
        FrameError,
        match=re.escape(
            "transform from 'camera' to 'map': expected connected frames, found map -> odom -> base_link -> "
            "(imu, laser); camera is in no transform; record /tf"
        ),
    ):
        tree.lookup("map", "camera", [T0])
    two = TransformTree([link("map", "odom", (0, (0, 0, 0), 0.0)), link("base", "laser", (0, (0, 0, 0), 0.0))], [])
    with pytest.raises(
        FrameError,
        match=re.escape("from 'laser' to 'map': expected connected frames, found base -> laser; map -> odom; record"),
    ):
        two.lookup("map", "laser", [T0])
    with pytest.raises(FrameError, match="found no frames; laser is in no transform; map is in no transform"):
        TransformTree([], []).lookup("map", "laser", [T0])
    assert tree.frames == ("base_link", "imu", "laser", "map", "odom")


def test_any_order_duplicates_zero_stamps_and_invalid_poses():
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
    assert ignored(tree) == {
        ("odom", "base"): "1 stamped 0 before the clock ran, 1 with a quaternion of zeros, "
        "1 with a translation that is not finite or absurd"
    }
    assert tree.span("odom", "base") == (T0, T0 + S)


def test_links_of_wrong_shapes_are_refused():
    with pytest.raises(FrameError, match=r"transform a -> b: expected stamps \(k,\)"):
        Link("a", "b", np.array([1, 2]), np.zeros((1, 3)), np.zeros((1, 4)))


@settings(max_examples=30, deadline=None, derandomize=True)
@given(yaws=st.lists(st.floats(-3, 3), min_size=2, max_size=6), share=st.floats(0, 1))
def test_turning_by_less_than_half_a_circle_is_linear_in_yaw(yaws, share):
    rows = [(T0 + number * S, (number, 0, 0), yaw) for number, yaw in enumerate(yaws)]
    found = TransformTree([], [link("odom", "base", *rows)]).lookup("odom", "base", [T0 + round(share * S)])
    step = (yaws[1] - yaws[0] + np.pi) % (2 * np.pi) - np.pi
    if abs(abs(step) - np.pi) > 1e-3:
        np.testing.assert_allclose(np.cos(found.yaw_rad - (yaws[0] + round(share * S) / S * step)), [1.0], atol=1e-9)


# --- several parents


def two_parents():
    """base has the parents odom and ekf, both of them in map: base is at x = 1 in odom and at x = 2 in ekf."""
    stamps = [T0 + number * S for number in range(11)]
    above = [link("map", "odom", (T0, (10, 0, 0), 0.0), (T0 + 10 * S, (10, 0, 0), 0.0))]
    above += [link("map", "ekf", (T0, (20, 0, 0), 0.0), (T0 + 10 * S, (20, 0, 0), 0.0))]
    by_odom = link("odom", "base", *[(t, (1, 0, 0), 0.0) for t in stamps])
    by_ekf = link("ekf", "base", *[(t + S // 2, (2, 0, 0), 0.0) for t in stamps[:-1]])
    return TransformTree([link("base", "laser", (0, (0.25, 0, 0), 0.0))], [*above, by_odom, by_ekf])


def test_the_parent_with_the_latest_stamp_is_in_force():
    """As in tf2's buffer, which keeps the stamps of all parents of a child in one list."""
    tree = two_parents()
    times = T0 + np.array([-S, 0, S // 4, S // 2 - 1, S // 2, S - 1, S, 10 * S])
    found = tree.lookup("map", "laser", times).translation_m[:, 0]
    np.testing.assert_allclose(found, [11.25, 11.25, 11.25, 11.25, 22.25, 22.25, 11.25, 11.25])
    assert tree.several_parents("map", "laser", times) == {"base": ("ekf", "odom")}
    assert tree.several_parents("map", "laser", times[:4]) == {}
    assert tree.span("map", "laser") == (T0, T0 + 10 * S)


def test_only_parents_that_lead_to_a_connection_count():
    """Parents in another tree do not count, nor others than an ancestor that is itself the other frame."""
    tree = two_parents()
    times = T0 + np.arange(0, 10 * S, S // 7)
    for frame, x in (("odom", 1.25), ("ekf", 2.25)):
        np.testing.assert_allclose(tree.lookup(frame, "laser", times).translation_m[:, 0], x)
        np.testing.assert_allclose(tree.lookup("laser", frame, times).translation_m[:, 0], -x)
        assert tree.several_parents(frame, "laser", times) == {}
    row = (T0, (0, 0, 0), 0.0)
    apart = TransformTree([link("map", "odom", row)], [link("lost", "base", row), link("odom", "base", row)])
    assert apart.lookup("map", "base", [T0]).translation_m.shape == (1, 3)
    with pytest.raises(
        FrameError,
        match="expected connected frames, found lost -> base; map -> odom -> base; nowhere is in no transform",
    ):
        apart.lookup("nowhere", "base", [T0])


def test_a_parent_does_not_count_before_it_is_connected_to_the_map():
    """ekf -> base is sent all the time, but map -> ekf only from 6 s: until then odom is used, and ekf is not held."""
    stamps = [T0 + number * S for number in range(11)]
    tree = TransformTree(
        [link("map", "odom", (0, (10, 0, 0), 0.0))],
        [
            link("map", "ekf", *[(t, (20, 0, 0), 0.0) for t in stamps[6:9]]),
            link("odom", "base", *[(t, (1, 0, 0), 0.0) for t in stamps]),
            link("ekf", "base", *[(t + S // 2, (2, 0, 0), 0.0) for t in stamps[:-1]]),
        ],
    )
    times = T0 + S * np.array([0, 2, 5, 6, 7, 8, 9]) + S * 3 // 4
    found = tree.lookup("map", "base", times, hold_ns=0).translation_m[:, 0]
    np.testing.assert_allclose(found, [11, 11, 11, 22, 22, 11, 11])
    assert tree.span("map", "base") == (T0, T0 + 10 * S)
    assert tree.largest_gap_ns("map", "base", times).max() == S


def test_a_pose_is_held_until_another_parent_takes_over():
    """The base leaves odom at 2 s and returns at 6 s: its pose in odom is unknown in between."""
    tree = TransformTree(
        [link("map", "odom", (0, (0, 0, 0), 0.0)), link("map", "lift", (0, (0, 0, 0), 0.0))],
        [
            link("odom", "base", *[(T0 + t * S, (t, 0, 0), 0.0) for t in (0, 1, 2, 6, 7)]),
            link("lift", "base", (T0 + 3 * S, (100, 0, 0), 0.0), (T0 + 4 * S, (102, 0, 0), 0.0)),
        ],
    )
    times = T0 + np.array([1, 3, 4, 5, 6, 7, 9, 11, 13]) * S // 2
    found = tree.lookup("map", "base", times).translation_m[:, 0]
    np.testing.assert_allclose(found, [0.5, 1.5, 2.0, 2.0, 100.0, 101.0, 102.0, 102.0, 6.5])
    gaps = tree.largest_gap_ns("map", "base", times)
    np.testing.assert_array_equal(gaps, np.array([1, 1, 0, 1, 0, 1, 2, 2, 1]) * S)
    # in odom alone there is a gap
    np.testing.assert_allclose(tree.lookup("odom", "base", times[5:7]).translation_m[:, 0], [3.5, 4.5])
    np.testing.assert_array_equal(tree.largest_gap_ns("odom", "base", times[5:7]), [4 * S, 4 * S])


def test_a_moving_parent_is_preferred_to_fixed_ones_and_the_last_fixed_one_to_others():
    fixed = [link("map", "base", (T0, (x, 0, 0), 0.0)) for x in (1, 2)]
    other = link("map", "dock", (0, (0, 0, 0), 0.0))
    docked = link("dock", "base", (T0, (7, 0, 0), 0.0))
    assert TransformTree([fixed[0], other, docked, fixed[1]], []).lookup("map", "base", [T0]).translation_m[0, 0] == 2
    assert TransformTree([*fixed, other, docked], []).lookup("map", "base", [T0]).translation_m[0, 0] == 7
    moving = link("dock", "base", (T0, (9, 0, 0), 0.0))
    tree = TransformTree([*fixed, other], [moving])
    assert tree.lookup("map", "base", [T0 - S]).translation_m[0, 0] == 9
    assert tree.span("map", "base") == (T0, T0)
    with pytest.raises(FrameError, match="transform dock -> base: expected times between"):
        tree.lookup("map", "base", [T0 + 2 * S])


def test_a_fixed_transform_that_is_sent_again_counts_from_then():
    rows = [(T0 + at * S, (x, 0, 0), 0.0) for at, x in ((0, 1), (2, 1), (4, 3), (6, 1))]
    tree = TransformTree([link("base", "laser", row) for row in rows], [])
    times = T0 + np.array([-9, 0, 3, 4, 5, 6, 99]) * S
    assert tree.lookup("base", "laser", times).translation_m[:, 0].tolist() == [1, 1, 1, 3, 3, 1, 1]
    assert tree.largest_gap_ns("base", "laser", times).tolist() == [0] * 7
    assert tree.span("base", "laser") is None
    (curve,) = tree.static_changes()
    assert curve.changes.tolist() == [2, 3]
    again = TransformTree([link("base", "laser", *rows[:2])], [])
    assert again.static_changes() == []


def test_a_fixed_frame_that_is_mounted_elsewhere_moves_when_that_is_sent():
    moving = link("map", "base", (T0 + S, (0, 0, 0), 0.0), (T0 + 9 * S, (0, 0, 0), 0.0))
    arm = link("base", "arm", (T0, (0, 5, 0), 0.0))
    mounted = [link("base", "laser", (T0, (1, 0, 0), 0.0)), link("arm", "laser", (T0 + 5 * S, (2, 0, 0), 0.0))]
    for static in ([arm, *mounted], [arm, *mounted[::-1]]):
        found = TransformTree(static, [moving]).lookup("map", "laser", T0 + np.array([1, 4, 5, 9]) * S)
        assert found.translation_m[:, :2].tolist() == [[1, 0], [1, 0], [2, 5], [2, 5]]


def test_a_missing_link_names_what_was_ignored():
    zero = Link("map", "odom", np.arange(1, 6) * S, np.zeros((5, 3)), np.zeros((5, 4)))
    with pytest.raises(
        FrameError, match=r"found no frames; ignored: map -> odom \(5 with a quaternion of zeros\); record"
    ):
        TransformTree([], [zero]).lookup("map", "odom", [S])


def test_the_parent_does_not_alternate_at_equal_stamps():
    tree = two_parents()
    same = TransformTree(
        [link("map", "odom", (0, (0, 0, 0), 0.0)), link("map", "ekf", (0, (0, 0, 0), 0.0))],
        [link(frame, "base", (T0, (x, 0, 0), 0.0), (T0 + S, (x, 0, 0), 0.0)) for frame, x in (("odom", 1), ("ekf", 2))],
    )
    assert same.lookup("map", "base", T0 + np.arange(4) * S // 2).translation_m[:, 0].tolist() == [2, 2, 2, 2]
    assert tree.frames == ("base", "ekf", "laser", "map", "odom")


def test_frames_that_change_between_two_roots():
    """Without a map, base and person both move from odom to ekf at 5 s: they connect all the time."""
    moving = [
        link(root, child, *[(T0 + t * S, (x * t, 0, 0), 0.0) for t in span])
        for root, span in (("odom", range(5)), ("ekf", range(5, 10)))
        for child, x in (("base", 1), ("person", 3))
    ]
    tree = TransformTree([], moving)
    times = T0 + np.array([0, 2, 7, 9]) * S
    np.testing.assert_allclose(tree.lookup("base", "person", times).translation_m[:, 0], [0, 4, 14, 18])
    np.testing.assert_allclose(tree.lookup("person", "base", times).translation_m[:, 0], [0, -4, -14, -18])
    assert tree.several_parents("base", "person", times) == {"base": ("ekf", "odom"), "person": ("ekf", "odom")}
    assert tree.span("base", "person") == (T0, T0 + 9 * S)


def test_a_gap_between_two_chains_is_held_over_and_reported():
    """The chain through odom ends at 2 s, the one through ekf begins at 8 s."""
    tree = TransformTree(
        [],
        [
            link(parent, child, *[(T0 + t * S, (x, 0, 0), 0.0) for t in span])
            for names, span, x in ((("map", "odom", "base"), (0, 1, 2), 1), (("map", "ekf", "base"), (8, 9), 2))
            for parent, child in itertools.pairwise(names)
        ],
    )
    times = T0 + np.array([1, 2, 5, 8]) * S
    np.testing.assert_allclose(tree.lookup("map", "base", times, hold_ns=0).translation_m[:, 0], [2, 2, 2, 4])
    np.testing.assert_array_equal(tree.largest_gap_ns("map", "base", times), [0, 0, 6 * S, 0])
    assert tree.span("map", "base") == (T0, T0 + 9 * S)
    with pytest.raises(
        FrameError, match=rf"transform (map -> ekf|ekf -> base): expected .* found {T0 + 11 * S} ns and 0 more"
    ):
        tree.lookup("map", "base", [T0, T0 + 11 * S])


def test_chains_that_are_complete_at_no_time():
    """map -> odom ends before odom -> base begins; map -> ekf begins after ekf -> base has ended."""
    rows = {t: (T0 + t * S, (0, 0, 0), 0.0) for t in range(10)}
    moving = [link("map", "odom", rows[0]), link("map", "ekf", rows[9])]
    moving += [link("odom", "base", rows[3]), link("ekf", "base", rows[4])]
    tree = TransformTree([], moving)
    first, last = tree.span("map", "base")
    assert first > last
    with pytest.raises(FrameError, match="expected times between"):
        tree.lookup("map", "base", [T0 + 3 * S])


def test_a_chain_that_is_fixed_for_a_time_only():
    """dock and door are fixed in hall, until hall moves from yard to town, in which door moves."""
    row = (T0, (0, 0, 0), 0.0)
    static = [link("hall", "dock", row), link("hall", "door", row)]
    moving = [link("yard", "hall", row), link("town", "hall", (T0 + 4 * S, (0, 0, 0), 0.0))]
    tree = TransformTree(static, [*moving, link("town", "door", *[(T0 + t * S, (t, 0, 0), 0.0) for t in (3, 9)])])
    times = T0 + np.array([-99, 0, 3, 4, 6]) * S
    assert tree.lookup("hall", "dock", times).translation_m.shape == (5, 3)
    found = tree.lookup("dock", "door", times, hold_ns=2 * S).translation_m[:, 0]
    np.testing.assert_allclose(found, [0, 0, 0, 4, 6])
    assert tree.span("dock", "door") == (np.iinfo(np.int64).min, T0 + 4 * S)


def test_cycles_are_refused_only_where_they_matter():
    row = (T0, (0, 0, 0), 0.0)
    cycle = TransformTree([link("a", "b", row), link("b", "a", row), link("c", "d", row), link("a", "e", row)], [])
    for target, source in (("c", "a"), ("a", "b"), ("b", "a"), ("d", "e")):
        with pytest.raises(FrameError, match=r"transform (a -> b -> a|b -> a -> b): .* found a cycle; remap"):
            cycle.lookup(target, source, [T0])
    assert cycle.lookup("c", "d", [T0]).translation_m.shape == (1, 3)
    assert cycle.describe() == "c -> d; a -> (b -> a, e)"


def test_not_all_of_many_frames_are_named():
    row = (T0, (0, 0, 0), 0.0)
    chain = TransformTree([link(f"f{number}", f"f{number + 1}", row) for number in range(1200)], [])
    assert chain.describe().startswith("f0 -> f1 -> ")
    assert chain.describe().endswith(" -> f98 -> f99; 1101 more frames")
    assert chain.lookup("f0", "f1200", [T0]).translation_m.shape == (1, 3)
    star = TransformTree([link("hub", f"f{number:03}", row) for number in range(200)], [])
    assert star.describe().endswith(", f097, f098); 101 more frames")


# --- long gaps


def test_the_largest_gap(tree):
    """map -> odom has a stamp every 4 s, odom -> base_link every 2 s; outside it is the distance to the nearest."""
    times = T0 + np.array([-S // 2, 0, S, 2 * S, 3 * S, 4 * S, 5 * S])
    found = tree.largest_gap_ns("map", "laser", times)
    np.testing.assert_array_equal(found, np.array([S // 2, 0, 4 * S, 4 * S, 4 * S, 2 * S, 3 * S]))
    np.testing.assert_array_equal(tree.largest_gap_ns("laser", "odom", times[:3]), [S // 2, 0, 2 * S])
    np.testing.assert_array_equal(tree.largest_gap_ns("imu", "laser", times[:3]), [0, 0, 0])
    with pytest.raises(FrameError, match="camera is in no transform"):
        tree.largest_gap_ns("map", "camera", times)


# --- invalid input


def test_invalid_transforms_are_ignored_and_counted():
    identity, far = (0, 0, 0, 1.0), 1e300
    quaternions = np.array([identity, identity, (0, 0, far, far), (0, 0, 0, 2.0), (0, 0, 0.7, 0.7), (np.inf, 0, 0, 0)])
    translations = np.array([(1, 0, 0), (far, 0, 0), (0, 0, 0), (0, 0, 0), (3, 0, 0), (0, 0, 0)], dtype=float)
    damaged = Link("odom", "base", T0 + np.arange(6) * S, translations, quaternions)
    row = (T0, (0, 0, 0), 0.0)
    tree = TransformTree([link("base", "/base", row), link("", "base", row)], [damaged, link("map", "", row)])
    assert ignored(tree) == {
        ("odom", "base"): "2 with a quaternion of length 1.41e+300, not 1, 1 with a quaternion that is not finite, "
        "1 with a translation that is not finite or absurd",
        **dict.fromkeys([("base", "base"), ("", "base"), ("map", "")], "1 in itself or without a name"),
    }
    assert tree.frames == ("base", "odom")
    found = tree.lookup("odom", "base", [T0 + 2 * S])
    np.testing.assert_allclose(found.translation_m, [[2, 0, 0]])
    np.testing.assert_allclose(found.yaw_rad, [np.pi / 4])


def test_stamps_of_zero_count_only_where_a_child_has_no_others():
    zero, later = (0, (5, 0, 0), 0.0), (T0, (1, 0, 0), 0.0)
    static = [link("map", "odom", zero), link("map", "ekf", zero)]
    tree = TransformTree(static, [link("odom", "base", zero), link("ekf", "base", later), link("odom", "cart", zero)])
    assert tree.span("map", "base") == (T0, T0)
    assert ignored(tree) == {("odom", "base"): "1 stamped 0 before the clock ran"}
    assert tree.span("map", "cart") == (0, 0)


def columns_of(entries):
    """Columns of (parent, child, t_ns, (x, y, z), (x, y, z, w))."""
    parents, children, t_ns, moves, turns = zip(*entries, strict=True)
    columns = {"header.frame_id": np.array(parents, dtype=object), "child_frame_id": np.array(children, dtype=object)}
    columns["header.stamp"] = np.array(t_ns, dtype=np.int64)
    for name, values, axes in (("translation", moves, "xyz"), ("rotation", turns, "xyzw")):
        for axis, column in zip(axes, np.array(values, dtype=float).T, strict=True):
            columns[f"transform.{name}.{axis}"] = column
    return {f"transforms[].{name}": column for name, column in columns.items()}


def test_links_of_columns():
    rng = np.random.default_rng(11)
    names = [("map", "odom"), ("odom", "base"), ("base", "laser")]
    entries = [
        (*names[rng.integers(3)], T0 + number, tuple(rng.normal(size=3)), tuple(rng.normal(size=4)))
        for number in range(50)
    ]
    entries += [(*names[number], T0 + 99, (0, 0, 0), (0, 0, 0, 1)) for number in (2, 0, 1)]
    counts = np.array([20, 0, 33])
    found = links_of(columns_of(entries), counts)
    assert [(one.parent, one.child) for one in found] == [names[2], names[0], names[1]]
    for one in found:
        mine = [entry for entry in entries if entry[:2] == (one.parent, one.child)]
        np.testing.assert_array_equal(one.t_ns, [entry[2] for entry in mine])
        np.testing.assert_array_equal(one.translation_m, [entry[3] for entry in mine])
        np.testing.assert_array_equal(one.quaternion, [entry[4] for entry in mine])
    corrected = links_of(columns_of(entries), counts, np.arange(53))
    np.testing.assert_array_equal(np.sort(np.concatenate([one.t_ns for one in corrected])), np.arange(53))


def test_links_of_invalid_columns():
    columns = columns_of([("map", "odom", T0, (0, 0, 0), (0, 0, 0, 1))] * 2)
    with pytest.raises(
        FrameError, match=re.escape("transforms: expected 3 entries in the field transforms[].header.stamp, found 2")
    ):
        links_of(columns, np.array([1, 2]))
    with pytest.raises(FrameError, match=r"expected 2 entries in the field transforms\[\].header.stamp, found 1"):
        links_of(columns, np.array([1, 1]), np.array([T0]))
    del columns["transforms[].child_frame_id"]
    with pytest.raises(
        FrameError,
        match=r"expected the field transforms\[\].child_frame_id, found transforms\[\].header.frame_id, .*; record",
    ):
        links_of(columns, np.array([1, 1]))
    empty = {name: column[:0] for name, column in columns_of([("a", "b", 0, (0, 0, 0), (0, 0, 0, 1))]).items()}
    assert links_of(empty, np.array([0, 0])) == []


# --- against a slow twin, which goes time by time and link by link


def slerp(p, q, share):
    p, q = np.array(p), np.array(q)
    if p @ q < 0:
        q = -q
    angle = math.acos(min(1.0, p @ q))
    if angle < 1e-9:
        return p
    return (math.sin((1 - share) * angle) * p + math.sin(share * angle) * q) / math.sin(angle)


def matrix(move, quaternion):
    x, y, z, w = quaternion
    result = np.eye(4)
    result[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    result[:3, 3] = move
    return result


class Twin:
    """The same rules in plain code: `rows` are (parent, child, t_ns or None where fixed, translation, quaternion)."""

    def __init__(self, rows):
        self.rows = rows

    @functools.cache  # noqa: B019 - a twin lives as long as its test
    def ancestors(self, frame):
        return {frame}.union(*(self.ancestors(row[0]) for row in self.rows if row[1] == frame))

    def parents(self, frame, stops):
        leading = [row for row in self.rows if row[1] == frame and self.ancestors(row[0]) & stops]
        moving = {row[0] for row in leading if row[2] is not None}
        return sorted(moving) or [row[0] for row in leading][-1:]

    def stamps(self, parent, child):
        return sorted(row[2] for row in self.rows if row[:2] == (parent, child) and row[2] is not None)

    def cover(self, frame, stops):
        if frame in stops:
            return -math.inf, math.inf
        spans = []
        for parent in self.parents(frame, stops):
            own, (first, last) = self.stamps(parent, frame), self.cover(parent, stops)
            spans.append((max([first, *own[:1]]), min([last, *own[-1:]])))
        spans = [span for span in spans if span[0] <= span[1]] or spans
        return min(first for first, _ in spans), max(last for _, last in spans)

    def step(self, frame, stops, t):
        """The parent in force, and the next stamp of another."""
        parents = self.parents(frame, stops)
        events = [(stamp, -number) for number, parent in enumerate(parents) for stamp in self.stamps(parent, frame)]
        covers = [self.cover(parent, stops) for parent in parents]
        events = [(t, n) for t, n in events if covers[-n][0] <= t <= covers[-n][1]] or events
        if len(parents) == 1:
            return parents[0], math.inf
        before, after = [event for event in events if event[0] <= t], [event for event in events if event[0] > t]
        chosen = max(before)[1] if before else max(n for stamp, n in after if stamp == min(after)[0])
        return parents[-chosen], min((stamp for stamp, n in after if n != chosen), default=math.inf)

    def climb(self, frame, stops, t):
        """Pairs of parent and child, each with when another parent takes over."""
        steps = []
        while frame not in stops:
            parent, until = self.step(frame, stops, t)
            steps.append((parent, frame, until))
            frame = parent
        return steps

    def chain(self, target, source, t):
        above = self.ancestors(source), self.ancestors(target)
        common = above[0] & above[1]
        stops = common & {source, target}
        if not stops:
            stops = {row[0] for row in self.rows if row[0] in common and row[1] in (above[0] | above[1]) - common}
        if len(stops) > 1:
            stops = {frame for frame in common if all(row[1] != frame for row in self.rows)}
        first, second = sorted((source, target))
        steps = self.climb(first, stops, t)
        others = self.climb(second, {first, *(step[0] for step in steps)}, t)
        climbed = [first, *(step[0] for step in steps)]
        steps = steps[: climbed.index(others[-1][0] if others else second)]
        return (steps, others) if first == source else (others, steps)

    def pose(self, parent, child, t, until):
        rows = [row for row in self.rows if row[:2] == (parent, child)]
        if rows[0][2] is None:
            return matrix(*rows[-1][3:]), 0
        rows = sorted(rows, key=lambda row: row[2])
        before, after = [row for row in rows if row[2] <= t], [row for row in rows if row[2] > t]
        if not before:
            return matrix(*rows[0][3:]), rows[0][2] - t
        (t0, move, turn), end = before[-1][2:], min([until, *(row[2] for row in after)])
        gap = 0 if t == t0 else t - t0 if end == math.inf else end - t0
        if not after or after[0][2] > until:
            return matrix(move, turn), gap
        t1, move1, turn1 = after[0][2:]
        share = (t - t0) / (t1 - t0)
        return matrix((1 - share) * np.array(move) + share * np.array(move1), slerp(turn, turn1, share)), gap

    def lookup(self, target, source, t):
        """4 x 4 matrix and largest gap."""
        results, gaps = [], [0]
        for steps in self.chain(target, source, t):
            result = np.eye(4)
            for parent, child, until in steps:
                pose, gap = self.pose(parent, child, t, until)
                result = pose @ result
                gaps.append(gap)
            results.append(result)
        return np.linalg.inv(results[1]) @ results[0], max(gaps)

    def covered(self, target, source, t):
        stamps = [self.stamps(*step[:2]) for steps in self.chain(target, source, t) for step in steps]
        return all(own[0] <= t <= own[-1] for own in stamps if own)


def forged(seed):
    """Rows of seven frames with up to three parents each; stamps are small numbers."""
    rng = np.random.default_rng(seed)
    rows = []
    for child in range(1, 7):
        for parent in rng.choice(child, size=min(child, rng.integers(0 if child == 1 else 1, 4)), replace=False):
            begin = int(rng.integers(1, 30))
            stamps = np.unique(rng.integers(begin, begin + rng.integers(2, 40), size=rng.integers(1, 8)))
            for t in [None] if rng.random() < 0.3 else stamps.tolist():
                turn = rng.normal(size=4)
                rows.append((f"f{parent}", f"f{child}", t, rng.normal(size=3), turn / np.linalg.norm(turn)))
    return rows


def tree_of(rows):
    links = [Link(p, c, np.array([t or 0]), np.array([move]), np.array([turn])) for p, c, t, move, turn in rows]
    static = [one for one, row in zip(links, rows, strict=True) if row[2] is None]
    return TransformTree(static, [one for one, row in zip(links, rows, strict=True) if row[2] is not None])


def pairs_of(tree, seed, most=6):
    """Some pairs of frames that connect."""
    for pair in np.random.default_rng(seed).permutation(list(itertools.permutations(tree.frames, 2)))[:most].tolist():
        with contextlib.suppress(FrameError):
            tree.span(*pair)
            yield pair


def four(transforms):
    result = np.tile(np.eye(4), (len(transforms.translation_m), 1, 1))
    result[:, :3, :3], result[:, :3, 3] = transforms.matrices, transforms.translation_m
    return result


@pytest.mark.parametrize("seed", [*range(25), 36])
def test_the_twin_agrees(seed):
    rows = forged(seed)
    tree, twin = tree_of(rows), Twin(rows)
    times = np.random.default_rng(seed).integers(-2, 75, size=8)
    for target, source in pairs_of(tree, seed):
        expected, gaps = zip(*(twin.lookup(target, source, int(t)) for t in times), strict=True)
        np.testing.assert_allclose(four(tree.lookup(target, source, times, hold_ns=10**6)), expected, atol=1e-9)
        np.testing.assert_array_equal(tree.largest_gap_ns(target, source, times), gaps)


@pytest.mark.parametrize("seed", [*range(25, 50), 83, 1146])
def test_the_span_is_that_of_the_twin_and_limits_the_lookup(seed):
    rows = forged(seed)
    tree, twin = tree_of(rows), Twin(rows)
    for target, source in pairs_of(tree, seed):
        span = tree.span(target, source) or (0, 89)
        covered = [t for t in range(90) if twin.covered(target, source, t)]
        if not covered:
            assert span[0] > span[1]
            continue
        first, last = covered[0], covered[-1]
        assert (max(span[0], 0), min(span[1], 89)) == (first, last)
        tree.lookup(target, source, np.arange(first, last + 1), hold_ns=0)
        for beyond in {first - 1, last + 1} & set(range(90)):
            tree.lookup(target, source, [beyond], hold_ns=1)
            with pytest.raises(FrameError, match=rf"expected times between .*, found {beyond} ns and 0 more"):
                tree.lookup(target, source, [beyond], hold_ns=0)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_the_opposite_lookup_is_the_inverse_and_fixed_frames_compose(seed):
    rows = [*forged(seed), ("f6", "tip", None, np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.5, 0.5, 0.5]))]
    tree = tree_of(rows)
    times = np.random.default_rng(seed).integers(-2, 75, size=30)
    far = {"hold_ns": 10**6}
    for target, source in pairs_of(tree, seed):
        there, back = (tree.lookup(*pair, times, **far) for pair in ((target, source), (source, target)))
        np.testing.assert_allclose(four(there), four(back.inverse()), atol=1e-9)
        gaps = [tree.largest_gap_ns(*pair, times) for pair in ((target, source), (source, target))]
        np.testing.assert_array_equal(*gaps)
        if source == "f6" and target != "tip":
            composed = there.after(tree.lookup("f6", "tip", times))
            np.testing.assert_allclose(four(tree.lookup(target, "tip", times, **far)), four(composed), atol=1e-9)
