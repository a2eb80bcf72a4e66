"""Rotations against scipy's, which is the slow twin: it takes longer to import than a small log to read."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from navirl_cli.logs.tf.rotations import IDENTITY, INVERSE, matrices, normalised, product, rotate, slerp

N = 500
#: Rounding of a few sums of products of numbers up to 1.
ROUNDING = 2e-15


@pytest.fixture
def rng():
    return np.random.default_rng(12)


def random_quaternions(rng, n=N):
    return normalised(rng.normal(size=(n, 4)))


def difference(found, rotations):
    """How far quaternions are from rotations; opposite quaternions are the same rotation."""
    right = rotations.as_quat()
    return np.minimum(np.abs(found - right).max(axis=1), np.abs(found + right).max(axis=1))


def test_quaternions_are_normalised(rng):
    found = normalised(rng.normal(size=(N, 4)) * 10.0 ** rng.uniform(-100, 100, (N, 1)))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=ROUNDING)


def test_products_and_inverses(rng):
    second, first = random_quaternions(rng), random_quaternions(rng)
    found = product(second, first)
    assert difference(found, Rotation.from_quat(second) * Rotation.from_quat(first)).max() < ROUNDING
    assert difference(first * INVERSE, Rotation.from_quat(first).inv()).max() < ROUNDING
    np.testing.assert_allclose(product(first, first * INVERSE), np.tile(IDENTITY, (N, 1)), atol=ROUNDING)


def test_rotated_vectors_and_matrices(rng):
    quaternions, vectors = random_quaternions(rng), rng.uniform(-1, 1, (N, 3))
    rotations = Rotation.from_quat(quaternions)
    np.testing.assert_allclose(rotate(quaternions, vectors), rotations.apply(vectors), atol=ROUNDING)
    np.testing.assert_allclose(rotate(quaternions, vectors[0]), rotations.apply(vectors[0]), atol=ROUNDING)
    np.testing.assert_allclose(matrices(quaternions), rotations.as_matrix(), atol=ROUNDING)


@pytest.mark.parametrize("angle_rad", [0.0, 1e-300, 1e-20, 1e-9, 1e-4, 0.1, 1.0, 3.0, np.pi - 1e-9])
def test_interpolation(rng, angle_rad):
    begin, axes, share = random_quaternions(rng), normalised(rng.normal(size=(N, 3))), rng.uniform(0, 1, N)
    end = (Rotation.from_quat(begin) * Rotation.from_rotvec(angle_rad * axes)).as_quat()
    found = slerp(begin, end * rng.choice((-1.0, 1.0), (N, 1)), share)
    right = Rotation.concatenate(
        [Slerp([0.0, 1.0], Rotation.from_quat(pair))(at) for *pair, at in zip(begin, end, share, strict=True)]
    )
    assert difference(found, right).max() < ROUNDING
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=ROUNDING)


def test_interpolation_begins_and_ends_where_it_should(rng):
    begin, end = random_quaternions(rng), random_quaternions(rng)
    assert difference(slerp(begin, end, np.zeros(N)), Rotation.from_quat(begin)).max() < ROUNDING
    assert difference(slerp(begin, end, np.ones(N)), Rotation.from_quat(end)).max() < ROUNDING


def test_half_a_turn_passes_through_a_quarter(rng):
    """Both arcs are the shorter one."""
    begin, axes = random_quaternions(rng), normalised(rng.normal(size=(N, 3)))
    end = (Rotation.from_quat(begin) * Rotation.from_rotvec(np.pi * axes)).as_quat()
    middle = Rotation.from_quat(slerp(begin, end, np.full(N, 0.5)))
    for other in (begin, end):
        turned = (middle * Rotation.from_quat(other).inv()).magnitude()
        np.testing.assert_allclose(turned, np.pi / 2, atol=1e-14)


def test_no_rotations():
    none = np.empty((0, 4))
    assert product(none, none).shape == slerp(none, none, np.empty(0)).shape == normalised(none).shape == (0, 4)
    assert rotate(none, (1.0, 2.0, 3.0)).shape == (0, 3)
    assert matrices(none).shape == (0, 3, 3)
