"""Slow, obvious twins: what the fast code must agree with, written for reading and not for speed.

Nothing here imports the code under test. Maps are arrays of bool ``free[row, column]``; cells are (column, row) as in
the package; arrays by move follow MOVES.
"""

import heapq
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import pairwise
from math import ceil, exp, floor, hypot, inf, isfinite, log, sqrt

import numpy as np
from scipy.special import logsumexp

from navirl_cli.arrays import BoolArray, FloatArray

Cell = tuple[int, int]

#: (dx, dy) of the eight moves, counter-clockwise from +x.
MOVES: tuple[Cell, ...] = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))


def is_free(free: BoolArray, cell: Cell) -> bool:
    column, row = cell
    return 0 <= row < free.shape[0] and 0 <= column < free.shape[1] and bool(free[row, column])


def free_cells(free: BoolArray) -> list[Cell]:
    return [(int(column), int(row)) for row, column in np.argwhere(free)]


def ways(free: BoolArray, cell: Cell) -> Iterator[tuple[int, Cell]]:
    """Number of the move and the cell it leads to, for every possible move."""
    for move, (dx, dy) in enumerate(MOVES):
        target = cell[0] + dx, cell[1] + dy
        if is_free(free, target):
            yield move, target


# --- shortest paths -------------------------------------------------------------------------------------------------


def steps_from(free: BoolArray, source: Cell) -> dict[Cell, tuple[int, int]]:
    """(straight, diagonal) steps of a shortest path from the source to every cell it reaches, by plain Dijkstra.

    The square root of 2 is irrational: two paths have the same length only if these pairs are equal, so that "on a
    shortest path" can be asked without any tolerance.
    """
    done: dict[Cell, tuple[int, int]] = {}
    queue = [(0.0, (0, 0), source)]
    while queue:
        _, (straight, diagonal), cell = heapq.heappop(queue)
        if cell in done:
            continue
        done[cell] = straight, diagonal
        for move, target in ways(free, cell):
            pair = (straight, diagonal + 1) if move % 2 else (straight + 1, diagonal)
            heapq.heappush(queue, (pair[0] + pair[1] * sqrt(2), pair, target))
    return done


def nominal_cells(free: BoolArray, start: Cell, goal: Cell) -> set[Cell]:
    """Cells on any shortest path: the steps from the start and those to the goal add up to the shortest path's."""
    there, back = steps_from(free, start), steps_from(free, goal)
    return {cell for cell in there if tuple(np.add(there[cell], back[cell])) == there[goal]}


# --- reward, soft values, visits ------------------------------------------------------------------------------------


def paper_reward(
    theta: tuple[float, ...],
    free: BoolArray,
    start: Cell,
    goal: Cell,
    people_m: FloatArray,
    resolution_m: float,
    origin_m: tuple[float, float],
) -> FloatArray:
    """r(s, a) of Eqs. 11-13, cell by cell: (rows, columns, 8), -inf where no move is possible and in the goal."""
    c0, a_g, a_p, sigma_p = theta
    nominal = nominal_cells(free, start, goal)
    reward = np.full((*free.shape, 8), -np.inf)
    for cell in free_cells(free):
        if cell == goal:
            continue
        deviation_m = min(hypot(cell[0] - c, cell[1] - r) for c, r in nominal) * resolution_m
        x = origin_m[0] + (cell[0] + 0.5) * resolution_m
        y = origin_m[1] + (cell[1] + 0.5) * resolution_m
        here = a_g * deviation_m**2
        here += sum(a_p * exp(-sigma_p * ((x - px) ** 2 + (y - py) ** 2)) for px, py in people_m)
        for move, _ in ways(free, cell):
            reward[cell[1], cell[0], move] = here + c0 * hypot(*MOVES[move]) * resolution_m
    return reward


def ahead(field: FloatArray, outside: float) -> FloatArray:
    """(rows, columns, 8): the field at the cell that each move leads to."""
    rows, columns = field.shape
    framed = np.full((rows + 2, columns + 2), outside)
    framed[1:-1, 1:-1] = field
    return np.stack([framed[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns] for dx, dy in MOVES], axis=2)


def soft_values(reward: FloatArray, goal: Cell, sweeps: int = 30_000) -> FloatArray:
    """Soft value iteration in the log domain: V(s) = log sum_a exp(r(s, a) + V(s')) until nothing moves."""
    values = np.full(reward.shape[:2], -np.inf)
    values[goal[1], goal[0]] = 0.0
    for _ in range(sweeps):
        before = values
        values = logsumexp(reward + ahead(before, -np.inf), axis=2)
        values[goal[1], goal[0]] = 0.0
        known = np.isfinite(values)
        if (known == np.isfinite(before)).all() and np.abs(values[known] - before[known]).max() < 1e-12:
            return values
    raise AssertionError("soft value iteration did not end: the partition function may be infinite")


