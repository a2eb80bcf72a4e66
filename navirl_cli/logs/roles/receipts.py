"""Times of receipt that cannot be true, made good by stamps and by the order in the file."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, IntArray
from navirl_cli.logs.findings import Finding, Findings, Kind
from navirl_cli.logs.roles.clocks import NS_PER_S
from navirl_cli.logs.roles.tracks import Track

#: Times of receipt this far from the others, ns, are wrong where they are fewer than this share of all.
_ANOTHER_DAY_NS: Final = 3600 * NS_PER_S
_FEW: Final = 0.01
#: No clock shows a later time than this, ns: the year 2116.
_LATEST_NS: Final = 1 << 62
#: Where more than this share of the times of receipt go back by more than a second, they are no times.
_NONSENSE: Final = 0.2


def repaired(tracks: Sequence[Track], reference: Track) -> tuple[list[Track], Findings]:
    """Replace times of receipt that cannot be true.

    A time is wrong if it is 0 while others are not, if it lies beyond the year 2116, or if it is one of a few that
    are more than an hour from all others. All are wrong if they are equal, or if they go back again and again. A wrong
    time is replaced by the message's stamp, shifted by the offset of its neighbours, or interpolated by the places in
    the file.

    Args:
        tracks: All of the recording.
        reference: Whose stamps are the recording's clock; one of the tracks.

    Returns:
        The tracks in the same order, and a finding if any time was wrong.
    """
    received = np.concatenate([track.received_ns for track in tracks])
    order = np.concatenate([track.order for track in tracks])
    wrong = wrong_receipts(received)
    if _are_nonsense(received[~wrong], order[~wrong]) and reference.is_stamped:
        wrong[:] = True
    if not wrong.any():
        return list(tracks), ()
    parts = np.split(wrong, np.cumsum([len(track) for track in tracks])[:-1])
    known = _filled(
        reference, next(part for track, part in zip(tracks, parts, strict=True) if track is reference), None
    )
    fixed = [_filled(track, part, known) for track, part in zip(tracks, parts, strict=True)]
    # messages of tf stand once for each pair of frames
    count = len(np.unique(order[wrong]))
    if wrong.all():
        return fixed, (Finding(Kind.NO_RECEIPTS, "the recorder's clock"),)
    return fixed, (Finding(Kind.WRONG_RECEIPTS, "the recorder's clock", count, detail=_shown(received[wrong])),)


def wrong_receipts(received_ns: IntArray) -> BoolArray:
    """(n,) which times of receipt cannot be true, by themselves."""
    wrong: BoolArray = (received_ns < 0) | (received_ns > _LATEST_NS)
    if len(received_ns) > 1 and (received_ns == received_ns[0]).all():
        return np.ones(len(received_ns), dtype=np.bool_)
    some = received_ns[~wrong]
    if some.size and np.median(some[some > 0] if (some > 0).any() else some) > _ANOTHER_DAY_NS:
        wrong |= received_ns == 0
    rows = np.flatnonzero(~wrong)
    rows = rows[np.argsort(received_ns[rows], kind="stable")]
    groups = np.split(rows, np.flatnonzero(np.diff(received_ns[rows]) > _ANOTHER_DAY_NS) + 1)
    for group in groups:
        if len(groups) > 1 and len(group) <= max(1, _FEW * len(rows)):
            wrong[group] = True
    return wrong


def _are_nonsense(received_ns: IntArray, order: IntArray) -> bool:
    """Whether times of receipt are no times."""
    steps = np.diff(received_ns[np.argsort(order, kind="stable")].astype(np.float64))
    return bool(len(steps) and (steps < -NS_PER_S).mean() > _NONSENSE)


def _filled(track: Track, wrong: BoolArray, known: Track | None) -> Track:
    """A track whose wrong times of receipt are replaced, through stamps or through the places of a known track."""
    if not wrong.any():
        return track
    received, right = track.received_ns.copy(), np.flatnonzero(~wrong)
    stamps = track.stamp_ns
    by_place = None if known is None else _by_place(track.order, known)
    apart = by_place is not None and bool((by_place == by_place[0]).all())  # written topic by topic
    if stamps is not None and (right.size or by_place is None or apart):
        offset = received[right] - stamps[right] if right.size else np.zeros(1, dtype=np.int64)
        nearest = _nearest(right, np.arange(len(track))) if right.size else np.zeros(len(track), dtype=np.int64)
        good = wrong & (stamps != 0)
        received[good] = (stamps + offset[nearest])[good]
        wrong = wrong & ~good
    if by_place is not None:
        received[wrong] = by_place[wrong]
    elif wrong.any():
        rows = np.flatnonzero(~wrong)
        if rows.size:
            received[wrong] = received[rows[_nearest(rows, np.flatnonzero(wrong))]]
    return replace(track, received_ns=received)


def _by_place(order: IntArray, known: Track) -> IntArray:
    """(n,) ns of receipt at places in the file, between those of a known track."""
    begin = known.received_ns[0]
    between = np.interp(order, known.order, (known.received_ns - begin).astype(np.float64))
    received: IntArray = begin + np.round(between).astype(np.int64)
    return received


def _nearest(among: IntArray, rows: IntArray) -> IntArray:
    """For each row the place of the nearest one among ascending rows."""
    after = np.clip(np.searchsorted(among, rows), 0, len(among) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(among[before] - rows) <= np.abs(among[after] - rows), before, after)


def _shown(received_ns: IntArray) -> str:
    """An example of a wrong time."""
    found = int(received_ns[0])
    if found < 0:
        return f"{found + (1 << 64)} ns"
    try:
        return f"{datetime.fromtimestamp(found / NS_PER_S, UTC):%Y-%m-%d %H:%M:%S} UTC" if found else "0"
    except (ValueError, OverflowError, OSError):
        return f"{found} ns"
