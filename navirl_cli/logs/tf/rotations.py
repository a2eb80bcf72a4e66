"""Rotations as unit quaternions in tf's order x, y, z, w.

These few lines of numpy stand in place of scipy's Rotation, whose import takes longer than reading a small log;
tests/test_rotations.py holds them to it. Source: Shoemake 1985, Animating rotation with quaternion curves, SIGGRAPH.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from navirl_cli.arrays import BoolArray, FloatArray

#: The rotation that changes nothing.
IDENTITY: Final = (0.0, 0.0, 0.0, 1.0)
#: Signs of the inverse rotation's numbers.
INVERSE: Final = np.array((-1.0, -1.0, -1.0, 1.0))
#: Lengths that are normalised to 1; a quaternion of another length is damaged, or no rotation at all.
_LENGTHS: Final = (0.9, 1.1)
#: A length within this of 1 is a matter of rounding.
_ROUNDING: Final = 0.01
#: A shorter quaternion is one of zeros: a message that was never filled in.
_ZERO: Final = 1e-6


def are_rotations(quaternions: FloatArray) -> BoolArray:
    """Which quaternions of shape (n, 4) are rotations, shape (n,): those of a length near 1."""
    length = _lengths(quaternions)
    rotations: BoolArray = (length > _LENGTHS[0]) & (length < _LENGTHS[1])
    return rotations


def faults(quaternions: FloatArray) -> dict[str, BoolArray]:
    """Why some quaternions of shape (n, 4) are no rotations.

    Returns:
        By reason, as in "3 with ...": which ones, shape (n,); only reasons that occur.
    """
    good, length = are_rotations(quaternions), _lengths(quaternions)
    finite: BoolArray = np.array(np.isfinite(quaternions).all(axis=1))
    wrong = finite & ~good & (length > _ZERO)
    example = f"{math.hypot(*quaternions[wrong][0].tolist()):.3g}" if wrong.any() else ""
    found: dict[str, BoolArray] = {
        "with a quaternion of zeros": finite & (length <= _ZERO),
        f"with a quaternion of length {example}, not 1": wrong,
        "with a quaternion that is not finite": ~finite,
    }
    return {reason: rows for reason, rows in found.items() if rows.any()}


def rescaled(quaternions: FloatArray) -> str:
    """What :func:`normalised` changes beyond rounding in rotations of shape (n, 4), in words; "" for nothing."""
    length = _lengths(quaternions)
    some = length[np.abs(length - 1.0) > _ROUNDING]
    if not some.size:
        return ""
    return f"{some.size} quaternions have lengths from {some.min():.3f} to {some.max():.3f}, not 1; normalised"


def _lengths(quaternions: FloatArray) -> FloatArray:
    """Lengths, shape (n,), of which those above 2 are only known to be."""
    # clipped, because the square of a damaged number may be too large for a float
    length: FloatArray = np.linalg.norm(np.clip(quaternions, -2.0, 2.0), axis=1)
    return length


def normalised(quaternions: FloatArray) -> FloatArray:
    """Quaternions of length 1.

    Args:
        quaternions: Shape (n, 4), of any length but 0.

    Returns:
        Shape (n, 4).
    """
    unit: FloatArray = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit


def product(second: FloatArray, first: FloatArray) -> FloatArray:
    """The rotations that apply `first` and then `second`.

    Args:
        second: Unit quaternions, shape (n, 4).
        first: The same.

    Returns:
        Shape (n, 4).
    """
    x, y, z, w = second.T
    a, b, c, d = first.T
    rows = (
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    )
    return np.stack(rows, axis=1)


def rotate(quaternions: FloatArray, vectors: ArrayLike) -> FloatArray:
    """Vectors after rotation: v + 2 w (u x v) + 2 u x (u x v) for a quaternion of vector part u and scalar part w.

    Args:
        quaternions: Unit quaternions, shape (n, 4).
        vectors: Shape (n, 3), or (3,) for one that all rotate.

    Returns:
        Shape (n, 3), in the vectors' unit.
    """
    x, y, z, w = quaternions.T
    a, b, c = np.asarray(vectors, dtype=np.float64).T
    p, q, r = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return np.stack((a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p), axis=1)


def matrices(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices of unit quaternions of shape (n, 4), shape (n, 3, 3)."""
    return np.stack([rotate(quaternions, axis) for axis in np.eye(3)], axis=2)


def roll_pitch_yaw(quaternions: FloatArray) -> FloatArray:
    """Angles about the fixed axes x, y and z, in this order, of unit quaternions of shape (n, 4), rad, shape (n, 3)."""
    turns = matrices(quaternions)
    roll, yaw = np.arctan2(turns[:, 2, 1], turns[:, 2, 2]), np.arctan2(turns[:, 1, 0], turns[:, 0, 0])
    pitch = np.arcsin(np.clip(-turns[:, 2, 0], -1.0, 1.0))
    return np.stack([roll, pitch, yaw], axis=1)


def slerp(begin: FloatArray, end: FloatArray, share: FloatArray) -> FloatArray:
    """Spherical linear interpolation on the shorter arc.

    Args:
        begin: Unit quaternions, shape (n, 4).
        end: The same; of opposite quaternions, which are the same rotation, that counts which is nearer to `begin`.
        share: How far from `begin` to `end`, 0 to 1, shape (n,).

    Returns:
        Unit quaternions, shape (n, 4).
    """
    end = np.where(np.sum(begin * end, axis=1, keepdims=True) < 0.0, -end, end)
    # by the lengths of sum and difference, which are exact for small angles, as the cosine is not
    angle = 2.0 * np.arctan2(np.linalg.norm(end - begin, axis=1), np.linalg.norm(end + begin, axis=1))
    sine = np.sin(angle)
    weights = [
        np.divide(np.sin(part * angle), sine, out=part.copy(), where=sine > 0.0)[:, None]
        for part in (1.0 - share, share)
    ]
    return normalised(weights[0] * begin + weights[1] * end)
