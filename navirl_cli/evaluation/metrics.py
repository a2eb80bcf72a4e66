"""Properties of a path (Fig. 7): length, distance to people, area between it and the nominal path."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.demos.grid import FloatArray
from navirl_cli.demos.lines import path_length_m


@dataclass(frozen=True)
class Metric:
    """What a number in a table is."""

    name: str
    label: str
    unit: str
    definition: str


#: In the order of the paper's figure; names are fields of :class:`PathMetrics`.
METRICS: tuple[Metric, ...] = (
    Metric("length_m", "path length", "m", "sum of the lengths of the path's segments"),
    Metric(
        "min_distance_m",
        "min. distance",
        "m",
        "least distance between the robot's shell and a person's centre, over all segments and people",
    ),
    Metric("area_m2", "area under path", "m²", "unsigned area between the path and the nominal path"),
)


@dataclass(frozen=True)
class PathMetrics:
    """Properties of one path; definitions in METRICS."""

    length_m: float
    #: NaN where there is nobody.
    min_distance_m: float
    area_m2: float


def path_metrics(line_m: FloatArray, nominal_m: FloatArray, people_m: FloatArray, robot_radius_m: float) -> PathMetrics:
    """Measure a path.

    Args:
        line_m: (n, 2) m, the path.
        nominal_m: (k, 2) m, the nominal path as a line.
        people_m: (p, 2) m.
        robot_radius_m: Taken off the distance between centres, m.

    Returns:
        The metrics.
    """
    distance = center_distance_m(line_m, people_m)
    return PathMetrics(path_length_m(line_m), distance - robot_radius_m, area_between_m2(line_m, nominal_m))


def center_distance_m(line_m: FloatArray, people_m: FloatArray) -> float:
    """Least distance between an (n, 2) line (segments, not only corners) and (p, 2) points, m; NaN for p = 0."""
    if len(people_m) == 0:
        return float("nan")
    start, along = line_m[:-1, None, :], np.diff(line_m, axis=0)[:, None, :]
    squared = np.maximum((along**2).sum(axis=2), 1e-300)
    share = np.clip(((people_m[None] - start) * along).sum(axis=2) / squared, 0.0, 1.0)
    away = start + share[..., None] * along - people_m[None]
    return float(np.sqrt((away**2).sum(axis=2).min()))


def area_between_m2(line_m: FloatArray, nominal_m: FloatArray) -> float:
    """Area between two lines with about the same ends, unsigned: where they cross, areas do not cancel.

    The two lines and the joins of their ends cut the plane into faces; the area is that of all bounded ones.

    Args:
        line_m: (n, 2) m.
        nominal_m: (k, 2) m.

    Returns:
        Area in m^2. Source: Kollmitz et al., Fig. 7; the faces as in shapely's polygonize.
    """
    from shapely import LineString, node, polygonize

    ring = np.concatenate([line_m, nominal_m[::-1], line_m[:1]])
    faces = polygonize([node(LineString(ring))])
    return float(faces.area)
