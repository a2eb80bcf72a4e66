"""Transforms between frames at given times, and the stamped links that they are computed from.

Between two stamps the translation is interpolated linearly and the rotation by spherical linear interpolation
(Shoemake 1985, Animating rotation with quaternion curves, SIGGRAPH), as tf2 does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.errors import FrameError
from navirl_cli.logs.tf.rotations import (
    IDENTITY,
    INVERSE,
    are_rotations,
    faults,
    matrices,
    normalised,
    product,
    rescaled,
    roll_pitch_yaw,
    rotate,
    slerp,
)

#: First and last time, ns.
Span = tuple[int, int]

#: Before and after all stamps, ns.
ALWAYS: Final[Span] = (int(np.iinfo(np.int64).min), int(np.iinfo(np.int64).max))
#: The origin of a frame is nearer than this, m; a damaged number may not be.
_FARTHEST_M: Final = 1e9
#: Fixed links that differ by less are the same, m and rad.
_SAME: Final = 1e-4

_STAMP: Final = "transforms[].header.stamp"
_PAIR: Final = ("transforms[].header.frame_id", "transforms[].child_frame_id")
_POSE: Final = (
    *(f"transforms[].transform.translation.{axis}" for axis in "xyz"),
    *(f"transforms[].transform.rotation.{axis}" for axis in "xyzw"),
)


@dataclass(frozen=True, eq=False)
class Link:
    """Poses of a child frame in its parent frame."""

    parent: str
    child: str
    #: Stamps in ns, shape (k,), in any order; of a fixed link, which may change, the times when it was sent.
    t_ns: IntArray
    #: Origin of the child in the parent, m, shape (k, 3).
    translation_m: FloatArray
    #: Rotation of the child in the parent as x, y, z, w, shape (k, 4).
    quaternion: FloatArray

    def __post_init__(self) -> None:
        """Check shapes."""
        k = len(self.t_ns)
        shapes = (np.shape(self.t_ns), np.shape(self.translation_m), np.shape(self.quaternion))
        if shapes != ((k,), (k, 3), (k, 4)) or k == 0:
            raise FrameError(
                f"transform {self.parent} -> {self.child}: expected stamps (k,), translations (k, 3) and quaternions "
                f"(k, 4) with k > 0, found shapes {shapes}"
            )


@dataclass(frozen=True, eq=False)
class Transforms:
    """Transforms of points from a source frame into a target frame, one for each time."""

    #: Rotations of the source frame in the target frame, unit quaternions x, y, z, w, shape (n, 4).
    quaternion: FloatArray
    #: Origin of the source frame in the target frame, m, shape (n, 3).
    translation_m: FloatArray

    @property
    def yaw_rad(self) -> FloatArray:
        """Heading of the source frame's x axis in the target frame's x-y plane, in (-pi, pi], shape (n,)."""
        axis = rotate(self.quaternion, (1.0, 0.0, 0.0))
        yaw: FloatArray = np.arctan2(axis[:, 1], axis[:, 0])
        return yaw

    @property
    def matrices(self) -> FloatArray:
        """Rotation matrices, whose columns are the source frame's axes in the target frame, shape (n, 3, 3)."""
        return matrices(self.quaternion)

    def apply(self, points_m: ArrayLike) -> FloatArray:
        """Points of the source frame in the target frame.

        Args:
            points_m: Shape (n, 3), or (3,) for the same point at each time; m.

        Returns:
            Shape (n, 3), m.
        """
        return rotate(self.quaternion, points_m) + self.translation_m

    def inverse(self) -> "Transforms":
        """The transforms from the target frame into the source frame."""
        back = self.quaternion * INVERSE
        return Transforms(back, -rotate(back, self.translation_m))

    def after(self, first: "Transforms") -> "Transforms":
        """The transforms that apply `first` and then these ones."""
        return Transforms(product(self.quaternion, first.quaternion), self.apply(first.translation_m))


