"""What everything in a recording is brought onto: one clock and one frame."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.errors import FrameError
from navirl_cli.logs.roles.clocks import Clock
from navirl_cli.logs.roles.columns import Table
from navirl_cli.logs.roles.plausible import PLACES, Limits, describe
from navirl_cli.logs.tf.tree import TransformTree

#: Names of a robot's own frame, where no message says it.
_BASES: Final = ("base_footprint", "base_link", "base")


@dataclass(eq=False)
class Setting:
    """Clock, frames, and where notes go."""

    #: Name of the recording, which starts every note.
    log: str
    clock: Clock
    tree: TransformTree
    #: The frame that everything is expressed in.
    fixed: str
    #: What is odd, in words.
    notes: list[str] = field(default_factory=list)
    #: What was lost, in words.
    lost: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Note something odd."""
        self.notes.append(f"{self.log}: {text}")

    def lose(self, text: str) -> None:
        """Note something lost."""
        self.lost.append(f"{self.log}: {text}")

    def same(self, frame: str) -> bool:
        """Whether a frame is the fixed one."""
        return frame.lstrip("/") == self.fixed.lstrip("/")

    def measured(self, table: Table, limits: Limits, *names: str, turned: BoolArray | None = None) -> Table:
        """A table without measurements that cannot be true, which are noted as lost."""
        good, trouble = describe(table.topic, table.stacked(*names), limits, turned)
        if not trouble:
            return table
        self.lose(trouble)
        return table.rows(good)

    def one_frame(self, table: Table) -> tuple[Table, str]:
        """A table whose messages are all in the commonest of their frames, and that frame."""
        frames = table.frames()
        (frame, count), *_ = Counter(frames.tolist()).most_common(1) or [("", 0)]
        if count == len(table):
            return table, frame
        self.lose(f"{len(table) - count} messages on {table.topic} are not in frame {frame!r}, as the others; left out")
        return table.rows(frames == frame), frame

    def placed(self, points_m: FloatArray, frames: NDArray[np.object_], t_ns: IntArray) -> tuple[FloatArray, str]:
        """Points in the fixed frame.

        Args:
            points_m: (n, 3) m.
            frames: (n,) the frame of each.
            t_ns: (n,) ns, when.

        Returns:
            (n, 2) m, NaN where a point cannot be placed, and why the first of those cannot.
        """
        placed, trouble = np.full((len(points_m), 2), np.nan), ""
        for frame in dict.fromkeys(frames.tolist()):
            rows = np.flatnonzero(frames == frame)
            if self.same(frame):
                placed[rows] = points_m[rows, :2]
                continue
            try:
                span = self.tree.span(self.fixed, frame)
                # what is said before tf's first word is placed by it: people and goals seldom move
                times = t_ns[rows] if span is None else np.clip(t_ns[rows], *span)
                placed[rows] = self.tree.lookup(self.fixed, frame, times).apply(points_m[rows])[:, :2]
            except FrameError as error:
                trouble = trouble or str(error)
        far = ~(np.abs(placed) <= PLACES.largest).all(axis=1)
        if not trouble and far.any():
            trouble = f"its numbers {'cannot be true' if np.isfinite(placed[far]).all() else 'are not finite'}"
        placed[far] = np.nan
        return placed, trouble

    def base(self, said: str) -> str:
        """The robot's own frame: as a message says, or by the usual names."""
        if said:
            return said
        for name in _BASES:
            if name in self.tree.frames:
                return name
        # a wrench that is given in it, or is said to be, needs no transform
        self.note(
            f"no message names the robot's own frame, and tf knows none of {', '.join(_BASES)}; base_link is assumed"
        )
        return "base_link"
