"""People, from messages of many types."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.errors import brief
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.recording import Track
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context

#: Most classes that a finding lists.
_MOST_LABELS: Final = 5


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
        counted, others = _counted(columns)
        xy, kept, lost = placed(columns, context, t_ns[owner], counted)
        findings += (*others, *lost)
        names = _names(columns, columns.topic if len(topics) > 1 else "1")[kept]
        tracks += _tracks(names, t_ns[owner][kept], xy[kept])
    return np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *times])), tuple(tracks), tuple(findings)


def placed(
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


def _counted(columns: Columns) -> tuple[BoolArray, Findings]:
    """(total,) which entries are people, as the message type and their class say; and the classes that are not."""
    counted: BoolArray = np.ones(len(columns["px"]), dtype=np.bool_)
    for name, counts in columns.message_type.counted.items():
        counted &= counts(columns[name])
    if "label" not in columns or not counted.any():
        return counted, ()
    labels = _labels(columns)
    if all(label == "" for label in labels[counted].tolist()):
        return counted, (Finding(Kind.NO_LABELS, columns.topic, int(counted.sum())),)
    people = columns.message_type.people_classes
    others = counted & ~np.array([_class(label) in people for label in labels.tolist()], dtype=np.bool_)
    if not others.any():
        return counted, ()
    found = Counter(str(label) or "no class" for label in labels[others].tolist()).most_common()
    listed = ", ".join(f"{brief(label)} ({count})" for label, count in found[:_MOST_LABELS])
    more = f" and {len(found) - _MOST_LABELS} other classes" if len(found) > _MOST_LABELS else ""
    return counted & ~others, (Finding(Kind.NOT_PEOPLE, columns.topic, int(others.sum()), detail=listed + more),)


def _labels(columns: Columns) -> NDArray[np.object_]:
    """(total,) class of each entry; of several the one with the highest score; "" without one."""
    labels = columns["label"]
    best: NDArray[np.object_] = np.empty(len(labels), dtype=object)
    if "score" not in columns or not columns.message_type.fields["score"].count("[]") > 1:
        best[:] = labels.tolist()
        return best
    for place, (several, scores) in enumerate(zip(labels, columns["score"], strict=True)):
        best[place] = several[int(np.argmax(scores))] if len(several) else ""
    return best


def _class(label: Any) -> int | str:
    """A label as message types name it: a number, or the first word of a text in lower case ("Body_7")."""
    if isinstance(label, str):
        return label.strip().partition("_")[0].lower()
    return int(label)


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
