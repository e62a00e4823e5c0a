"""The facet of another body that captures a point: closest points on quadratic sides, the same on every rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..locating import by_coordinate
from ..nodes import quadratic_shapes
from .bvh import build, nearest_triangles

PIECES = 4          # flat pieces along the edge of a facet, for the search
STEPS = 12          # of Gauss-Newton for the foot of the perpendicular; the distance is small against the curvature
SLACK = 0.25        # of the size of a facet: flat pieces are nearer to a point than the facet itself, by less than that
SETTLED = 1e-13     # of a barycentric coordinate: where no foot moves any more, no step is needed
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
        self._nodes, self.dim = nodes, nodes.shape[2]
        lattice, self._pieces = side_lattice(self.dim, PIECES)
        self._lattice = lattice
        shapes = quadratic_shapes(lattice, self.dim - 1)
        at = _in_space(np.einsum("pa,fak->fpk", shapes, nodes))
        flat = at[:, self._pieces].reshape(-1, 3, 3)
        order, boxes = build(flat.min(axis=1), flat.max(axis=1))
        self._tree = flat[order], order, boxes
        self._rim = _rim(numbers[:, : self.dim])
        edges = nodes[:, 1: self.dim] - nodes[:, :1]
        self._size = np.linalg.norm(edges, axis=2).max(axis=1)

    def capture(self, points: np.ndarray, reach: float = np.inf) -> Captured:
        """Sides and feet for points (k, dim), mm; what is farther off than ``reach``, mm, is over nothing."""
        piece, _, closest = nearest_triangles(*self._tree, np.ascontiguousarray(_in_space(points)))
        facet, part = np.divmod(piece, len(self._pieces))
        distance = np.linalg.norm(closest[:, : self.dim] - points, axis=1)
        chosen = np.flatnonzero(distance <= reach + SLACK * self._size[facet])
        found = self._feet(points[chosen], facet[chosen], part[chosen])
        if len(chosen) == len(points):
            return found
        count, shapes = len(points), np.zeros((len(points), self._nodes.shape[1]))
        out = Captured(facet, shapes, np.full(count, np.inf), np.zeros((count, self.dim)), np.zeros(count, bool))
        out.shapes[:, 0] = 1.0
        for all_of_them, those in zip(vars(out).values(), vars(found).values(), strict=True):
            all_of_them[chosen] = those
        return out

    def _feet(self, points: np.ndarray, facet: np.ndarray, part: np.ndarray) -> Captured:
        """Where points (k, dim) lie over given sides, of which a piece is nearest."""
        p = self._nodes[facet]
        inner = self._lattice[self._pieces[part]].mean(axis=1)
        for _ in range(STEPS):
            foot, tangents = self._at(inner, p)
            metric = np.matmul(tangents, np.swapaxes(tangents, 1, 2))
            metric += 1e-14 * np.trace(metric, axis1=1, axis2=2)[:, None, None] * np.eye(self.dim - 1)
            step = np.linalg.solve(metric, np.einsum("kti,ki->kt", tangents, points - foot)[..., None])[..., 0]
            free = np.concatenate([inner[:, :1] - step.sum(axis=1, keepdims=True), inner[:, 1:] + step], axis=1)
            before, inner = inner, np.clip(free, 0.0, None)
            inner /= inner.sum(axis=1, keepdims=True)
            if np.abs(inner - before).max(initial=0.0) < SETTLED:
                break
        foot, tangents = self._at(inner, p)
        normal = tangents[:, 0, ::-1] * [1.0, -1.0] if self.dim == 2 else np.cross(tangents[:, 0], tangents[:, 1])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        away = points - foot
        gap = np.einsum("ki,ki->k", away, normal)
        beside = np.linalg.norm(away - gap[:, None] * normal, axis=1) > OVERHANG * self._size[facet]
        at_rim = ((inner < 1e-12) & self._rim[facet]).any(axis=1)
        return Captured(facet, quadratic_shapes(inner, self.dim - 1), gap, normal, ~(beside & at_rim))

    def _at(self, inner, p):
        """Points (k, dim) of the sides with nodes p at barycentric coordinates, and tangents (k, dim - 1, dim)."""
        slope = by_coordinate(inner, p)
        return np.einsum("ka,kai->ki", quadratic_shapes(inner, self.dim - 1), p), slope[:, 1:] - slope[:, :1]


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


