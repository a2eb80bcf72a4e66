"""What the segments of paths add to a path's properties: length, distance to people, way in zones around them."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray

#: Zones around a person (Hall, The Hidden Dimension, 1966): name, and the distance up to which they reach, m.
ZONES: tuple[tuple[str, float], ...] = (
    ("intimate", 0.45),
    ("personal", 1.2),
    ("social", 3.6),
    ("public", float("inf")),
)
#: Distances along a segment are looked at in so many pieces: of a cell's diagonal 9 mm each.
PIECES = 16


@dataclass(frozen=True, eq=False)
class Segments:
    """Properties of straight segments, arrays of one shape (...)."""

    length_m: FloatArray
    #: Least distance between the robot's shell and a person's centre, m; NaN where there is nobody.
    least_m: FloatArray
    #: Integral of the distance to the nearest person over the way, m^2; NaN where there is nobody.
    distance_m2: FloatArray
    #: (..., 4) way in each of ZONES, m; zeros where there is nobody.
    zones_m: FloatArray


def segments(start_m: FloatArray, end_m: FloatArray, people_m: FloatArray, robot_radius_m: float) -> Segments:
    """Measure segments.

    The least distance is exact; integrals and zones are sums over pieces.

    Args:
        start_m: (..., 2) m.
        end_m: (..., 2) m.
        people_m: (p, 2) m.
        robot_radius_m: Taken off the distance between centres, m.
    """
    along = end_m - start_m
    length = np.hypot(along[..., 0], along[..., 1])
    if len(people_m) == 0:
        nothing = np.full(length.shape, np.nan)
        return Segments(length, nothing, nothing, np.zeros((*length.shape, len(ZONES))))
    squared = np.maximum((along**2).sum(axis=-1), 1e-300)
    least = np.full(length.shape, np.inf)
    for person in people_m:
        share = np.clip(((person - start_m) * along).sum(axis=-1) / squared, 0.0, 1.0)
        away = start_m + share[..., None] * along - person
        least = np.minimum(least, np.hypot(away[..., 0], away[..., 1]))
    total = np.zeros(length.shape)
    zones = np.zeros((*length.shape, len(ZONES)))
    limits = np.array([limit for _, limit in ZONES])
    for piece in range(PIECES):
        middle = start_m + (piece + 0.5) / PIECES * along
        distance = np.full(length.shape, np.inf)
        for person in people_m:
            distance = np.minimum(distance, np.hypot(middle[..., 0] - person[0], middle[..., 1] - person[1]))
        distance -= robot_radius_m
        total += distance
        # below the first limit: zone 0
        zone = (distance[..., None] >= limits).sum(axis=-1)
        zones += zone[..., None] == np.arange(len(ZONES))
    return Segments(length, least - robot_radius_m, total * length / PIECES, zones * length[..., None] / PIECES)
