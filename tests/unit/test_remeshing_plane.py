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
    middle = body.x[body.sides[:, 2]]
    labels = np.select([middle[:, 0] == 0, middle[:, 1] == 0, middle[:, 1] == 1], [-1, -2, 1], 0)
    return body, labels


def area(body):
    """Green's theorem on the parabolas of the boundary, mm²."""
    a, b, m = (body.x[body.sides[:, k]] for k in range(3))
    return float((np.cross(a, b) / 2 + 2 / 3 * np.cross(b - a, (a + b) / 2 - m)).sum())


@pytest.mark.parametrize("engine", ENGINES)
def test_rectangle_keeps_its_sides_and_labels(engine):
    body, labels = rectangle((20, 10))
    new = remesh(body, labels, lambda points: np.full(len(points), 0.1), engine=engine)
    assert area(new) == pytest.approx(2.0, rel=1e-14)
    middle = new.x[new.sides[:, 2]]
    expected = np.select([middle[:, 0] == 0, middle[:, 1] == 0, middle[:, 1] == 1], [-1, -2, 1], 0)
    assert np.array_equal(new.labels, expected) and len(new.sides) == 60
    assert new.engine == engine
