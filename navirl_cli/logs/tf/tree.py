"""Frames and the transforms between them, over time."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from navirl_cli.arrays import IntArray
from navirl_cli.errors import FrameError
from navirl_cli.logs.tf.transforms import ALWAYS, Chain, Curve, Faults, Link, Span, Steps, Transforms, beyond, in_force

#: How far outside of its stamps a moving transform is held constant, in ns: a few periods of a slow localisation.
HOLD_NS: Final = 1_000_000_000
#: A message names at most so many frames.
_MOST_SHOWN: Final = 100
#: An error names at most so many pairs of frames whose transforms are ignored.
_MOST_LISTED: Final = 5


class TransformTree:
    """The transforms of a log.

    Leading slashes of frame names, as in tf1, are dropped. Some transforms are ignored, as in tf2: those of a frame in
    itself or of a frame without a name, those with numbers that are not finite or absurd, and those with a quaternion
    far from unit length. A stamp of 0 is ignored where the child also has others, because it was sent before the
    simulated clock started. Of equal stamps the last transform is used.

    A fixed transform that is sent again with another value counts from when it was sent; the first one counts from the
    beginning (unlike in tf2, which knows the last one only).

    A child may have several parents: its parent changes, or two publishers disagree. These rules choose between them:

    1. Only parents that lead to a connection of the two frames count. Where one of the frames is an ancestor of the
       other, only those that lead up to it count.
    2. Fixed parents count only where no moving one is left.
    3. If one parent is left, it is used at all times. If several are left, each stamp puts its parent in force until
       the next stamp of another parent, as in tf2's buffer. Before all stamps the parent with the first stamp is in
       force; of equal stamps, the first parent by name, of fixed ones the last.
    4. Unlike in tf2, stamps at which the transforms above their parent have not begun or have ended do not count,
       unless this holds for all stamps.

    No pose is interpolated across a time in which another parent was in force: as in tf2, it is held until the other
    takes over.

    Args:
        static: Fixed links, with the times when they were sent.
        moving: Links over time; several for one child and parent are joined, and replace a fixed one.
    """

    def __init__(self, static: Iterable[Link], moving: Iterable[Link]) -> None:
        self._parents: dict[str, dict[str, Curve]] = {}
        self._children: dict[str, set[str]] = {}
        #: What is wrong with transforms, by parent and child; only pairs of which something is.
        self.faults: dict[tuple[str, str], list[Faults]] = {}
        self._add(static, fixed=True)
        self._add(moving, fixed=False)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted({*self._parents, *self._children}))

    def lookup(self, target: str, source: str, t_ns: ArrayLike, hold_ns: int = HOLD_NS) -> Transforms:
        """Transforms from the source frame into the target frame.

        Within `span` a transform is interpolated or held over gaps of any length, as in tf2: check `largest_gap_ns`.

        Args:
            target: Frame to transform into.
            source: Frame to transform from; the result is also the pose of the source frame in the target frame.
            t_ns: Times in ns on the clock of the transforms' stamps, shape (n,).
            hold_ns: How far outside of `span` a moving transform is held constant, ns.

        Returns:
            n transforms.

        Raises:
            FrameError: The frames are not connected or form a cycle, or a time is more than `hold_ns` outside of `span`
                and outside of a transform's stamps.
        """
        times = _times(t_ns)
        chains = self._chains(target, source, times)
        self._check(chains, times, hold_ns, (target, source))
        quaternion, translation = np.empty((len(times), 4)), np.empty((len(times), 3))
        for chain in chains:
            poses = chain.at(times[chain.rows])
            quaternion[chain.rows], translation[chain.rows] = poses.quaternion, poses.translation_m
        return Transforms(quaternion, translation)

    def span(self, target: str, source: str) -> Span | None:
        """First and last time in ns that all moving transforms between two frames cover with their stamps.

        Where a frame changes its parent, there may be times between these two that are not covered.

        Returns:
            The times; None if all transforms are fixed. If all transforms together cover no time, the first is the
            later one.

        Raises:
            FrameError: The frames are not connected or form a cycle.
        """
        times = _times([])
        chains = self._chains(target, source, times)
        if not chains:  # several parents take turns, at stamps: look at the first and the last time of each turn
            above = self._above(_name(source)) | self._above(_name(target))
            stamps = np.concatenate([curve.t_ns for frame in above for curve in self._curves(frame)])
            times = np.unique(np.concatenate([ALWAYS, stamps, stamps - 1]))
            chains = self._chains(target, source, times)
        span = chains[0].span
        if len(chains) > 1:
            known = np.concatenate([times[chain.rows][~beyond(times[chain.rows], chain.span)] for chain in chains])
            span = (int(known.min()), int(known.max())) if known.size else ALWAYS[::-1]
        return None if span == ALWAYS else span

    def largest_gap_ns(self, target: str, source: str, t_ns: ArrayLike) -> IntArray:
        """The longest gap between stamps over which `lookup` interpolates at each time.

        The arguments are those of `lookup`; the n times may also lie outside of `span`.

        Returns:
            Shape (n,), ns: for each time the distance between the stamps before and after it, and of all transforms of
            the chain the largest. The distance is 0 where a transform is fixed or has a stamp at that time. Where it
            has stamps on one side only, the distance is that to the nearest; where another parent takes over, that to
            the other's stamp.

        Raises:
            FrameError: The frames are not connected or form a cycle.
        """
        times = _times(t_ns)
        gaps = np.zeros(len(times), dtype=np.int64)
        for chain in self._chains(target, source, times):
            gaps[chain.rows] = chain.gaps(times[chain.rows])
        return gaps

    def stamps(self, target: str, source: str) -> IntArray:
        """Stamps in ns of all moving transforms above two frames, within `span`, ascending, shape (n,).

        Raises:
            FrameError: The frames are not connected or form a cycle.
        """
        first, last = self.span(target, source) or (1, 0)
        above = self._above(_name(source)) | self._above(_name(target))
        curves = [curve for frame in above for curve in self._curves(frame) if not curve.fixed]
        stamps = np.unique(np.concatenate([_times([]), *(curve.t_ns for curve in curves)]))
        return stamps[(stamps >= first) & (stamps <= last)]

    def several_parents(self, target: str, source: str, t_ns: ArrayLike) -> dict[str, tuple[str, ...]]:
        """Frames whose parent changes during the times of a `lookup` with the same arguments.

        Returns:
            The names of the parents, sorted, by child; empty if each frame has the same parent at all these times.

        Raises:
            FrameError: The frames are not connected or form a cycle.
        """
        used: dict[str, set[str]] = {}
        for chain in self._chains(target, source, _times(t_ns)):
            for curve in chain.curves:
                used.setdefault(curve.child, set()).add(curve.parent)
        return {child: tuple(sorted(parents)) for child, parents in sorted(used.items()) if len(parents) > 1}

    def describe(self) -> str:
        """How the frames connect: "map -> odom -> base_link -> (imu, laser)"; trees are separated by semicolons.

        A frame with several parents is listed under each of them; its children are listed under the first only.
        """
        seen: set[str] = set()
        roots = [frame for frame in self.frames if frame not in self._parents]
        # a cycle has no root: after the roots, the other frames follow
        rest = (frame for frame in (*roots, *self.frames) if frame not in seen and len(seen) < _MOST_SHOWN)
        trees = [_branch(frame, self._children, seen) for frame in rest]
        more = len(self.frames) - len(seen)
        return "; ".join(trees) + (f"; {more} more frames" if more else "") or "no frames"

    def is_constant(self, target: str, source: str) -> bool:
        """Whether the transform between two frames is the same at all times: static, and never sent again otherwise.

        Raises:
            FrameError: The frames are not connected or form a cycle.
        """
        chains = self._chains(target, source, _times([]))
        return bool(chains) and not any(
            curve.changes.size or not curve.fixed for chain in chains for curve in chain.curves
        )

    def static_changes(self) -> list[Curve]:
        """The fixed transforms that are sent again with another value, by child."""
        curves = [curve for frame in sorted(self._parents) for curve in self._curves(frame)]
        return [curve for curve in curves if curve.changes.size]

    def _add(self, links: Iterable[Link], *, fixed: bool) -> None:
        """Join the links of each pair of frames into a curve, in the order of the pairs' last links."""
        groups: dict[tuple[str, str], list[Link]] = {}
        for link in links:
            pair = _name(link.parent), _name(link.child)
            groups[pair] = groups.pop(pair, [])
            groups[pair].append(link)
        clocked = {child for (_, child), group in groups.items() for link in group if np.any(link.t_ns)}
        for (parent, child), group in groups.items():
            curve, faults = Curve.of(group, parent, child, fixed=fixed, zeros=fixed or child not in clocked)
            if faults.ignored or faults.rescaled:
                self.faults.setdefault((parent, child), []).append(faults)
            if curve is not None:
                self._parents.setdefault(child, {})[parent] = curve
                self._children.setdefault(parent, set()).add(child)

    def _check(self, chains: Sequence[Chain], times: IntArray, hold_ns: int, frames: tuple[str, str]) -> None:
        """Refuse times that are not covered."""
        outside = (chain.rows[beyond(times[chain.rows], chain.span, hold_ns)] for chain in chains)
        late = np.concatenate([_times([]), *outside])
        span = self.span(*frames) if late.size else None
        if span is None or not (late := late[beyond(times[late], span, hold_ns)]).size:
            return
        found = int(times[late.min()])
        curves = next(chain.curves for chain in chains if late.min() in chain.rows)
        curve = max(curves, key=lambda curve: max(curve.span[0] - found, found - curve.span[1]))
        raise FrameError(
            f"transform {curve.parent} -> {curve.child}: expected times between {curve.span[0]} and {curve.span[1]} ns "
            f"(held {hold_ns} ns beyond), found {found} ns and {late.size - 1} more outside; check that stamps "
            "and times come from one clock, or cut the run"
        )

    def _chains(self, target: str, source: str, times: IntArray) -> list[Chain]:
        """The chains between two frames, one for each time; without times, the only one there can be, or none."""
        source, target = _name(source), _name(target)
        stops = self._stops(target, source)
        # the frames' own order, not that of the arguments, so that both directions use the same chain
        first, second = sorted((source, target))
        chains = []
        for rows, steps in self._climb(first, stops, times):
            climbed = [first, *(curve.parent for curve, _ in steps)]
            for some, others in self._climb(second, set(climbed), times[rows]):
                meeting = climbed.index(others[-1][0].parent if others else second)
                cut = [(curve, until[some]) for curve, until in steps[:meeting]]
                chains.append(Chain(rows[some], *((cut, others) if first == source else (others, cut))))
        return chains

    def _stops(self, target: str, source: str) -> set[str]:
        """Where the climbs from the two frames end: one frame in which all of them meet, or else the common roots."""
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
        """Yield rows of the times and the steps in force at them, from a frame up to a stop."""
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
                own = rows[chosen[rows] == number]
                if own.size or len(graph[frame]) == 1:
                    stack.append((curve.parent, own, [*steps, (curve, until)]))

    def _curves(self, frame: str, leads: set[str] | None = None) -> list[Curve]:
        """A frame's curves to the parents in `leads`: the moving ones, or else the fixed ones, the last one first."""
        curves = [curve for curve in self._parents.get(frame, {}).values() if leads is None or curve.parent in leads]
        moving = sorted((curve for curve in curves if not curve.fixed), key=lambda curve: curve.parent)
        if moving or not curves:
            return moving
        # of fixed parents that were sent at one time the last counts
        return [curves[-1], *(curve for curve in curves[-2::-1] if curve.t_ns[-1] != curves[-1].t_ns[-1])]

    def _above(self, frame: str) -> set[str]:
        """A frame and all its ancestors."""
        return _reached({frame}, self._parents)

    def _refuse(self, target: str, source: str) -> NoReturn:
        """Raise the error of two frames that do not connect."""
        _parents_first({frame: self._curves(frame) for frame in self._above(source) | self._above(target)})
        named = {*self.frames, *(frame for pair in self.faults for frame in pair)}
        alone = [frame for frame in dict.fromkeys((source, target)) if frame not in named]
        left_out = [
            f"{parent} -> {child} ({one})"
            for (parent, child), some in self.faults.items()
            for one in some
            if one.ignored
        ]
        ignored = [f"ignored: {', '.join(left_out[:_MOST_LISTED])}"] if left_out else []
        known = "; ".join([self.describe(), *ignored, *(f"{frame} is in no transform" for frame in alone)])
        raise FrameError(
            f"transform from {source!r} to {target!r}: expected connected frames, found {known}; "
            "record /tf and /tf_static of the entire run, or name other frames"
        )


