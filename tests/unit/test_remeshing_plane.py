"""A plane body meshed anew: the same boundary, the same labels, the wanted sizes."""

import numpy as np
import pytest

from fenics_forming.physics import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.remeshing import BodyArrays, remesh

ENGINES = ["mmg", "gmsh"]


def rectangle(divisions):
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), divisions))
    body = BodyArrays(nodes.x.copy(), nodes.cells.copy())
    return body, where(body)


def where(body):
    """Labels of the sides of the rectangle by where they lie: mirror planes x = 0 and y = 0, a tool at y = 1."""
    x, y = body.x[body.sides[:, 2]].T
    return np.select([abs(x) < 1e-12, abs(y) < 1e-12, abs(y - 1) < 1e-12], [-1, -2, 1], 0)


def area(body):
    """Green's theorem on the parabolas of the boundary, mm²."""
    a, b, m = (body.x[body.sides[:, k]] for k in range(3))
    return float((cross(a, b) / 2 + 2 / 3 * cross(b - a, (a + b) / 2 - m)).sum())


def cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@pytest.mark.parametrize("engine", ENGINES)
def test_rectangle_keeps_its_sides_and_labels(engine):
    body, labels = rectangle((20, 10))
    new = remesh(body, labels, lambda points: np.full(len(points), 0.1), engine=engine)
    assert area(new) == pytest.approx(2.0, rel=1e-14)
    assert np.array_equal(new.labels, where(new)) and len(new.sides) == 60
    for axis in range(2):
        assert (new.x[new.sides[new.labels == -1 - axis], axis] == 0.0).all(), "not only to rounding"
    assert new.engine == engine
