"""Frames and the transforms between them, over time."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from navirl_cli.arrays import IntArray
from navirl_cli.errors import FrameError
from navirl_cli.logs.tf.transforms import ALWAYS, Curve, Link, Span, Steps, Transforms, Way, beyond, in_force

#: How far outside of its stamps a moving transform is held constant, in ns: a few periods of a slow localisation.
HOLD_NS: Final = 1_000_000_000
#: More frames than this are not written into a message.
_MOST_SHOWN: Final = 100


class TransformTree:
    """The transforms of a log.

    Leading slashes of frame names, a habit of tf1, are dropped. Transforms of a frame in itself or without a name, with
    numbers that are not finite or absurd, or with a quaternion far from unit length are ignored, as tf2 does; so are
    stamps of 0 beside others of one child (sent before the simulated clock started). Of equal stamps the last counts.

    A child may have several parents: its parent changes, or two publishers disagree. Between two frames only those
    parents count that lead to a connection; where one of the two frames lies above the other, only those that lead up
    to it; and fixed ones only where no moving one does (of several fixed ones the last). If one is left, it counts at
    all times. If several are, each stamp puts its parent in force until the next stamp of another, as in tf2's buffer;
    before all stamps the first is, and of equal stamps the first parent by name. Other than in tf2, stamps at which
    the transforms above their parent have not begun or have ended do not count, unless all are such. No pose is
    interpolated across a time in which another parent was in force: as in tf2, it is held until the other takes over.

    Args:
        static: Fixed links; of several for one child and parent the last counts.
        moving: Links over time; several for one child and parent are joined, and replace a fixed one.
    """

    def __init__(self, static: Iterable[Link], moving: Iterable[Link]) -> None:
        self._parents: dict[str, dict[str, Curve]] = {}
        self._children: dict[str, set[str]] = {}
        #: Number of ignored transforms by parent and child.
        self.ignored: dict[tuple[str, str], int] = {}
        self._add(static, fixed=True)
        self._add(moving, fixed=False)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted({*self._parents, *self._children}))

    def lookup(self, target: str, source: str, t_ns: ArrayLike, hold_ns: int = HOLD_NS) -> Transforms:
        """Transforms from the source frame into the target frame.

        Inside of `span` a transform without a stamp near is interpolated or held however long it takes, as in tf2: ask
        `largest_gap_ns` before you believe it.

        Args:
            target: Frame to transform into.
            source: Frame to transform from: the result is the source frame's pose in the target frame.
            t_ns: Times in ns on the clock of the transforms' stamps, shape (n,).
            hold_ns: How far outside of `span` a moving transform is held constant.

        Returns:
            n transforms.

        Raises:
            FrameError: The frames are not connected, or in a circle, or a time lies further than `hold_ns` outside of
                `span` and of a transform's stamps.
        """
        times = _times(t_ns)
        ways = self._ways(target, source, times)
        self._check(ways, times, hold_ns, (target, source))
        quaternion, translation = np.empty((len(times), 4)), np.empty((len(times), 3))
        for way in ways:
            poses = way.at(times[way.rows])
            quaternion[way.rows], translation[way.rows] = poses.quaternion, poses.translation_m
        return Transforms(quaternion, translation)

    def span(self, target: str, source: str) -> Span | None:
        """First and last time in ns at which all moving transforms between two frames have begun and not ended.

        With several parents over time, the transforms may end between these times, and begin again.

        Returns:
            The times; None if all transforms are fixed. If no time is covered by all, the first is the greater one.

        Raises:
            FrameError: The frames are not connected, or in a circle.
        """
        times = _times([])
        ways = self._ways(target, source, times)
        if not ways:  # which way is in force changes at stamps: each stretch is seen where it begins and where it ends
            above = self._above(_name(source)) | self._above(_name(target))
            stamps = np.concatenate([curve.t_ns for frame in above for curve in self._curves(frame)])
            times = np.unique(np.concatenate([ALWAYS, stamps, stamps - 1]))
            ways = self._ways(target, source, times)
        span = ways[0].span
        if len(ways) > 1:
            known = np.concatenate([times[way.rows][~beyond(times[way.rows], way.span)] for way in ways])
            span = (int(known.min()), int(known.max())) if known.size else ALWAYS[::-1]
        return None if span == ALWAYS else span

    def largest_gap_ns(self, target: str, source: str, t_ns: ArrayLike) -> IntArray:
        """How far apart the stamps are between which `lookup` interpolates: in a long hole its answer is invented.

        The arguments are those of `lookup`; the n times may also lie outside of `span`.

        Returns:
            For each time, the longest distance in ns between the stamps before and after it over all transforms on the
            way, (n,): 0 where all are fixed or have a stamp at that time; where a transform has stamps on one side
            only, the distance to the nearest; where another parent takes over, the distance to its stamp.

        Raises:
            FrameError: The frames are not connected, or in a circle.
        """
        times = _times(t_ns)
        gaps = np.zeros(len(times), dtype=np.int64)
        for way in self._ways(target, source, times):
            gaps[way.rows] = way.gaps(times[way.rows])
        return gaps

    def stamps(self, target: str, source: str) -> IntArray:
        """Stamps in ns of the moving transforms that two frames hang on, within `span`, ascending, (n,).

        Raises:
            FrameError: The frames are not connected, or in a circle.
        """
        first, last = self.span(target, source) or (1, 0)
        above = self._above(_name(source)) | self._above(_name(target))
        curves = [curve for frame in above for curve in self._curves(frame) if not curve.fixed]
        stamps = np.unique(np.concatenate([_times([]), *(curve.t_ns for curve in curves)]))
        return stamps[(stamps >= first) & (stamps <= last)]

    def several_parents(self, target: str, source: str, t_ns: ArrayLike) -> dict[str, tuple[str, ...]]:
        """Frames that `lookup` takes from one parent to another over the times, given the same arguments.

        Returns:
            Their parents, sorted, by child; empty if at all these times each frame has the same parent.

        Raises:
            FrameError: The frames are not connected, or in a circle.
        """
        used: dict[str, set[str]] = {}
        for way in self._ways(target, source, _times(t_ns)):
            for curve in way.curves:
                used.setdefault(curve.child, set()).add(curve.parent)
        return {child: tuple(sorted(parents)) for child, parents in sorted(used.items()) if len(parents) > 1}

    def describe(self) -> str:
        """How the frames connect: "map -> odom -> base_link -> (imu, laser)"; trees are parted by semicolons.

        A frame with several parents stands under each, but what is below it stands under the first only.
        """
        seen: set[str] = set()
        roots = [frame for frame in self.frames if frame not in self._parents]
        # a circle has no root, hence after the roots any frame not yet seen
        rest = (frame for frame in (*roots, *self.frames) if frame not in seen and len(seen) < _MOST_SHOWN)
        trees = [_branch(frame, self._children, seen) for frame in rest]
        more = len(self.frames) - len(seen)
        return "; ".join(trees) + (f"; {more} more frames" if more else "") or "no frames"

    def _add(self, links: Iterable[Link], *, fixed: bool) -> None:
        """Join the links of each pair of frames into a curve; of fixed ones, the last comes last."""
        groups: dict[tuple[str, str], list[Link]] = {}
        for link in links:
            pair = _name(link.parent), _name(link.child)
            groups[pair] = groups.pop(pair, [])
            groups[pair].append(link)
        clocked = {child for (_, child), group in groups.items() for link in group if np.any(link.t_ns)}
        for (parent, child), group in groups.items():
            curve, ignored = Curve.of(group, parent, child, fixed=fixed, zeros=fixed or child not in clocked)
            if ignored:
                self.ignored[parent, child] = self.ignored.get((parent, child), 0) + ignored
            if curve is not None:
                self._parents.setdefault(child, {})[parent] = curve
                self._children.setdefault(parent, set()).add(child)

    def _check(self, ways: Sequence[Way], times: IntArray, hold_ns: int, frames: tuple[str, str]) -> None:
        """Refuse times that are not covered."""
        late = np.concatenate([_times([]), *(way.rows[beyond(times[way.rows], way.span, hold_ns)] for way in ways)])
        span = self.span(*frames) if late.size else None
        if span is None or not (late := late[beyond(times[late], span, hold_ns)]).size:
            return
        found = int(times[late.min()])
        curves = next(way.curves for way in ways if late.min() in way.rows)
        curve = max(curves, key=lambda curve: max(curve.span[0] - found, found - curve.span[1]))
        raise FrameError(
            f"transform {curve.parent} -> {curve.child}: expected times between {curve.span[0]} and {curve.span[1]} ns "
            f"(held {hold_ns} ns beyond), found {found} ns and {late.size - 1} more outside; check that stamps "
            "and times are of one clock, or cut the run"
        )

    def _ways(self, target: str, source: str, times: IntArray) -> list[Way]:
        """The ways between two frames; each time has one, unless no time is given and the frames have several."""
        source, target = _name(source), _name(target)
        stops = self._stops(target, source)
        # in an order of their own, so that the way back is the same way
        first, second = sorted((source, target))
        ways = []
        for rows, steps in self._climb(first, stops, times):
            passed = [first, *(curve.parent for curve, _ in steps)]
            for part, others in self._climb(second, set(passed), times[rows]):
                meeting = passed.index(others[-1][0].parent if others else second)
                cut = [(curve, until[part]) for curve, until in steps[:meeting]]
                ways.append(Way(rows[part], *((cut, others) if first == source else (others, cut))))
        return ways

    def _stops(self, target: str, source: str) -> set[str]:
        """Where ways up from the two frames end: one frame where all must meet, else the common roots."""
        above = self._above(source), self._above(target)
        common = above[0] & above[1]
        if not common:
            self._refuse(target, source)
        ends = common & {source, target}
        if not ends:
            below = (above[0] | above[1]) - common
            ends = {parent for frame in below for parent in self._parents.get(frame, ()) if parent in common}
        if len(ends) == 1:
            return ends
        _parents_first({frame: self._curves(frame) for frame in common})
        return {frame for frame in common if frame not in self._parents}

    def _climb(self, frame: str, stops: set[str], times: IntArray) -> Iterator[tuple[IntArray, Steps]]:
        """Rows of the times, with the steps from a frame up to a stop that are in force then."""
        leads = _reached(stops, self._children)
        graph = {child: self._curves(child, leads) for child in (self._above(frame) & leads) - stops}
        covers = _covers_of(graph)
        force = {child: in_force(curves, covers, times) for child, curves in graph.items()}
        stack: list[tuple[str, IntArray, Steps]] = [(frame, np.arange(len(times)), [])]
        while stack:
            frame, rows, steps = stack.pop()
            if frame in stops:
                yield rows, [(curve, until[rows]) for curve, until in steps]
                continue
            chosen, until = force[frame]
            for number, curve in enumerate(graph[frame]):
                part = rows[chosen[rows] == number]
                if part.size or len(graph[frame]) == 1:
                    stack.append((curve.parent, part, [*steps, (curve, until)]))

    def _curves(self, frame: str, leads: set[str] | None = None) -> list[Curve]:
        """A frame's curves to those parents that lead on: the moving ones, or else the last fixed one."""
        curves = [curve for curve in self._parents.get(frame, {}).values() if leads is None or curve.parent in leads]
        return sorted((curve for curve in curves if not curve.fixed), key=lambda curve: curve.parent) or curves[-1:]

    def _above(self, frame: str) -> set[str]:
        """A frame and all its ancestors."""
        return _reached({frame}, self._parents)

    def _refuse(self, target: str, source: str) -> NoReturn:
        """Say why two frames do not connect."""
        _parents_first({frame: self._curves(frame) for frame in self._above(source) | self._above(target)})
        alone = [frame for frame in dict.fromkeys((source, target)) if frame not in self.frames]
        known = "; ".join([self.describe(), *(f"{frame} stands alone" for frame in alone)])
        raise FrameError(
            f"transform from {source!r} to {target!r}: expected frames that connect, found {known}; "
            "record /tf and /tf_static of the whole run, or name other frames"
        )


