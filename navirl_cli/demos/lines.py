"""Lines in the plane: their length, with fewer points, with more points."""

import numpy as np

from navirl_cli.arrays import FloatArray


def path_length_m(line_m: FloatArray) -> float:
    """Length of an (n, 2) line, m."""
    return float(np.hypot(*np.diff(line_m, axis=0).T).sum())


def thinned(line_m: FloatArray, spacing_m: float) -> FloatArray:
    """Points of an (n, 2) line at least a spacing apart, m: noise in place adds no length."""
    kept = [line_m[0]]
    for point in line_m:
        if np.hypot(*(point - kept[-1])) >= spacing_m:
            kept.append(point)
    return np.array(kept)


def divided(line_m: FloatArray, t_s: FloatArray, longest_m: float) -> tuple[FloatArray, FloatArray]:
    """A timed line with more points, so that no piece is longer than a given length; its own points stay.

    Args:
        line_m: (n, 2) m.
        t_s: (n,) s, or another quantity along the line.
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
