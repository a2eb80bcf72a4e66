"""Random effects: against a grid without approximation, closed forms, and finite differences."""

from dataclasses import dataclass, replace

import numpy as np
import oracles
import pytest
from scipy.stats import chi2

from navirl_cli.arrays import FloatArray
from navirl_cli.irl.newton import Point
from navirl_cli.irl.nodes import Alone, Nodes, draw, laplace, sampled, scattered
from navirl_cli.irl.random_effects import random_effects
from navirl_cli.irl.restricted import LEAST, MEAN_TIMES, WIDTH, Restricted
from navirl_cli.irl.spread import Factors, Spread
from navirl_cli.parallel import Local


@dataclass
class Bell:
    """A Gaussian likelihood."""

    at: FloatArray
    precision: FloatArray

    @property
    def bounds(self):
        return np.full(len(self.at), -np.inf), np.full(len(self.at), np.inf)

    def __call__(self, y):
        away = y - self.at
        return Point(y, -0.5 * away @ self.precision @ away, -self.precision @ away, -self.precision)

    def value(self, y):
        return self(y).value


@dataclass
class Lopsided:
    """The likelihood of a magnitude exp(y) seen through counts: steep above, flat below."""

    at: float
    information: float
    bounds = (np.array([-np.inf]), np.array([np.inf]))

    def __call__(self, y):
        grown = np.exp(y - self.at)
        value = self.information * (y - self.at - grown).sum()
        return Point(y, float(value), self.information * (1 - grown), -self.information * np.diag(grown))

    def value(self, y):
        return self(y).value


def bells(count=12, seed=0, scatter=(0.3, 0.2)):
    rng = np.random.default_rng(seed)
    precision = np.diag([50.0, 80.0])
    return [
        Bell(np.array([1.0, 2.0]) + rng.normal(0, scatter) + rng.normal(0, [0.14, 0.11]), precision)
        for _ in range(count)
    ]


def test_lopsided_people_are_those_of_a_grid():
    rng = np.random.default_rng(3)
    people = [Lopsided(float(rng.normal(1.0, 0.5)), float(rng.uniform(4, 12))) for _ in range(10)]
    found = random_effects(people, np.array([1.0]), executor=Local(1))
    places = np.linspace(-3, 4, 500)
    logs = np.array([[one.value(np.array([y])) for y in places] for one in people])
    twin = oracles.scattered_people(
        logs,
        places,
        np.linspace(-0.5, 2.5, 60),
        np.exp(np.linspace(np.log(LEAST), np.log(3), 60)),
        WIDTH,
        1.0,
        MEAN_TIMES * WIDTH,
    )
    assert found.converged
    mean, covariance = found.mixture.typical()
    spread = twin["mean"][1]
    assert mean[0] == pytest.approx(twin["mean"][0], abs=0.1 * spread)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(spread, rel=0.1)
    assert found.mixture.scatter_quantile(0, 0.5) == pytest.approx(twin["scatter"][0], rel=0.1)
    expected, deviation = twin["people"].T
    assert np.abs((found.mixture.person_mean[:, 0] - expected) / deviation).max() < 0.15
    assert np.sqrt(found.mixture.person_covariance[:, 0, 0]) == pytest.approx(deviation, rel=0.15)


def test_far_from_their_spread_skewed_people_are_still_those_of_a_grid():
    """Gaussian stand-ins made under a small scatter find a larger one too unlikely."""
    people = [Lopsided(at, 2.0) for at in (0.2, 0.8, 1.4)]
    near, far = Spread(np.array([1.0]), np.array([0.2])), Spread(np.array([0.8]), np.array([0.6]))
    places = np.linspace(-6, 4, 20_001)
    logs = np.array([[one.value(np.array([y])) for y in places] for one in people])
    weight = np.exp(logs + far.log_density(places[:, None]))
    exact = np.log(weight.sum(axis=1) * (places[1] - places[0]))
    around = [laplace(one, near.wider(2.0), near.mean) for one in people]
    nodes = [draw(Alone(one, k), mode, number=k) for k, (one, mode) in enumerate(zip(people, around, strict=True))]
    known = sampled(nodes, around, near.wider(2.0))
    mean, *_, found = known.moments(far)
    assert found == pytest.approx(exact, abs=0.02)
    assert mean[:, 0] == pytest.approx(weight @ places / weight.sum(axis=1), abs=0.02)
    standing = Factors.of([laplace(one, near, near.mean) for one in people], near)
    rise = [(known.moments(one)[2] - standing.moments(one)[2]).sum() for one in (near, far)]
    assert rise[1] - rise[0] > 0.1