def _times(t_ns: ArrayLike) -> IntArray:
    return np.atleast_1d(np.asarray(t_ns, dtype=np.int64))


def _name(frame: str) -> str:
    return frame.lstrip("/")


def _branch(frame: str, children: Mapping[str, Iterable[str]], seen: set[str]) -> str:
    """A frame and its children, unless these are listed already."""
    below = [] if frame in seen else sorted(children.get(frame, ()))
    seen.add(frame)
    branches = [_branch(child, children, seen) for child in below if child in seen or len(seen) < _MOST_SHOWN]
    text = f"({', '.join(branches)})" if len(branches) > 1 else "".join(branches)
    return f"{frame} -> {text}" if text else frame


def _parents_first(graph: Mapping[str, Sequence[Curve]]) -> list[str]:
    """Frames in an order in which parents come before children; refuses cycles."""
    parents = {child: [curve.parent for curve in curves] for child, curves in graph.items()}
    try:
        return list(TopologicalSorter(parents).static_order())
    except CycleError as error:
        cycle = " -> ".join(error.args[1])
        raise FrameError(
            f"transform {cycle}: expected a tree of frames, found a cycle; "
            "remap the frames of one publisher, or record without it"
        ) from error


def _covers_of(graph: Mapping[str, Sequence[Curve]]) -> dict[str, Span]:
    """The span that the stamps of all transforms above a frame cover, by frame."""
    found: dict[str, Span] = {}
    for child in _parents_first(graph):
        spans = [(curve.span, found.get(curve.parent, ALWAYS)) for curve in graph.get(child, ())]
        both = [(max(own[0], above[0]), min(own[1], above[1])) for own, above in spans] or [ALWAYS]
        both = [span for span in both if span[0] <= span[1]] or both
        found[child] = min(first for first, _ in both), max(last for _, last in both)
    return found


def _reached(begin: set[str], neighbours: Mapping[str, Iterable[str]]) -> set[str]:
    """The frames of a set and all frames that can be reached from them."""
    found, open_ = set(begin), list(begin)
    while open_:
        new = set(neighbours.get(open_.pop(), ())) - found
        found |= new
        open_.extend(new)
    return found
