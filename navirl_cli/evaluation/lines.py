"""Paths of one scene as lines, and what follows from their geometry: length, distances, zones, turns, area, onset."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.lines import divided, thinned
from navirl_cli.evaluation.segments import ZONES, Segments

#: Lines are measured in pieces no longer than this, m. Turns are measured between points this far apart, a little less
#: than a cell, so that the points of paths on the grid stay.
PIECE_M, APART_M = 0.1, 0.0999
#: A path has left the nominal path where it is farther from it than this, m: a cell and a half.
LEAVES_M = 0.15
#: Coordinates of maps differ by less than this through rounding, m.
ROUNDING_M = 1e-12


@dataclass(frozen=True, eq=False)
class Lines:
    """Paths of one type in one scene; the properties have one value for each path."""

    #: (m, n, 2) m, map frame; a shorter path stays at its end.
    lines_m: FloatArray
    #: (k, 2) m, the nominal path.
    nominal_m: FloatArray
    #: (p, 2) m.
    people_m: FloatArray
    #: Subtracted from distances between centres, m.
    robot_radius_m: float

    def each(self, function: Callable[[FloatArray], float]) -> FloatArray:
        """(m,) values of a function of one (n, 2) line."""
        return np.array([function(line) for line in self.lines_m])

    @cached_property
    def length_m(self) -> FloatArray:
        """(m,) path length, m."""
        steps = np.diff(self.lines_m, axis=1)
        length: FloatArray = np.hypot(steps[..., 0], steps[..., 1]).sum(axis=1)
        return length

    @cached_property
    def min_distance_m(self) -> FloatArray:
        """(m,) smallest distance between the robot's shell and a person's centre, m; needs people."""
        start, end = self.lines_m[:, :-1], self.lines_m[:, 1:]
        least: FloatArray = Segments(start, end, self.people_m, self.robot_radius_m).least_m.min(axis=1)
        return least

    @cached_property
    def zones_m(self) -> FloatArray:
        """(m, 4) path length in each of ZONES, m; needs people."""
        return np.array([zones for zones, _ in self._in_pieces])

    @cached_property
    def mean_distance_m(self) -> FloatArray:
        """(m,) mean along the path of the distance between shell and nearest person, m; needs people."""
        return np.array([distance for _, distance in self._in_pieces]) / self.length_m

    @cached_property
    def heading_rad(self) -> FloatArray:
        """(m,) sum of the absolute changes of direction, rad."""
        return self.each(lambda line: heading_change_rad(thinned(line, APART_M)))

    @cached_property
    def area_m2(self) -> FloatArray:
        """(m,) area between path and nominal path, m^2."""
        return areas_m2(self.lines_m, self.nominal_m)

    @cached_property
    def onset_m(self) -> FloatArray:
        """(m,) distance to the first person where the path leaves the nominal path, m; NaN as in :func:`onset_m`."""
        return self.each(lambda line: onset_m(line, self.nominal_m, self.people_m))

    @cached_property
    def _in_pieces(self) -> list[tuple[FloatArray, float]]:
        """(4,) path length in each zone, m, and integral of the distance to the nearest person, m^2, of each path."""
        found = []
        for line in self.lines_m:
            pieces, _ = divided(line, np.arange(float(len(line))), PIECE_M)
            parts = Segments(pieces[:-1], pieces[1:], self.people_m, self.robot_radius_m)
            found.append((parts.zones_m.sum(axis=0), float(parts.distance_m2.sum())))
        return found


def zone_text(number: int) -> str:
    """The borders of a zone, as "0.45 to 1.2 m"."""
    low = ZONES[number - 1][1] if number else 0.0
    high = ZONES[number][1]
    if np.isinf(high):
        return f"{low:g} m or more"
    return f"{low:g} to {high:g} m" if number else f"less than {high:g} m"


def heading_change_rad(line_m: FloatArray) -> float:
    """Sum of the absolute changes of direction between the segments of an (n, 2) line, rad; rests do not count."""
    steps = np.diff(line_m, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    turned = np.angle(np.exp(1j * np.diff(np.arctan2(steps[:, 1], steps[:, 0]))))
    return float(np.abs(turned).sum())


def center_distance_m(line_m: FloatArray, people_m: FloatArray) -> float:
    """Smallest distance between an (n, 2) line (segments, not only corners) and (p, 2) points, m; NaN for p = 0."""
    if len(people_m) == 0:
        return float("nan")
    return float(Segments(line_m[:-1], line_m[1:], people_m, 0.0).least_m.min())


def area_between_m2(line_m: FloatArray, nominal_m: FloatArray) -> float:
    """Area between two lines with about the same ends, unsigned: where they cross, areas do not cancel.

    The two lines and the joins of their ends cut the plane into faces; the area is that of all bounded ones.

    Args:
        line_m: (n, 2) m.
        nominal_m: (k, 2) m.

    Returns:
        Area in m^2. Source: Kollmitz et al., Fig. 7; the faces as in shapely's polygonize.
    """
    return float(areas_m2(line_m[None], nominal_m)[0])


def areas_m2(lines_m: FloatArray, nominal_m: FloatArray) -> FloatArray:
    """Areas between many lines and a nominal one, each as :func:`area_between_m2`.

    Args:
        lines_m: (m, n, 2) m; a line may rest at its end.
        nominal_m: (k, 2) m.
    """
    areas = _areas_along(lines_m, nominal_m)
    if (turning := np.isnan(areas)).any():
        areas[turning] = _areas_of_faces(lines_m[turning], nominal_m)
    return areas


def _areas_along(lines_m: FloatArray, nominal_m: FloatArray) -> FloatArray:
    """(m,) areas beside a straight nominal path, as integrals of the distance from it.

    NaN for lines that somewhere move backwards along it, and for a nominal path with corners. Four of five paths of a
    policy in a hallway never move backwards, and cutting the plane into faces takes ten times as long.
    """
    ahead = nominal_m[-1] - nominal_m[0]
    length = float(np.hypot(*ahead))
    ahead = ahead / max(length, ROUNDING_M)
    if length == 0 or (np.abs(_beside(nominal_m, nominal_m[0], ahead)) > ROUNDING_M).any():
        return np.full(len(lines_m), np.nan)
    ends = ((0, 0), (1, 1))
    along = np.pad((lines_m - nominal_m[0]) @ ahead, ends)
    along[:, -1] = length
    steps = np.diff(along, axis=1)
    beside = np.abs(aside := np.pad(_beside(lines_m, nominal_m[0], ahead), ends))
    summed = beside[:, 1:] + beside[:, :-1]
    crossing = aside[:, 1:] * aside[:, :-1] < 0
    # Where a segment crosses the nominal path, two triangles are left of the trapezium.
    height = np.where(crossing, (beside[:, 1:] ** 2 + beside[:, :-1] ** 2) / np.where(crossing, summed, 1.0), summed)
    backwards = steps < -ROUNDING_M
    # The joins of the ends may lie on the nominal path: a robot starts somewhere within its cell.
    backwards[:, 0] &= beside[:, 1] > ROUNDING_M
    backwards[:, -1] &= beside[:, -2] > ROUNDING_M
    areas: FloatArray = np.where(backwards.any(axis=1), np.nan, (height * steps).sum(axis=1) / 2)
    return areas


def _beside(points_m: FloatArray, start_m: FloatArray, ahead: FloatArray) -> FloatArray:
    """(...) signed distances of (..., 2) points from the straight line through a point, m."""
    away = points_m - start_m
    beside: FloatArray = ahead[0] * away[..., 1] - ahead[1] * away[..., 0]
    return beside


def _areas_of_faces(lines_m: FloatArray, nominal_m: FloatArray) -> FloatArray:
    """(m,) areas of the bounded faces between lines and a nominal path."""
    import shapely

    back = np.broadcast_to(nominal_m[::-1], (len(lines_m), *nominal_m.shape))
    rings = np.concatenate([lines_m, back, lines_m[:, :1]], axis=1)
    faces = shapely.polygonize(shapely.node(shapely.linestrings(rings))[:, None])
    area: FloatArray = shapely.area(faces)
    return area


def onset_m(line_m: FloatArray, nominal_m: FloatArray, people_m: FloatArray) -> float:
    """How far before the first person a path leaves the nominal path, along the nominal path.

    Args:
        line_m: (n, 2) m, the path.
        nominal_m: (k, 2) m.
        people_m: (p, 2) m.

    Returns:
        m; negative where it leaves behind the first person; NaN where there are no people, where the path never leaves
        the nominal path by LEAVES_M, and where it starts away from it.
    """
    from shapely import LineString, distance, line_locate_point, points

    nominal = LineString(nominal_m)
    away = distance(points(line_m), nominal)
    if len(people_m) == 0 or away[0] > LEAVES_M or away.max() <= LEAVES_M:
        return float("nan")
    left = int(np.argmax(away > LEAVES_M))
    share = (LEAVES_M - away[left - 1]) / (away[left] - away[left - 1])
    where = line_m[left - 1] + share * (line_m[left] - line_m[left - 1])
    person = float(line_locate_point(nominal, points(people_m)).min())
    return person - float(line_locate_point(nominal, points(where)))
