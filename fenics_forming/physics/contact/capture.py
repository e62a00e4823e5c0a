"""The facet of another body that captures a point: closest points on quadratic sides, the same on every rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..locating import slopes
from ..nodes import EDGES, quadratic_shapes
from .bvh import build, nearest_triangles, refit
from .feet import find_feet

PIECES = 4          # flat pieces along the edge of a facet, for the search
SLACK = 0.25        # of the size of a facet: flat pieces are nearer to a point than the facet itself, by less than that
# Of the squared distance: beside an edge both faces are as near as rounding has it, and the order of the sides hangs on the
# number of ranks; the face that the point lies before takes it. In space alone: in the plane points of integration are few,
# and where a rivet slides off the edge of its hole the force jumps by 2.6 % with a new mesh.
ALIKE = 1e-6
OVERHANG = 1e-6     # of the size of a facet: a point that reaches farther over the rim of the surface is not over it
SHARP = 0.75        # cosine between the normals of sides with a common edge; below it, where the body is convex, either
                    # ends there: beyond the edge both are equally near, and neither is over anything
NONE, SEVERAL = -1, -2      # sides beyond an edge, where there is not just one


@dataclass(frozen=True)
class Captured:
    """Where points lie over a surface.

    facet (k,) · shapes (k, 3 | 6) of its nodes at the foot · gap (k,) mm, along the outward normal (k, dim) ·
    over (k,) whether the point is over the surface and not beyond its rim · beyond (k,) how far it is, mm
    """

    facet: np.ndarray
    shapes: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    over: np.ndarray
    beyond: np.ndarray


class CapturingSurface:
    """Quadratic sides of one body as others see them.

    Parameters
    ----------
    nodes : (f, 3 | 6, dim) positions of the nodes of every side, turned as ``physics.surface`` wants them, mm
    numbers : (f, 3 | 6) numbers of the nodes, equal on all ranks: sides with a common edge are neighbours
    with_edges : whether the surface ends at sharp edges as it does at its rim

    Attributes
    ----------
    size : (f,) length of the longest edge from the first vertex, mm · rim : (f, dim) whether the surface ends at the edge
        opposite to each vertex (in the plane: at the other end) · neighbours : (f, dim) the side beyond it, NONE or SEVERAL
    """

    def __init__(self, nodes: np.ndarray, numbers: np.ndarray, *, with_edges: bool = False):
        self.dim, self._with_edges = nodes.shape[2], with_edges
        lattice, self._pieces = side_lattice(self.dim, PIECES)
        self._middles, self._ends = lattice[self._pieces].mean(axis=1), np.array(EDGES[self.dim - 1])
        self._shapes = quadratic_shapes(lattice, self.dim - 1)
        self.neighbours = _neighbours(numbers[:, : self.dim])
        self._at_edges = _edge_slopes(self.dim)
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
        self.size = np.linalg.norm(nodes[:, 1: self.dim] - nodes[:, :1], axis=2).max(axis=1)
        self.rim = self.neighbours == NONE
        if self._with_edges:
            self.rim = self.rim | self._sharp()
        return _in_space(np.matmul(self._shapes, self._nodes))[:, self._pieces].reshape(-1, 3, 3)

    def capture(self, points: np.ndarray, reach: float = np.inf) -> Captured:
        """Sides and feet for points (k, dim), mm; what is farther off than ``reach``, mm, is over nothing."""
        within = (reach + SLACK * self.size.max(initial=0.0)) ** 2
        piece, _, closest = nearest_triangles(*self._tree, np.ascontiguousarray(_in_space(points)), within,
                                               *((ALIKE, True) if self.dim == 3 else ()))
        some = np.flatnonzero(piece >= 0)
        facet, part = np.divmod(piece[some], len(self._pieces))
        off = closest[some, : self.dim] - points[some]
        near = np.einsum("pi,pi->p", off, off) <= (reach + SLACK * self.size[facet]) ** 2
        chosen, facet = some[near], facet[near]
        found = self._feet(points[chosen], facet, part[near])
        if len(chosen) == len(points):
            return found
        count, shapes = len(points), np.zeros((len(points), self._nodes.shape[1]))
        shapes[:, 0] = 1.0
        out = Captured(np.zeros(count, int), shapes, np.full(count, np.inf), np.zeros((count, self.dim)),
                       np.zeros(count, bool), np.full(count, np.inf))
        for all_of_them, those in zip(vars(out).values(), vars(found).values(), strict=True):
            all_of_them[chosen] = those
        return out

    def feet(self, points: np.ndarray, facet: np.ndarray, reach: np.ndarray) -> Captured:
        """Where points (k, dim) lie over given sides (k,), over whose rims they may ``reach`` (k,), mm."""
        return self._feet(points, facet, np.full(len(facet), len(self._pieces) // 2), reach)

    def _feet(self, points: np.ndarray, facet: np.ndarray, part: np.ndarray, reach: np.ndarray | None = None) -> Captured:
        """The same for points of which a piece of the side is nearest."""
        reach = OVERHANG * self.size[facet] if reach is None else reach
        shapes, gap, normal, beyond = find_feet(np.ascontiguousarray(points), facet, self._middles[part], self._nodes,
                                                self._ends, self.rim, reach)
        return Captured(facet, shapes, gap, normal, beyond <= reach, beyond)

    def has_below(self, points: np.ndarray, found: Captured) -> np.ndarray:
        """Whether the feet are below the points (k, dim), on the sides or tangents of these, (k,)."""
        feet = np.einsum("kn,kni->ki", found.shapes, self._nodes[found.facet])
        off = points - feet - found.gap[:, None] * found.normal
        return np.einsum("ki,ki->k", off, off) <= (OVERHANG * self.size[found.facet]) ** 2

    def _sharp(self) -> np.ndarray:
        """Whether the body turns sharply, and is convex, at the edge opposite to each vertex, (f, dim)."""
        tangents = np.einsum("ena,fni->efai", self._at_edges, self._nodes)      # the derivatives by all coordinates
        tangents = np.moveaxis(tangents[:, :, 1:] - tangents[:, :, :1], 0, 1)   # f, edges, dim - 1, dim
        across = tangents[:, :, 0, ::-1] * [1.0, -1.0] if self.dim == 2 else np.cross(tangents[:, :, 0], tangents[:, :, 1])
        normal = across / np.linalg.norm(across, axis=2, keepdims=True)
        middle, (facet, edge) = self._nodes[:, : self.dim].mean(axis=1), np.nonzero(self.neighbours >= 0)
        other = self.neighbours[facet, edge]
        back = np.argmax(self.neighbours[other] == facet[:, None], axis=1)
        sharp = np.zeros(self.neighbours.shape, bool)
        sharp[facet, edge] = (np.einsum("ki,ki->k", normal[facet, edge], normal[other, back]) < SHARP) & \
            (np.einsum("ki,ki->k", normal[facet, edge], middle[other] - middle[facet]) < 0)
        return sharp


def _neighbours(vertices: np.ndarray) -> np.ndarray:
    """The side beyond the edge opposite to each vertex (in the plane: the other end), NONE or SEVERAL, (f, dim)."""
    dim = vertices.shape[1]
    edges = np.sort(np.stack([np.delete(vertices, k, axis=1) for k in range(dim)], axis=1), axis=2)
    _, inverse, count = np.unique(edges.reshape(-1, dim - 1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(inverse.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    one, other = order[first], order[first + 1]
    out = np.where(count[inverse.ravel()] == 1, NONE, SEVERAL)
    out[one], out[other] = other // dim, one // dim
    return out.reshape(vertices.shape)


def _edge_slopes(dim: int) -> np.ndarray:
    """Derivatives of the quadratic shapes by the barycentric coordinates, in the middle of each edge (in the plane: at
    each end) of a side, (edges, 3 | 6, dim)."""
    return slopes((1.0 - np.eye(dim)) / (dim - 1), dim - 1)


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


