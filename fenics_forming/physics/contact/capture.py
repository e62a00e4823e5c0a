"""The facet of another body that captures a point: closest points on quadratic sides, the same on every rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..nodes import EDGES, quadratic_shapes
from .bvh import build, nearest_triangles, refit
from .feet import find_feet

PIECES = 4          # flat pieces along the edge of a facet, for the search
SLACK = 0.25        # of the size of a facet: flat pieces are nearer to a point than the facet itself, by less than that
# Of the squared distance: beside an edge both faces are as near as rounding has it, and the order of the sides hangs on the
# number of ranks; the face that the point lies before takes it.
ALIKE = 1e-6
OVERHANG = 1e-6     # of the size of a facet: a point that reaches farther over the rim of the surface is not over it


@dataclass(frozen=True)
class Captured:
    """Where points lie over a surface.

    facet (k,) · shapes (k, 3 | 6) of its nodes at the foot · gap (k,) mm, along the outward normal (k, dim) ·
    over (k,) whether the point is over the surface and not beyond its rim
    """

    facet: np.ndarray
    shapes: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    over: np.ndarray


class CapturingSurface:
    """Quadratic sides of one body as others see them.

    Parameters
    ----------
    nodes : (f, 3 | 6, dim) positions of the nodes of every side, turned as ``physics.surface`` wants them, mm
    numbers : (f, 3 | 6) numbers of the nodes, equal on all ranks: sides with a common edge are neighbours
    """

    def __init__(self, nodes: np.ndarray, numbers: np.ndarray):
        self.dim = nodes.shape[2]
        lattice, self._pieces = side_lattice(self.dim, PIECES)
        self._middles, self._ends = lattice[self._pieces].mean(axis=1), np.array(EDGES[self.dim - 1])
        self._shapes = quadratic_shapes(lattice, self.dim - 1)
        self._rim = _rim(numbers[:, : self.dim])
        flat = self._flat(nodes)
        order, boxes = build(flat.min(axis=1), flat.max(axis=1))
        self._tree = flat[order], order, boxes

    def follow(self, nodes: np.ndarray) -> None:
        """Take over other positions of the nodes, (f, 3 | 6, dim), mm."""
        flat, (_, order, boxes) = self._flat(nodes), self._tree
        self._tree = flat[order], order, boxes
        refit(self._tree[0], boxes)

    def _flat(self, nodes: np.ndarray) -> np.ndarray:
        """Flat pieces of sides with these nodes, (pieces, 3, 3)."""
        self._nodes = np.ascontiguousarray(nodes)
        self._size = np.linalg.norm(nodes[:, 1: self.dim] - nodes[:, :1], axis=2).max(axis=1)
        return _in_space(np.matmul(self._shapes, self._nodes))[:, self._pieces].reshape(-1, 3, 3)

    def capture(self, points: np.ndarray, reach: float = np.inf) -> Captured:
        """Sides and feet for points (k, dim), mm; what is farther off than ``reach``, mm, is over nothing."""
        within = (reach + SLACK * self._size.max(initial=0.0)) ** 2
        piece, _, closest = nearest_triangles(*self._tree, np.ascontiguousarray(_in_space(points)), within,
                                               ALIKE, True)
        some = np.flatnonzero(piece >= 0)
        facet, part = np.divmod(piece[some], len(self._pieces))
        off = closest[some, : self.dim] - points[some]
        near = np.einsum("pi,pi->p", off, off) <= (reach + SLACK * self._size[facet]) ** 2
        chosen, facet = some[near], facet[near]
        found = self._feet(points[chosen], facet, part[near])
        if len(chosen) == len(points):
            return found
        count, shapes = len(points), np.zeros((len(points), self._nodes.shape[1]))
        shapes[:, 0] = 1.0
        out = Captured(np.zeros(count, int), shapes, np.full(count, np.inf), np.zeros((count, self.dim)),
                       np.zeros(count, bool))
        for all_of_them, those in zip(vars(out).values(), vars(found).values(), strict=True):
            all_of_them[chosen] = those
        return out

    def _feet(self, points: np.ndarray, facet: np.ndarray, part: np.ndarray) -> Captured:
        """Where points (k, dim) lie over given sides, of which a piece is nearest."""
        shapes, gap, normal, over = find_feet(np.ascontiguousarray(points), facet, self._middles[part], self._nodes,
                                              self._ends, self._rim, OVERHANG * self._size)
        return Captured(facet, shapes, gap, normal, over)


def _rim(vertices: np.ndarray) -> np.ndarray:
    """Whether the edge opposite to each vertex (in the plane: the other end) belongs to no other side, (f, dim)."""
    dim = vertices.shape[1]
    edges = np.sort(np.stack([np.delete(vertices, k, axis=1) for k in range(dim)], axis=1), axis=2)
    _, inverse, count = np.unique(edges.reshape(-1, dim - 1), axis=0, return_inverse=True, return_counts=True)
    return (count[inverse.ravel()] == 1).reshape(vertices.shape)


def side_lattice(dim: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates of a regular lattice with n parts on an edge of a side, and the corners (pieces, 3) of
    the pieces between them."""
    if dim == 2:
        t = np.linspace(0.0, 1.0, n + 1)
        k = np.arange(n)
        return np.stack([1 - t, t], axis=1), np.stack([k, k + 1, k + 1], axis=1)     # triangles without width
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    inside = i + j <= n
    number = np.full((n + 2, n + 2), -1)
    number[i[inside], j[inside]] = np.arange(inside.sum())
    up = [(number[a, b], number[a + 1, b], number[a, b + 1]) for a in range(n) for b in range(n - a)]
    down = [(number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]) for a in range(n) for b in range(n - a - 1)]
    u, v = i[inside] / n, j[inside] / n
    return np.stack([1 - u - v, u, v], axis=1), np.array(up + down)


def _in_space(points: np.ndarray) -> np.ndarray:
    """Points of the plane with a third coordinate of zero; points of space as they are."""
    if points.shape[-1] == 3:
        return points
    return np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1)


