"""The paper's algorithm as its text describes it, in plain numpy: the baseline of the fit's benchmark.

Soft value iteration until no value changes by 0.01, forward propagation until 5 % of the mass are left, Adam. It is
written for speed: flat preallocated arrays over the free cells' bounding box, shifts by slicing, no loop over cells.
Its recursion runs in one of two domains with the same iterates. LogDomain keeps V and takes log-sum-exps, which is safe
on any map. ExpDomain keeps exp(V), which needs no exponentials but is valid only while V > -1380.
Cell units: c0 per cell, a_g per m^2, a_p, and the width w of the personal space in cells.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.scene import Scene

INITIAL = (-5.0, -0.01, -5.0, 5.0)
LOWER, UPPER = np.array([-np.inf, -np.inf, -np.inf, 0.1]), np.array([-0.1, 0.0, np.inf, np.inf])
VALUE_TOLERANCE, MASS_LEFT = 0.01, 0.05
RATE, RATE_FACTOR, RATE_EVERY, DECAY, MAX_STEPS = 0.1, 0.8, 100, 0.01, 500
VALUE_CHANGE, GRADIENT_LEFT = 0.01, 0.1
#: After so many sweeps the partition function is taken as infinite.
MAX_SWEEPS = 20_000
#: Logarithm below which a summand is negligible relative to 1. exp takes twice as long where it underflows.
SMALLEST = -60.0
DIAGONAL = np.sqrt(2.0)


class DenseScene:
    """A scene as flat arrays over the bounding box of its free cells, framed by one occupied cell."""

    def __init__(self, scene: Scene) -> None:
        low, high = scene.lattice.cells.min(axis=0) - 1, scene.lattice.cells.max(axis=0) + 1
        self.width, rows = (high - low + 1).tolist()
        self.size = self.width * rows
        self.place: IntArray = (scene.lattice.cells - low) @ np.array([1, self.width])
        self.start, self.goal = (int(self.place[state]) for state in (scene.start, scene.goal))
        resolution_m = scene.lattice.grid.resolution_m
        # Outside the free cells squared distances and mass are zero.
        self.deviation_m2 = self._spread(scene.deviation_m**2)
        (person_m,) = scene.people_m
        self.person_cells2 = self._spread((((scene.lattice.xy_m - person_m) / resolution_m) ** 2).sum(axis=1))
        self.open = self._spread(np.ones(len(self.place)))
        self.open[self.goal] = 0.0
        # The inner part of the frame: every neighbour of its cells lies in the array.
        self.inner = slice(self.width + 1, self.size - self.width - 1)

    def _spread(self, by_state: FloatArray) -> FloatArray:
        flat = np.zeros(self.size)
        flat[self.place] = by_state
        return flat

    def shifts(self) -> list[tuple[slice, float]]:
        """Positions of the eight neighbours of the inner cells, and the length of the step to them in cells."""
        begin, end, width = self.inner.start, self.inner.stop, self.width
        offsets = [1, -1, width, -width, width + 1, width - 1, -width + 1, -width - 1]
        return [(slice(begin + o, end + o), 1.0 if abs(o) in (1, width) else float(DIAGONAL)) for o in offsets]


class Recursion(Protocol):
    """One domain of the recursion."""

    def run(self, c0: float, by_cell: FloatArray) -> tuple[float, FloatArray, float]:
        """V(start), expected visits by cell without the goal, and the expected length of the path in cells."""


class LogDomain:
    """Values as they are, log-sum-exp by the largest."""

    def __init__(self, scene: DenseScene) -> None:
        self.scene, self.shifts = scene, scene.shifts()
        inner = scene.size - 2 * scene.width - 2
        self.q, self.policy, self.top = np.empty((8, inner)), np.empty((8, inner)), np.empty(inner)
        self.closed = scene.open[scene.inner] == 0

    def run(self, c0: float, by_cell: FloatArray) -> tuple[float, FloatArray, float]:
        """As in :class:`Recursion`."""
        scene, inner = self.scene, self.scene.inner
        value, after = np.full(scene.size, -1e9), np.full(scene.size, -1e9)
        value[scene.goal] = after[scene.goal] = 0.0
        closed_value = np.where(self.closed, value[inner], 0.0)
        for _ in range(MAX_SWEEPS):
            self._back_up(c0, by_cell[inner], value, after[inner])
            np.copyto(after[inner], closed_value, where=self.closed)
            np.subtract(after[inner], value[inner], out=self.top)
            change = max(float(self.top.max()), -float(self.top.min()))
            value, after = after, value
            if change < VALUE_TOLERANCE:
                break
        self._back_up(c0, by_cell[inner], value, after[inner])
        np.divide(self.policy, self.q_sum, out=self.policy)
        self.policy[:, self.closed] = 0.0
        return float(after[scene.start]), *self._propagate()

    def _back_up(self, c0: float, by_cell: FloatArray, value: FloatArray, after: FloatArray) -> None:
        """V <- log sum_a exp(r + V(s')); the policy buffer keeps the summands, up to a factor by cell."""
        for q, (shift, length) in zip(self.q, self.shifts, strict=True):
            np.add(value[shift], c0 * length, out=q)
        np.max(self.q, axis=0, out=self.top)
        np.subtract(self.q, self.top, out=self.policy)
        np.maximum(self.policy, SMALLEST, out=self.policy)
        np.exp(self.policy, out=self.policy)
        self.q_sum = self.policy.sum(axis=0)
        np.log(self.q_sum, out=after)
        after += self.top
        after += by_cell

    def _propagate(self) -> tuple[FloatArray, float]:
        """Push the start's mass forward and sum the visits."""
        scene, inner = self.scene, self.scene.inner
        mass, visits = np.zeros(scene.size), np.zeros(scene.size)
        mass[scene.start] = 1.0
        flow = self.q
        while mass.sum() >= MASS_LEFT:
            visits += mass
            np.multiply(self.policy, mass[inner], out=flow)
            mass[:] = 0.0
            for part, (shift, _) in zip(flow, self.shifts, strict=True):
                mass[shift] += part
            mass[scene.goal] = 0.0
        lengths = np.array([length for _, length in self.shifts])
        return visits, float(lengths @ (self.policy @ visits[inner]))


class ExpDomain:
    """Exponentials of the values: a sweep is sums over neighbours alone."""

    #: exp(V) of the goal; as close to the largest double as sums of neighbours allow.
    TOP = 1e300

    def __init__(self, scene: DenseScene) -> None:
        self.scene = scene
        self.reached = scene.open > 0
        self.across, self.diagonal, self.straight = (np.zeros(scene.size) for _ in range(3))

    def run(self, c0: float, by_cell: FloatArray) -> tuple[float, FloatArray, float]:
        """As in :class:`Recursion`.

        Raises:
            FloatingPointError: A value leaves the range of a double.
        """
        scene, goal = self.scene, self.scene.goal
        straight, diagonal = np.exp(c0), np.exp(c0 * DIAGONAL)
        gain = np.exp(by_cell) * scene.open
        z, after, bound = np.zeros(scene.size), np.zeros(scene.size), np.empty(scene.size)
        z[goal] = self.TOP
        for _ in range(MAX_SWEEPS):
            self._sum_neighbours(z, straight, diagonal, after)
            after *= gain
            after[goal] = self.TOP
            # From zero the values only rise, so this bounds every change. An unreached start counts as a change too.
            np.multiply(z, np.exp(VALUE_TOLERANCE), out=bound)
            settled = (after <= bound).all()
            z, after = after, z
            if settled:
                break
        least = float(z[self.reached].min())
        if not (least > 1e-300 and np.isfinite(z).all()):
            raise FloatingPointError("values beyond the range of a double: use LogDomain")
        self._sum_neighbours(z, straight, diagonal, after)
        after *= gain
        value = float(np.log(after[scene.start]) - np.log(self.TOP))
        return value, *self._propagate(
            z, after, gain, (float(straight), float(diagonal)), float(np.sqrt(least) * np.sqrt(self.TOP))
        )

    def _sum_neighbours(self, x: FloatArray, straight: float, diagonal: float, out: FloatArray) -> None:
        """Weighted sum over the eight neighbours of every inner cell, from sums of the two in the row."""
        width, inner = self.scene.width, self.scene.inner
        above, below = slice(2 * width + 1, self.scene.size - 1), slice(1, self.scene.size - 2 * width - 1)
        np.add(x[:-2], x[2:], out=self.across[1:-1])
        np.add(self.across[above], self.across[below], out=self.diagonal[inner])
        np.add(x[above], x[below], out=self.straight[inner])
        self.straight[inner] += self.across[inner]
        np.multiply(self.straight, straight, out=out)
        self.diagonal *= diagonal
        out += self.diagonal

    def _propagate(
        self, z: FloatArray, after: FloatArray, gain: FloatArray, weights: tuple[float, float], middle: float
    ) -> tuple[FloatArray, float]:
        """Push the start's mass forward with P(s, s') = gain(s) weight z(s') / after(s), and sum the visits."""
        scene = self.scene
        leave = np.divide(gain * middle, after, out=np.zeros(scene.size), where=self.reached)
        arrive = z / middle
        arrive[scene.goal] = 0.0
        mass, visits, sent = np.zeros(scene.size), np.zeros(scene.size), np.empty(scene.size)
        mass[scene.start] = 1.0
        while mass.sum() >= MASS_LEFT:
            visits += mass
            np.multiply(mass, leave, out=sent)
            self._sum_neighbours(sent, *weights, mass)
            mass *= arrive
        self._sum_neighbours(visits * leave, *weights, mass)
        arrive[scene.goal] = self.TOP / middle
        return visits, float(arrive @ (self.straight * weights[0] + DIAGONAL * self.diagonal))


@dataclass(frozen=True)
class Learnt:
    """Where Adam stopped."""

    theta: tuple[float, ...]
    steps: int

    def reward(self, resolution_m: float) -> Reward:
        """The same in SI units."""
        c0, a_g, a_p, width = self.theta
        return Reward((c0 / resolution_m, a_g, a_p, 1 / (2 * (resolution_m * width) ** 2)))


def learn(scene: Scene, paths: Sequence[IntArray], domain: type[LogDomain] | type[ExpDomain]) -> Learnt:
    """Maximise the likelihood of demonstrated paths, each an array of states into the goal, by Adam."""
    dense = DenseScene(scene)
    recursion: Recursion = domain(dense)
    demonstrated = np.bincount(dense.place[np.concatenate([path[:-1] for path in paths])], minlength=dense.size)
    steps = np.concatenate([np.hypot(*np.diff(scene.lattice.cells[path], axis=0).T) for path in paths])
    count, length = len(paths), float(steps.sum())
    theta, last = np.array(INITIAL), -np.inf
    first, second = np.zeros(4), np.zeros(4)
    for step in range(MAX_STEPS):
        value, gradient = _value_and_gradient(dense, recursion, theta, demonstrated, length, count)
        if abs(value - last) < VALUE_CHANGE and np.abs(gradient).max() < GRADIENT_LEFT:
            return Learnt(tuple(theta.tolist()), step)
        last, (epoch, within) = value, divmod(step, RATE_EVERY)
        if within == 0:
            first, second = np.zeros(4), np.zeros(4)
        rate = RATE * RATE_FACTOR**epoch
        slope = -gradient + DECAY * rate * theta
        first, second = 0.9 * first + 0.1 * slope, 0.999 * second + 0.001 * slope**2
        ahead, size = first / (1 - 0.9 ** (within + 1)), np.sqrt(second / (1 - 0.999 ** (within + 1)))
        theta = np.clip(theta - rate * ahead / (size + 1e-8), LOWER, UPPER)
    return Learnt(tuple(theta.tolist()), MAX_STEPS)


def _value_and_gradient(
    dense: DenseScene, recursion: Recursion, theta: FloatArray, demonstrated: IntArray, length: float, count: int
) -> tuple[float, FloatArray]:
    """Log-likelihood and gradient (Eq. 6) as the approximate values and visits give them."""
    c0, a_g, a_p, width = theta.tolist()
    bump = np.exp(dense.person_cells2 * (-0.5 / width**2))
    by_cell = a_g * dense.deviation_m2 + a_p * bump
    value, visits, expected_length = recursion.run(c0, by_cell)
    surplus = demonstrated - count * visits
    gradient = np.array(
        [
            length - count * expected_length,
            surplus @ dense.deviation_m2,
            surplus @ bump,
            surplus @ (bump * dense.person_cells2) * a_p / width**3,
        ]
    )
    return c0 * length + float(demonstrated @ by_cell) - count * value, gradient
