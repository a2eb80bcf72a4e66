"""The bias of a force sensor: its output without a push, which drifts with temperature and steps with a new load."""

import numpy as np
from numpy.typing import NDArray

from navirl_cli.arrays import FloatArray, IntArray
from navirl_cli.demos.smoothing import smoothing_spline

#: Length of the stretches whose steadiness is judged, s.
STRETCH_S = 0.25
#: Length of the bins of steady stretches, s; with fewer bins than this the bias is one constant.
BIN_S = 2.0
FEWEST_BINS = 30
#: Costs of a change of the bias, measured in forces at which a contact begins: the change per minute without cost, the
#: cost of each further such force in s, and the largest cost of a change in s.
FREE_PER_MIN, COST_S, MOST_COST_S = 0.5, 20.0, 60.0
#: A change that exceeds the free one by this much, in the same measure, is a step.
STEP = 0.5
#: Most bins between two that show the bias.
LOOK_BACK = 300
#: Changes of the bias within this time are smoothed, s; fewer bins between two steps hold one constant.
BEND_S, _FEWEST = 10.0, 5


def bias_of(t_s: FloatArray, force_n: FloatArray, begins_n: float) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The sensor's bias as a function of time.

    Where the force is steady the sensor shows its bias, or a steady push. The two differ in how they change: the bias
    drifts, and steps rarely and lastingly; a push begins and ends. Among all chains of steady bins in order of time the
    one with the largest duration - cost of changes is taken. With contacts from 3 N on, 1.5 N a minute are free, and
    each further 3 N cost 20 s, at most 60 s a change. So a push, whose force changes twice, is left out unless it lasts
    for minutes; a load put on the robot is followed if it stays. The bias is a smoothing spline through the chain, a
    separate one after each step. Where less than a minute is steady, it is :func:`quiet_bias`.

    Args:
        t_s: (n,) s, increasing.
        force_n: (n, 3) N, sensor frame.
        begins_n: Force at which a contact begins, N; much smaller changes do no harm.

    Returns:
        (n, 3) bias in N, and (n,) samples of quiet stretches that show it.
    """
    rate = 1 / float(np.median(np.diff(t_s)))
    means, spread, length = _stretches(force_n, rate)
    middle = t_s[: len(means) * length].reshape(len(means), length).mean(axis=1)
    # not only the quiet stretches: on a moving robot the force varies more, around the same bias
    steady = spread <= 2 * np.median(spread) + 1e-12
    at, level = _binned(middle[steady], means[steady])
    if len(at) < FEWEST_BINS:
        constant, samples = quiet_bias(force_n, rate)
        return np.tile(constant, (len(force_n), 1)), samples
    chain = _chain(at, level, begins_n)
    at, level = at[chain], level[chain]
    steps = np.flatnonzero(_beyond(np.diff(at), np.diff(level, axis=0), begins_n) > STEP)
    at, level = _with_steps(at, _smooth(at, level, steps), steps, middle, means)
    bias, here = (np.stack([np.interp(times, at, axis) for axis in level.T], axis=1) for times in (t_s, middle))
    return bias, _samples(_near(means, here, _quiet(spread)), length, len(force_n))


def quiet_bias(force_n: FloatArray, rate_hz: float) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The sensor's bias as one constant, from the stretches without a push.

    A stretch is quiet when it varies hardly more than the quietest tenth of all. A steady push varies little too. But
    most quiet stretches are free of contact, and so is their median; stretches far from it are left out.

    Args:
        force_n: (n, 3) N, sensor frame.
        rate_hz: Samples a second.

    Returns:
        (3,) bias in N, and (n,) samples of the quiet stretches that it comes from.
    """
    means, spread, length = _stretches(force_n, rate_hz)
    quiet = _quiet(spread)
    quiet = _near(means, np.median(means[quiet], axis=0), quiet)
    return means[quiet].mean(axis=0), _samples(quiet, length, len(force_n))


