"""The trust-region method: known maxima, bounds, saddles, places where nothing is defined."""

import numpy as np
import oracles
import pytest
from scipy.optimize import minimize

from navirl_cli.irl.newton import Point, _region_step, _step, maximise

ALL = np.inf


def quadratic(gradient, hessian):
    def objective(x):
        return Point(x, float(gradient @ x + 0.5 * x @ hessian @ x), gradient + hessian @ x, hessian)

    return objective


def climb(objective, start, lower=None, upper=None, free=None, progress=None):
    start = np.asarray(start, dtype=float)
    lower = np.full(len(start), -ALL) if lower is None else np.asarray(lower, dtype=float)
    upper = np.full(len(start), ALL) if upper is None else np.asarray(upper, dtype=float)
    free = np.ones(len(start), dtype=bool) if free is None else np.asarray(free)
    begin = objective(np.clip(start, lower, upper))
    return maximise(objective, begin, (lower, upper), free, progress)


def test_a_quadratic_is_climbed_to_its_top_and_every_accepted_point_is_reported():
    hessian = np.array([[-2.0, 0.5], [0.5, -1.0]])
    top = np.array([3.0, -2.0])
    seen = []
    found = climb(quadratic(-hessian @ top, hessian), [0.0, 0.0], progress=seen.append)
    assert found.converged
    assert found.best.x == pytest.approx(top, abs=1e-9)
    assert found.path_value[1:].tolist() == seen
    assert (np.diff(found.path_value) > 0).all()
    assert found.path[0].tolist() == [0.0, 0.0]
    assert found.path[-1].tolist() == found.best.x.tolist()


def test_a_bound_is_met_and_the_others_are_optimal():
    # Top at (2, 2); x is held at 1, where d/dy (-y^2 + y x + ...) = 0: H = [[-2, 1], [1, -2]], g = (2, 2).
    objective = quadratic(np.array([2.0, 2.0]), np.array([[-2.0, 1.0], [1.0, -2.0]]))
    found = climb(objective, [0.0, 0.0], upper=[1.0, 10.0])
    assert found.converged
    assert found.best.x[0] == 1.0, "on the bound to the last digit"
    assert found.best.x[1] == pytest.approx(1.5, abs=1e-9)


def test_a_bound_is_left_when_that_raises_the_objective():
    objective = quadratic(np.array([-2.0, -2.0]), np.array([[-2.0, 0.0], [0.0, -2.0]]))
    found = climb(objective, [0.0, 5.0], upper=[0.0, 10.0])
    assert found.converged
    assert found.best.x == pytest.approx([-1.0, -1.0], abs=1e-9)


def test_fixed_variables_do_not_move():
    objective = quadratic(np.array([2.0, 2.0]), np.array([[-2.0, 1.0], [1.0, -2.0]]))
    found = climb(objective, [0.25, 0.0], free=[False, True])
    assert found.converged
    assert found.best.x[0] == 0.25
    assert found.best.x[1] == pytest.approx(1.125, abs=1e-9)


@pytest.mark.parametrize("block", range(10))
def test_concave_quadratics_in_boxes_against_scipy(block):
    rng = np.random.default_rng(block)
    for trial in range(40):
        k = int(rng.integers(2, 6))
        root = rng.normal(size=(k, k))
        hessian, gradient = -(root @ root.T + 0.01 * np.eye(k)), 3 * rng.normal(size=k)
        lower, upper = -rng.random(k), rng.random(k)
        start = lower + (upper - lower) * rng.random(k)
        start = np.where(rng.random(k) < 0.4, lower, start) if trial % 2 else start
        objective = quadratic(gradient, hessian)
        found = climb(objective, start, lower, upper)
        assert found.converged
        other = minimize(
            lambda x, f=objective: -f(x).value,
            start,
            jac=lambda x, f=objective: -f(x).gradient,
            bounds=list(zip(lower, upper, strict=True)),
            method="L-BFGS-B",
            options={"ftol": 1e-15, "gtol": 1e-10},
        )
        assert found.best.value >= -other.fun - 1e-8
        assert ((found.best.x >= lower) & (found.best.x <= upper)).all()


@pytest.mark.parametrize("block", range(6))
def test_where_it_converges_no_direction_leads_up_in_boxes_with_saddles(block):
    rng = np.random.default_rng(50 + block)
    for _ in range(40):
        k = int(rng.integers(2, 5))
        root = rng.normal(size=(k, k))
        objective = quadratic(3 * rng.normal(size=k), root + root.T)
        lower, upper = -rng.random(k), rng.random(k)
        found = climb(objective, np.zeros(k), lower, upper)
        assert found.converged
        x, gradient = found.best.x, found.best.gradient
        assert np.abs(np.clip(x + gradient, lower, upper) - x).max() < 1e-3


def test_a_saddle_is_left():
    # x^2 - y^2 - x^4/4 from its saddle: the tops are at x = +-sqrt(2), value 1.
    def objective(x):
        value = x[0] ** 2 - x[1] ** 2 - x[0] ** 4 / 4
        gradient = np.array([2 * x[0] - x[0] ** 3, -2 * x[1]])
        return Point(x, float(value), gradient, np.diag([2 - 3 * x[0] ** 2, -2.0]))

    found = climb(objective, [0.0, 0.0])
    assert found.converged
    assert found.best.value == pytest.approx(1.0, abs=1e-9)


def banana(x):
    """Rosenbrock's valley, turned over: top 0 at (1, 1)."""
    a, b = x
    value = -(100 * (b - a * a) ** 2 + (1 - a) ** 2)
    gradient = np.array([400 * a * (b - a * a) + 2 * (1 - a), -200 * (b - a * a)])
    hessian = np.array([[400 * b - 1200 * a * a - 2, 400 * a], [400 * a, -200.0]])
    return Point(x, float(value), gradient, hessian)


