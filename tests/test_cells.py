"""Distances and connected parts on cells, against scipy.ndimage and against drawings."""

import factories as make
import numpy as np
import pytest
from scipy import ndimage

from navirl_cli.demos.cells import connected_to, distances_to


@pytest.mark.parametrize("seed", range(4))
def test_distances_and_parts_of_random_maps(seed):
    rng = np.random.default_rng(seed)
    for _ in range(200):
        marked = rng.random(rng.integers(1, 16, 2)) < rng.random()
        if not marked.any():
            continue
        # Both are square roots of the same integers.
        assert (distances_to(marked) == ndimage.distance_transform_edt(~marked)).all()
        labels, _ = ndimage.label(marked, structure=np.ones((3, 3)))
        row, column = rng.choice(np.argwhere(marked))
        assert (connected_to(marked, (column, row)) == (labels == labels[row, column])).all()


def test_distances_across_a_large_map():
    marked = np.zeros((150, 400), dtype=bool)
    marked[np.arange(150), 2 * np.arange(150)] = True
    assert (distances_to(marked) == ndimage.distance_transform_edt(~marked)).all()


def test_parts_touch_at_corners_and_wind_back():
    grid = make.grid_of(
        """
        ..#.....
        ..#.###.
        ##.##.#.
        ......#.
        ####.##.
        ...#....
        """
    )
    free = ~grid.occupied
    expected = free.copy()
    expected[0, :3] = False  # lower left
    assert (connected_to(free, (0, 5)) == expected).all()
    assert (connected_to(free, (0, 0)) == (free & ~expected)).all()
