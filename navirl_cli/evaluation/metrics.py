"""The metrics: each is declared here, with what it needs and the function that computes it, and nowhere else.

To add one, write the function, append a :class:`Metric` to METRICS and write a test. Tables, files, options,
completions and the page of metrics read METRICS.
"""

from collections.abc import Mapping

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.evaluation.lines import LEAVES_M, Lines, zone_text
from navirl_cli.evaluation.metric import Metric, Need
from navirl_cli.evaluation.motion import PERSON_RADIUS_M, STILL_M_S, Drive
from navirl_cli.evaluation.policy_paths import Visits
from navirl_cli.evaluation.segments import ZONES

_PAPER = "Kollmitz et al., IROS 2020, Fig. 7"
_HALL = "zones: Hall, The Hidden Dimension, 1966"
_FRANCIS = "Francis et al., Principles and Guidelines for Evaluating Social Robot Navigation Algorithms, 2023"
_HUNAV = "Perez-Higueras et al., HuNavSim, 2023"
#: When smoothed derivatives do not exist.
_SHORT = "shorter than 1.1 s"


#: The paper's three, in the order of its figure.
PAPER_METRICS: tuple[Metric, ...] = (
    Metric(
        "length_m",
        "path length",
        "m",
        "sum of the lengths of the path's segments",
        _PAPER,
        lines=lambda lines: lines.length_m,
        exact=lambda visits: visits.length_m,
    ),
    Metric(
        "min_distance_m",
        "min. distance",
        "m",
        "smallest distance between the robot's shell and a person's centre, over all segments and people",
        _PAPER,
        (Need.PEOPLE,),
        lines=lambda lines: lines.min_distance_m,
    ),
    Metric(
        "area_m2",
        "area under path",
        "m²",
        "area between the path and the nominal path; areas on both sides add up",
        _PAPER,
        lines=lambda lines: lines.area_m2,
    ),
)


def _zone_metrics() -> list[Metric]:
    """Path length, share of the path length, and time in each zone."""
    found = []
    for number, (zone, _) in enumerate(ZONES):
        where = f"the robot's shell is {zone_text(number)} from the nearest person's centre"

        def length(path: Lines, number: int = number) -> FloatArray:
            return path.zones_m[:, number]

        def share(path: Lines, number: int = number) -> FloatArray:
            return path.zones_m[:, number] / path.length_m

        def time(drive: Drive, number: int = number) -> float:
            return float(drive.zones_s[number])

        def expected(visits: Visits, number: int = number) -> float:
            return float(visits.zones_m[number])

        people, times = (Need.PEOPLE,), (Need.TIMES, Need.PEOPLE)
        length_label, share_label, time_label = (f"{what} in {zone} zone" for what in ("path length", "share", "time"))
        found += [
            Metric(
                f"{zone}_m",
                length_label,
                "m",
                f"length of the path where {where}",
                _HALL,
                people,
                lines=length,
                exact=expected,
            ),
            Metric(
                f"{zone}_share", share_label, "1", f"share of the path length where {where}", _HALL, people, lines=share
            ),
            Metric(f"{zone}_s", time_label, "s", f"time during which {where}", _HALL, times, drive=time),
        ]
    return [*found, *_intrusions()]


def _intrusions() -> list[Metric]:
    """Share of the time in zones near people, and how often they were entered."""
    found = []
    for number, (zone, limit_m) in enumerate(ZONES[:-1]):

        def share(drive: Drive, number: int = number) -> float:
            return float(drive.zones_s[number]) / drive.duration_s

        def entries(drive: Drive, number: int = number) -> float:
            return float(drive.intrusions(number))

        needs = (Need.TIMES, Need.PEOPLE)
        where = f"the robot's shell is {zone_text(number)} from the nearest person's centre"
        near = f"the distance of the robot's shell from the nearest person's centre fell below {limit_m:g} m"
        found += [
            Metric(
                f"{zone}_time_share",
                f"time share in {zone} zone",
                "1",
                f"share of the time during which {where}",
                f"{_HUNAV} (space intrusions, there in per cent)",
                needs,
                drive=share,
            ),
            Metric(
                f"{zone}_intrusions",
                f"intrusions into {zone} zone",
                "1",
                f"how often {near}, or was below at the start",
                "Tsoi et al., SEAN 2.0, 2022 (there by who approaches)",
                needs,
                drive=entries,
            ),
        ]
    return found