def soft_policy(reward: FloatArray, values: FloatArray) -> FloatArray:
    """P(a|s) = exp(r + V' - V), (rows, columns, 8); zeros where nothing can be done."""
    with np.errstate(invalid="ignore"):
        logs = reward + ahead(values, -np.inf) - values[:, :, None]
    return np.where(np.isfinite(reward) & np.isfinite(logs), np.exp(logs), 0.0)


def expected_visits(policy: FloatArray, start: Cell, goal: Cell) -> FloatArray:
    """Mass let go at the start and moved step by step until nothing is under way; visits are its sum over time."""
    rows, columns = policy.shape[:2]
    mass = np.zeros((rows, columns))
    mass[start[1], start[0]] = 1.0
    visits = mass.copy()
    for _ in range(100_000):
        framed = np.zeros((rows + 2, columns + 2))
        for move, (dx, dy) in enumerate(MOVES):
            framed[1 + dy : 1 + dy + rows, 1 + dx : 1 + dx + columns] += mass * policy[:, :, move]
        mass = framed[1:-1, 1:-1]
        visits += mass
        mass = mass.copy()
        mass[goal[1], goal[0]] = 0.0
        if mass.sum() < 1e-16:
            return visits
    raise AssertionError("mass never arrives in the goal")


# --- turns ---------------------------------------------------------------------------------------------------------

#: A cell and the move by which a path came there, None where it begins.
Came = tuple[Cell, int | None]


def turn_states(free: BoolArray, goal: Cell) -> list[Came]:
    """Every cell with every move that can lead into it, and every cell as a beginning; the goal's need no moves."""
    begun: list[Came] = [(cell, None) for cell in free_cells(free)]
    entered: list[Came] = [
        (target, move) for cell in free_cells(free) if cell != goal for move, target in ways(free, cell)
    ]
    return [*begun, *entered]


def is_sharp(before: int | None, move: int) -> bool:
    """Whether a move turns by 90 degrees or more: the scalar product of both moves is not positive."""
    if before is None:
        return False
    (x, y), (u, v) = MOVES[before], MOVES[move]
    return x * u + y * v <= 0


def turn_values(reward: FloatArray, sharp: float, free: BoolArray, goal: Cell) -> dict[Came, float]:
    """Soft values by cell and incoming move, by value iteration in the log domain.

    Args:
        reward: (rows, columns, 8) of a step without the turn.
        sharp: Added to the reward of a step that turns sharply.
    """
    values = {state: 0.0 if state[0] == goal else -inf for state in turn_states(free, goal)}
    for _ in range(2000):
        before = dict(values)
        for cell, came in before:
            if cell != goal:
                logs = [
                    reward[cell[1], cell[0], move] + sharp * is_sharp(came, move) + before[target, move]
                    for move, target in ways(free, cell)
                ]
                values[cell, came] = float(logsumexp(logs))
        if max(abs(values[s] - before[s]) if isfinite(before[s]) else inf for s in values) < 1e-12:
            return values
    raise AssertionError("soft value iteration did not end")


def turn_flow(
    reward: FloatArray, sharp: float, free: BoolArray, start: Cell, goal: Cell
) -> dict[tuple[Came, int], float]:
    """Expected number of times that each move is made in each state, by mass that is moved step by step."""
    values = turn_values(reward, sharp, free, goal)
    flow: dict[tuple[Came, int], float] = {}
    mass: dict[Came, float] = {(start, None): 1.0}
    while sum(mass.values()) > 1e-16:
        after: dict[Came, float] = {}
        for (cell, came), here in mass.items():
            for move, target in ways(free, cell):
                log_p = (
                    reward[cell[1], cell[0], move]
                    + sharp * is_sharp(came, move)
                    + values[target, move]
                    - values[cell, came]
                )
                taken = here * exp(log_p)
                flow[(cell, came), move] = flow.get(((cell, came), move), 0.0) + taken
                if target != goal:
                    after[target, move] = after.get((target, move), 0.0) + taken
        mass = after
    return flow


# --- people who differ ---------------------------------------------------------------------------------------------


