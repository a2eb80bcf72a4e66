"""Paths drawn from a learnt policy in a scene, as many as a precision asks for, and their metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Final, NamedTuple

import numpy as np

from navirl_cli.arrays import FloatArray
from navirl_cli.evaluation.groups import GroupMetrics
from navirl_cli.evaluation.metric import Metric, Need
from navirl_cli.evaluation.policy_paths import Nearness, PolicyLines, Steps, Visits
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import SampledPaths, sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene

#: However small an error is asked for, no more paths are drawn in a scene.
MOST: Final = 100_000


@dataclass(frozen=True)
class Precision:
    """How many paths to draw from a policy in each scene."""

    samples: int = 100
    #: Largest Monte Carlo standard error of an expected value that visits do not give exactly, as a share of that value
    #: or of the paths' standard deviation, whichever is larger; None to draw `samples` and no more.
    error: float | None = None


@dataclass(frozen=True, eq=False)
class Shown:
    """Demonstrations whose learnt paths are the same, because scene, nominal path and robot are the same."""

    scene: Scene
    #: (k, 2) m.
    nominal_m: FloatArray
    #: Subtracted from distances, m.
    robot_radius_m: float
    #: Places of the demonstrations in the list that was given.
    numbers: tuple[int, ...]
    #: (k, 2) m each: the demonstrated paths through the centres of their cells.
    demonstrated_m: tuple[FloatArray, ...]


@dataclass(frozen=True, eq=False)
class Drawn:
    """Metrics of a policy's paths in a scene."""

    #: By metric: (1, paths) values, or (demonstrations, paths) of metrics beside a demonstrated path.
    values: dict[str, FloatArray]
    #: Exact expected values, where visits give them.
    exact: dict[str, float]
    #: By metric: why it does not exist in this scene.
    missing: dict[str, str]


def draw(
    reward: Reward, shown: Shown, metrics: Sequence[Metric], precision: Precision, rng: np.random.Generator
) -> Drawn:
    """Draw and measure paths.

    Args:
        reward: What was learnt.
        shown: Where.
        metrics: To compute; those that learnt paths do not have are left out.
        precision: How many paths.
        rng: Source of randomness.

    Raises:
        InfinitePartitionError: The reward has no policy in the scene.
    """
    scene = shown.scene
    policy = policy_of(reward, scene)
    lacking = frozenset() if len(scene.people_m) else frozenset({Need.PEOPLE})
    of_learnt = [metric for metric in metrics if metric.drive is None]
    missing = {metric.name: reason for metric in of_learnt if (reason := metric.reason(lacking)) is not None}
    there = [metric for metric in of_learnt if metric.name not in missing]
    steps = Steps(scene.lattice, scene.people_m, shown.robot_radius_m)
    paths = sample_paths(policy, scene.start, precision.samples, rng)
    values = _values(there, steps, paths, shown)
    if precision.error is not None:
        drawn = [values[metric.name] for metric in there if metric.exact is None]
        more = _needed(drawn, precision.error) - len(paths)
        if more > 0:
            paths = paths.joined(sample_paths(policy, scene.start, more, rng), scene.goal)
            values = _values(there, steps, paths, shown)
    visits = Visits(steps, policy, scene.start)
    exact = {metric.name: metric.exact(visits) for metric in there if metric.exact is not None}
    return Drawn(values, exact, missing)


def _values(metrics: Sequence[Metric], steps: Steps, paths: SampledPaths, shown: Shown) -> dict[str, FloatArray]:
    """Metrics of drawn paths, as in :class:`Drawn`."""
    lines = PolicyLines.of(steps, paths, shown.nominal_m)
    beside = [Nearness(line, steps.lattice, paths) for line in shown.demonstrated_m]
    values: dict[str, FloatArray] = {}
    for metric in metrics:
        if metric.lines is not None:
            values[metric.name] = metric.lines(lines)[None]
        elif metric.near is not None:
            values[metric.name] = np.array([metric.near(near) for near in beside])
    return values


