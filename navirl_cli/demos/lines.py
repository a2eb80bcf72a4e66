"""Lines in the plane: length, and a line without shaking in place."""

import numpy as np

from navirl_cli.demos.grid import FloatArray


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