def test_a_bent_ridge_is_followed():
    found = climb(banana, [-1.2, 1.0])
    assert found.converged
    assert found.best.x == pytest.approx([1.0, 1.0], abs=1e-4)
    assert len(found.path) < 60


def test_a_bent_ridge_that_a_bound_cuts_off():
    found = climb(banana, [-1.2, 1.0], upper=[0.5, 10.0])
    assert found.converged
    assert found.best.x == pytest.approx([0.5, 0.25], abs=1e-6)


def test_where_the_objective_does_not_exist_the_step_is_shortened():
    # log x + log(1 - x): steps over the ends give -inf; top at 1/2.
    def objective(x):
        if not 0 < x[0] < 1:
            return Point(x, -np.inf, np.zeros(1), np.zeros((1, 1)))
        slope, bend = 1 / x[0] - 1 / (1 - x[0]), -1 / x[0] ** 2 - 1 / (1 - x[0]) ** 2
        return Point(x, float(np.log(x[0] * (1 - x[0]))), np.array([slope]), np.array([[bend]]))

    found = climb(objective, [1e-3])
    assert found.converged
    assert found.best.x[0] == pytest.approx(0.5, abs=1e-4)
    assert np.isfinite(found.path_value).all()
    assert not found.blocked


def test_it_does_not_report_convergence_at_a_jump_of_the_objective():
    def objective(x):
        value = float(x[0]) if x[0] < 1 else -np.inf
        return Point(x, value, np.ones(1), np.zeros((1, 1)))

    found = climb(objective, [0.0])
    assert not found.converged
    assert found.blocked
    assert found.best.x[0] == pytest.approx(1.0, abs=1e-6)
    assert np.isfinite(found.best.value)


def test_a_climb_without_end_is_not_converged():
    found = climb(lambda x: Point(x, float(x[0]), np.ones(1), np.zeros((1, 1))), [0.0])
    assert not found.converged
    assert found.best.x[0] > 1000


@pytest.mark.parametrize("beyond", [-np.inf, 1e9 - 1.0])
def test_a_step_with_a_predicted_gain_below_rounding_is_not_taken_downhill(beyond):
    # A value of 1e9 is known to 1e-7: promises below are not told from noise, but a loss of 1 is no noise.
    def objective(x):
        if x[0] > 0:
            return Point(x, beyond, np.zeros(1), np.zeros((1, 1)))
        return Point(x, 1e9, np.array([1e-5]), np.array([[-1e-3]]))

    found = climb(objective, [0.0])
    assert found.best.value == 1e9
    assert found.best.x[0] == 0.0


@pytest.mark.parametrize("seed", range(30))
def test_a_step_stays_within_region_and_bounds_and_raises_the_model(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, 4))
    here = Point(np.zeros(4), 0.0, rng.normal(size=4), root + root.T)
    lower, upper, radius = -rng.random(4), rng.random(4), float(rng.uniform(0.2, 1.5))
    step = _step(here, lower, upper, np.ones(4, dtype=bool), radius)
    assert np.linalg.norm(step) <= radius * (1 + 1e-9)
    assert ((step >= lower) & (step <= upper)).all()
    assert here.gradient @ step + step @ here.hessian @ step / 2 > 0


@pytest.mark.parametrize("size", [2, 3])
@pytest.mark.parametrize("seed", range(8))
def test_region_steps_against_every_direction(size, seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    hessian, gradient = root + root.T - seed * np.eye(size) / 2, rng.normal(size=size)
    radius = float(rng.uniform(0.1, 3))
    step = _region_step(gradient, hessian, radius)
    assert np.linalg.norm(step) <= radius * (1 + 1e-9)
    value = gradient @ step + step @ hessian @ step / 2
    best = oracles.best_on_ball(gradient, hessian, radius)
    assert value >= best - 1e-9
    assert value == pytest.approx(best, rel=1e-3)


def test_region_step_in_the_hard_case():
    # The gradient does not touch the direction of largest curvature: the way out is along it, either sense.
    step = _region_step(np.array([1.0, 0.0]), np.diag([-1.0, 2.0]), 2.0)
    assert step[0] == pytest.approx(1 / 3)  # g / (2 - (-1))
    assert abs(step[1]) == pytest.approx(np.sqrt(4 - 1 / 9))


def test_no_region_no_step():
    assert np.linalg.norm(_region_step(np.array([1.0, 2.0]), np.diag([-1.0, 2.0]), 0.0)) < 1e-9


def waves(x):
    """Tops at 0 and near 2 pi, the second one lower."""
    return Point(
        x,
        float(np.cos(x[0]) - x[0] ** 2 / 1000),
        np.array([-np.sin(x[0]) - x[0] / 500]),
        np.array([[-np.cos(x[0]) - 1 / 500]]),
    )


@pytest.mark.parametrize(("start", "same"), [(0.9, True), (-0.5, True), (5.5, False), (1.6, True), (4.6, False)])
def test_a_search_that_converges_to_a_known_maximum_ends_early(start, same):
    top = climb(waves, [0.3]).best
    begin = waves(np.array([start]))
    again = maximise(waves, begin, (np.array([-20.0]), np.array([20.0])), np.array([True]), known=[top])
    assert again.converged is not same
    assert abs(again.best.x[0] - top.x[0]) < (1.0 if same else 10.0)
    if not same:
        assert again.best.x[0] == pytest.approx(2 * np.pi, abs=0.02)
