"""The one frame that everything in a recording is brought into, and what every role asks of it."""

from collections import Counter
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.errors import FrameError
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.plausible import PLACES, Limits, plausible_messages
from navirl_cli.logs.tf.tree import TransformTree

#: Usual names of a robot's own frame, where no message names it.
_BASES: Final = ("base_footprint", "base_link", "base")


@dataclass(frozen=True, eq=False)
class Context:
    """The frames of a recording."""

    #: Name of the recording, which begins every error.
    log: str
    tree: TransformTree
    #: The frame that everything is expressed in.
    fixed: str
    #: Of the robot, where the user named it; "" otherwise.
    namespace: str = ""

    def is_fixed(self, frame: str) -> bool:
        """Whether a frame is the fixed one."""
        return frame.lstrip("/") == self.fixed.lstrip("/")

    def placed(self, points_m: FloatArray, frames: NDArray[np.object_], t_ns: IntArray) -> tuple[FloatArray, str]:
        """Points in the fixed frame.

        Args:
            points_m: (n, 3) m.
            frames: (n,) the frame of each.
            t_ns: (n,) ns, when.

        Returns:
            (n, 2) m, NaN where a point cannot be placed, and why the first of those cannot.
        """
        placed, problem = np.full((len(points_m), 2), np.nan), ""
        for frame in dict.fromkeys(frames.tolist()):
            rows = np.flatnonzero(frames == frame)
            if self.is_fixed(frame):
                placed[rows] = points_m[rows, :2]
                continue
            try:
                span = self.tree.span(self.fixed, frame)
                # before tf's first transform that one counts: people and goals seldom move
                times = t_ns[rows] if span is None else np.clip(t_ns[rows], *span)
                placed[rows] = self.tree.lookup(self.fixed, frame, times).apply(points_m[rows])[:, :2]
            except FrameError as error:
                problem = problem or str(error)
        far = ~(np.abs(placed) <= PLACES.largest).all(axis=1)
        if not problem and far.any():
            problem = f"its numbers {'cannot be true' if np.isfinite(placed[far]).all() else 'are not finite'}"
        placed[far] = np.nan
        return placed, problem

    def base_frame(self, named: str) -> tuple[str, Findings]:
        """The robot's own frame: the one that a message names, else the usual one that tf knows.

        Raises:
            FrameError: tf knows the frames of several robots, and none is in the namespace.
        """
        if named:
            return named, ()
        frames = self.tree.frames
        own = f"{self.namespace.strip('/')}/" if self.namespace else ""
        for name in (*(f"{own}{base}" for base in _BASES), *_BASES):
            if name in frames:
                return name, ()
        for base in _BASES:
            prefixed = [frame for frame in frames if frame.rpartition("/")[2] == base]
            if len(prefixed) > 1:
                raise FrameError(
                    f"{self.log}: expected one robot's frame, found {', '.join(prefixed)}; choose the robot with "
                    f"`namespace` /{prefixed[0].rpartition('/')[0]}"
                )
            if prefixed:
                return prefixed[0], ()
        # a wrench that is given in it needs no transform
        return "base_link", (Finding(Kind.BASE_ASSUMED, "base_link", detail=", ".join(_BASES)),)


def plausible(
    columns: Columns, limits: Limits, *names: str, quaternions: FloatArray | None = None
) -> tuple[Columns, Findings]:
    """The messages whose measurements are plausible; the others are a loss."""
    good, findings = plausible_messages(columns.topic, columns.stacked(*names), limits, quaternions)
    return (columns.rows(good), findings) if findings else (columns, ())


def in_one_frame(columns: Columns) -> tuple[Columns, str, Findings]:
    """The messages in the most common of their frames, and that frame; the others are a loss."""
    frames = columns.frames()
    (frame, count), *_ = Counter(frames.tolist()).most_common(1) or [("", 0)]
    if count == len(columns):
        return columns, frame, ()
    lost = Finding(Kind.OTHER_FRAME, columns.topic, len(columns) - count, detail=frame)
    return columns.rows(frames == frame), frame, (lost,)