def test_draws_around_two_approximations_count_together():
    person, spread = Lopsided(0.3, 5.0), Spread(np.array([1.0]), np.array([0.6]))
    mode = laplace(person, spread, spread.mean)
    beside = replace(mode, mean=mode.mean + 1.0)
    alone = Alone(person)
    both = Nodes.together([draw(alone, beside), draw(alone, mode, number=1)])
    assert both.around == (beside, mode)
    right = sampled([draw(alone, mode, number=2)], [mode], spread).posteriors(spread)[0]
    known = sampled([both], [mode], spread).posteriors(spread)[0]
    assert known.drawn == 2 * right.drawn
    assert known.mean == pytest.approx(right.mean, abs=0.05 * np.sqrt(right.covariance[0, 0]))
    assert known.evidence == pytest.approx(right.evidence, abs=0.02)


def test_a_posterior_under_a_spread_is_that_of_a_grid():
    person, spread = Lopsided(0.3, 5.0), Spread(np.array([1.0]), np.array([0.6]))
    mode = laplace(person, spread, spread.mean)
    known = sampled([draw(Alone(person), mode)], [mode], spread).posteriors(spread)[0]
    places = np.linspace(-4, 5, 20_001)
    logs = np.array([person.value(np.array([y])) for y in places]) + spread.log_density(places[:, None])
    weight = np.exp(logs)
    mean = weight @ places / weight.sum()
    variance = weight @ (places - mean) ** 2 / weight.sum()
    assert known.mean[0] == pytest.approx(mean, abs=0.03 * np.sqrt(variance))
    assert known.covariance[0, 0] == pytest.approx(variance, rel=0.05)
    assert known.evidence == pytest.approx(np.log(weight.sum() * (places[1] - places[0])), abs=2e-3)
    assert 0.5 * known.drawn < known.effective <= known.drawn


def test_gaussian_people_with_much_information_scatter_as_they_do():
    people = [Bell(one.at, one.precision * 1e4) for one in bells()]
    found = random_effects(people, np.zeros(2), width=1e6, executor=Local(1))
    at = np.array([one.at for one in people])
    mean, _ = found.mixture.typical()
    assert mean == pytest.approx(at.mean(axis=0), abs=1e-3)
    # With a flat density of the scatter, the sum of squares over its square has a chi-squared distribution, n - 2.
    assert found.spread.scatter == pytest.approx(np.sqrt(12 * at.var(axis=0) / chi2.median(10)), rel=0.03)
    assert found.differ.all()
    assert found.mixture.person_mean == pytest.approx(at, abs=1e-3)


def test_people_who_are_alike_are_not_said_to_differ():
    alike = [Bell(one.at, one.precision) for one in bells(scatter=(0.0, 0.0), seed=5)]
    found = random_effects(alike, np.zeros(2), executor=Local(1))
    assert not found.differ.any()
    at = np.array([one.at for one in alike])
    mean, _ = found.mixture.typical()
    away = np.abs(found.mixture.person_mean - mean)
    assert (away < np.abs(at - mean) + 1e-3).all(), "drawn towards the typical person"


def test_derivatives_of_the_restricted_likelihood():
    people, rng = bells(5), np.random.default_rng(1)
    spread = Spread(np.array([1.1, 1.9]), np.array([0.3, 0.25]))
    objective = Restricted(Factors.of([laplace(one, spread, spread.mean) for one in people], spread), np.zeros(2))
    x = spread.x + rng.normal(0, 0.2, 4)
    point = objective(x)
    assert point.gradient == pytest.approx(oracles.derivative(lambda z: objective(z).value, x), abs=1e-6)
    assert point.hessian == pytest.approx(oracles.derivative(lambda z: objective(z).gradient, x), abs=1e-4)


