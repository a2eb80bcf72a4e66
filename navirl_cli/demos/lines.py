"""Lines in the plane: length, and a line without shaking in place."""

import numpy as np

from navirl_cli.arrays import FloatArray


def path_length_m(line_m: FloatArray) -> float:
    """Length of an (n, 2) line, m."""
    return float(np.hypot(*np.diff(line_m, axis=0).T).sum())


def thinned(line_m: FloatArray, spacing_m: float) -> FloatArray:
    """The points of an (n, 2) line at which it got on by a spacing, m: what shakes in place adds no length."""
    kept = [line_m[0]]
    for point in line_m:
        if np.hypot(*(point - kept[-1])) >= spacing_m:
            kept.append(point)
    return np.array(kept)


def divided(line_m: FloatArray, t_s: FloatArray, longest_m: float) -> tuple[FloatArray, FloatArray]:
    """A timed line with points so dense that no piece is longer than a length; its own points stay.

    Args:
        line_m: (n, 2) m.
        t_s: (n,) s, or whatever else runs along the line.
        longest_m: Longest piece, m.
    """
    length = np.hypot(*np.diff(line_m, axis=0).T)
    pieces = np.maximum(np.ceil(length / longest_m), 1).astype(np.int64)
    segment = np.repeat(np.arange(len(pieces)), pieces)
    share = (np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[segment]
    place = np.append(segment + share, len(pieces))
    numbers = np.arange(len(t_s))
    line = np.stack([np.interp(place, numbers, axis) for axis in line_m.T], axis=1)
    return line, np.interp(place, numbers, t_s)