def scattered_people(
    log_likelihoods: FloatArray,
    places: FloatArray,
    means: FloatArray,
    scatters: FloatArray,
    width: float,
    center: float,
    mean_width: float,
) -> dict[str, FloatArray]:
    """All that is unknown about people who are scattered in one variable, on a grid and without any approximation.

    Person i has y_i ~ N(m, s^2) and is seen through a log-likelihood. Beforehand m is normal and s half
    normal.

    Args:
        log_likelihoods: (people, places) of each person.
        places: Even grid of y.
        means: Even grid of m.
        scatters: Grid of s, even in its logarithm.
        width: Of the distribution of s.
        center: Of the distribution of m.
        mean_width: Its standard deviation.

    Returns:
        "mean": expectation and standard deviation of m; "scatter": median of s; "people": (people, 2) expectation and
        standard deviation of y_i.
    """
    step = places[1] - places[0]
    weight = np.zeros((len(means), len(scatters)))
    first, second = np.zeros((2, len(log_likelihoods), len(means), len(scatters)))
    for i, m in enumerate(means):
        for j, s in enumerate(scatters):
            prior = -0.5 * ((places - m) / s) ** 2 - log(s * sqrt(2 * np.pi))
            each = np.exp(log_likelihoods + prior) * step
            of_person = each.sum(axis=1)
            # the density of log s is s times that of s
            weight[i, j] = np.log(of_person).sum() - 0.5 * (s / width) ** 2 + log(s)
            weight[i, j] -= 0.5 * ((m - center) / mean_width) ** 2
            first[:, i, j] = each @ places / of_person
            second[:, i, j] = each @ places**2 / of_person
    weight = np.exp(weight - weight.max())
    weight /= weight.sum()
    expected = float(weight.sum(axis=1) @ means)
    spread = sqrt(float(weight.sum(axis=1) @ (means - expected) ** 2))
    y = (first * weight).sum(axis=(1, 2))
    return {
        "mean": np.array([expected, spread]),
        "scatter": np.interp(0.5, np.cumsum(weight.sum(axis=0)) - 0.5 * weight.sum(axis=0), scatters)[None],
        "people": np.column_stack([y, np.sqrt((second * weight).sum(axis=(1, 2)) - y**2)]),
    }


# --- derivatives ----------------------------------------------------------------------------------------------------


def derivative(function: Callable[[FloatArray], FloatArray], at: FloatArray, relative: float = 1e-3) -> FloatArray:
    """Central finite differences of fourth order: (..., k) derivatives of a function of (k,) variables.

    Of the value it is the gradient, of the gradient the Hessian.
    """
    columns = []
    for j in range(len(at)):
        step = np.zeros(len(at))
        step[j] = relative * max(abs(at[j]), 0.1)
        near = np.asarray(function(at + step)) - np.asarray(function(at - step))
        far = np.asarray(function(at + 2 * step)) - np.asarray(function(at - 2 * step))
        columns.append((8 * near - far) / (12 * step[j]))
    return np.stack(columns, axis=-1)


# --- worlds solved by hand ------------------------------------------------------------------------------------------


class CorridorOfThree:
    """Three cells of 0.1 m in a row: start A, middle B, goal G. A step's weight is w = exp(c0 0.1 m).

    z_A = w z_B            from A the only move leads to B
    z_B = w z_A + w        from B one leads back, one into the goal, where z = 1
    hence z_B = w / (1 - w^2) and z_A = w^2 / (1 - w^2). We choose w = 1/2, that is c0 = -10 ln 2 /m:
    """

    C0 = -10 * log(2)
    Z_A, Z_B = 1 / 3, 2 / 3
    # P(G|B) = w / z_B = (1/2) / (2/3), and back with the rest.
    TO_GOAL, BACK = 3 / 4, 1 / 4
    # D_A = 1 + D_B / 4 (the start, and every way back); D_B = D_A (from A all go to B): D = 4/3 in both.
    VISITS = 4 / 3
    # log p(A B G) = log P(B|A) + log P(G|B) = 0 + log 3/4.
    LOG_LIKELIHOOD = log(3 / 4)
    # Every move drives 0.1 m. Demonstrated: 2 moves. Expected: D_A + D_B = 8/3 moves. Gradient by c0: their difference.
    GRADIENT_C0 = 0.1 * (2 - 8 / 3)
    # V_A = 2u - log(1 - e^2u) with u = log w. Its second derivative by u is 4 w^2 / (1 - w^2)^2 = 1 / (9/16).
    HESSIAN_C0 = -(0.1**2) * 16 / 9
    # Equally likely moves: one choice at A, two at B.
    UNIFORM_LOG_LIKELIHOOD = log(1 / 1) + log(1 / 2)


