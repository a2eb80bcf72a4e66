"""Commands by hand: how far a joystick is from rest, or the velocity that a hand gives."""

from collections.abc import Sequence

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.logs.roles.columns import Columns

#: An axis of a joystick this near to 0 is at rest there, if it is so in this share of the messages.
_STICK_REST, _RESTS = 0.05, 0.05


def commands_of(topics: Sequence[Columns]) -> tuple[IntArray, FloatArray]:
    """(c,) ns and (c,) how far the joystick is from where its axes rest: a stick at 0, a pad's triggers at 1."""
    times = [np.zeros(0, dtype=np.int64)]
    away = [np.zeros(0)]
    for columns in topics:
        axes = _axes(columns)
        rest = np.zeros(axes.shape[1])
        if "axes" in columns:
            near = np.abs(axes) < _STICK_REST
            # an axis that comes back to 0 rests there, wherever it is mostly; a trigger shows 0 until it is first used
            back = (near & np.logical_or.accumulate(~near, axis=0)).mean(axis=0) > _RESTS
            rest = np.where(back, 0.0, np.median(axes, axis=0))
        away.append(np.abs(axes - rest).max(axis=1))
        times.append(columns.t_ns)
    t_ns = np.concatenate(times)
    order = np.argsort(t_ns, kind="stable")
    return t_ns[order], np.concatenate(away)[order]


def _axes(columns: Columns) -> FloatArray:
    """(n, a) what a command holds, 0 where it is not finite."""
    if "axes" not in columns:
        axes = columns.stacked(*(name for name in columns.by_field if name not in {"stamp", "frame"}))
    else:
        counts, owner = columns.owner_counts, columns.owner
        axes = np.zeros((len(columns), max(int(counts.max()), 1)))
        place = np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]
        axes[owner, place] = columns["axes"]
    return np.where(np.isfinite(axes), axes, 0.0)
