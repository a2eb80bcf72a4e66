"""Properties of a policy's paths: of drawn ones, all at once, and expected values where visits give them exactly."""

from dataclasses import dataclass

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.demos.grid import MOVES, TURN_RAD, moves_along
from navirl_cli.evaluation.metrics import areas_m2
from navirl_cli.evaluation.segments import ZONES, Segments, segments
from navirl_cli.irl.lattice import Lattice
from navirl_cli.irl.paths import SampledPaths
from navirl_cli.irl.values import Policy


@dataclass(frozen=True, eq=False)
class Steps:
    """What every step of a lattice adds to a path's properties."""

    lattice: Lattice
    #: Arrays of shape (n, 8); steps that are not possible hold no meaning.
    segments: Segments

    @staticmethod
    def of(lattice: Lattice, people_m: FloatArray, robot_radius_m: float) -> "Steps":
        """Measure all steps.

        Args:
            lattice: The states.
            people_m: (p, 2) m.
            robot_radius_m: Taken off distances, m.
        """
        start = np.broadcast_to(lattice.xy_m[:, None], (lattice.size, 8, 2))
        end = start + MOVES * lattice.grid.resolution_m
        return Steps(lattice, segments(start, end, people_m, robot_radius_m))

    def expected(self, policy: Policy, start: int) -> dict[str, float]:
        """Exact expected values of what adds up along a path.

        Args:
            policy: On the same lattice.
            start: State in which paths start.

        Returns:
            length_m, heading_rad, and the way in each zone, as NAME_m.
        """
        flow = policy.visits_from(start)[:, None] * policy.probability
        found = {"length_m": float((flow * self.lattice.step_m).sum())}
        nobody = bool(np.isnan(self.segments.least_m).all())
        for number, (name, _) in enumerate(ZONES):
            way = float((flow * self.segments.zones_m[..., number]).sum())
            found[f"{name}_m"] = float("nan") if nobody else way
        # The next move is drawn in the state where this one ends; none is in the goal.
        turns = policy.probability @ TURN_RAD
        possible = flow > 0
        after = np.where(possible, self.lattice.neighbours, 0)
        found["heading_rad"] = float(
            (flow * np.take_along_axis(turns[after], np.arange(8)[None, :, None], 2)[..., 0]).sum()
        )
        return found

    def measured(self, paths: SampledPaths, nominal_m: FloatArray) -> dict[str, FloatArray]:
        """Properties of drawn paths.

        Args:
            paths: On the same lattice.
            nominal_m: (k, 2) m.

        Returns:
            (paths,) values by name: all that follow from a line and the people.
        """
        found = additive(self, paths)
        length = found["length_m"]
        found["area_m2"] = areas_m2(self.lattice.xy_m[paths.states], nominal_m)
        found["curvature_1_m"] = found["heading_rad"] / length
        found["compliance"] = 1 - found["intimate_m"] / length
        return found | {f"{name}_share": found[f"{name}_m"] / length for name, _ in ZONES}


def additive(steps: Steps, paths: SampledPaths) -> dict[str, FloatArray]:
    """Properties that follow from the steps one by one, by name, (paths,) each."""
    here, moves = paths.states[:, :-1], moves_along(steps.lattice.cells[paths.states])
    driven = moves >= 0
    parts = steps.segments

    def total(values: FloatArray) -> FloatArray:
        summed: FloatArray = np.where(driven, values[here, moves], 0.0).sum(axis=1)
        return summed

    length = np.where(driven, steps.lattice.step_m[moves], 0.0).sum(axis=1)
    both = driven[:, 1:] & driven[:, :-1]
    turned = np.where(both, TURN_RAD[moves[:, :-1], moves[:, 1:]], 0.0).sum(axis=1)
    found = {
        "length_m": length,
        "min_distance_m": np.where(driven, parts.least_m[here, moves], np.inf).min(axis=1),
        "mean_distance_m": total(parts.distance_m2) / length,
        "heading_rad": turned,
    }
    for number, (name, _) in enumerate(ZONES):
        found[f"{name}_m"] = total(parts.zones_m[..., number])
    if np.isnan(parts.least_m).all():  # nobody is there
        about_people = ("min_distance_m", "mean_distance_m", *(f"{name}_m" for name, _ in ZONES))
        found |= dict.fromkeys(about_people, np.full(len(length), np.nan))
    return found


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
