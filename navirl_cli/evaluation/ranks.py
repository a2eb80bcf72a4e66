"""How well a learnt policy explains each path: the rank of its log-likelihood among those of the policy's own paths.

If demonstrations came from the policy, ranks would be uniform between 0 and 1 (A. P. Dawid, Statistical theory: the
prequential approach, Journal of the Royal Statistical Society A 147 (1984); S. Talts et al., Validating Bayesian
inference algorithms with simulation-based calibration, 2018). Paths that the policy hardly takes have ranks near 0.
Many ranks near 1 belong to demonstrations that are more typical than the policy's own paths.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.demonstration import Demonstration
from navirl_cli.demos.grid import moves_along
from navirl_cli.errors import DemonstrationError
from navirl_cli.evaluation.compare import nominal_of
from navirl_cli.evaluation.groups import Trained, by_evidence_group, evidence_group_of
from navirl_cli.evaluation.lines import Lines
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import SampledPaths, sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene, scenes_of
from navirl_cli.irl.values import Policy

#: So many of the drawn paths are measured: areas take time.
MEASURED = 500
#: A demonstration fits badly if a smaller share of the policy's paths is less likely, or if its least distance or its
#: area lies in a smaller share at either end.
RARE, EXTREME = 0.01, 0.005


@dataclass(frozen=True)
class Rank:
    """The ranks of one demonstration: shares of the policy's paths in [0, 1]; ties are broken at random."""

    id: str
    #: As :func:`~navirl_cli.evaluation.groups.evidence_group_of`.
    group: str
    #: Of the demonstrated path under the policy, nats.
    log_likelihood: float
    #: Share of the policy's paths that are less likely.
    rank: float
    #: Share that passes people nearer, through the centres of cells; None without people.
    distance_rank: float | None
    #: Share with a smaller area between path and nominal path.
    area_rank: float
    #: Whether the reward was learnt without this participant; None where that is unknown.
    held_out: bool | None = None

    @property
    def fits_badly(self) -> bool:
        """Whether hardly any path of the policy is like it."""
        two_sided = [share for share in (self.distance_rank, self.area_rank) if share is not None]
        return self.rank < RARE or any(min(share, 1 - share) < EXTREME for share in two_sided)


@dataclass(frozen=True)
class GroupRanks:
    """Ranks of the demonstrations of one group, either learnt from or of participants held out."""

    group: str
    held_out: bool | None
    ranks: tuple[Rank, ...]

    @property
    def name(self) -> str:
        """The group, and whether its participants were held out."""
        return f"{self.group}, held out" if self.held_out else self.group

    def uniformity(self) -> tuple[float, float]:
        """Kolmogorov and Smirnov's distance of the ranks from the uniform, and its exact p-value."""
        from scipy.stats import kstest

        found = kstest([one.rank for one in self.ranks], "uniform")
        return float(found.statistic), float(found.pvalue)


def chosen_to_rank(
    demonstrations: Sequence[Demonstration], trained: Trained | None
) -> tuple[list[Demonstration], dict[str, int]]:
    """The demonstrations of the groups that a reward was learnt from, and how many others there are by group.

    A reward for pushes says nothing about obstacle courses or scenes without people. Where it is unknown what the
    reward was learnt from, all demonstrations are chosen.
    """
    if trained is None:
        return list(demonstrations), {}
    groups = by_evidence_group(demonstrations)
    others = {group: len(own) for group, own in groups.items() if group not in trained.groups}
    return [one for one in demonstrations if evidence_group_of(one) in trained.groups], others


def check_to_rank(demonstrations: Sequence[Demonstration], trained: Trained | None) -> None:
    """Refuse to rank where the reward was learnt from none of the groups.

    Raises:
        DemonstrationError: There is nothing to rank.
    """
    left, others = chosen_to_rank(demonstrations, trained)
    if not left:
        groups = " / ".join(sorted(frozenset() if trained is None else trained.groups))
        raise DemonstrationError(
            f"ranks: expected demonstrations like those that the reward was learnt from ({groups}), "
            f"found {' / '.join(others)}; take demonstrations of these groups"
        )


@dataclass(frozen=True)
class Ranking:
    """Ranks, and how many demonstrations by group were not ranked."""

    ranks: tuple[Rank, ...] = ()
    not_ranked: Mapping[str, int] = field(default_factory=dict)
    #: What the reward was learnt from; None where that is unknown.
    trained: Trained | None = None

    @property
    def unlike(self) -> list[str]:
        """Groups that were ranked although the reward was not learnt from them."""
        known = None if self.trained is None else self.trained.groups
        return [] if known is None else sorted({one.group for one in self.ranks} - known)

    @property
    def bad(self) -> list[Rank]:
        """Those that fit badly, of groups that the reward was learnt from."""
        return [one for one in self.ranks if one.fits_badly and one.group not in self.unlike]


