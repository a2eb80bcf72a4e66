"""The one clock and the one frame that everything in a recording is brought onto."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.errors import FrameError
from navirl_cli.logs.roles.clocks import Clock, in_order
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.plausible import PLACES, Limits, plausible_messages
from navirl_cli.logs.tf.tree import TransformTree

#: Usual names of a robot's own frame, where no message names it.
_BASES: Final = ("base_footprint", "base_link", "base")


@dataclass(eq=False)
class Context:
    """Clock, frames, and what was found about them."""

    #: Name of the recording, which begins every note.
    log: str
    clock: Clock
    tree: TransformTree
    #: The frame that everything is expressed in.
    fixed: str
    #: What is unusual, in words.
    notes: list[str] = field(default_factory=list)
    #: What was lost, in words.
    lost: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Note something unusual."""
        self.notes.append(f"{self.log}: {text}")

    def lose(self, text: str) -> None:
        """Note a loss."""
        self.lost.append(f"{self.log}: {text}")

    def is_fixed(self, frame: str) -> bool:
        """Whether a frame is the fixed one."""
        return frame.lstrip("/") == self.fixed.lstrip("/")

    def plausible(self, columns: Columns, limits: Limits, *names: str, rotations: BoolArray | None = None) -> Columns:
        """The messages whose measurements are plausible; the others are noted as lost."""
        good, problem = plausible_messages(columns.topic, columns.stacked(*names), limits, rotations)
        if not problem:
            return columns
        self.lose(problem)
        return columns.rows(good)

    def in_one_frame(self, columns: Columns) -> tuple[Columns, str]:
        """The messages in the most common of their frames, and that frame; the others are noted as lost."""
        frames = columns.frames()
        (frame, count), *_ = Counter(frames.tolist()).most_common(1) or [("", 0)]
        if count == len(columns):
            return columns, frame
        others = len(columns) - count
        self.lose(f"{others} messages on {columns.topic} are not in frame {frame!r}, as the others are; left out")
        return columns.rows(frames == frame), frame

    def ordered_times(self, columns: Columns) -> tuple[IntArray, IntArray]:
        """(n,) ns on the recording's clock, and the rows in order of time, which are noted where they were not."""
        t_ns = columns.times(self.clock)
        rows, notes = in_order(columns.topic, t_ns)
        for text in notes:
            self.note(text)
        return t_ns, rows

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

    def base_frame(self, named: str) -> str:
        """The robot's own frame: the one that a message names, else the usual one that tf knows."""
        if named:
            return named
        for name in _BASES:
            if name in self.tree.frames:
                return name
        # a wrench that is given in it needs no transform
        bases = ", ".join(_BASES)
        self.note(f"no message names the robot's own frame, and tf knows none of {bases}; base_link is assumed")
        return "base_link"