def test_nodes_are_even_and_their_density_is_right():
    person = Bell(np.array([0.5, -0.2]), np.array([[8.0, 3.0], [3.0, 6.0]]))
    spread = Spread(np.zeros(2), np.ones(2))
    y, density = scattered(laplace(person, spread, spread.mean), 4000, 0)
    logs = np.array([person.value(one) for one in y]) + spread.log_density(y) - density
    both = person.precision + np.eye(2)
    pull = person.precision @ person.at
    exact = 0.5 * pull @ np.linalg.solve(both, pull) - 0.5 * np.linalg.slogdet(both)[1] - 0.5 * pull @ person.at
    assert np.log(np.exp(logs).mean()) == pytest.approx(exact, abs=2e-3)


@dataclass
class Pair:
    """People who are asked together."""

    people: list
    members: np.ndarray

    def values(self, y):
        return np.array([one.value(y) for one in self.people])


def test_shared_nodes_serve_everybody_in_any_order():
    first, second, third = (Lopsided(at, 5.0) for at in (0.2, 0.7, 1.3))
    spread = Spread(np.array([0.8]), np.array([0.5]))
    modes = [laplace(one, spread, spread.mean) for one in (first, second, third)]
    exact = sampled(
        [draw(Alone(one, k), modes[k], 2000) for k, one in enumerate((first, second, third))], modes, spread
    )
    pair = Pair([third, first], np.array([2, 0]))
    shared = Nodes.together([draw(pair, modes[2], 100), draw(pair, modes[0], 150, number=1)])
    assert shared.counts == (200, 300)
    known = sampled([shared, draw(Alone(second, 1), modes[1], 200)], modes, spread).moments(spread)
    for found, expected in zip(known, exact.moments(spread), strict=True):
        assert found == pytest.approx(expected, abs=5e-3)


def test_the_error_of_nodes_is_known():
    person, spread = Lopsided(0.3, 4.0), Spread(np.array([0.8]), np.array([0.6]))
    mode = laplace(person, spread, spread.mean)
    slopes, noise = [], []
    for number in range(60):
        known = sampled([draw(Alone(person), mode, 16, number)], [mode], spread)
        mean, covariance, _ = known.moments(spread)
        away = mean[0, 0] - spread.mean[0]
        slopes.append([away / 0.36, (away**2 + covariance[0, 0, 0]) / 0.36 - 1])
        noise.append(np.diag(known.noise(spread)))
    ratio = np.var(slopes, axis=0) / np.mean(noise, axis=0)
    assert (ratio < 1.2).all(), "not too small"
    assert (ratio > 0.02).all(), "nor much too large, by even nodes"


def test_a_spread_stays_near_another():
    other = Spread(np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    found = Spread(np.array([5.0, 2.1]), np.array([0.11, 0.001])).near(other, (1.0, 0.7))
    assert found.mean == pytest.approx([1.1, 2.1])
    assert found.scatter == pytest.approx([0.11, 0.2 * np.exp(-0.7)])


def test_between_far_nodes_the_stand_in_is_mended_as_under_a_wider_scatter():
    person, spread = Lopsided(0.3, 5.0), Spread(np.array([1.0]), np.array([0.6]))
    mode = laplace(person, spread, spread.mean)
    known = replace(sampled([draw(Alone(person), mode, 16)], [mode], spread), least=0.15)
    mean, covariance, log = known.moments(Spread(np.array([0.6]), np.array([0.01])))
    assert log[0] == pytest.approx(person.value(np.array([0.6])), abs=0.02), "of people who are alike"
    assert mean[0, 0] == pytest.approx(0.6, abs=1e-3)
    assert covariance[0, 0, 0] == pytest.approx(1e-4, rel=0.02)
