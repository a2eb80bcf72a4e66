"""Goals: announced as places, as the ends of plans, or by the status of a navigation action alone."""

from typing import Final

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context
from navirl_cli.logs.roles.people import placed
from navirl_cli.logs.roles.poses import Poses

#: action_msgs/GoalStatus: the goal was reached; this and larger numbers end it.
_SUCCEEDED: Final = 4
#: A goal whose action ended with no more than this to drive was reached, m.
_REACHED_M: Final = 0.5


def goals_of(columns: Columns | None, context: Context, poses: Poses | None) -> tuple[IntArray, FloatArray, Findings]:
    """The goals announced.

    Args:
        columns: Messages with goals; a plan's goal is its end.
        context: The frames.
        poses: The robot's, which place the goals of an action.

    Returns:
        (g,) ns, (g, 2) m, and what was found out.
    """
    if columns is None or len(columns) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2)), ()
    if "px" not in columns:
        return _by_action(columns, poses)
    if columns.counts is not None:
        columns = columns.last_entries()
    t_ns = columns.t_ns
    xy, good, lost = placed(columns, context, t_ns, np.ones(len(t_ns), dtype=np.bool_))
    order = np.argsort(t_ns[good], kind="stable")
    return t_ns[good][order], xy[good][order], lost


def _by_action(columns: Columns, poses: Poses | None) -> tuple[IntArray, FloatArray, Findings]:
    """The goals of an action, each placed where the robot was when it was reached."""
    spans = _status_spans(columns) if "status" in columns else _feedback_spans(columns)
    reached = [(begin, end) for begin, end in spans if end is not None] if poses else []
    findings = []
    if len(reached) < len(spans):
        findings.append(Finding(Kind.GOALS_NOT_REACHED, columns.topic, len(spans) - len(reached)))
    if not reached or poses is None:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2)), tuple(findings)
    begins, ends = np.array(reached, dtype=np.int64).T
    xy = np.stack([np.interp(ends, poses.t_ns, axis) for axis in poses.xy_m.T], axis=1)
    order = np.argsort(begins, kind="stable")
    return begins[order], xy[order], (*findings, Finding(Kind.GOALS_BY_ACTION, columns.topic))


def _status_spans(columns: Columns) -> list[tuple[int, int | None]]:
    """When each goal was first listed, ns, and when it was reached; None where it was not."""
    spans: dict[int, tuple[int, int | None]] = {}
    ended: set[int] = set()
    rows = zip(columns["accepted"].tolist(), columns["status"].tolist(), columns.t_ns[columns.owner], strict=True)
    for accepted, status, t_ns in rows:
        begin, _ = spans.setdefault(accepted, (int(t_ns), None))
        if status >= _SUCCEEDED and accepted not in ended:
            ended.add(accepted)
            spans[accepted] = (begin, int(t_ns) if status == _SUCCEEDED else None)
    return list(spans.values())


def _feedback_spans(columns: Columns) -> list[tuple[int, int | None]]:
    """The same by the feedback that a goal gave, which ends near the goal."""
    rows: dict[bytes, list[int]] = {}
    for row, number in enumerate(columns["goal"].astype(np.uint8)):
        rows.setdefault(number.tobytes(), []).append(row)
    return [
        (int(columns.t_ns[own[0]]), int(columns.t_ns[own[-1]]) if columns["left"][own[-1]] <= _REACHED_M else None)
        for own in rows.values()
    ]