@dataclass(frozen=True)
class Faults:
    """What is wrong with the poses between two frames."""

    #: Number of poses that are ignored, by reason, as in "3 with a quaternion of zeros".
    ignored: Mapping[str, int]
    #: What was normalised beyond rounding, in words; "" for nothing.
    rescaled: str

    def __str__(self) -> str:
        return ", ".join(f"{count} {reason}" for reason, count in self.ignored.items())


@dataclass(frozen=True, eq=False)
class Curve:
    """The valid poses of a child frame in its parent, in order of time."""

    parent: str
    child: str
    #: Stamps in ns, strictly increasing, shape (k,); where the link is fixed, the times from which a pose counts.
    t_ns: IntArray
    #: Shape (k, 3), m.
    translation_m: FloatArray
    #: Unit quaternions x, y, z, w, shape (k, 4).
    quaternion: FloatArray
    #: Whether each pose is held until the next, and the first one also before it was sent.
    fixed: bool

    @classmethod
    def of(
        cls, links: Sequence[Link], parent: str, child: str, *, fixed: bool, zeros: bool
    ) -> tuple[Self | None, "Faults"]:
        """Join links into a curve; of equal stamps the last is used.

        Args:
            links: At least one.
            parent: Name of the parent frame.
            child: Name of the child frame.
            fixed: Whether the link is fixed: it changes only where another pose is sent.
            zeros: Whether a stamp of 0 is valid.

        Returns:
            The curve, None if no pose is valid; and what is wrong with the poses.
        """
        t_ns = np.concatenate([np.asarray(link.t_ns, dtype=np.int64) for link in links])
        translation = np.concatenate([np.asarray(link.translation_m, dtype=np.float64) for link in links])
        quaternion = np.concatenate([np.asarray(link.quaternion, dtype=np.float64) for link in links])
        problems = {
            "in itself or without a name": np.full(len(t_ns), parent in ("", child) or child == ""),
            "stamped 0 before the clock ran": np.array(~(zeros | (t_ns != 0))),
            **faults(quaternion),
            "with a translation that is not finite or absurd": ~(np.abs(translation) < _FARTHEST_M).all(axis=1),
        }
        good = are_rotations(quaternion) & ~np.any(list(problems.values()), axis=0)
        found = Faults(_counted(problems), rescaled(quaternion[good]))
        rows = np.flatnonzero(good)
        if not rows.size:
            return None, found
        rows = rows[np.argsort(t_ns[rows], kind="stable")]
        rows = rows[np.append(t_ns[rows[1:]] > t_ns[rows[:-1]], True)]
        return cls(parent, child, t_ns[rows], translation[rows], normalised(quaternion[rows]), fixed), found

    @property
    def changes(self) -> IntArray:
        """Rows of a fixed link at which another pose begins, shape (m,); poses that are sent again change nothing."""
        moved = np.abs(np.diff(self.translation_m, axis=0)).max(axis=1, initial=0.0) > _SAME
        turned = np.abs((self.quaternion[1:] * self.quaternion[:-1]).sum(axis=1)) < 1.0 - _SAME**2
        return np.flatnonzero(moved | turned) + 1 if self.fixed else np.zeros(0, dtype=np.int64)

    def described(self, rows: Sequence[int]) -> list[str]:
        """Some of the poses in words: place in m, and roll, pitch and yaw in degrees."""
        turns = np.degrees(roll_pitch_yaw(self.quaternion[list(rows)]))
        return [
            f"({', '.join(f'{value:g}' for value in np.round(place, 3) + 0.0)}) m turned by "
            f"({', '.join(f'{angle:g}' for angle in np.round(turn, 1) + 0.0)}) deg"
            for place, turn in zip(self.translation_m[list(rows)], turns, strict=True)
        ]

    @property
    def span(self) -> Span:
        """First and last stamp in ns; ALWAYS for a fixed link."""
        return ALWAYS if self.fixed else (int(self.t_ns[0]), int(self.t_ns[-1]))

    def at(self, times: IntArray, until: IntArray) -> Transforms:
        """The child's poses in the parent; before the first stamp and after the last one they are held.

        Args:
            times: Shape (n,), ns.
            until: When another parent takes over, shape (n,), ns. Stamps after that are not interpolated to.
        """
        rows = self._rows(times)
        after = np.minimum(rows + 1, len(self.t_ns) - 1)
        # differences first: a float cannot resolve nanoseconds since 1970
        step = np.maximum(self.t_ns[after] - self.t_ns[rows], 1)
        share = np.where(self.t_ns[after] <= until, np.clip((times - self.t_ns[rows]) / step, 0.0, 1.0), 0.0)
        share = np.zeros(len(times)) if self.fixed else share
        line = share[:, None]
        translation = (1.0 - line) * self.translation_m[rows] + line * self.translation_m[after]
        return Transforms(slerp(self.quaternion[rows], self.quaternion[after], share), translation)

    def gaps(self, times: IntArray, until: IntArray) -> IntArray:
        """Distance in ns between the stamps around each time, or to the only one; 0 at a stamp; shape (n,)."""
        if self.fixed:
            return np.zeros(len(times), dtype=np.int64)
        rows = self._rows(times)
        begin, end = self.t_ns[rows], np.minimum(np.append(self.t_ns[1:], ALWAYS[1])[rows], until)
        held = (times < begin) | (end == ALWAYS[1])
        return np.where(held | (times == begin), np.abs(times - begin), np.where(held, begin, end) - begin)

    def _rows(self, times: IntArray) -> IntArray:
        """The last stamp at or before each time, or the first."""
        return np.maximum(np.searchsorted(self.t_ns, times, side="right") - 1, 0)


