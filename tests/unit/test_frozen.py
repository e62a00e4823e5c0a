"""A frozen field: quadratic in its mesh, linear beyond, and not of the nodes that have moved since."""

import numpy as np
import pytest

from fenics_forming import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.process.frozen import FrozenField


def unit_mesh(dim):
    return meshing.rectangle((0, 0), (1, 1), (3, 3)) if dim == 2 else meshing.box((0, 0, 0), (1, 1, 1), (2, 2, 2))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_quadratic_field_is_met_at_any_point_of_a_straight_mesh(dim):
    nodes = Nodes(unit_mesh(dim))
    field = lambda x: np.column_stack([x[:, 0] ** 2 - x[:, 1] * x[:, -1], 3 * x[:, 1] + 1])  # noqa: E731
    frozen = FrozenField(nodes, field(nodes.x))
    points = np.random.default_rng(1).uniform(0, 1, (40, dim))
    assert frozen.at(points) == pytest.approx(field(points), abs=1e-12)
    assert frozen.at(nodes.x) == pytest.approx(field(nodes.x), abs=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_beyond_the_mesh_the_field_goes_on_linearly(dim):
    """A linear field is met there too; of a quadratic one, the tangent at the nearest place."""
    nodes = Nodes(unit_mesh(dim))
    slope = np.arange(1.0, dim + 1)
    outside = np.vstack([np.full(dim, 1.3), np.full(dim, -0.2), np.r_[0.4, np.full(dim - 1, 1.1)]])
    assert FrozenField(nodes, (nodes.x @ slope)[:, None]).at(outside)[:, 0] == pytest.approx(outside @ slope, abs=1e-12)
    beyond = np.array([np.r_[1.2, np.full(dim - 1, 0.45)]])
    square = FrozenField(nodes, nodes.x[:, :1] ** 2)
    assert square.at(beyond)[0, 0] == pytest.approx(1 + 2 * 0.2, abs=1e-12)
    found = square.find(np.vstack([beyond, 0.5 * np.ones(dim)]))
    assert found.distance == pytest.approx([0.2, 0.0], abs=1e-12)


def test_moving_the_nodes_does_not_move_the_field():
    nodes = Nodes(unit_mesh(2))
    frozen = FrozenField(nodes, nodes.x.copy())
    nodes.x[:] = 2 * nodes.x + 5
    assert frozen.at(np.array([[0.25, 0.5]])) == pytest.approx(np.array([[0.25, 0.5]]), abs=1e-12)
