"""How far one path is from others: path dissimilarity and the modified Hausdorff distance."""

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.paths import SampledPaths


def nearness(line_m: FloatArray, paths: SampledPaths, lattice: Lattice) -> dict[str, FloatArray]:
    """Compare a demonstrated path through centres of cells with drawn paths on the same cells.

    Distances are from centres of cells to the other path's segments; the mean is over the cells that a path passes.

    Args:
        line_m: (k, 2) m, centres of the demonstrated path's cells.
        paths: Drawn from a policy.
        lattice: Their states.

    Returns:
        (paths,) each: to_learnt_m, from_learnt_m, dissimilarity_m, hausdorff_m.
    """
    from shapely import LineString, distance, linestrings, points

    # Whatever a drawn path passes is a cell, whose distance to the demonstrated path is known once.
    seen = np.unique(paths.states)
    away = np.zeros(lattice.size)
    away[seen] = distance(points(lattice.xy_m[seen]), LineString(line_m))
    on_the_way = np.arange(paths.states.shape[1]) < paths.lengths[:, None]
    back = np.where(on_the_way, away[paths.states], 0.0).sum(axis=1) / paths.lengths
    there = distance(points(line_m)[None, :], linestrings(lattice.xy_m[paths.states])[:, None]).mean(axis=1)
    return {
        "to_learnt_m": there,
        "from_learnt_m": back,
        "dissimilarity_m": (there + back) / 2,
        "hausdorff_m": np.maximum(there, back),
    }