#: Curves from a frame up to an ancestor, each with the times at which another parent takes over, shape (m,), ns.
Steps = list[tuple[Curve, IntArray]]


@dataclass(frozen=True, eq=False)
class Chain:
    """The chain of transforms between two frames at some times of a lookup."""

    #: Rows of these times, shape (m,).
    rows: IntArray
    #: From the source frame up to the frame in which the two meet.
    up: Steps
    #: The same from the target frame.
    down: Steps

    @property
    def curves(self) -> tuple[Curve, ...]:
        """All curves."""
        return tuple(curve for curve, _ in (*self.up, *self.down))

    @property
    def span(self) -> Span:
        """First and last time in ns that all curves cover; ALWAYS if all are fixed."""
        spans = [ALWAYS, *(curve.span for curve in self.curves)]
        return max(first for first, _ in spans), min(last for _, last in spans)

    def at(self, times: IntArray) -> Transforms:
        """The transforms from source to target at the chain's times, shape (m,)."""
        into, back = (_composed(steps, times) for steps in (self.up, self.down))
        return back.inverse().after(into) if self.down else into

    def gaps(self, times: IntArray) -> IntArray:
        """The largest of the curves' gaps, shape (m,), ns."""
        gaps = [curve.gaps(times, until) for curve, until in (*self.up, *self.down)]
        largest: IntArray = np.max([np.zeros(len(times), dtype=np.int64), *gaps], axis=0)
        return largest


