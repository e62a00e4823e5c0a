"""Where the surface of a body ends, at sharp edges as at a rim: nothing beyond is over it, on no side and by no chance."""

import numpy as np
import pytest
from mpi4py import MPI

from fenics_forming.physics import meshing
from fenics_forming.physics.contact.capture import OVERHANG, CapturingSurface
from fenics_forming.physics.contact.overhanging import END, reaching_over
from fenics_forming.physics.facets import exterior_facets
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.surface import facet_sides

OFF = np.array([1e-4, 1e-3, 0.01, 0.05, 0.2])


def surface_of(dim, cells, shift=0.0, turn=0.0, with_edges=True):
    """That of a unit square or cube, and f(points) that brings points along with it."""
    kind = {2: meshing.rectangle, 3: meshing.box}[dim]
    nodes = Nodes(kind([0] * dim, [1] * dim, [cells] * dim, MPI.COMM_SELF))
    cosine, sine = np.cos(turn), np.sin(turn)
    rotation = np.eye(dim)
    rotation[:2, :2] = [[cosine, -sine], [sine, cosine]]
    moved = lambda x: np.asarray(x, float) @ rotation.T + shift  # noqa: E731
    sides = facet_sides(nodes, exterior_facets(nodes.mesh))
    return CapturingSurface(moved(nodes.x)[sides], sides, with_edges=with_edges), moved


@pytest.mark.parametrize("turn", [0.0, 0.4])
@pytest.mark.parametrize("shift", [0.0, 0.1, 3.7])
@pytest.mark.parametrize(("dim", "cells"), [(2, 2), (2, 3), (2, 5), (3, 2)])
def test_beyond_a_sharp_edge_nothing_is_over_either_face(dim, cells, shift, turn):
    """Both faces are equally near there: which one rounding took decided whether the point was held."""
    surface, moved = surface_of(dim, cells, shift, turn)
    for along in range(dim - 1):
        beside = np.full((2 * len(OFF), dim), 0.37)
        beside[:, along], beside[:, -1] = np.concatenate([1 + OFF, -OFF]), -0.01
        assert not surface.capture(moved(beside)).over.any()
    assert surface.capture(moved(np.full((1, dim), 0.37) - 0.37001 * np.eye(dim)[-1])).over.all()


def test_over_a_blunt_or_hollow_edge_points_are_over_a_face():
    """A corner of 30 degrees is one of a mesh on a curved surface; a point in a hollow corner has sunk in there."""
    blunt = np.array([[1, 0], [0, 0], [-np.cos(np.pi / 6), -np.sin(np.pi / 6)]])
    hollow = np.array([[1, 0], [0, 0], [0, 1]], float)
    for p, points in (blunt, [[-0.02, 0.1]]), (hollow, [[-0.01, -0.01]]):
        ends = np.stack([p[:-1], p[1:], 0.5 * (p[:-1] + p[1:])], axis=1)
        surface = CapturingSurface(ends, np.array([[0, 1, 3], [1, 2, 4]]), with_edges=True)
        assert surface.capture(np.array(points)).over.all()


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_node_at_an_end_loses_as_much_surface_as_hangs_over(turn):
    """Share (1 - s/s_e)²: s of Simpson's sixth of a side at first, nothing at s_e; and the force on it has no moment."""
    surface, moved = surface_of(2, 1, turn=turn)
    reach, over = END * 0.5, np.array([0.0, 1e-4, 0.02, 0.08, 0.16, 0.17])
    deep = 10 * OVERHANG        # farther than a point may reach over the rim of the face beside
    points = moved(np.column_stack([1 + over, np.full(len(over), -deep)]))
    outward = np.tile(moved([0.0, 1.0]) - moved([0.0, 0.0]), (len(over), 1))
    found, left = reaching_over(surface, surface.capture(points), points, outward, np.full(len(over), reach))
    inside = over < reach
    assert found.over.tolist() == inside.tolist()
    assert left[inside] == pytest.approx((1 - over[inside] / reach) ** 2, abs=1e-12)
    assert (1 - left[1]) * 0.5 / 6 == pytest.approx(over[1], rel=1e-3), "surface lost = way over the rim"
    feet = np.einsum("kn,kni->ki", found.shapes[inside], surface._nodes[found.facet[inside]])
    assert points[inside] - feet == pytest.approx(deep * found.normal[inside], abs=1e-12), "the foot is right below"
    assert found.shapes.sum(axis=1) == pytest.approx(1.0)


def test_nodes_between_the_ends_are_over_the_other_body_or_not():
    surface, moved = surface_of(2, 2)
    points = np.array([[1.02, -1e-6], [0.98, -1e-6]])
    found, left = reaching_over(surface, surface.capture(points), points, np.array(2 * [[0.0, 1.0]]), np.zeros(2))
    assert found.over.tolist() == [False, True] and (left == 1).all()
