"""Gradient ascent by Adam: step for step against a plain loop written from the paper's description."""

from math import sqrt

import factories as make
import numpy as np
import pytest

from navirl_cli.irl.adam import ascend
from navirl_cli.irl.evidence import evidence_of
from navirl_cli.irl.fit import Method, fit
from navirl_cli.irl.likelihood import value_and_gradient
from navirl_cli.irl.reward import Reward
from navirl_cli.irl.status import Status

FAR = (np.full(2, -np.inf), np.full(2, np.inf))
BOTH = np.array([True, True])


def adam(objective, start, lower, upper, free, steps):
    """Kingma and Ba's algorithm 1, number by number, ascending; begun anew with 4/5 of the rate every 100 steps."""
    x = [float(value) for value in start]
    places = [list(x)]
    m = v = None
    for t in range(steps):
        if t % 100 == 0:
            m, v = [0.0] * len(x), [0.0] * len(x)
        _, g = objective(np.array(x))
        for i in range(len(x)):
            m[i] = 0.9 * m[i] + 0.1 * g[i]
            v[i] = 0.999 * v[i] + 0.001 * g[i] * g[i]
            if free[i]:
                m_hat, v_hat = m[i] / (1 - 0.9 ** (t % 100 + 1)), v[i] / (1 - 0.999 ** (t % 100 + 1))
                step = 0.1 * 0.8 ** (t // 100) * m_hat / (sqrt(v_hat) + 1e-8)
                x[i] = min(max(x[i] + step, lower[i]), upper[i])
        places.append(list(x))
    return np.array(places)


def bowl(x):
    """Top 0 at (3, -40), so flat in the second that it is under way for hundreds of steps."""
    away = x - np.array([3.0, -40.0])
    return float(-(away[0] ** 2) - 0.05 * away[1] ** 2), np.array([-2 * away[0], -0.1 * away[1]])


@pytest.mark.parametrize(
    ("bounds", "free"),
    [(FAR, BOTH), (FAR, np.array([True, False])), ((np.array([-9.0, -7.5]), np.array([1.5, 0.0])), BOTH)],
    ids=["free", "one held", "bounded"],
)
def test_every_step_against_a_plain_loop(bounds, free):
    places, values, _ = ascend(bowl, np.zeros(2), bounds, free)
    slow = adam(bowl, [0.0, 0.0], *bounds, free, len(places) - 1)
    assert len(places) > 20
    assert places == pytest.approx(slow, rel=1e-9, abs=1e-9)
    assert values == pytest.approx([bowl(x)[0] for x in slow])
    assert ((places >= bounds[0]) & (places <= bounds[1])).all()


def test_the_rate_falls_after_every_hundred_steps_and_the_means_are_reset():
    # On a slope of constant steepness every step of Adam is as long as the learning rate.
    places, values, ended = ascend(lambda x: (1e3 * x[0], np.array([1e3, 0.0])), np.zeros(2), FAR, BOTH)
    lengths = np.diff(places[:, 0])
    assert len(lengths) == 500
    assert lengths == pytest.approx(np.repeat(0.1 * 0.8 ** np.arange(5), 100), rel=1e-6)
    assert (places[:, 1] == 0).all()
    assert not ended
    assert values == pytest.approx(1e3 * places[:, 0])


def test_it_stops_when_value_and_gradient_are_below_their_tolerances():
    # Within 0.05 of the top of -x^2 the gradient is below 0.1; the step before changed the value by less than 0.01.
    places, values, ended = ascend(
        lambda x: (-float(x[0] ** 2), np.array([-2 * x[0], 0.0])), np.array([1.0, 5.0]), FAR, BOTH
    )
    assert ended
    flat = np.abs(2 * places[:, 0]) < 0.1
    still = np.concatenate([[False], np.abs(np.diff(values)) < 0.01])
    assert np.flatnonzero(flat & still)[0] == len(places) - 1


@pytest.mark.parametrize(("slope", "gain", "ends"), [(0.11, 0.009, False), (0.09, 0.011, False), (0.09, 0.009, True)])
def test_one_tolerance_alone_does_not_stop_it(slope, gain, ends):
    asked = []

    def objective(_):
        asked.append(True)
        return gain * len(asked), np.array([0.0, -slope])

    places, _, ended = ascend(objective, np.zeros(2), FAR, BOTH)
    assert ended is ends
    assert len(places) == (2 if ends else 501)


def test_a_fixed_variable_does_not_prevent_convergence():
    _, _, ended = ascend(lambda _: (0.0, np.array([0.0, 7.0])), np.zeros(2), FAR, np.array([True, False]))
    assert ended


def test_where_the_value_does_not_exist_the_step_is_halved():
    asked = []

    def cliff(x):
        asked.append(float(x[0]))
        return (float(x[0]), np.array([1.0, 0.0])) if x[0] < 0.17 else (-np.inf, np.zeros(2))

    places, values, ended = ascend(cliff, np.zeros(2), FAR, BOTH)
    assert asked[:4] == pytest.approx([0.0, 0.1, 0.2, 0.15])
    assert places[:3, 0] == pytest.approx([0.0, 0.1, 0.15])
    assert np.isfinite(values).all()
    assert (places[:, 0] < 0.17).all()
    assert places[-1, 0] == pytest.approx(0.17, abs=1e-3)
    assert not ended


def test_progress_is_called_with_every_value():
    told = []
    _, values, _ = ascend(bowl, np.zeros(2), FAR, BOTH, told.append)
    assert told == values[1:].tolist()


@pytest.fixture(scope="module")
def evidence():
    scene = make.scene_on(make.open_grid(14, 8), [0, 3], [13, 4], [[0.7, 0.4]])
    return evidence_of(make.drawn(scene, Reward((-32.0, -2.0, -4.0, 3.0)), 60, seed=6))


def test_a_fit_by_adam_follows_the_plain_loop_and_ends_at_newtons_maximum(evidence):
    start = Reward.named({})
    scale = np.array([10.0, 1.0, 1.0, 1.0])

    def objective(x):
        value, gradient = value_and_gradient(evidence, Reward(tuple(x * scale)))
        return value - 0.0005 * float(x @ x), gradient * scale - 0.001 * x

    told = []
    found = fit(evidence, start, 1e-3, method=Method.ADAM, progress=lambda step, value: told.append((step, value)))
    lower, upper = np.array([-1e3, -1e4, -1e4, 1e-3]), np.array([-1e-3, 0.0, 1e4, 1e3])
    slow = adam(objective, np.array(start.theta) / scale, lower, upper, [True] * 4, 25)
    assert found.path_theta[:26] == pytest.approx(slow * scale, rel=1e-7)
    assert found.method is Method.ADAM
    assert found.status is Status.CONVERGED
    assert [step for step, _ in told] == list(range(1, found.iterations + 1))
    assert told[-1][1] == pytest.approx(found.objective)
    newton = fit(evidence, start, 1e-3)
    assert newton.iterations < found.iterations / 3
    # The study's rule stops where the gradient is below 0.1: not quite at the top.
    assert 0 <= newton.log_likelihood - found.log_likelihood < 0.1
    assert np.abs(np.subtract(newton.reward.theta, found.reward.theta) / newton.standard_errors).max() < 0.5
    assert found.standard_errors == pytest.approx(newton.standard_errors, rel=0.2)


def test_adam_begins_at_the_given_start_alone_and_leaves_fixed_parameters(evidence):
    start = Reward((-45.0, -0.4, -2.0, 2.5))
    found = fit(evidence, start, 0.0, method=Method.ADAM, fixed=("c0", "sigma_p"))
    assert (found.reward.theta[0], found.reward.theta[3]) == (-45.0, 2.5)
    assert tuple(found.path_theta[0]) == pytest.approx(start.theta)
    assert found.reward.theta[1:3] == pytest.approx(
        fit(evidence, start, 0.0, fixed=("c0", "sigma_p")).reward.theta[1:3], abs=0.3
    )


def test_it_converges_at_once_if_all_variables_are_fixed(evidence):
    start = Reward.named({})
    found = fit(evidence, start, 0.0, method=Method.ADAM, fixed=("c0", "a_g", "a_p", "sigma_p"))
    assert found.reward == start
    assert found.status is Status.CONVERGED


def test_a_variable_on_its_bound_does_not_prevent_convergence():
    places, _, ended = ascend(bowl, np.zeros(2), (np.array([-9.0, -7.5]), np.array([9.0, 0.0])), BOTH)
    assert places[-1] == pytest.approx([3.0, -7.5], abs=0.1)
    assert ended