def _times(t_ns: ArrayLike) -> IntArray:
    return np.atleast_1d(np.asarray(t_ns, dtype=np.int64))


def _name(frame: str) -> str:
    return frame.lstrip("/")


def _branch(frame: str, children: Mapping[str, Iterable[str]], seen: set[str]) -> str:
    """A frame and what is below it, unless it stands somewhere else already."""
    below = [] if frame in seen else sorted(children.get(frame, ()))
    seen.add(frame)
    branches = [_branch(child, children, seen) for child in below if child in seen or len(seen) < _MOST_SHOWN]
    text = f"({', '.join(branches)})" if len(branches) > 1 else "".join(branches)
    return f"{frame} -> {text}" if text else frame


def _parents_first(graph: Mapping[str, Sequence[Curve]]) -> list[str]:
    """Frames in an order in which parents come before children; refuses circles."""
    parents = {child: [curve.parent for curve in curves] for child, curves in graph.items()}
    try:
        return list(TopologicalSorter(parents).static_order())
    except CycleError as error:
        circle = " -> ".join(error.args[1])
        raise FrameError(
            f"transform {circle}: expected parents that lead up to one frame, found a circle; "
            "remap one publisher's frames, or record without it"
        ) from error


def _covers_of(graph: Mapping[str, Sequence[Curve]]) -> dict[str, Span]:
    """From when to when all transforms from a frame up have stamps, by frame."""
    found: dict[str, Span] = {}
    for child in _parents_first(graph):
        spans = [(curve.span, found.get(curve.parent, ALWAYS)) for curve in graph.get(child, ())]
        both = [(max(own[0], above[0]), min(own[1], above[1])) for own, above in spans] or [ALWAYS]
        both = [span for span in both if span[0] <= span[1]] or both
        found[child] = min(first for first, _ in both), max(last for _, last in both)
    return found


def _reached(begin: set[str], neighbours: Mapping[str, Iterable[str]]) -> set[str]:
    """The frames of a set and all that can be reached from them."""
    found, open_ = set(begin), list(begin)
    while open_:
        new = set(neighbours.get(open_.pop(), ())) - found
        found |= new
        open_.extend(new)
    return found
