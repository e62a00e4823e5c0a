"""How good the cells of a mesh are: shape, size against the neighbours, room left before order 2 folds over."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import basix
import numpy as np

from ..nodes import EDGES, QUADRATURE_DEGREE
from .body_arrays import keys


@dataclass(frozen=True)
class Quality:
    """Radius ratios of the cells of a mesh: the smallest, the one that 1 % of the cells fall below, the mean."""

    smallest: float
    low: float
    mean: float

    @classmethod
    def of(cls, x: np.ndarray, cells: np.ndarray) -> Quality:
        ratio = radius_ratio(x, cells)
        return cls(float(ratio.min()), float(np.quantile(ratio, 0.01)), float(ratio.mean()))


def radius_ratio(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """dim times the radius of the inscribed over that of the circumscribed circle or sphere, (m,).

    1 for an equilateral cell, 0 for a flat one. Only the vertices count:
    16 A² / ((a + b + c) a b c) for triangles with the area A and the edges a, b, c;
    216 V² / (S √((p+q+r)(p+q-r)(p-q+r)(q+r-p))) for tetrahedra with the volume V, the surface S and the products
    p, q, r of the lengths of opposite edges.
    """
    dim = x.shape[1]
    p = x[cells[:, : dim + 1]]
    length = [np.linalg.norm(p[:, b] - p[:, a], axis=1) for a, b in EDGES[dim]]
    if dim == 2:
        a, b, c = length
        return _over((2.0 * _determinant(p)) ** 2, (a + b + c) * a * b * c)
    surface = sum(0.5 * np.linalg.norm(np.cross(p[:, b] - p[:, a], p[:, c] - p[:, a]), axis=1)
                  for a, b, c in ((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)))
    p1, q, r = length[0] * length[5], length[1] * length[4], length[2] * length[3]
    product = np.maximum((p1 + q + r) * (p1 + q - r) * (p1 - q + r) * (q + r - p1), 0.0)
    return _over(6.0 * _determinant(p) ** 2, surface * np.sqrt(product))


def neighbour_ratio(x: np.ndarray, cells: np.ndarray) -> float:
    """Largest ratio of the sizes (area to the power 1/2, volume to the power 1/3) of two cells with a common facet."""
    dim = x.shape[1]
    size = np.abs(_determinant(x[cells[:, : dim + 1]])) ** (1.0 / dim)
    first, second = neighbours(cells, len(x), dim)
    if len(first) == 0:
        return 1.0
    a, b = size[first], size[second]
    return float(_over(np.maximum(a, b), np.minimum(a, b), np.inf).max())


def neighbours(cells: np.ndarray, count: int, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """The two cells on either side of each interior facet; `count` nodes."""
    facets = np.stack([np.delete(cells[:, : dim + 1], i, axis=1) for i in range(dim + 1)], axis=1)
    key = keys(facets.reshape(-1, dim), count)
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    return order[same] // (dim + 1), order[same + 1] // (dim + 1)


def scaled_jacobian(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Smallest Jacobian of each cell of order 2, at its nodes and integration points, over that of its vertices, (m,).

    1 for straight-sided cells with the mid-nodes half-way; 0 or less where the map of the cell folds over.
    """
    dim = x.shape[1]
    gradients = _gradients(dim)
    if dim == 2:       # points, cells
        (a, c), (b, d) = ([g @ x[:, i][cells.T] for g in gradients] for i in range(2))
        straight = _determinant(x[cells[:, :3]])
        return _over(((a * d - b * c) * np.sign(straight)).min(axis=0), np.abs(straight))
    p = x[cells]
    jacobian = np.matmul(gradients.reshape(-1, gradients.shape[-1]), p).reshape(len(p), *gradients.shape[:2], dim)
    det = np.linalg.det(np.moveaxis(jacobian, 2, 1))      # cells, points, derivative, component
    straight = _determinant(p[:, : dim + 1])
    return _over((det * np.sign(straight)[:, None]).min(axis=1), np.abs(straight))


def overturned(before: np.ndarray, after: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Whether the vertices of each cell go round the other way when its nodes move, (m,): no ratio of radii tells."""
    corners = cells[:, : before.shape[1] + 1]
    return _determinant(before[corners]) * _determinant(after[corners]) <= 0.0


@cache
def _gradients(dim: int) -> np.ndarray:
    """Of the quadratic shape functions at the nodes and integration points: (derivative, point, node)."""
    cell = basix.CellType.triangle if dim == 2 else basix.CellType.tetrahedron
    element = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
    points, _ = basix.make_quadrature(cell, QUADRATURE_DEGREE[dim])
    return element.tabulate(1, np.concatenate([element.points, points]))[1:, :, :, 0]


def _determinant(p: np.ndarray) -> np.ndarray:
    """Of the edges from the first vertex: 2 A or 6 V with a sign, for vertices (m, dim + 1, dim)."""
    e = p[:, 1:] - p[:, :1]
    if e.shape[1] == 2:
        return e[:, 0, 0] * e[:, 1, 1] - e[:, 0, 1] * e[:, 1, 0]
    return np.einsum("mi,mi->m", e[:, 0], np.cross(e[:, 1], e[:, 2]))


def _over(a: np.ndarray, b: np.ndarray, otherwise: float = 0.0) -> np.ndarray:
    return np.divide(a, b, out=np.full(len(b), otherwise), where=b > 0)