def _stretches(force_n: FloatArray, rate_hz: float) -> tuple[FloatArray, FloatArray, int]:
    """(b, 3) means and (b,) standard deviations of the force in stretches, N, and the number of samples in each."""
    length = max(4, round(STRETCH_S * rate_hz))
    count = max(1, len(force_n) // length)
    blocks = force_n[: count * length].reshape(count, -1, 3)
    return blocks.mean(axis=1), np.sqrt(blocks.var(axis=1).sum(axis=1)), blocks.shape[1]


def _quiet(spread_n: FloatArray) -> NDArray[np.bool_]:
    """(b,) the stretches that vary hardly more than the quietest tenth."""
    quiet: NDArray[np.bool_] = spread_n <= 2 * np.quantile(spread_n, 0.1) + 1e-12
    return quiet


def _near(means_n: FloatArray, bias_n: FloatArray, quiet: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(b,) the quiet stretches that lie near the bias."""
    away = np.sqrt(((means_n - bias_n) ** 2).sum(axis=1))
    near: NDArray[np.bool_] = quiet & (away <= 3 * np.median(away[quiet]) + 1e-12)
    return near


def _samples(stretches: NDArray[np.bool_], length: int, count: int) -> NDArray[np.bool_]:
    """(count,) the samples of some stretches."""
    samples = np.zeros(count, dtype=bool)
    samples[: len(stretches) * length] = np.repeat(stretches, length)
    return samples


def _binned(t_s: FloatArray, force_n: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k,) mean times and (k, 3) median forces of the stretches in each bin that has some."""
    _, first = np.unique(np.floor((t_s - t_s[0]) / BIN_S), return_index=True)
    groups = np.split(np.arange(len(t_s)), first[1:])
    at = np.array([t_s[group].mean() for group in groups])
    return at, np.array([np.median(force_n[group], axis=0) for group in groups])


def _beyond(seconds: FloatArray, change_n: FloatArray, begins_n: float) -> FloatArray:
    """(k,) by how much changes of the bias, (k, 3) N within (k,) s, exceed the free change, in ``begins_n``."""
    size = np.sqrt((change_n**2).sum(axis=1)) / begins_n
    beyond: FloatArray = np.maximum(size - FREE_PER_MIN * seconds / 60, 0)
    return beyond


def _chain(at_s: FloatArray, level_n: FloatArray, begins_n: float) -> IntArray:
    """Numbers of the bins on the chain with the largest duration - cost of changes.

    Dynamic programming over the last bin of a chain: ``score`` is the value of the best chain up to each bin, s.
    """
    score = np.full(len(at_s), BIN_S)
    before = np.full(len(at_s), -1)
    for i in range(1, len(at_s)):
        past = slice(max(0, i - LOOK_BACK), i)
        beyond = _beyond(at_s[i] - at_s[past], level_n[i] - level_n[past], begins_n)
        reached = score[past] - np.minimum(COST_S * beyond, MOST_COST_S)
        best = int(reached.argmax())
        if reached[best] > 0:
            score[i] += reached[best]
            before[i] = past.start + best
    chain = [int(score.argmax())]
    while before[chain[-1]] >= 0:
        chain.append(int(before[chain[-1]]))
    return np.array(chain[::-1])


def _smooth(at_s: FloatArray, level_n: FloatArray, steps: IntArray) -> FloatArray:
    """(k, 3) the bias at the bins of a chain, smoothed from each step to the next.

    The spline's penalty is BEND_S^4 / BIN_S. It ends straight, and so follows a steady drift up to its ends.
    """
    parts = []
    for part in np.split(np.arange(len(at_s)), steps + 1):
        x, y = at_s[part], level_n[part]
        if len(part) < _FEWEST:
            parts.append(np.tile(y.mean(axis=0), (len(part), 1)))
        else:
            parts.append(smoothing_spline(x, y, BEND_S**4 / BIN_S))
    return np.concatenate(parts)


def _with_steps(
    at_s: FloatArray, level_n: FloatArray, steps: IntArray, middle_s: FloatArray, means_n: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The bias with each step at the time that best separates the stretches before it from those after it."""
    for step in steps[::-1]:
        old, new = level_n[step], level_n[step + 1]
        inside = np.flatnonzero((middle_s > at_s[step]) & (middle_s < at_s[step + 1]))
        nearer = [np.sqrt(((means_n[inside] - level) ** 2).sum(axis=1)) for level in (old, new)]
        first = int(np.append(0.0, np.cumsum(nearer[0] - nearer[1])).argmin())
        borders = np.concatenate([at_s[[step]], middle_s[inside], at_s[[step + 1]]])
        place = borders[first : first + 2].mean()
        at_s = np.insert(at_s, step + 1, [place, place])
        level_n = np.insert(level_n, step + 1, [old, new], axis=0)
    return at_s, level_n