#: All metrics, in the order of the tables.
METRICS: tuple[Metric, ...] = (
    *PAPER_METRICS,
    Metric(
        "min_center_distance_m",
        "min. distance of centres",
        "m",
        "smallest distance between the robot's centre and a person's centre",
        needs=(Need.PEOPLE,),
        lines=lambda lines: lines.min_distance_m + lines.robot_radius_m,
    ),
    Metric(
        "mean_distance_m",
        "mean distance",
        "m",
        "mean along the path of the distance between the robot's shell and the nearest person's centre",
        f"{_HUNAV} (there over time, to the person's shell)",
        (Need.PEOPLE,),
        lines=lambda lines: lines.mean_distance_m,
    ),
    Metric(
        "compliance",
        "space compliance",
        "1",
        "share of the path length outside the intimate zone",
        "Kapoor et al., SocNavGym, 2023 (there over steps, between centres)",
        (Need.PEOPLE,),
        lines=lambda lines: 1 - lines.zones_m[:, 0] / lines.length_m,
    ),
    *_zone_metrics(),
    Metric(
        "onset_m",
        "avoidance onset",
        "m",
        "distance to the first person, along the nominal path, from where the path has left the nominal path by "
        f"{LEAVES_M:g} m; negative behind the person",
        needs=(Need.PEOPLE,),
        lines=lambda lines: lines.onset_m,
        undefined=f"the path does not leave the nominal path by {LEAVES_M:g} m, or does not start on it",
    ),
    Metric(
        "heading_rad",
        "heading change",
        "rad",
        "sum of the absolute changes of direction, between points 10 cm apart or between moves on the grid",
        f"{_HUNAV} (there of the robot's heading, pose by pose)",
        lines=lambda lines: lines.heading_rad,
        exact=lambda visits: visits.heading_rad,
    ),
    Metric(
        "curvature_1_m",
        "mean curvature",
        "1/m",
        "heading change divided by path length",
        lines=lambda lines: lines.heading_rad / lines.length_m,
    ),
    Metric(
        "duration_s",
        "duration",
        "s",
        "time from the first pose to the last",
        needs=(Need.TIMES,),
        drive=lambda drive: drive.duration_s,
    ),
    Metric(
        "not_moving_s",
        "time not moving",
        "s",
        f"time during which the smoothed speed is below {STILL_M_S:g} m/s; turning on the spot counts",
        f"{_FRANCIS} (stalled time); {_HUNAV} (there 0.001 m/s, and turning is moving)",
        (Need.TIMES,),
        drive=lambda drive: drive.not_moving_s,
        undefined=_SHORT,
    ),
    Metric(
        "time_to_collision_s",
        "time to collision",
        "s",
        "least time, over the drive and all people, after which the robot's shell and a person of radius "
        f"{PERSON_RADIUS_M:g} m would touch if both kept their velocity, smoothed over 1.1 s; 0 where they touch",
        _FRANCIS,
        (Need.TIMES, Need.PEOPLE),
        drive=lambda drive: drive.time_to_collision_s,
        undefined=f"never on a course to collide, or {_SHORT}",
    ),
    Metric(
        "speed_m_s",
        "mean speed",
        "m/s",
        "mean magnitude of the velocity, smoothed over 1.1 s",
        needs=(Need.TIMES,),
        drive=lambda drive: drive.speed_m_s,
        undefined=_SHORT,
    ),
    Metric(
        "acceleration_m_s2",
        "mean acceleration",
        "m/s²",
        "mean magnitude of the first derivative of the velocity",
        needs=(Need.TIMES,),
        drive=lambda drive: drive.acceleration_m_s2,
        undefined=_SHORT,
    ),
    Metric(
        "jerk_m_s3",
        "mean jerk",
        "m/s³",
        "mean magnitude of the second derivative of the velocity",
        needs=(Need.TIMES,),
        drive=lambda drive: drive.jerk_m_s3,
        undefined=_SHORT,
    ),
    Metric(
        "contact_share",
        "contact",
        "1",
        "share of the time in contact",
        needs=(Need.WRENCH, Need.TIMES),
        drive=lambda drive: drive.contact_share,
    ),
    Metric(
        "peak_force_n",
        "peak force",
        "N",
        "largest horizontal force in contact, 0 without contact",
        needs=(Need.WRENCH,),
        drive=lambda drive: drive.peak_force_n,
    ),
    Metric(
        "impulse_n_s",
        "impulse",
        "N s",
        "sum over the contacts of the magnitude of the force's integral over time",
        needs=(Need.WRENCH, Need.TIMES),
        drive=lambda drive: drive.impulse_n_s,
    ),
    Metric(
        "work_j",
        "work",
        "J",
        "integral over the contacts of force times velocity: work done by the person",
        needs=(Need.WRENCH, Need.TIMES),
        drive=lambda drive: drive.work_j,
        undefined=_SHORT,
    ),
    Metric(
        "to_learnt_m",
        "demonstrated to learnt",
        "m",
        "mean over the demonstrated path's cells of the distance to the learnt path",
        "path dissimilarity, as in upo_nav_irl (Perez-Higueras et al.)",
        near=lambda near: near.to_learnt_m,
    ),
    Metric(
        "from_learnt_m",
        "learnt to demonstrated",
        "m",
        "mean over the learnt path's cells of the distance to the demonstrated path",
        near=lambda near: near.from_learnt_m,
    ),
    Metric(
        "dissimilarity_m",
        "dissimilarity",
        "m",
        "mean of the two: demonstrated to learnt, and learnt to demonstrated",
        near=lambda near: (near.to_learnt_m + near.from_learnt_m) / 2,
    ),
    Metric(
        "hausdorff_m",
        "mod. Hausdorff",
        "m",
        "the larger of the two: demonstrated to learnt, and learnt to demonstrated",
        "Dubuisson and Jain, ICPR 1994 (modified Hausdorff distance)",
        near=lambda near: np.maximum(near.to_learnt_m, near.from_learnt_m),
    ),
)
BY_NAME: Mapping[str, Metric] = {metric.name: metric for metric in METRICS}


def metric_named(name: str) -> Metric:
    """A metric of METRICS.

    Raises:
        KeyError: There is no such metric.
    """
    return BY_NAME[name]