class SquareOfFour:
    """2 x 2 cells of 0.1 m, start A and goal G in opposite corners, B and C in the other two.

    A straight step weighs w = exp(c0 0.1 m), a diagonal one u = w^sqrt(2). By symmetry z_B = z_C = b, and z_A = a:
        a = u + 2 w b              straight across into the goal, or to B or C
        b = w + w a + u b          into the goal, back to A, or across to the other one
    The second gives b = w (1 + a) / (1 - u); put into the first, a = (u + q) / (1 - q) with q = 2 w^2 / (1 - u).
    """

    @staticmethod
    def z(c0: float) -> tuple[float, float]:
        w = exp(c0 * 0.1)
        u = w ** sqrt(2)
        q = 2 * w**2 / (1 - u)
        a = (u + q) / (1 - q)
        return a, w * (1 + a) / (1 - u)


# --- lines ----------------------------------------------------------------------------------------------------------


def distance_to_segment(
    point: tuple[float, float], a: tuple[float, float], b: tuple[float, float]
) -> tuple[float, tuple[float, float]]:
    """Distance of a point to the segment from a to b, and the segment's point nearest to it."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    length_2 = ux * ux + uy * uy
    share = 0.0 if length_2 == 0 else ((point[0] - a[0]) * ux + (point[1] - a[1]) * uy) / length_2
    share = min(1.0, max(0.0, share))
    near = (a[0] + share * ux, a[1] + share * uy)
    return hypot(point[0] - near[0], point[1] - near[1]), near


def rasterised(line_cells: FloatArray) -> list[Cell]:
    """The study's rule on an (n, 2) line in units of cells, in which the cell (c, r) has its centre at (c, r).

    Start in the first pose's cell; of the eight neighbours, never the one before, step to the one nearest to the rest
    of the line; cut the line there; stop in the last pose's cell.
    """
    rest = [(float(x), float(y)) for x, y in line_cells]
    cell, last = (tuple(int(np.floor(v + 0.5)) for v in rest[i]) for i in (0, -1))
    path = [cell]
    while cell != last:
        best = None
        for dx, dy in MOVES:
            candidate = (cell[0] + dx, cell[1] + dy)
            if len(path) > 1 and candidate == path[-2]:
                continue
            for number in range(len(rest) - 1):
                distance, near = distance_to_segment(candidate, rest[number], rest[number + 1])
                if best is None or distance < best[0]:
                    best = distance, candidate, near, number
        _, cell, near, number = best
        rest = [near, *rest[number + 1 :]]
        path.append(cell)
        assert len(path) < 10_000, "the rule walks in circles"
    return path


def passed_cells(line_cells: FloatArray, *, arms: bool) -> list[tuple[Cell, float]]:
    """What an (n, 2) line in units of cells passes, in exact fractions: cell (c, r) reaches from (c, r) to (c+1, r+1).

    Either every cell with the length of the line in it, or, of the crosses through the cells' centres, each arm that
    the line crosses, with how much nearer to the centre than to the arm's end (half a cell away) that is.
    """
    passed = []
    for start, end in pairwise([tuple(map(Fraction, point)) for point in line_cells.tolist()]):
        along = [b - a for a, b in zip(start, end, strict=True)]
        shares = {}
        for axis in (0, 1):
            low, high = sorted((start[axis], end[axis]))
            for line in range(floor(low) - 1, floor(high) + 2):
                at = line + Fraction(1, 2) * arms
                if along[axis] != 0 and low <= at <= high:
                    shares[(at - start[axis]) / along[axis]] = axis
        if arms:
            for share, axis in sorted(shares.items()):
                point = [a + share * b for a, b in zip(start, along, strict=True)]
                cell = [floor(v) for v in point]
                off = point[1 - axis] - cell[1 - axis] - Fraction(1, 2)
                passed.append(((cell[0], cell[1]), float(Fraction(1, 2) - abs(off))))
        else:
            for one, other in pairwise(sorted({Fraction(0), Fraction(1), *shares})):
                x, y = (a + (one + other) / 2 * b for a, b in zip(start, along, strict=True))
                passed.append(((floor(x), floor(y)), float(other - one) * hypot(*map(float, along))))
    return passed


def without_spare_cells(passed: list[tuple[Cell, float]], first: Cell, last: Cell, apart: int) -> list[Cell]:
    """Take the least cell out of those whose neighbours in the path are at most so far apart, again and again.

    For lines that are not made to touch corners and borders, where cells would weigh nothing or the same.
    """
    path = [[first, inf], *([cell, weight] for cell, weight in passed), [last, inf]]
    while True:
        for i in range(len(path) - 1, 0, -1):
            if path[i][0] == path[i - 1][0]:
                path[i - 1][1] += path.pop(i)[1]
        spare = [
            i
            for i in range(1, len(path) - 1)
            if max(abs(a - b) for a, b in zip(path[i - 1][0], path[i + 1][0], strict=True)) <= apart
        ]
        if not spare:
            return [cell for cell, _ in path]
        path.pop(min(spare, key=lambda i: path[i][1]))


def nearest_times(
    line_m: FloatArray, t_s: FloatArray, centres_m: FloatArray, piece_m: float
) -> tuple[list[float], float]:
    """Times in order at which a line is nearest to points, as a sum of squared distances, and that sum.

    The line is looked at in pieces; the first point has the line's first time, the last point its last.
    """
    places = [(float(t_s[0]), *map(float, line_m[0]))]
    for (x0, y0), (x1, y1), t0, t1 in zip(line_m[:-1], line_m[1:], t_s[:-1], t_s[1:], strict=True):
        pieces = max(1, ceil(hypot(x1 - x0, y1 - y0) / piece_m))
        places += [
            (t0 + (t1 - t0) * i / pieces, x0 + (x1 - x0) * i / pieces, y0 + (y1 - y0) * i / pieces)
            for i in range(1, pieces + 1)
        ]
    # By point: for every place the least sum with this point there, and the place of the point before.
    sums = [0.0 if i == 0 else inf for i in range(len(places))]
    origins = []
    for cx, cy in centres_m[1:]:
        least, origin, now, came = inf, 0, [], []
        for i, (_, x, y) in enumerate(places):
            if sums[i] < least:
                least, origin = sums[i], i
            now.append(least + (x - cx) ** 2 + (y - cy) ** 2)
            came.append(origin)
        sums = now
        origins.append(came)
    at = [len(places) - 1]
    for came in reversed(origins):
        at.append(came[at[-1]])
    return [places[i][0] for i in reversed(at)], sums[-1]


def area_by_raster(line_m: FloatArray, nominal_m: FloatArray, cell_m: float) -> float:
    """Area between two lines: small squares whose centre lies inside the closed curve of both (even-odd rule)."""
    ring = np.concatenate([line_m, nominal_m[::-1], line_m[:1]])
    low, high = ring.min(axis=0) - cell_m, ring.max(axis=0) + cell_m
    x = np.arange(low[0], high[0], cell_m)[None, :]
    y = np.arange(low[1], high[1], cell_m)[:, None]
    inside = np.zeros((y.size, x.size), dtype=bool)
    for (x0, y0), (x1, y1) in pairwise(ring):
        if y0 == y1:
            continue
        crossed = (y0 > y) != (y1 > y)
        inside ^= crossed & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    return float(inside.sum()) * cell_m**2


def distance_by_sampling(line_m: FloatArray, people_m: FloatArray, per_segment: int = 20_000) -> float:
    """Least distance of many points along a line to any person."""
    shares = np.linspace(0, 1, per_segment)[:, None]
    points = np.concatenate([a + shares * (b - a) for a, b in pairwise(line_m)])
    return min(float(np.hypot(*(points - person).T).min()) for person in people_m)


def length_by_steps(line_m: FloatArray) -> float:
    return sum(hypot(x1 - x0, y1 - y0) for (x0, y0), (x1, y1) in pairwise(line_m))


def best_on_ball(gradient: FloatArray, hessian: FloatArray, radius: float) -> float:
    """Largest value of g.p + p.H.p/2 over |p| <= radius, over many directions (k = 2 or 3) and all lengths."""
    if len(gradient) == 2:
        angles = np.linspace(-np.pi, np.pi, 40_001)
        directions = np.stack([np.cos(angles), np.sin(angles)])
    else:
        turns = 20_000  # a spiral from pole to pole
        heights = np.linspace(-1, 1, 200_001)
        across = np.sqrt(1 - heights**2)
        directions = np.stack([across * np.cos(turns * heights), across * np.sin(turns * heights), heights])
    slope = gradient @ directions
    bend = np.einsum("ik,ij,jk->k", directions, hessian, directions)
    peak = np.where(bend < 0, np.clip(-slope / np.where(bend < 0, bend, -1.0), 0, radius), radius)
    return float(max((slope * length + bend * length**2 / 2).max() for length in (peak, np.full_like(peak, radius))))
