"""Bins find the nearest points, wherever one asks."""

import numpy as np
import pytest

from fenics_forming.physics.nearest import Bins


@pytest.mark.parametrize("shape", [(1, 1), (10, 0.3), (0.001, 5), (1, 0)])
@pytest.mark.parametrize("count", [1, 2, 7, 500])
@pytest.mark.parametrize("many", [1, 8])
def test_no_other_point_is_nearer_than_those_found(shape, count, many):
    random = np.random.default_rng(count)
    points = random.random((count, 2)) ** 3 * shape             # dense in one corner
    asked = (1.6 * random.random((200, 2)) - 0.3) * shape       # a third of them outside
    many = min(many, count)
    every = np.linalg.norm(points - asked[:, None], axis=2)
    found = Bins(points).query(asked, many)
    assert all(len(set(row)) == many for row in found.tolist())
    # the same differences of coordinates, rounded once or twice more
    assert np.allclose(np.take_along_axis(every, found, axis=1), np.sort(every, axis=1)[:, :many], rtol=1e-12, atol=1e-14)


def test_of_equally_near_points_the_first_is_taken():
    points = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    assert Bins(points).query(np.zeros((1, 2)), 3).tolist() == [[0, 1, 2]]
