"""Frames and the transforms between them, over time.

A transform tree knows for each child frame its parent and the child's pose in it, fixed or at stamps. Between two
stamps the translation is interpolated linearly and the rotation by spherical linear interpolation (Shoemake 1985,
Animating rotation with quaternion curves, SIGGRAPH), as tf2 does.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from navirl_cli.errors import FrameError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: How far outside of its stamps a moving transform is held constant, in ns: a few periods of a slow localisation.
HOLD_NS: Final = 1_000_000_000
#: Quaternions shorter than this have no direction.
_MIN_QUATERNION: Final = 1e-6


@dataclass(frozen=True)
class Link:
    """Poses of a child frame in its parent frame."""

    parent: str
    child: str
    #: Stamps in ns, shape (k,), any order; a fixed link needs one row, whose stamp does not matter.
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


@dataclass(frozen=True)
class Transforms:
    """Transforms of points from a source frame into a target frame, one for each time."""

    #: n rotations.
    rotation: Rotation
    #: Origin of the source frame in the target frame, m, shape (n, 3).
    translation_m: FloatArray

    @property
    def yaw_rad(self) -> FloatArray:
        """Heading of the source frame's x axis in the target frame's x-y plane, in (-pi, pi], shape (n,)."""
        axis = self.rotation.apply((1.0, 0.0, 0.0))
        yaw: FloatArray = np.arctan2(axis[:, 1], axis[:, 0])
        return yaw

    def apply(self, points_m: ArrayLike) -> FloatArray:
        """Points of the source frame in the target frame.

        Args:
            points_m: Shape (n, 3), or (3,) for the same point at each time; m.

        Returns:
            Shape (n, 3), m.
        """
        rotated: FloatArray = self.rotation.apply(np.asarray(points_m, dtype=np.float64))
        return rotated + self.translation_m

    def inverse(self) -> "Transforms":
        """The transforms from the target frame into the source frame."""
        back = self.rotation.inv()
        return Transforms(back, -back.apply(self.translation_m))

    def after(self, first: "Transforms") -> "Transforms":
        """The transforms that apply `first` and then these."""
        return Transforms(self.rotation * first.rotation, self.apply(first.translation_m))


class TransformTree:
    """The transforms of a log.

    Leading slashes of frame names, a habit of tf1, are dropped. Transforms with numbers that are not finite or with a
    quaternion of zero length are ignored, as tf2 does; so are stamps of 0 beside others (sent before the simulated
    clock started). Of equal stamps the last counts.

    Args:
        static: Fixed links; of several for one child and parent the last counts.
        moving: Links over time; several for one child and parent are joined.
    """

    def __init__(self, static: Iterable[Link], moving: Iterable[Link]) -> None:
        self._parents: dict[str, dict[str, _Curve]] = {}
        #: Number of ignored transforms by parent and child.
        self.ignored: dict[tuple[str, str], int] = {}
        for links, fixed in ((static, True), (moving, False)):
            groups: dict[tuple[str, str], list[Link]] = {}
            for link in links:
                groups.setdefault((_name(link.parent), _name(link.child)), []).append(link)
            for (parent, child), group in groups.items():
                self._add(parent, child, group, fixed=fixed)

    @classmethod
    def from_messages(cls, static_messages: Iterable[Any], moving_messages: Iterable[Any]) -> Self:
        """Build the tree from decoded tf2_msgs/msg/TFMessage objects of /tf_static and /tf."""
        return cls(_links(static_messages), _links(moving_messages))

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted({*self._parents, *(parent for parents in self._parents.values() for parent in parents)}))

    def lookup(self, target: str, source: str, t_ns: ArrayLike, hold_ns: int = HOLD_NS) -> Transforms:
        """Transforms from the source frame into the target frame.

        Args:
            target: Frame to transform into.
            source: Frame to transform from: the result is the source frame's pose in the target frame.
            t_ns: Times in ns on the clock of the transforms' stamps, shape (n,).
            hold_ns: How far outside of its stamps a moving transform is held constant.

        Returns:
            n transforms.

        Raises:
            FrameError: The frames are not connected, a frame between them has several parents, or a time lies further
                outside of a transform's stamps than `hold_ns`.
        """
        times = np.atleast_1d(np.asarray(t_ns, dtype=np.int64))
        up, down = self._chains(_name(target), _name(source))
        forward, backward = _identity(len(times)), _identity(len(times))
        for curve in up:
            forward = curve.at(times, hold_ns).after(forward)
        for curve in down:
            backward = curve.at(times, hold_ns).after(backward)
        return backward.inverse().after(forward) if down else forward

    def span(self, target: str, source: str) -> tuple[int, int] | None:
        """First and last time in ns that all moving transforms between two frames cover; None if all are fixed.

        Raises:
            FrameError: As in `lookup`. If no time is covered by all, the first time is greater than the last.
        """
        up, down = self._chains(_name(target), _name(source))
        spans = [(int(curve.t_ns[0]), int(curve.t_ns[-1])) for curve in (*up, *down) if not curve.fixed]
        return (max(first for first, _ in spans), min(last for _, last in spans)) if spans else None

    def describe(self) -> str:
        """How the frames connect: "map -> odom -> base_link -> (imu, laser)"; trees are parted by semicolons."""
        children: dict[str, list[str]] = {}
        for child in sorted(self._parents):
            children.setdefault(next(iter(self._parents[child])), []).append(child)
        roots = [frame for frame in self.frames if frame not in self._parents]
        return "; ".join(_branch(root, children) for root in roots) or "no frames"

    def _add(self, parent: str, child: str, links: Sequence[Link], *, fixed: bool) -> None:
        """Join the links of one pair of frames into a curve."""
        t_ns = np.concatenate([np.asarray(link.t_ns, dtype=np.int64) for link in links])
        translation = np.concatenate([np.asarray(link.translation_m, dtype=np.float64) for link in links])
        quaternion = np.concatenate([np.asarray(link.quaternion, dtype=np.float64) for link in links])
        good = np.isfinite(translation).all(axis=1) & np.isfinite(quaternion).all(axis=1)
        good &= np.linalg.norm(np.where(np.isfinite(quaternion), quaternion, 0.0), axis=1) > _MIN_QUATERNION
        if not fixed and (t_ns[good] != 0).any():
            good &= t_ns != 0
        if not good.all():
            self.ignored[parent, child] = int((~good).sum())
        rows = np.flatnonzero(good)
        if not rows.size:
            return
        if fixed:
            rows = rows[-1:]
        else:
            rows = rows[np.argsort(t_ns[rows], kind="stable")]
            rows = rows[np.append(np.diff(t_ns[rows]) > 0, True)]
        curve = _Curve(
            t_ns[rows], translation[rows], Rotation.from_quat(quaternion[rows]), fixed, f"{parent} -> {child}"
        )
        self._parents.setdefault(child, {})[parent] = curve

    def _chains(self, target: str, source: str) -> tuple[list["_Curve"], list["_Curve"]]:
        """Curves from source and from target up to their first common ancestor."""
        up, down = self._ancestors(source), self._ancestors(target)
        below = {frame for frame, _ in down}
        common = next((frame for frame, _ in up if frame in below), None)
        if common is None:
            self._refuse(target, source, (up[-1][0], down[-1][0]))
        return _until(up, str(common)), _until(down, str(common))

    def _refuse(self, target: str, source: str, tops: tuple[str, str]) -> NoReturn:
        """Say why two frames do not connect; `tops` are the highest frames that they lead to."""
        for top in tops:
            if parents := self._parents.get(top):
                found = f"{len(parents)} ({', '.join(parents)})" if len(parents) > 1 else "a circle"
                raise FrameError(
                    f"frame {top!r}: expected one parent all the time, found {found}; "
                    "remap one publisher's frame, or record it without the other"
                )
        alone = [frame for frame in dict.fromkeys((source, target)) if frame not in self.frames]
        known = "; ".join([self.describe(), *(f"{frame} stands alone" for frame in alone)])
        raise FrameError(
            f"transform from {source!r} to {target!r}: expected frames that connect, found {known}; "
            "record /tf and /tf_static of the whole run, or name other frames"
        )

    def _ancestors(self, frame: str) -> list[tuple[str, "_Curve | None"]]:
        """The frame and its ancestors, each with the curve to its parent, up to one that has none or no single one."""
        chain: list[tuple[str, _Curve | None]] = []
        passed: set[str] = set()
        while len(self._parents.get(frame, {})) == 1 and frame not in passed:
            passed.add(frame)
            parent, curve = next(iter(self._parents[frame].items()))
            chain.append((frame, curve))
            frame = parent
        return [*chain, (frame, None)]


@dataclass(frozen=True)
class _Curve:
    """A link, cleaned and sorted."""

    t_ns: IntArray
    translation_m: FloatArray
    rotation: Rotation
    fixed: bool
    name: str

    def at(self, times: IntArray, hold_ns: int) -> Transforms:
        """The child's poses in the parent at the times."""
        if self.fixed:
            rows = np.zeros(len(times), dtype=np.int64)
            return Transforms(self.rotation[rows], self.translation_m[rows])
        first, last = int(self.t_ns[0]), int(self.t_ns[-1])
        outside = (times < first - hold_ns) | (times > last + hold_ns)
        if outside.any():
            found = int(times[np.argmax(outside)])
            raise FrameError(
                f"transform {self.name}: expected times between {first} and {last} ns (held {hold_ns} ns beyond), "
                f"found {found} ns and {int(outside.sum()) - 1} more outside; check that stamps and times are of one "
                "clock, or cut the run"
            )
        # differences first: nanoseconds since 1970 do not fit into a float
        seconds = (np.clip(times, first, last) - first) * 1e-9
        keys = (self.t_ns - first) * 1e-9
        translation = np.stack([np.interp(seconds, keys, axis) for axis in self.translation_m.T], axis=1)
        if len(keys) == 1:
            return Transforms(self.rotation[np.zeros(len(times), dtype=np.int64)], translation)
        return Transforms(Slerp(keys, self.rotation)(np.minimum(seconds, keys[-1])), translation)


