"""What can be measured of a path: names, units, definitions, and the values that follow from its line."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.lines import divided, path_length_m, thinned
from navirl_cli.evaluation.segments import ZONES, segments

#: Values of one path by metric; NaN where one does not exist.
Values = Mapping[str, float]
#: Driven lines are looked at in pieces no longer than this, m, and turns between points this far apart (a little less,
#: so that points of the grid stay).
PIECE_M, APART_M = 0.1, 0.0999
#: A path has left the nominal one where it is farther from it than this, m: a cell and a half.
LEAVES_M = 0.15


class Of(StrEnum):
    """What a metric needs."""

    LINE = "a path"
    PEOPLE = "a path and people"
    TIMES = "measured times"
    CONTACT = "a wrench"
    LEARNT = "a learnt policy"


@dataclass(frozen=True)
class Metric:
    """What a number in a table is."""

    name: str
    label: str
    unit: str
    definition: str
    of: Of = Of.LINE
    source: str = ""

    @property
    def heading(self) -> str:
        """Label and unit, where it has one."""
        return self.label if self.unit == "1" else f"{self.label} {self.unit}"


_HALL = "zones: Hall, The Hidden Dimension, 1966"
_PAPER = "Kollmitz et al., IROS 2020, Fig. 7"

#: The paper's three, in the order of its figure.
PAPER_METRICS: tuple[Metric, ...] = (
    Metric("length_m", "path length", "m", "sum of the lengths of the path's segments", source=_PAPER),
    Metric(
        "min_distance_m",
        "min. distance",
        "m",
        "least distance between the robot's shell and a person's centre, over all segments and people",
        Of.PEOPLE,
        _PAPER,
    ),
    Metric("area_m2", "area under path", "m²", "unsigned area between the path and the nominal path", source=_PAPER),
)


def _zone_text(number: int) -> str:
    """The borders of a zone."""
    low = ZONES[number - 1][1] if number else 0.0
    high = ZONES[number][1]
    return f"from {low:g} m on" if np.isinf(high) else f"{low:g} to {high:g} m" if number else f"below {high:g} m"


def _zone_metrics() -> list[Metric]:
    """Way, share of the way and time in each zone."""
    found = []
    for number, (name, _) in enumerate(ZONES):
        where = f"where the robot's shell is {_zone_text(number)} from the nearest person's centre"
        found += [
            Metric(f"{name}_m", f"way, {name}", "m", f"way {where}", Of.PEOPLE, _HALL),
            Metric(f"{name}_share", f"share, {name}", "1", f"share of the way {where}", Of.PEOPLE, _HALL),
            Metric(f"{name}_s", f"time, {name}", "s", f"time {where}", Of.TIMES, _HALL),
        ]
    return found


#: Everything that is measured, in the order of the tables.
METRICS: tuple[Metric, ...] = (
    *PAPER_METRICS,
    Metric(
        "mean_distance_m",
        "mean distance",
        "m",
        "mean over the way of the distance between the robot's shell and the nearest person's centre",
        Of.PEOPLE,
        "Perez-Higueras et al., HuNavSim, 2023",
    ),
    Metric(
        "compliance",
        "space compliance",
        "1",
        "share of the way outside of the intimate zone",
        Of.PEOPLE,
        "Kapoor et al., SocNavGym, 2023 (there over steps)",
    ),
    *_zone_metrics(),
    Metric(
        "heading_rad",
        "heading change",
        "rad",
        "sum of absolute changes of direction between points 10 cm apart, or between moves on the grid",
        source="Perez-Higueras et al., HuNavSim, 2023",
    ),
    Metric("curvature_1_m", "mean curvature", "1/m", "heading change over path length"),
    Metric("duration_s", "duration", "s", "time from the first pose to the last", Of.TIMES),
    Metric("speed_m_s", "mean speed", "m/s", "mean size of the smoothed velocity", Of.TIMES),
    Metric("acceleration_m_s2", "mean acceleration", "m/s²", "mean size of its first derivative", Of.TIMES),
    Metric("jerk_m_s3", "mean jerk", "m/s³", "mean size of its second derivative, the position's third", Of.TIMES),
    Metric("contact_share", "contact", "1", "share of the time in contact", Of.CONTACT),
    Metric("peak_n", "peak force", "N", "largest horizontal force in contact", Of.CONTACT),
    Metric("impulse_ns", "impulse", "N s", "sum over contacts of the size of the force's integral", Of.CONTACT),
    Metric("work_j", "work", "J", "integral over contacts of force times velocity: done by the person", Of.CONTACT),
    Metric(
        "to_learnt_m",
        "demo to learnt",
        "m",
        "mean over the demonstrated path of the nearest distance to a learnt one, both through centres of cells",
        Of.LEARNT,
        "path dissimilarity, as in upo_nav_irl (Perez-Higueras et al.)",
    ),
    Metric("from_learnt_m", "learnt to demo", "m", "the same from the learnt path to the demonstrated", Of.LEARNT),
    Metric("dissimilarity_m", "dissimilarity", "m", "mean of the two", Of.LEARNT),
    Metric(
        "hausdorff_m",
        "mod. Hausdorff",
        "m",
        "the larger of the two",
        Of.LEARNT,
        "Dubuisson and Jain, ICPR 1994 (modified Hausdorff distance)",
    ),
)
BY_NAME: Mapping[str, Metric] = {metric.name: metric for metric in METRICS}


def paper_values(line_m: FloatArray, nominal_m: FloatArray, people_m: FloatArray, robot_radius_m: float) -> Values:
    """The paper's three properties of a path.

    Args:
        line_m: (n, 2) m, the path.
        nominal_m: (k, 2) m, the nominal path as a line.
        people_m: (p, 2) m.
        robot_radius_m: Taken off the distance between centres, m.
    """
    return {
        "length_m": path_length_m(line_m),
        "min_distance_m": center_distance_m(line_m, people_m) - robot_radius_m,
        "area_m2": area_between_m2(line_m, nominal_m),
    }


def line_values(line_m: FloatArray, nominal_m: FloatArray, people_m: FloatArray, robot_radius_m: float) -> Values:
    """Everything that follows from a path's line and the people; arguments as of :func:`paper_values`."""
    found = dict(paper_values(line_m, nominal_m, people_m, robot_radius_m))
    length = found["length_m"]
    pieces, _ = divided(line_m, np.arange(float(len(line_m))), PIECE_M)
    parts = segments(pieces[:-1], pieces[1:], people_m, robot_radius_m)
    ways = parts.zones_m.sum(axis=0) if len(people_m) else np.full(len(ZONES), np.nan)
    found |= shares(length, float(parts.distance_m2.sum()) / length, ways)
    return found | turning(heading_change_rad(thinned(line_m, APART_M)), length)