def in_force(curves: Sequence[Curve], covers: Mapping[str, Span], times: IntArray) -> tuple[IntArray, IntArray]:
    """Which of a child's curves is in force at each time, and when another one takes over.

    Args:
        curves: Curves to p different parents.
        covers: By parent, the span of its own transforms above it, ns. Stamps outside of it do not count, unless all
            stamps are outside. A fixed link counts from when it was sent, whatever is above it.
        times: Shape (n,), ns.

    Returns:
        Index of the curve, shape (n,), and the time in ns at which another one takes over, shape (n,).
    """
    if len(curves) == 1:
        return np.zeros(len(times), dtype=np.int64), np.full(len(times), ALWAYS[1])
    spans = [ALWAYS if curve.fixed else covers.get(curve.parent, ALWAYS) for curve in curves]
    kept = [curve.t_ns[~beyond(curve.t_ns, span)] for curve, span in zip(curves, spans, strict=True)]
    stamps = kept if any(t.size for t in kept) else [curve.t_ns for curve in curves]
    padded = [np.concatenate([ALWAYS[:1], t, ALWAYS[1:]]) for t in stamps]
    places = [np.searchsorted(t, times, side="right") for t in stamps]
    latest = np.stack([t[place] for t, place in zip(padded, places, strict=True)])
    following = np.stack([t[place + 1] for t, place in zip(padded, places, strict=True)])
    chosen = np.where((latest == ALWAYS[0]).all(axis=0), following.argmin(axis=0), latest.argmax(axis=0))
    others = np.where(np.arange(len(curves))[:, None] == chosen, ALWAYS[1], following)
    return chosen, others.min(axis=0)


def links_of(columns: Mapping[str, NDArray[Any]], counts: IntArray, t_ns: IntArray | None = None) -> list[Link]:
    """A link for each pair of frames in the columns of TFMessages.

    Args:
        columns: By field, such as `transforms[].transform.rotation.w`: the entries of all messages in order, shape
            (total,); translations in m, stamps as int64 ns, names as str objects.
        counts: Number of entries of each message, shape (n,).
        t_ns: Stamps in ns that replace the column's, shape (total,).

    Returns:
        Links in the order of their last entries, so that the last of several fixed links stays the last.

    Raises:
        FrameError: A field is missing or has another number of entries than the messages.
    """
    columns = dict(columns) if t_ns is None else {**columns, _STAMP: t_ns}
    total = int(np.sum(counts))
    for name in (_STAMP, *_PAIR, *_POSE):
        if name not in columns:
            raise FrameError(
                f"transforms: expected the field {name}, found {', '.join(columns) or 'no fields'}; "
                "record tf2_msgs/msg/TFMessage, or leave out the topic"
            )
        if (found := len(columns[name])) != total:
            raise FrameError(f"transforms: expected {total} entries in the field {name}, found {found}")
    if total == 0:
        return []
    pairs: dict[tuple[str, str], int] = {}
    entries = zip(*(columns[name].tolist() for name in _PAIR), strict=True)
    group = np.fromiter((pairs.setdefault(pair, len(pairs)) for pair in entries), np.int64, total)
    order = np.argsort(group, kind="stable")
    members = np.split(order, np.flatnonzero(np.diff(group[order])) + 1)
    poses = np.stack([np.asarray(columns[name], dtype=np.float64) for name in _POSE], axis=1)
    return [
        Link(parent, child, columns[_STAMP][rows], poses[rows, :3], poses[rows, 3:])
        for (parent, child), rows in sorted(zip(pairs, members, strict=True), key=lambda item: int(item[1][-1]))
    ]


def beyond(times: IntArray, span: Span, hold_ns: int = 0) -> BoolArray:
    """Which times lie more than `hold_ns` outside of a span, shape (n,)."""
    return (times < span[0] - hold_ns) | (times > span[1] + hold_ns)


def _counted(problems: Mapping[str, BoolArray]) -> dict[str, int]:
    """How many rows each problem has, each row under its first one."""
    counts, seen = {}, np.zeros(len(next(iter(problems.values()))), dtype=np.bool_)
    for reason, rows in problems.items():
        if count := int((rows & ~seen).sum()):
            counts[reason] = count
        seen = seen | rows
    return counts


def _composed(steps: Steps, times: IntArray) -> Transforms:
    """The transforms of several steps, one after the other."""
    poses = Transforms(np.tile(IDENTITY, (len(times), 1)), np.zeros((len(times), 3)))
    for curve, until in steps:
        poses = curve.at(times, until).after(poses)
    return poses
