"""People and goals, from messages of many types."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.recording import Track
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context


def people_of(topics: Sequence[Columns], context: Context) -> tuple[IntArray, tuple[Track, ...], Findings]:
    """The tracks of all people.

    Args:
        topics: One that lists people, or several about one person each.
        context: The frames.

    Returns:
        (m,) ns of every message, ascending, the tracks, and what was found out. A person without a name is named by
        the place in the message, or by the topic.
    """
    times: list[IntArray] = []
    tracks: list[Track] = []
    findings: list[Finding] = []
    for columns in topics:
        t_ns, owner = columns.t_ns, columns.owner
        times.append(t_ns)
        xy, kept, lost = _placed(columns, context, t_ns[owner], _counted(columns))
        findings += lost
        names = _names(columns, columns.topic if len(topics) > 1 else "1")[kept]
        tracks += _tracks(names, t_ns[owner][kept], xy[kept])
    return np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *times])), tuple(tracks), tuple(findings)


def goals_of(columns: Columns | None, context: Context) -> tuple[IntArray, FloatArray, Findings]:
    """(g,) ns and (g, 2) m of the goals announced, and what was found out; a plan's goal is its end."""
    if columns is None or len(columns) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2)), ()
    if columns.counts is not None:
        columns = columns.last_entries()
    t_ns = columns.t_ns
    xy, good, lost = _placed(columns, context, t_ns, np.ones(len(t_ns), dtype=np.bool_))
    order = np.argsort(t_ns[good], kind="stable")
    return t_ns[good][order], xy[good][order], lost


def _placed(
    columns: Columns, context: Context, t_ns: IntArray, wanted: BoolArray
) -> tuple[FloatArray, BoolArray, Findings]:
    """(total, 2) m of the wanted entries in the fixed frame, (total,) which can be placed, and a loss of the others."""
    xy = np.full((len(wanted), 2), np.nan)
    points_m, frames = columns.stacked("px", "py", "pz"), columns.frames()
    xy[wanted], problem = context.placed(points_m[wanted], frames[wanted], t_ns[wanted])
    good: BoolArray = np.array(np.isfinite(xy).all(axis=1))
    if not problem:
        return xy, good, ()
    kind = Kind.UNPLACED_MESSAGES if columns.counts is None else Kind.UNPLACED_ENTRIES
    return xy, good, (Finding(kind, columns.topic, int((wanted & ~good).sum()), detail=problem),)


def _counted(columns: Columns) -> BoolArray:
    """(total,) which entries are people, as the message type says."""
    counted: BoolArray = np.ones(len(columns["px"]), dtype=np.bool_)
    for name, counts in columns.message_type.counted.items():
        counted &= counts(columns[name])
    return counted


def _names(columns: Columns, alone: str) -> NDArray[np.object_]:
    """(total,) name of each entry's person."""
    if columns.counts is None:
        return np.full(len(columns), alone, dtype=object)
    if "space" in columns:
        return np.array([f"{space}/{name}" for space, name in zip(columns["space"], columns["name"], strict=True)])
    if "name" in columns:
        names = [f"{name:.17g}" if isinstance(name, float) else str(name) for name in columns["name"].tolist()]
        # some trackers give all people the same name, or an empty one
        if "" not in names and len(set(zip(columns.owner.tolist(), names, strict=True))) == len(names):
            return np.array(names, dtype=object)
    first = np.cumsum(columns.counts) - columns.counts
    return np.array([str(place + 1) for place in (np.arange(len(columns["px"])) - first[columns.owner]).tolist()])


def _tracks(names: NDArray[np.object_], t_ns: IntArray, xy_m: FloatArray) -> list[Track]:
    """A track for each name, in the order of their first appearance."""
    tracks = []
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)
        _, first = np.unique(t_ns[rows], return_index=True)
        tracks.append(Track(str(name), t_ns[rows[first]], xy_m[rows[first]]))
    return tracks
