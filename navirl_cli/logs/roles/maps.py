"""The maps of a recording, in its fixed frame."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.errors import FrameError, LogError, counted
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.map_geometry import check_geometry, is_empty, yaw_of
from navirl_cli.logs.occupancy import MapHistory, Sheet
from navirl_cli.logs.roles import message_types
from navirl_cli.logs.roles.clocks import NS_PER_S
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context

#: A map that is delivered late counts from its stamp, if that is at most so much before its receipt, ns.
_LATE_NS: Final = 24 * 3600 * NS_PER_S
_REMEDY: Final = "record the map again, or give it with `map`"


@dataclass(frozen=True, eq=False)
class Maps:
    """The maps of a log in one frame."""

    history: MapHistory
    frame: str
    findings: Findings


def maps_in(log: str, topics: Sequence[Columns]) -> Maps:
    """The maps of a log and their frame: that of the last one.

    Args:
        log: The recording's name, for messages.
        topics: The map's messages and those of its updates, with cells packed.

    Raises:
        LogError: Of no map do the cells run along its frame's axes, or the numbers of all contradict each other.
    """
    whole = [one for one in topics if one.message_type.name != message_types.MAP_UPDATES.name]
    updates = [one for one in topics if one not in whole]
    if not whole:
        names = ", ".join(one.topic for one in updates)
        raise LogError(f"{log}: expected a map, found only updates on {names}; {_REMEDY}")
    (columns,) = whole
    frames = np.array([name.lstrip("/") for name in columns["frame"].tolist()])
    frame = str(frames[-1])
    sheets: list[tuple[int, int, Sheet]] = []
    problems: list[LogError] = []
    for row in np.flatnonzero(frames == frame).tolist():
        try:
            sheets.append((int(columns.order[row]), _since_ns(columns, row), _sheet(log, columns, row)))
        except LogError as error:
            problems.append(error)
    if not sheets:
        raise problems[-1]
    others = int((frames != frame).sum())
    lost = [Finding(Kind.OTHER_FRAME, columns.topic, others, detail=frame)] if others else []
    lost += (
        [Finding(Kind.UNUSABLE_MAPS, columns.topic, len(problems), detail=_reason(problems[-1], log, columns.topic))]
        if problems
        else []
    )
    empty = sum(is_empty(_quaternion(columns, row)) for row in range(len(columns)))
    lost += [Finding(Kind.EMPTY_ORIGIN, columns.topic, empty)] if empty else []
    changes = [(int(one.order[row]), _since_ns(one, row), one, row) for one in updates for row in range(len(one))]
    history, outside = _history(sheets, changes)
    lost += [Finding(Kind.OUTSIDE_UPDATES, updates[0].topic, outside)] if outside else []
    return Maps(history, frame, (*lost, *_told(columns.topic, history)))


def _reason(problem: LogError, log: str, topic: str) -> str:
    """What is wrong with a map, without log and topic."""
    return str(problem).removeprefix(f"{log}: topic {topic}: ")


def _history(
    sheets: Sequence[tuple[int, int, Sheet]], updates: Sequence[tuple[int, int, Columns, int]]
) -> tuple[MapHistory, int]:
    """Maps and updates in the order in which they were sent, and the number of updates that fit no map."""
    kept: list[tuple[int, Sheet]] = []
    outside, base, wait = 0, None, sorted(updates, key=lambda one: one[0], reverse=True)
    for order, since_ns, sheet in [*sheets, (sys.maxsize, 0, None)]:
        while wait and wait[-1][0] < order:
            _, at_ns, columns, row = wait.pop()
            update = _update(columns, row, base)
            outside += update is None
            if update is not None and kept[-1][1] != update:
                kept.append((at_ns, update))
        if sheet is not None and (not kept or kept[-1][1] != sheet):
            kept.append((since_ns, sheet))
        base = sheet
    return MapHistory(np.array([since for since, _ in kept]), tuple(one for _, one in kept)), outside


def _sheet(log: str, columns: Columns, row: int) -> Sheet:
    """One map message, checked."""
    where = f"{log}: topic {columns.topic}"
    resolution, origin = float(columns["resolution"][row]), tuple(float(columns[name][row]) for name in ("px", "py"))
    check_geometry(where, resolution, origin, yaw_of(where, _quaternion(columns, row), _REMEDY), _REMEDY)
    height, width, size = (int(one[row]) for one in (columns["height"], columns["width"], columns.owner_counts))
    if size != height * width or size == 0:
        raise LogError(f"{where}: expected a map of {height} x {width} cells, found {size}; record the map again")
    # a float32 of 0.1 is 0.10000000149 as a double: the shortest decimal was meant
    return Sheet(columns["data"][row], (height, width), float(str(np.float32(resolution))), (origin[0], origin[1]))


def _update(columns: Columns, row: int, base: Sheet | None) -> Sheet | None:
    """One update; None where it does not lie within the map."""
    x, y, width, height = (int(columns[name][row]) for name in ("x", "y", "width", "height"))
    if base is None or min(x, y) < 0 or min(width, height) < 1 or int(columns.owner_counts[row]) != width * height:
        return None
    rows, cols = base.shape
    if y + height > rows or x + width > cols:
        return None
    return Sheet(columns["data"][row], (height, width), None, corner=(y, x))


def _quaternion(columns: Columns, row: int) -> tuple[float, ...]:
    return tuple(float(columns[name][row]) for name in ("qx", "qy", "qz", "qw"))


def _since_ns(columns: Columns, row: int) -> int:
    """From when a map counts: its receipt, or its stamp where it was delivered late, as latched maps are."""
    received, stamp = int(columns.t_ns[row]), int(columns["stamp"][row])
    return stamp if received - _LATE_NS < stamp < received else received


def _told(topic: str, history: MapHistory) -> Findings:
    """That a map changes."""
    whole = [one for one in history.sheets if one.resolution_m is not None]
    if len(history.sheets) == 1:
        return ()
    shapes = list(dict.fromkeys(f"{columns} x {rows}" for rows, columns in (one.shape for one in whole)))
    cells = shapes[0] if len(shapes) == 1 else f"{shapes[0]} to {shapes[-1]}"
    updates = len(history.sheets) - len(whole)
    maps = f"{len(whole)} different maps" if len(whole) > 1 else "one map"
    detail = f"{maps} of {cells} cells" + (f", {counted(updates, 'update')}" if updates else "")
    return (Finding(Kind.MAP_CHANGES, topic, len(history.sheets), detail=detail),)


def placed_maps(maps: Maps, context: Context) -> MapHistory:
    """Maps in the fixed frame, which must not be rotated against the maps' frame.

    Args:
        maps: In their own frame.
        context: The frames.

    Raises:
        LogError: The fixed frame is rotated against the map's, or moves.
        FrameError: tf does not connect the frames.
    """
    frame, history = maps.frame, maps.history
    if not frame or context.is_fixed(frame):
        return history
    try:
        span = context.tree.span(context.fixed, frame)
        times = history.since_ns if span is None else np.array(span)
        into = context.tree.lookup(context.fixed, frame, times)
    except FrameError as error:
        raise FrameError(f"{context.log}: the map is given in frame {frame!r}: {error}") from error
    moved, yaw = into.translation_m[:, :2], into.yaw_rad
    finest = min(one.resolution_m for one in history.sheets if one.resolution_m is not None)
    if np.abs(yaw).max() > 1e-3 or np.abs(moved - moved[0]).max() > finest / 10:
        raise LogError(
            f"{context.log}: the map's frame {frame!r} is rotated against {context.fixed!r} or moves in it, so that "
            f"its cells cannot be kept; choose `frame` {frame}, or give a map in {context.fixed!r} with `map`"
        )
    return history.shifted(moved[0].tolist())
