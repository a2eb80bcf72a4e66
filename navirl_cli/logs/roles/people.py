"""People and goals as messages of many types tell them."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.logs.recording import Track
from navirl_cli.logs.roles.columns import Table
from navirl_cli.logs.roles.context import Setting

#: visualization_msgs/Marker: cubes, spheres, cylinders and meshes stand for bodies; lines, arrows and texts do not.
_BODIES: Final = (1, 2, 3, 10)
_ADDED: Final = 0
#: hunav_msgs/Agent: the robot is among its agents.
_ROBOT: Final = 2


def people_of(tables: Sequence[Table], setting: Setting) -> tuple[IntArray, tuple[Track, ...]]:
    """The tracks of all people.

    Args:
        tables: Of the topics about people: one that lists them, or several about one person each.
        setting: Clock and frames.

    Returns:
        (m,) ns of every message, ascending, and the tracks. Who has no name is called by the place in the message, or
        by the topic.
    """
    times: list[IntArray] = []
    tracks: list[Track] = []
    for table in tables:
        alone = table.topic if len(tables) > 1 else "1"
        t_ns = table.times(setting.clock)
        times.append(t_ns)
        owner = table.owner
        xy, kept = _placed(table, setting, t_ns[owner], _bodies(table))
        names = _names(table, alone)[kept]
        tracks += _tracks(names, t_ns[owner][kept], xy[kept])
    return np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *times])), tuple(tracks)


def goals_of(table: Table | None, setting: Setting) -> tuple[IntArray, FloatArray]:
    """(g,) ns and (g, 2) m of the goals announced; a plan's goal is its end."""
    if table is None or len(table) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
    t_ns = table.times(setting.clock, momentary=True)
    if table.counts is not None:
        some = table.counts > 0
        ends = np.cumsum(table.counts)[some] - 1
        columns = {
            name: column[ends if table.kind.of_entries(name) else some] for name, column in table.columns.items()
        }
        t_ns = t_ns[some]
        table = Table(table.topic, table.kind, table.log_time_ns[some], columns, None)
    xy, good = _placed(table, setting, t_ns, np.ones(len(t_ns), dtype=np.bool_))
    order = np.argsort(t_ns[good], kind="stable")
    return t_ns[good][order], xy[good][order]


def _placed(table: Table, setting: Setting, t_ns: IntArray, wanted: BoolArray) -> tuple[FloatArray, BoolArray]:
    """(total, 2) m of the wanted entries in the fixed frame, and (total,) which of them can be placed."""
    xy = np.full((len(wanted), 2), np.nan)
    points_m, frames = table.stacked("px", "py", "pz"), table.frames()
    xy[wanted], trouble = setting.placed(points_m[wanted], frames[wanted], t_ns[wanted])
    good: BoolArray = np.array(np.isfinite(xy).all(axis=1))
    if trouble:
        what = "messages" if table.counts is None else "places"
        setting.lose(f"{int((wanted & ~good).sum())} {what} on {table.topic} left out: {trouble}")
    return xy, good


def _bodies(table: Table) -> BoolArray:
    """(total,) which entries stand for people."""
    columns = table.columns
    good: BoolArray = np.ones(len(columns["px"]), dtype=np.bool_)
    if "action" in columns:
        good = np.isin(columns["kind"], _BODIES) & (columns["action"] == _ADDED)
    elif "kind" in columns:
        good = columns["kind"] != _ROBOT
    return good


def _names(table: Table, alone: str) -> NDArray[np.object_]:
    """(total,) what each entry's person is called."""
    columns = table.columns
    if table.counts is None:
        return np.full(len(table), alone, dtype=object)
    if "space" in columns:
        return np.array([f"{space}/{name}" for space, name in zip(columns["space"], columns["name"], strict=True)])
    if "name" in columns:
        said = [f"{name:.17g}" if isinstance(name, float) else str(name) for name in columns["name"].tolist()]
        # some trackers give everybody the same name, or none
        if "" not in said and len(set(zip(table.owner.tolist(), said, strict=True))) == len(said):
            return np.array(said, dtype=object)
    first = np.cumsum(table.counts) - table.counts
    return np.array([str(place + 1) for place in (np.arange(len(columns["px"])) - first[table.owner]).tolist()])


def _tracks(names: NDArray[np.object_], t_ns: IntArray, xy_m: FloatArray) -> list[Track]:
    """A track for each name, in the order of their first appearance."""
    tracks = []
    for name in dict.fromkeys(names.tolist()):
        rows = np.flatnonzero(names == name)
        _, first = np.unique(t_ns[rows], return_index=True)
        tracks.append(Track(str(name), t_ns[rows[first]], xy_m[rows[first]]))
    return tracks