def _needed(values: Sequence[FloatArray], error: float) -> int:
    """How many paths a precision takes, estimated from the first paths."""
    needed = 0
    for row in (row[np.isfinite(row)] for own in values for row in own):
        spread = float(row.std(ddof=1)) if len(row) > 1 else 0.0
        if spread > 0:
            allowed = error * max(abs(float(row.mean())), spread)
            needed = max(needed, ceil((spread / allowed) ** 2))
    return min(needed, MOST)


def expected_here(drawn: Drawn, place: int, metrics: Sequence[Metric]) -> dict[str, float]:
    """Expected values of one demonstration's learnt paths, exact where visits give them; NaN where none exists.

    Args:
        drawn: Its learnt paths.
        place: Its place among the demonstrations that share them.
        metrics: That were asked for.
    """
    found = {}
    for metric in metrics:
        if metric.name in drawn.exact:
            found[metric.name] = drawn.exact[metric.name]
        elif metric.drive is None:
            own = drawn.values.get(metric.name, np.empty((1, 0)))
            known = own[place if metric.near is not None and len(own) > place else 0]
            known = known[np.isfinite(known)]
            found[metric.name] = float(known.mean()) if len(known) else float("nan")
    return found


def expected_of(
    group: str, path_type: str, members: Sequence[tuple[Drawn, int]], metrics: Sequence[Metric]
) -> GroupMetrics:
    """Expected values over the scenes of a group, each as often as it was demonstrated in.

    Args:
        group: Its name.
        path_type: Its type of path.
        members: For each demonstration its learnt paths, and its place among the demonstrations that share them.
        metrics: That were asked for.
    """
    scenes: dict[Drawn, list[int]] = {}
    for drawn, place in members:
        scenes.setdefault(drawn, []).append(place)
    found = {metric.name: _expected(metric, scenes) for metric in metrics if metric.drive is None}
    return GroupMetrics(
        group,
        path_type,
        len(members),
        mean={name: one.mean for name, one in found.items()},
        std={name: one.std for name, one in found.items()},
        error={name: one.error for name, one in found.items()},
        exact={name: one.exact for name, one in found.items() if one.exact is not None},
        missing={name: one.missing for name, one in found.items() if one.missing},
    )


class _Expected(NamedTuple):
    """One metric of :class:`GroupMetrics`."""

    mean: float
    std: float
    error: float
    exact: float | None
    missing: Mapping[str, int]


def _expected(metric: Metric, scenes: Mapping[Drawn, Sequence[int]]) -> _Expected:
    """One metric over scenes, each with the places of the group's demonstrations in it."""
    weights: list[float] = []
    values: list[FloatArray] = []
    exact: list[float] = []
    missing: dict[str, int] = {}
    for drawn, places in scenes.items():
        own = drawn.values.get(metric.name, np.empty((1, 0)))
        # Demonstrations of one scene share its paths, and therefore the error.
        own = own[list(places)] if metric.near is not None else own
        known = own[:, np.isfinite(own).all(axis=0)]
        if known.size == 0:
            reason = drawn.missing.get(metric.name, metric.undefined)
            missing[reason] = missing.get(reason, 0) + len(places)
            continue
        weights.append(len(places) * known.shape[1] / own.shape[1])
        values.append(known)
        exact += [drawn.exact[metric.name]] * len(places) if metric.exact is not None else []
    if not values:
        return _Expected(np.nan, np.nan, np.nan, None, missing)
    weight = np.array(weights) / sum(weights)
    mean = float(weight @ [own.mean() for own in values])
    second = float(weight @ [np.square(own).mean() for own in values])
    errors = [_standard_error(own.mean(axis=0)) for own in values]
    return _Expected(
        mean,
        float(np.sqrt(max(second - mean**2, 0.0))),
        float(np.sqrt(weight**2 @ np.square(errors))),
        float(np.mean(exact)) if exact else None,
        missing,
    )


def _standard_error(values: FloatArray) -> float:
    """Standard error of the mean of independent values; NaN for one."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else float("nan")
