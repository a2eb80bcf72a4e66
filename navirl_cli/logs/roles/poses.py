"""Where the robot was: from odometry through tf, from a localisation's poses, or from tf alone."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.errors import FrameError, LogError
from navirl_cli.logs.recording import Jump
from navirl_cli.logs.roles.clocks import NS_PER_S, in_order
from navirl_cli.logs.roles.columns import Table
from navirl_cli.logs.roles.context import Setting
from navirl_cli.logs.roles.plausible import PLACES, sound_rotations

#: tf that is silent for longer is not bridged, ns.
HOLE_NS: Final = 5 * NS_PER_S
#: How far outside of tf's stamps odometry is still placed, ns.
_HOLD_NS: Final = NS_PER_S
#: Window over which the localisation's corrections count as one, ns, and the size from which they are a jump, m.
_WINDOW_NS: Final = NS_PER_S // 2
JUMP_M: Final = 0.25
#: No robot among people drives faster, m/s.
_FASTEST_M_S: Final = 3.0

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


def poses_of(table: Table | None, setting: Setting) -> Poses:
    """Bring the robot's poses into the fixed frame.

    Args:
        table: Messages with poses; None to take them from tf.
        setting: Clock and frames.

    Raises:
        FrameError: tf does not connect the frames, or covers none of the poses' times.
        LogError: No pose can be true.
    """
    if table is None:
        return _from_tf(setting)
    from scipy.spatial.transform import Rotation

    from navirl_cli.logs.tf.transforms import Transforms

    table, frame = setting.one_frame(table)
    turns = sound_rotations(table.stacked(*_ROTATION))
    table = setting.measured(table, PLACES, *_POSITION, turned=turns)
    if len(table) == 0:
        raise LogError(f"{setting.log}: topic {table.topic}: expected poses, found none that are finite")
    stamps = table.times(setting.clock)
    notes: list[str] = []
    rows = in_order(table.topic, stamps, notes)
    for text in notes:
        setting.note(text)
    said = str(table.columns["child"][0]) if "child" in table.columns else ""
    base = setting.base(said)
    rows = rows[_known(table.topic, base, stamps[rows], frame, setting)]
    t_ns = stamps[rows]
    table = table.rows(rows)
    poses = Transforms(Rotation.from_quat(table.stacked(*_ROTATION)), table.stacked(*_POSITION))
    into = setting.tree.lookup(setting.fixed, frame, t_ns)
    placed = into.after(poses)
    jumps = _leaps(t_ns, poses.translation_m[:, :2])
    if not setting.same(frame):
        span = setting.tree.span(setting.fixed, frame) or (int(t_ns[0]), int(t_ns[-1]))
        earlier = setting.tree.lookup(setting.fixed, frame, np.clip(t_ns - _WINDOW_NS, *span))
        moved = into.apply(poses.translation_m) - earlier.apply(poses.translation_m)
        corrections = _corrections(t_ns, np.hypot(*moved[:, :2].T))
        jumps = tuple(sorted((*jumps, *corrections), key=lambda jump: jump.t_ns))
    velocity = table.stacked("vx", "vy") if "vx" in table.columns else None
    if velocity is not None and not (np.isfinite(velocity).all() and velocity.any()):
        velocity = None
    return Poses(t_ns, placed.translation_m[:, :2], placed.yaw_rad, velocity, jumps, base)


def _from_tf(setting: Setting) -> Poses:
    """The poses at which tf itself was stamped."""
    base = setting.base("")
    try:
        t_ns = setting.tree.stamps(setting.fixed, base)
    except FrameError as error:
        raise FrameError(
            f"{setting.log}: no odometry, and tf does not tell poses in its place: {error}; record the robot's odometry"
        ) from error
    if len(t_ns) < 2:
        raise LogError(
            f"{setting.log}: no odometry, and in tf {base!r} does not move on {setting.fixed!r}; record the robot's "
            "odometry"
        )
    t_ns = t_ns[~_silent(base, t_ns, setting)]
    placed = setting.tree.lookup(setting.fixed, base, t_ns)
    xy = placed.translation_m[:, :2]
    setting.note(f"no odometry: poses are those of {base!r} in tf")
    return Poses(t_ns, xy, placed.yaw_rad, None, _leaps(t_ns, xy), base)


def _known(topic: str, base: str, t_ns: IntArray, frame: str, setting: Setting) -> IntArray:
    """Rows at which tf says where a frame is: before the localisation's first word nobody knows."""
    if setting.same(frame):
        return np.arange(len(t_ns))
    tree, fixed = setting.tree, setting.fixed
    try:
        span = tree.span(fixed, frame)
    except FrameError as error:
        raise FrameError(f"{setting.log}: {topic} places {base!r} in frame {frame!r}: {error}") from error
    if span is None:
        return np.arange(len(t_ns))
    known = (t_ns >= span[0] - _HOLD_NS) & (t_ns <= span[1] + _HOLD_NS)
    if not known.any():
        raise FrameError(
            f"{setting.log}: the transform from {frame!r} to {fixed!r} is known at no time of {topic}; check that tf "
            "and odometry are stamped by the same clock, or try --time log"
        )
    if not known.all():
        setting.note(f"{int((~known).sum())} poses lie outside the time that tf covers; left out")
    rows = np.flatnonzero(known)
    rows = rows[~_silent(frame, t_ns[rows], setting)]
    for child, parents in tree.several_parents(fixed, frame, t_ns[rows]).items():
        setting.note(f"tf gives {child!r} several parents in turn: {', '.join(parents)}")
    return rows


def _silent(frame: str, t_ns: IntArray, setting: Setting) -> BoolArray:
    """(n,) at which times tf has been silent on a frame for too long, which is noted as lost."""
    silent: BoolArray = setting.tree.largest_gap_ns(setting.fixed, frame, t_ns) > HOLE_NS
    if silent.any():
        setting.lose(
            f"{int(silent.sum())} poses lie where tf is silent for more than {HOLE_NS / NS_PER_S:g} s; left out"
        )
    return silent


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
