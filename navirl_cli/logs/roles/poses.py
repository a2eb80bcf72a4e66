"""Where the robot was: from odometry through tf, from a localisation's poses, or from tf alone."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.recording import Jump
from navirl_cli.logs.roles.clocks import NS_PER_S
from navirl_cli.logs.roles.columns import Columns
from navirl_cli.logs.roles.context import Context, in_one_frame, plausible
from navirl_cli.logs.roles.plausible import PLACES
from navirl_cli.logs.roles.times import without_repeats
from navirl_cli.logs.tf.rotations import normalised
from navirl_cli.logs.tf.transforms import Transforms

#: Gaps of tf that are longer are not interpolated over, ns.
GAP_NS: Final = 5 * NS_PER_S
#: How far outside of tf's stamps odometry is still placed, ns.
_HOLD_NS: Final = NS_PER_S
#: Window over which the localisation's corrections count as one, ns, and the size from which they are a jump, m.
_WINDOW_NS: Final = NS_PER_S // 2
JUMP_M: Final = 0.25
#: No robot among people drives faster, m/s.
_FASTEST_M_S: Final = 3.0

#: Two tracks lie farther apart than this, m. At least so many jumps, such a share of the steps, lead from one to the
#: other, and such a share of these lead back again.
_APART_M: Final = 0.1
_MIN_JUMPS: Final = 10
_JUMPING: Final = 0.05
_RETURNING: Final = 0.8

_POSITION: Final = ("px", "py", "pz")
_ROTATION: Final = ("qx", "qy", "qz", "qw")


@dataclass(frozen=True, eq=False)
class Poses:
    """The robot's poses in the fixed frame."""

    #: (n,) ns, increasing; (n, 2) m; (n,) rad.
    t_ns: IntArray
    xy_m: FloatArray
    yaw_rad: FloatArray
    #: (n, 2) m/s forward and to the left, or None.
    velocity_m_s: FloatArray | None
    jumps: tuple[Jump, ...]
    #: The robot's own frame.
    base: str
    #: (u,) ns of odometry that tf does not place.
    unplaced_ns: IntArray


def poses_of(columns: Columns | None, context: Context) -> tuple[Poses, Findings]:
    """Bring the robot's poses into the fixed frame.

    Args:
        columns: Messages with poses, in order of time; None to take them from tf.
        context: The frames.

    Raises:
        FrameError: tf does not connect the frames, or covers none of the poses' times.
        LogError: No pose is plausible, or there are those of two robots.
    """
    if columns is None:
        return _from_tf(context)
    columns, frame, others = in_one_frame(columns)
    if apart := _two_tracks(columns.stacked(*_POSITION)[:, :2]):
        count, apart_m = apart
        raise LogError(
            f"{context.log}: topic {columns.topic}: poses jump to and fro between two tracks {apart_m:.2f} m apart "
            f"({count} times); two nodes seem to publish there; record one of them only, or name another topic with "
            "`topic` odometry=/name"
        )
    columns, implausible = plausible(columns, PLACES, *_POSITION, quaternions=columns.stacked(*_ROTATION))
    if len(columns) == 0:
        why = next((f" ({one.detail})" for one in implausible if one.detail), "")
        raise LogError(
            f"{context.log}: topic {columns.topic}: expected poses, found none that are finite{why}; record the "
            "odometry again, or name another topic with `topic` odometry=/name"
        )
    columns, repeated = without_repeats(columns)
    base, assumed = context.base_frame(str(columns["child"][0]) if "child" in columns else "")
    rows, uncovered = _covered(columns.topic, base, columns.t_ns, frame, context)
    unplaced_ns = np.delete(columns.t_ns, rows)
    columns = columns.rows(rows)
    t_ns = columns.t_ns
    poses = Transforms(normalised(columns.stacked(*_ROTATION)), columns.stacked(*_POSITION))
    into = context.tree.lookup(context.fixed, frame, t_ns)
    placed = into.after(poses)
    jumps = _leaps(t_ns, poses.translation_m[:, :2])
    if not context.is_fixed(frame):
        span = context.tree.span(context.fixed, frame) or (int(t_ns[0]), int(t_ns[-1]))
        earlier = context.tree.lookup(context.fixed, frame, np.clip(t_ns - _WINDOW_NS, *span))
        moved = into.apply(poses.translation_m) - earlier.apply(poses.translation_m)
        corrections = _corrections(t_ns, np.hypot(*moved[:, :2].T))
        jumps = tuple(sorted((*jumps, *corrections), key=lambda jump: jump.t_ns))
    velocity = columns.stacked("vx", "vy") if "vx" in columns else None
    if velocity is not None and not (np.isfinite(velocity).all() and velocity.any()):
        velocity = None
    found = (*others, *implausible, *repeated, *assumed, *uncovered)
    return Poses(t_ns, placed.translation_m[:, :2], placed.yaw_rad, velocity, jumps, base, unplaced_ns), found