def _identity(n: int) -> Transforms:
    return Transforms(Rotation.from_quat(np.tile((0.0, 0.0, 0.0, 1.0), (n, 1))), np.zeros((n, 3)))


def _until(chain: list[tuple[str, _Curve | None]], common: str) -> list[_Curve]:
    """The curves below the common ancestor."""
    names = [frame for frame, _ in chain]
    return [curve for _, curve in chain[: names.index(common)] if curve is not None]


def _name(frame: str) -> str:
    return frame.lstrip("/")


def _branch(frame: str, children: dict[str, list[str]]) -> str:
    below = [_branch(child, children) for child in children.get(frame, [])]
    if not below:
        return frame
    return f"{frame} -> {below[0]}" if len(below) == 1 else f"{frame} -> ({', '.join(below)})"


def _links(messages: Iterable[Any]) -> list[Link]:
    """A link for each pair of frames in TFMessage objects."""
    rows: dict[tuple[str, str], list[tuple[int, tuple[float, ...]]]] = {}
    for message in messages:
        for stamped in message.transforms:
            stamp, move, turn = stamped.header.stamp, stamped.transform.translation, stamped.transform.rotation
            pose = (move.x, move.y, move.z, turn.x, turn.y, turn.z, turn.w)
            pair = (stamped.header.frame_id, stamped.child_frame_id)
            rows.setdefault(pair, []).append((stamp.sec * 1_000_000_000 + stamp.nanosec, pose))
    links = []
    for (parent, child), group in rows.items():
        poses = np.array([pose for _, pose in group], dtype=np.float64)
        t_ns = np.array([t_ns for t_ns, _ in group], dtype=np.int64)
        links.append(Link(parent, child, t_ns, poses[:, :3], poses[:, 3:]))
    return links