def ranking(
    demonstrations: Sequence[Demonstration],
    reward: Reward,
    trained: Trained | None,
    samples: int,
    rng: np.random.Generator,
) -> Ranking:
    """Rank the demonstrations of the groups that a reward was learnt from; arguments as of :func:`ranks_of`."""
    chosen, others = chosen_to_rank(demonstrations, trained)
    return Ranking(tuple(ranks_of(chosen, reward, samples, rng, trained=trained)), others, trained)


def ranks_of(
    demonstrations: Sequence[Demonstration],
    reward: Reward,
    samples: int,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
    trained: Trained | None = None,
) -> list[Rank]:
    """Rank demonstrations among paths drawn from a policy in their scenes.

    Args:
        demonstrations: Preferably such as the reward was not learnt from.
        reward: What was learnt.
        samples: Paths to draw in each scene.
        rng: Source of randomness.
        progress: Called with demonstrations done and in all.
        trained: What the reward was learnt from; None where that is unknown.

    Raises:
        SceneError: A demonstration's scene has no path from start to goal.
        InfinitePartitionError: The reward has no policy in a scene.
    """
    drawn: dict[Scene, _Drawn] = {}
    found = []
    for number, (one, scene) in enumerate(zip(demonstrations, scenes_of(demonstrations), strict=True)):
        if scene not in drawn:
            policy = policy_of(reward, scene)
            paths = sample_paths(policy, scene.start, samples, rng)
            drawn[scene] = _Drawn(scene, policy, paths, sampled_log_likelihoods(policy, paths), {})
        among = drawn[scene]
        own = path_log_likelihood(among.policy, scene.lattice.states_of(one.cells), moves_along(one.cells))
        rank = share_below(own, among.log_likelihood, rng)
        distance, area = _shape_ranks(one, among, rng)
        held_out = None if trained is None else one.participant not in trained.participants
        found.append(Rank(one.id, evidence_group_of(one), own, rank, distance, area, held_out))
        if progress is not None:
            progress(number + 1, len(demonstrations))
    return found


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Paths of a policy in a scene."""

    scene: Scene
    policy: Policy
    paths: SampledPaths
    #: (paths,) nats.
    log_likelihood: FloatArray
    #: (MEASURED,) areas by the bytes of the nominal path, m^2, and least distances by None, m.
    measured: dict[bytes | None, FloatArray]


def _shape_ranks(one: Demonstration, among: _Drawn, rng: np.random.Generator) -> tuple[float | None, float]:
    """Ranks of a path through the centres of its cells, by least distance and by area."""
    scene = among.scene
    nominal_m = nominal_of(one, scene)
    drawn = Lines(scene.lattice.xy_m[among.paths.states[:MEASURED]], nominal_m, scene.people_m, 0.0)
    own = Lines(one.grid.centres_of(one.cells)[None], nominal_m, scene.people_m, 0.0)
    if (key := nominal_m.tobytes()) not in among.measured:
        among.measured[key] = drawn.area_m2
    area = share_below(float(own.area_m2[0]), among.measured[key], rng)
    if not len(scene.people_m):
        return None, area
    if None not in among.measured:
        among.measured[None] = drawn.min_distance_m
    return share_below(float(own.min_distance_m[0]), among.measured[None], rng), area


def share_below(value: float, among: FloatArray, rng: np.random.Generator) -> float:
    """Rank of a value in [0, 1] among (n,) others; uniform where it is one of them, ties broken at random."""
    # Sums in another order differ in their last digits.
    below, equal = (among < value - 1e-9).sum(), (np.abs(among - value) <= 1e-9).sum()
    return float((below + rng.uniform() * (equal + 1)) / (len(among) + 1))


def by_group_and_training(ranks: Sequence[Rank]) -> list[GroupRanks]:
    """Ranks by group, those of participants held out by themselves, in the order in which they come."""
    found: dict[tuple[str, bool | None], list[Rank]] = {}
    for one in ranks:
        found.setdefault((one.group, one.held_out), []).append(one)
    return [GroupRanks(group, held_out, tuple(own)) for (group, held_out), own in found.items()]


def path_log_likelihood(policy: Policy, states: IntArray, moves: IntArray) -> float:
    """Log-probability of a (k,) path's k - 1 moves, nats; -inf where the policy never makes one."""
    return float(policy.log_likelihoods(states, moves).sum())


def sampled_log_likelihoods(policy: Policy, paths: SampledPaths) -> FloatArray:
    """(paths,) log-probabilities of paths drawn from the policy, nats."""
    moves = moves_along(policy.lattice.cells[paths.states])
    total: FloatArray = policy.log_likelihoods(paths.states, moves).sum(axis=1)
    return total