def shares(length_m: float, mean_distance_m: float, zones_m: FloatArray) -> dict[str, float]:
    """Values that follow from the way in each zone."""
    found = {"mean_distance_m": mean_distance_m, "compliance": 1 - float(zones_m[0]) / length_m}
    for (name, _), way in zip(ZONES, zones_m.tolist(), strict=True):
        found |= {f"{name}_m": way, f"{name}_share": way / length_m}
    return found


def turning(heading_rad: float, length_m: float) -> dict[str, float]:
    """Values that follow from the heading change."""
    return {"heading_rad": heading_rad, "curvature_1_m": heading_rad / length_m}


def heading_change_rad(line_m: FloatArray) -> float:
    """Sum of the absolute changes of direction between the segments of an (n, 2) line, rad; rests do not count."""
    steps = np.diff(line_m, axis=0)
    steps = steps[(steps != 0).any(axis=1)]
    turned = np.angle(np.exp(1j * np.diff(np.arctan2(steps[:, 1], steps[:, 0]))))
    return float(np.abs(turned).sum())


def center_distance_m(line_m: FloatArray, people_m: FloatArray) -> float:
    """Least distance between an (n, 2) line (segments, not only corners) and (p, 2) points, m; NaN for p = 0."""
    if len(people_m) == 0:
        return float("nan")
    return float(segments(line_m[:-1], line_m[1:], people_m, 0.0).least_m.min())


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
    import shapely

    back = np.broadcast_to(nominal_m[::-1], (len(lines_m), *nominal_m.shape))
    rings = np.concatenate([lines_m, back, lines_m[:, :1]], axis=1)
    faces = shapely.polygonize(shapely.node(shapely.linestrings(rings))[:, None])
    area: FloatArray = shapely.area(faces)
    return area


def onset_m(line_m: FloatArray, nominal_m: FloatArray, people_m: FloatArray) -> float:
    """How far before the first person a path leaves the nominal one, along it.

    Args:
        line_m: (n, 2) m, the path.
        nominal_m: (k, 2) m.
        people_m: (p, 2) m.

    Returns:
        m; negative where it leaves behind the first person; NaN where there is nobody, or the path never leaves the
        nominal one by LEAVES_M, or starts away from it.
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
