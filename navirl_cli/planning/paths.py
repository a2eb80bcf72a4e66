"""Paths to drive: the most probable one, drawn ones, and the one along the ridge of the visits.

A learnt reward has no infinite cost: the single most probable path may lead through a person, although nearly all paths
of the policy lead around. So the bodies of people are obstacles here, and nothing else changes: a planned path has the
probability that the policy gives it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Final

import numpy as np

from navirl_cli.arrays import BoolArray, FloatArray, IntArray
from navirl_cli.demos.grid import moves_along
from navirl_cli.errors import SceneError
from navirl_cli.evaluation.lines import Lines
from navirl_cli.evaluation.motion import PERSON_RADIUS_M
from navirl_cli.evaluation.policy_paths import PolicyLines, Steps
from navirl_cli.irl.graph import Graph
from navirl_cli.irl.likelihood import policy_of
from navirl_cli.irl.paths import sample_paths
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.values import Policy
from navirl_cli.planning.problem import Problem

#: Paths drawn at most for each one that touches nobody.
MOST_DRAWS: Final = 1000


class Mode(StrEnum):
    """Which path is planned."""

    #: The most probable path of the policy.
    LIKELY = "likely"
    #: Paths drawn from the policy (Eq. 9).
    SAMPLE = "sample"
    #: The path along the ridge of the policy's expected visits.
    EXPECTED = "expected"


@dataclass(frozen=True, eq=False)
class Path:
    """A planned path."""

    #: (k,) states, from start to goal.
    states: IntArray
    #: (k, 2) m, map frame: from the exact start through the centres of the cells to the exact goal.
    line_m: FloatArray
    #: log p of the states under the policy, nats.
    log_probability: float


@dataclass(frozen=True, eq=False)
class Planner:
    """The policy of a reward in a problem, and its paths."""

    problem: Problem
    reward: Reward

    @cached_property
    def policy(self) -> Policy:
        """The soft-optimal policy.

        Raises:
            InfinitePartitionError: The reward has no policy in the scene.
        """
        return policy_of(self.reward, self.problem.scene)

    @cached_property
    def visits(self) -> FloatArray:
        """(n,) expected visits by cell."""
        return self.policy.visits_by_cell(self.problem.scene.start)

    @cached_property
    def touching(self) -> BoolArray:
        """(n,) states in which the robot's shell would touch a person's body."""
        problem = self.problem
        clear_m = problem.robot_radius_m + PERSON_RADIUS_M
        near = np.zeros(problem.scene.lattice.size, dtype=bool)
        for person in problem.scene.people_m:
            near |= np.hypot(*(problem.scene.lattice.xy_m - person).T) < clear_m
        # a robot that was pushed into somebody may still leave
        near[[problem.scene.start, problem.scene.goal]] = False
        return near

    @cached_property
    def passing_m(self) -> tuple[float, float]:
        """Mean and standard deviation of the least distance to people over paths of the policy, m; needs people."""
        drawn = sample_paths(self.policy, self.problem.scene.start, 300, np.random.default_rng(0))
        steps = Steps(self.problem.scene.lattice, self.problem.scene.people_m, self.problem.robot_radius_m)
        least = PolicyLines.of(steps, drawn, self.problem.nominal_m).min_distance_m
        return float(least.mean()), float(least.std())

    def plan(self, mode: Mode, count: int = 1, seed: int = 0) -> list[Path]:
        """Paths from start to goal.

        Args:
            mode: Which paths.
            count: Number of paths of Mode.SAMPLE.
            seed: Of these.

        Raises:
            SceneError: People leave no way through.
            InfinitePartitionError: The reward has no policy in the scene.
        """
        if mode is Mode.SAMPLE:
            return [self.path(states) for states in self._drawn(count, np.random.default_rng(seed))]
        return [self.path(self._most_probable() if mode is Mode.LIKELY else self._ridge())]

    def path(self, states: IntArray) -> Path:
        """A path through states."""
        lattice = self.problem.scene.lattice
        line = lattice.xy_m[states].copy()
        line[0], line[-1] = self.problem.start_m, self.problem.goal_m
        moves = moves_along(lattice.cells[states])
        return Path(states, line, float(self.policy.log_likelihoods(states, moves).sum()))

    def _drawn(self, count: int, rng: np.random.Generator) -> list[IntArray]:
        """States of drawn paths that touch nobody."""
        found: list[IntArray] = []
        for _ in range(MOST_DRAWS):
            drawn = sample_paths(self.policy, self.problem.scene.start, count, rng)
            paths = [drawn.path(number) for number in range(len(drawn))]
            found += [states for states in paths if not self.touching[states].any()]
            if len(found) >= count:
                return found[:count]
        raise SceneError(
            f"of {MOST_DRAWS * count} paths drawn from the policy {len(found)} touch nobody, fewer than the {count} "
            "wanted: people leave hardly any space; plan with `mode` likely"
        )

    def _most_probable(self) -> IntArray:
        """(k,) states of the path with the largest product of probabilities, by Dijkstra on their -log."""
        with np.errstate(divide="ignore"):
            cost = -np.log(self.policy.probability)
        # scipy takes a cost of zero for a missing edge
        return self._cheapest(self.policy.graph, self.policy.goal, np.maximum(cost, 1e-300))

    def _ridge(self) -> IntArray:
        """(k,) states of the path of least length weighed by the inverse of the visits."""
        lattice = self.problem.scene.lattice
        seldom = 1 / np.maximum(self.visits, 1e-300)
        # A step lies half in the cell that it leaves and half in the one that it enters.
        both = (seldom[:, None] + seldom[lattice.neighbours]) / 2
        return self._cheapest(lattice, self.problem.scene.goal, both * lattice.step_m)

    def _cheapest(self, graph: Graph, goal: int, cost: FloatArray) -> IntArray:
        """(k,) cells along the cheapest path into a state; cost (n, 8), inf or 0 where a move is not possible."""
        start = graph.beginning_in(self.problem.scene.start)
        entered = graph.cells_of(graph.neighbours)
        allowed = graph.possible & np.isfinite(cost) & ~self.touching[entered]
        total, following = graph.cheapest_tree(goal, np.where(allowed, cost, np.inf))
        if not np.isfinite(total[start]):
            raise SceneError(
                "people leave no free path from start to goal: the robot's shell keeps "
                f"{PERSON_RADIUS_M:g} m to their centres; choose another goal, or wait until they move"
            )
        path = [start]
        while path[-1] != goal:
            path.append(int(following[path[-1]]))
        return graph.cells_of(np.array(path))


def measured(problem: Problem, line_m: FloatArray) -> Lines:
    """A line of a problem as a type that measures it."""
    return Lines(line_m[None], problem.nominal_m, problem.scene.people_m, problem.robot_radius_m)


def rewards_by_term(problem: Problem, reward: Reward, states: IntArray) -> dict[str, float]:
    """The sum of every term along a path, nats, by the term's name.

    Args:
        problem: The problem.
        reward: The reward.
        states: (k,) from start to goal.
    """
    return {term.name: total[0] for term, total in zip(reward.terms, _sums(problem, reward, [states]), strict=True)}


def rewards_of_people(problem: Problem, reward: Reward, paths: Sequence[IntArray]) -> FloatArray:
    """(m,) the part of each path's reward that people cause, nats; the paths each (k,) from start to goal."""
    total = np.zeros(len(paths))
    for term, sums in zip(reward.terms, _sums(problem, reward, paths), strict=True):
        if term.about_people:
            total += sums
    return total


def _sums(problem: Problem, reward: Reward, paths: Sequence[IntArray]) -> list[list[float]]:
    """The sums of every term along each path, nats."""
    scene = problem.scene
    graph = reward.ordering(scene).graph
    moves = [moves_along(scene.lattice.cells[states]) for states in paths]
    along = [graph.along(states, own)[:-1] for states, own in zip(paths, moves, strict=True)]
    found, at = [], 0
    for term in reward.terms:
        count = len(term.parameters)
        value = term.on(scene, reward.theta[at : at + count]).value
        full = np.broadcast_to(graph.on_states(value), (graph.size, 8))
        found.append([float(full[left, own].sum()) for left, own in zip(along, moves, strict=True)])
        at += count
    return found