def _from_tf(context: Context) -> tuple[Poses, Findings]:
    """The poses at which tf itself was stamped."""
    base, assumed = context.base_frame("")
    try:
        t_ns = context.tree.stamps(context.fixed, base)
    except FrameError as error:
        raise FrameError(
            f"{context.log}: no odometry, and tf does not give poses in its place: {error}; record the robot's odometry"
        ) from error
    if len(t_ns) < 2:
        raise LogError(
            f"{context.log}: no odometry, and in tf {base!r} does not move on {context.fixed!r}; record the robot's "
            "odometry"
        )
    inside, lost = _in_gaps(base, t_ns, context)
    unplaced_ns, t_ns = t_ns[inside], t_ns[~inside]
    placed = context.tree.lookup(context.fixed, base, t_ns)
    xy = placed.translation_m[:, :2]
    found = (*assumed, *lost, Finding(Kind.POSES_FROM_TF, base))
    return Poses(t_ns, xy, placed.yaw_rad, None, _leaps(t_ns, xy), base, unplaced_ns), found


def _covered(topic: str, base: str, t_ns: IntArray, frame: str, context: Context) -> tuple[IntArray, Findings]:
    """Rows at which tf places a frame, and what was found out about the others."""
    if context.is_fixed(frame):
        return np.arange(len(t_ns)), ()
    tree, fixed = context.tree, context.fixed
    try:
        span = tree.span(fixed, frame)
    except FrameError as error:
        raise FrameError(f"{context.log}: {topic} places {base!r} in frame {frame!r}: {error}") from error
    if span is None:
        return np.arange(len(t_ns)), ()
    covered = (t_ns >= span[0] - _HOLD_NS) & (t_ns <= span[1] + _HOLD_NS)
    if not covered.any():
        raise FrameError(
            f"{context.log}: the transform from {frame!r} to {fixed!r} is known at no time of {topic}; check that tf "
            "and odometry are stamped by the same clock, or try `time` log"
        )
    findings = []
    if not covered.all():
        findings.append(Finding(Kind.UNCOVERED_POSES, frame, int((~covered).sum())))
    rows = np.flatnonzero(covered)
    inside, lost = _in_gaps(frame, t_ns[rows], context)
    rows = rows[~inside]
    for child, parents in tree.several_parents(fixed, frame, t_ns[rows]).items():
        findings.append(Finding(Kind.SEVERAL_PARENTS, child, detail=", ".join(parents)))
    return rows, (*findings, *lost)


def _in_gaps(frame: str, t_ns: IntArray, context: Context) -> tuple[BoolArray, Findings]:
    """(n,) which times lie in gaps of tf that are too long, and their loss."""
    inside: BoolArray = context.tree.largest_gap_ns(context.fixed, frame, t_ns) > GAP_NS
    if not inside.any():
        return inside, ()
    return inside, (Finding(Kind.POSES_IN_GAPS, frame, int(inside.sum()), GAP_NS / NS_PER_S),)


def _two_tracks(xy_m: FloatArray) -> tuple[int, float] | None:
    """How often and how far positions (n, 2) m jump to and fro between two tracks; None where they do not."""
    moved = np.diff(xy_m[np.isfinite(xy_m).all(axis=1)], axis=0)
    size = np.hypot(*moved.T)
    jumps = np.flatnonzero(size > _APART_M)
    if len(jumps) < max(_MIN_JUMPS, _JUMPING * len(moved)):
        return None
    there, back = moved[jumps[:-1]], moved[jumps[1:]]
    returns = np.hypot(*(there + back).T) < np.maximum(size[jumps[:-1]], size[jumps[1:]]) / 2
    # of a jump there and the next one back, the difference holds the distance twice and the motion not at all
    apart_m = float(np.median(np.hypot(*(there - back)[returns].T)) / 2) if returns.any() else 0.0
    return (len(jumps), apart_m) if returns.mean() > _RETURNING else None


def _corrections(t_ns: IntArray, moved_m: FloatArray) -> tuple[Jump, ...]:
    """Jumps by how far the localisation's correction moves the robot within the window, (n,) m."""
    above = np.flatnonzero(np.diff(np.concatenate([[False], moved_m > JUMP_M, [False]]).astype(np.int8)))
    spans = above.reshape(-1, 2).tolist()
    return tuple(Jump(int(t_ns[first]), float(moved_m[first:stop].max())) for first, stop in spans)


def _leaps(t_ns: IntArray, xy_m: FloatArray) -> tuple[Jump, ...]:
    """Jumps by steps that no robot drives."""
    steps = np.hypot(*np.diff(xy_m, axis=0).T)
    rows = np.flatnonzero(steps > JUMP_M + _FASTEST_M_S * np.diff(t_ns) / NS_PER_S)
    return tuple(Jump(int(t_ns[row + 1]), float(steps[row])) for row in rows)
