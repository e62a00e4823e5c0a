"""The points of a body's surface that look at another body."""

from __future__ import annotations

import basix
import numpy as np

from ..kinematics import Kinematics
from .capture import side_lattice
from .facets import seen_from_vertices

# Vertices of the master lie anywhere between the points, and the integrand has kinks there: so a side is cut into equal
# parts with a low rule on each. Patch test, greatest stress error in the plane: 0.3 % with 6 x 2 points, 1.2 % with one
# rule of 6, 2.3 % with 2 x 2; in space 1e-5 with 9 triangles of 3 points, 1.3 % with one rule of 16.
PARTS, DEGREE = {2: 6, 3: 3}, {2: 3, 3: 2}


class SlavePoints:
    """The points of a quadrature rule on sides of a body, and the corners of these sides that carry traction.

    Parameters
    ----------
    sides : (f, 3 | 6) nodes of this rank's sides, turned as ``physics.surface`` wants them
    element : "integration_point": many points in a side, traction linear between its nodes; "node": the nodes themselves

    Attributes
    ----------
    basis : (points per side, corners) shares of the corners in the points · corners : (f, corners) nodes that carry
    """

    def __init__(self, sides: np.ndarray, kinematics: Kinematics, dim: int, element: str):
        self.sides, self.kinematics, self.dim = sides, kinematics, dim
        cell = {2: basix.CellType.interval, 3: basix.CellType.triangle}[dim]
        shapes = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
        hats = basix.create_element(basix.ElementFamily.P, cell, 1)
        if element == "node":
            # Simpson's rule; on triangles that of the four triangles between vertices and mid-nodes: all weights positive
            points, self._weights = shapes.points, np.array({2: [1, 1, 4], 3: [1, 1, 1, 3, 3, 3]}[dim]) / {2: 6, 3: 24}[dim]
            self.basis, self.corners, places = np.eye(len(points)), sides, points
        else:
            points, self._weights = _in_parts(cell, dim)
            self.basis = _halved(hats.tabulate(0, points)[0, :, :, 0])
            self.corners, places = sides, shapes.points
        table = shapes.tabulate(1, points)[..., 0]
        self.shape, self._gradient = table[0], table[1:]
        self._gradient_at_corners = shapes.tabulate(1, places)[1:, :, :, 0]
        self._places = hats.tabulate(0, places)[0, :, :, 0]
        self.per_side, self.points_per_facet = len(points), len(places)
        self.count = len(sides) * self.per_side

    def trace(self, nodal: np.ndarray) -> np.ndarray:
        """A nodal field (nodes[, k]) at the points, (points[, k])."""
        values = nodal[self.sides]
        columns = values.reshape(*self.sides.shape, int(np.prod(nodal.shape[1:])))
        return np.matmul(self.shape, columns).reshape(self.count, *nodal.shape[1:])

    def surface(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Surface that belongs to each point, mm² (mm in plane strain, 2 pi r included in axisymmetry), (points,), and
        the outward unit normals, (points, dim)."""
        across, length = self._across(x, self._gradient)
        surface = (length * self._weights).ravel()
        return surface * self.kinematics.weight_at(self.trace(x)), (across / length[..., None]).reshape(-1, self.dim)

    def corner_normals(self, x: np.ndarray) -> np.ndarray:
        """Outward unit normals of the sides at their corners, (f, corners, dim)."""
        across, length = self._across(x, self._gradient_at_corners)
        return across / length[..., None]

    def _across(self, x, gradient):
        tangents = np.matmul(gradient[:, None], x[self.sides])
        across = tangents[0][..., ::-1] * [1.0, -1.0] if self.dim == 2 else np.cross(tangents[0], tangents[1])
        return across, np.linalg.norm(across, axis=-1)

    def points_from(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The corners as seen from the vertices in rising order of ``rows`` (nodes,), as ``ContactFacets.points_from``."""
        return seen_from_vertices(rows[self.sides[:, : self.dim]], self._places)


def _halved(inner: np.ndarray) -> np.ndarray:
    """Functions of barycentric coordinates (p, dim) that are 1 at one node of a quadratic side and linear in each half
    (quarter) of it: those of the vertices, then of the mid-nodes, (p, 3 | 6)."""
    at_vertices = np.maximum(2 * inner - 1, 0.0)
    middle = 1 - at_vertices.sum(axis=1, keepdims=True)
    if inner.shape[1] == 3:
        middle = middle - 2 * inner + 2 * at_vertices
    return np.concatenate([at_vertices, middle], axis=1)


def _in_parts(cell, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of a low rule on each of the equal parts of a side."""
    points, weights = basix.make_quadrature(cell, DEGREE[dim])
    lattice, parts = side_lattice(dim, PARTS[dim])
    corners = lattice[parts[:, :dim], 1:]
    edges = corners[:, 1:] - corners[:, :1]
    return (corners[:, :1] + points @ edges).reshape(-1, dim - 1), np.tile(weights / len(parts), len(parts))
