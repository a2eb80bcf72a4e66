"""What the segments of paths add to their properties: length, distance to people, path length in zones around them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from navirl_cli.arrays import FloatArray

#: Zones around a person (Hall, The Hidden Dimension, 1966): name, and the distance up to which they reach, m.
ZONES: tuple[tuple[str, float], ...] = (
    ("intimate", 0.45),
    ("personal", 1.2),
    ("social", 3.6),
    ("public", float("inf")),
)
#: Distances along a segment are sampled in so many pieces: of a cell's diagonal 9 mm each.
PIECES = 16


@dataclass(frozen=True, eq=False)
class Segments:
    """Properties of straight segments, arrays of one shape (...), each computed when it is first used."""

    #: (..., 2) m.
    start_m: FloatArray
    end_m: FloatArray
    #: (p, 2) m.
    people_m: FloatArray
    #: Subtracted from the distance between centres, m.
    robot_radius_m: float

    @cached_property
    def length_m(self) -> FloatArray:
        """Length of each segment, m."""
        length: FloatArray = np.hypot(self._along[..., 0], self._along[..., 1])
        return length

    @cached_property
    def least_m(self) -> FloatArray:
        """Smallest distance between the robot's shell and a person's centre, m, exact; NaN without people."""
        if len(self.people_m) == 0:
            return np.full(self.length_m.shape, np.nan)
        squared = np.maximum((self._along**2).sum(axis=-1), 1e-300)
        least = np.full(self.length_m.shape, np.inf)
        for person in self.people_m:
            share = np.clip(((person - self.start_m) * self._along).sum(axis=-1) / squared, 0.0, 1.0)
            away = self.start_m + share[..., None] * self._along - person
            least = np.minimum(least, np.hypot(away[..., 0], away[..., 1]))
        return least - self.robot_radius_m

    @property
    def distance_m2(self) -> FloatArray:
        """Integral of the distance to the nearest person along the segment, m^2; NaN without people."""
        return self._sampled[0]

    @property
    def zones_m(self) -> FloatArray:
        """(..., 4) path length in each of ZONES, m; NaN without people."""
        return self._sampled[1]

    @cached_property
    def _along(self) -> FloatArray:
        """(..., 2) from start to end, m."""
        return self.end_m - self.start_m

    @cached_property
    def _sampled(self) -> tuple[FloatArray, FloatArray]:
        """Integral of distances and path lengths in zones, as sums over pieces."""
        shape = self.length_m.shape
        if len(self.people_m) == 0:
            return np.full(shape, np.nan), np.full((*shape, len(ZONES)), np.nan)
        total = np.zeros(shape)
        zones = np.zeros((*shape, len(ZONES)))
        limits = np.array([limit for _, limit in ZONES])
        for piece in range(PIECES):
            middle = self.start_m + (piece + 0.5) / PIECES * self._along
            distance = np.full(shape, np.inf)
            for person in self.people_m:
                distance = np.minimum(distance, np.hypot(middle[..., 0] - person[0], middle[..., 1] - person[1]))
            distance -= self.robot_radius_m
            total += distance
            # Below the first limit: zone 0.
            zone = (distance[..., None] >= limits).sum(axis=-1)
            zones += zone[..., None] == np.arange(len(ZONES))
        return total * self.length_m / PIECES, zones * self.length_m[..., None] / PIECES
