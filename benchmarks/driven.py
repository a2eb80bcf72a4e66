"""Lines as a robot would drive them along paths of cells, rasterised by every rule and used for a fit.

Paths of cells are sampled from the policy of known parameters. A line is driven along each: through a uniformly sampled
point in each cell, with corners rounded as by a robot with a delayed response, and observed as poses with
noise. Only its ends are cell centres, like marks on a floor. The lines are rasterised on the same grid, or on one
shifted by a random part of a cell, as maps are. The fit to these cells is compared with the fit to the sampled cells.
The difference is due to driving and rule. It excludes the estimator's own bias and variance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import factories as make
import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import Grid
from navirl_cli.demos.rasterize import Rule, rasterize
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import fit
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene
from navirl_cli.simulation.driving import FORWARD_M_S, Path

#: Poses a second.
POSE_HZ = 30.0
RULES = tuple(Rule)


@dataclass(frozen=True)
class World:
    """How lines are driven and observed."""

    name: str
    #: Standard deviation of the Gaussian along the line that rounds its corners, m.
    smoothing_m: float
    #: Standard deviation of each coordinate of a pose, m.
    noise_m: float
    #: Whether the grid is shifted against the sampled cells.
    shifted: bool


@dataclass(frozen=True)
class Refits:
    """Fits to one data set: to its sampled cells and to the cells of every rule."""

    #: (k,) parameters and standard errors from the sampled cells.
    theta: FloatArray
    errors: FloatArray
    #: (rules, k) parameters from each rule's cells.
    by_rule: FloatArray
    #: (rules,) share of cells that are in both paths (of those in either), and diagonal steps a path.
    shared: FloatArray
    diagonal: FloatArray
    #: Diagonal steps of the sampled paths.
    drawn_diagonal: float


def refits(scene: Scene, truth: Reward, count: int, seeds: tuple[int, int], world: World) -> Refits:
    """Sample a data set, drive it, rasterise it by every rule, fit.

    Args:
        scene: Map, start, goal and people.
        truth: The reward whose policy is sampled.
        count: Number of demonstrations.
        seeds: Of the data set; worlds share the paths and the random numbers along them.
        world: How it is driven and observed.
    """
    rng = np.random.default_rng(seeds)
    sampled = sample_paths(policy_of(truth, scene), scene.start, count, rng)
    drawn = [scene.lattice.cells[sampled.path(number)] for number in range(count)]
    grid, half = scene.lattice.grid, scene.lattice.grid.resolution_m / 2
    off = rng.uniform(-half, half, 2) if world.shifted else np.zeros(2)
    other = Grid(grid.occupied, grid.resolution_m, (grid.origin_m[0] + off[0], grid.origin_m[1] + off[1]))
    lines = [_driven(cells, grid, world, rng) for cells in drawn]
    own, errors = _learnt([make.demonstration(grid, cells, scene.people_m, i) for i, cells in enumerate(drawn)], truth)
    by_rule, shared, diagonal = [], [], []
    for rule in RULES:
        paths = [_until_arrival(rasterize(line, other, rule)) for line in lines]
        demonstrations = [make.demonstration(other, path, scene.people_m, i) for i, path in enumerate(paths)]
        by_rule.append(_learnt(demonstrations, truth)[0])
        shared.append(np.mean([_overlap(one, two) for one, two in zip(paths, drawn, strict=True)]))
        diagonal.append(_diagonal(paths))
    return Refits(own, errors, np.array(by_rule), np.array(shared), np.array(diagonal), _diagonal(drawn))


def overall(worlds: Sequence[FloatArray]) -> FloatArray:
    """(rules,) one figure a rule: root mean square, over worlds and parameters, of the mean difference.

    Args:
        worlds: By world the (n, rules, k) differences of its data sets, in standard errors.
    """
    size: FloatArray = np.sqrt(np.mean([(away.mean(axis=0) ** 2).mean(axis=1) for away in worlds], axis=0))
    return size


def resampled(worlds: Sequence[FloatArray], count: int = 2000, seed: int = 0) -> FloatArray:
    """(count, rules) overall figures with the data sets of every world resampled with replacement."""
    rng = np.random.default_rng(seed)
    return np.array(
        [overall([away[rng.integers(0, len(away), len(away))] for away in worlds]) for _ in range(count)],
    )


def best_rule(worlds: Sequence[FloatArray]) -> Rule:
    """The least biased rule, unless the study's is within two standard errors of it."""
    size, again = overall(worlds), resampled(worlds)
    best, study = int(size.argmin()), RULES.index(Rule.STUDY)
    error = float((again[:, study] - again[:, best]).std())
    return Rule.STUDY if size[study] - size[best] <= 2 * error else RULES[best]


def _driven(cells: IntArray, grid: Grid, world: World, rng: np.random.Generator) -> FloatArray:
    """(n, 2) m: poses of a robot that drove through the cells."""
    half = grid.resolution_m / 2
    points = grid.centres_of(cells)
    points[1:-1] += rng.uniform(-half, half, (len(cells) - 2, 2))
    line = Path.along(points, world.smoothing_m, FORWARD_M_S / POSE_HZ).xy_m
    poses: FloatArray = line + rng.normal(0.0, 1.0, line.shape) * world.noise_m
    return poses


def _learnt(demonstrations: Sequence[Demonstration], truth: Reward) -> tuple[FloatArray, FloatArray]:
    """Parameters and standard errors; one start at the truth is enough."""
    found = fit(evidence_of(demonstrations), truth, l2=0.0, scan=False)
    return np.array(found.reward.theta), found.standard_errors


def _until_arrival(cells: IntArray) -> IntArray:
    """A trial ends when it first reaches the goal's cell."""
    arrived = (cells == cells[-1]).all(axis=1)
    return cells[: int(arrived.argmax()) + 1]


def _overlap(one: IntArray, other: IntArray) -> float:
    a, b = set(map(tuple, one.tolist())), set(map(tuple, other.tolist()))
    return len(a & b) / len(a | b)


def _diagonal(paths: Sequence[IntArray]) -> float:
    return float(np.mean([(np.abs(np.diff(path, axis=0)).sum(axis=1) == 2).sum() for path in paths]))
