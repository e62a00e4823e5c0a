"""Finding points in the cells of an order-2 simplex mesh that is given as arrays: all points at once.

A point starts in the cell with the nearest centroid and walks across the facet of its most negative barycentric
coordinate. One that ends at the boundary tries again from several cells; what is outside takes the nearest place found.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .locating_kernels import ROUND_OFF, across_mids, clipped, curved_walks, distances, means, on_facets, walks
from .nearest import Bins
from .nodes import EDGES, keys, quadratic_shapes

CANDIDATES = 8        # cells from which a point that ended at the boundary starts again
DOUBTFUL = 0.1        # of the cell's longest edge: a point farther outside is compared with every cell around it
NEAR = 1e-3           # of the cell's edge: so near to its facet a point is not compared with other facets


@dataclass(frozen=True)
class Located:
    """Places in cells, one for each point.

    Attributes
    ----------
    cells : (p,) rows of the cells
    barycentric : (p, dim + 1), none negative, sum 1
    distance : (p,) mm between the point and its place: 0 inside, up to round-off
    """

    cells: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray

    def replaced(self, rows: np.ndarray, other: Located) -> Located:
        """This with the given rows taken from another."""
        out = [np.array(a) for a in (self.cells, self.barycentric, self.distance)]
        for mine, new in zip(out, (other.cells, other.barycentric, other.distance), strict=True):
            mine[rows] = new
        return Located(*out)


class Locator:
    """Finds points in a mesh.

    Parameters
    ----------
    x : (n, dim) positions of the nodes, mm
    cells : (m, 6 | 10) nodes of the cells in basix order, the vertices first

    Attributes
    ----------
    vertices : (m, dim + 1) vertices of the cells
    gradients : (m, dim, dim) 1/mm, of the barycentric coordinates but the first in the straight cells
    weights : (m,) sizes of the straight cells, up to one factor
    """

    def __init__(self, x: np.ndarray, cells: np.ndarray):
        self.x, self.cells, self.dim = np.ascontiguousarray(x, float), np.ascontiguousarray(cells, np.int64), np.shape(x)[1]
        self.vertices, self._edges = self.cells[:, : self.dim + 1], np.array(EDGES[self.dim])
        corners = self.x[self.vertices]
        self._origin = corners[:, 0].copy()
        self.gradients, volumes = _inverse(corners[:, 1:] - corners[:, :1])
        self.weights = np.abs(volumes)
        self._centroids = corners.mean(axis=1)

    @cached_property
    def _tree(self):
        return _tree(self._centroids)

    @cached_property
    def _near(self):
        """Function of points to the cells with the nearest centroids."""
        return _nearest(self._centroids, None if self.dim == 2 else self._tree)

    @cached_property
    def neighbours(self) -> np.ndarray:
        """(m, dim + 1) the cell across the facet opposite to each vertex; -1 on the boundary."""
        if self.dim == 2:
            return across_mids(self.cells[:, 3:], len(self.x))
        sides = np.stack([np.delete(self.vertices, i, axis=1) for i in range(self.dim + 1)], axis=1)
        key = keys(sides.reshape(-1, self.dim), len(self.x))
        order = np.argsort(key)
        twin = np.flatnonzero(key[order][1:] == key[order][:-1])
        first, second = order[twin], order[twin + 1]
        across = np.full(len(key), -1)
        across[first], across[second] = second // (self.dim + 1), first // (self.dim + 1)
        return across.reshape(-1, self.dim + 1)

    # ------------------------------------------------------------------ straight cells
    def barycentric(self, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Barycentric coordinates, (p, dim + 1), of each point in the straight simplex of its cell; negative outside."""
        local = np.einsum("pij,pj->pi", self.gradients[cells], points - self._origin[cells])
        return np.concatenate([1.0 - local.sum(axis=1, keepdims=True), local], axis=1)

    def find(self, points: np.ndarray) -> Located:
        """The straight simplex that each point (p, dim) lies in, or the nearest place found where it lies in none."""
        points = np.ascontiguousarray(points, float)
        cells, inner = self._walk(points, self._near(points)[:, 0])
        found = self._clipped(points, cells, inner)
        outside = np.flatnonzero(inner.min(axis=1) < -ROUND_OFF)
        if len(outside):
            found = self._nearest_of(points, found, outside, self._near(points[outside], CANDIDATES))
        doubtful = outside[found.distance[outside] > DOUBTFUL * self._size(found.cells[outside])]
        return self._among_all_near(points, found, doubtful) if len(doubtful) else found

    def interpolated(self, nodal: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Of values (n,) at the vertices, linear between them, those at points (p, dim), (p,); outside the one where
        the walk ends, near but maybe not the nearest."""
        points = np.ascontiguousarray(points, float)
        return means(nodal, self.vertices, *self._walk(points, self._near(points)[:, 0]))

    def _size(self, cells):
        """Longest straight edge at the first vertex of cells, (p,) mm."""
        edges = self.x[self.vertices[cells, 1:]] - self._origin[cells, None]
        return np.linalg.norm(edges, axis=2).max(axis=1, initial=0.0)

    def _walk(self, points, cells):
        """From the given cells towards the points: where each ends, and its coordinates there."""
        return walks(self._origin, self.gradients, self.neighbours, points, cells)

    def _clipped(self, points, cells, inner):
        return Located(cells, *clipped(self.x, self.vertices, points, cells, inner))

    def _nearest_of(self, points, found, rows, starts):
        """For the points ``rows`` the best place among what was found and the ends of walks from ``starts`` (rows, k)."""
        each = np.repeat(rows, starts.shape[1])
        cells, inner = self._walk(points[each], starts.ravel())
        tried = self._clipped(points[each], cells, inner)
        return _better(found, rows, tried, np.arange(len(each)).reshape(starts.shape))

    def _among_all_near(self, points, found, rows):
        """The best place among all cells that may hold a point: none that lies inside is missed."""
        reach = np.linalg.norm(self.x[self.vertices] - self._centroids[:, None], axis=2).max()
        near = self._tree.query_ball_point(points[rows], reach)
        counts = np.array([len(n) for n in near])
        rows, counts, near = rows[counts > 0], counts[counts > 0], [n for n in near if n]
        if not near:
            return found
        cells = np.concatenate(near).astype(int)
        each = np.repeat(rows, counts)
        tried = self._clipped(points[each], cells, self.barycentric(points[each], cells))
        first = np.lexsort((tried.distance, each))[np.cumsum(counts) - counts]   # of every point the nearest
        return _better(found, rows, tried, first[np.argsort(each[first])][:, None])

    # ------------------------------------------------------------------ curved cells
    def place(self, located: Located) -> np.ndarray:
        """Where local coordinates lie in the curved cells, (p, dim) mm."""
        return np.einsum("pa,pad->pd", quadratic_shapes(located.barycentric, self.dim), self.x[self.cells[located.cells]])

    def find_curved(self, points: np.ndarray, straight: Located | None = None) -> Located:
        """The curved cell that each point (p, dim) lies in, with the coordinates that its quadratic map takes there.

        Newton steps in the cell that holds the point when straight; where the curved side lies between, in the cell
        behind it. Outside: the nearest place of the facets around. ``straight``: what `find` gave, if it is known.
        """
        points = np.ascontiguousarray(points, float)
        found = self.find(points) if straight is None else straight
        cells, inner = curved_walks(self.x, self.cells, self._edges, self._origin, self.gradients, self.neighbours, points,
                                    found.cells, found.barycentric)
        outside = np.flatnonzero(inner.min(axis=1) < -ROUND_OFF)
        side = np.argmin(inner[outside], axis=1)
        inner[outside] = self._on_facet(points[outside], cells[outside], side, convex(inner[outside]))
        located = self._measured(points, cells, inner)
        far = outside[located.distance[outside] > NEAR * self._size(cells[outside])]
        return self._nearest_facet(points, located, far) if len(far) else located

    def _measured(self, points, cells, inner):
        return Located(cells, inner, distances(self.x, self.cells, self._edges, points, cells, inner))

    @cached_property
    def _boundary(self):
        """Cells and sides of the boundary facets, (f,) each, and a function of points to those with the nearest centres."""
        cells, sides = np.nonzero(self.neighbours < 0)
        whole = self.x[self.vertices[cells]].sum(axis=1) - self.x[self.vertices[cells, sides]]
        return cells, sides, _nearest(whole / self.dim)

    def _nearest_facet(self, points, found, rows):
        """What was found with, for the points ``rows``, the nearest place on the boundary facets around them."""
        cells, sides, nearest = self._boundary
        near = nearest(points[rows], CANDIDATES)
        each, facets = np.repeat(rows, near.shape[1]), near.ravel()
        start = np.full((len(each), self.dim + 1), 1.0 / self.dim)
        inner = self._on_facet(points[each], cells[facets], sides[facets], start)
        tried = self._measured(points[each], cells[facets], inner)
        return _better(found, rows, tried, np.arange(len(each)).reshape(near.shape))

    def _on_facet(self, points, cells, side, inner):
        """Coordinates of the nearest place on the facet opposite to the vertex ``side``."""
        return on_facets(self.x, self.cells, self._edges, points, cells, side, inner)


def _tree(points):
    from scipy.spatial import cKDTree  # a tenth of a second, which a run that searches nothing saves
    return cKDTree(points)


def _nearest(among: np.ndarray, tree=None):
    """Function of points (p, dim), and how many, to the numbers of the nearest of some points (n, dim): (p, many or n)."""
    if among.shape[1] == 2:
        bins = Bins(among)
        return lambda points, many=1: bins.query(points, min(many, len(among)))
    tree = _tree(among) if tree is None else tree
    return lambda points, many=1: tree.query(points, k=min(many, len(among)))[1].reshape(len(points), -1)


def convex(inner: np.ndarray) -> np.ndarray:
    """Barycentric coordinates clipped to the simplex: none negative, sum 1."""
    inner = np.clip(inner, 0.0, None)
    whole = inner.sum(axis=1, keepdims=True)
    return np.where(whole > 0, inner / np.where(whole > 0, whole, 1.0), 1.0 / inner.shape[1])


def _better(found, rows, tried, choices):
    """``found`` with, in ``rows``, the nearest of the ``choices`` (rows, k) among ``tried`` where it is nearer."""
    best = choices[np.arange(len(rows)), np.argmin(tried.distance[choices], axis=1)]
    nearer = tried.distance[best] < found.distance[rows]
    rows, best = rows[nearer], best[nearer]
    return found.replaced(rows, Located(tried.cells[best], tried.barycentric[best], tried.distance[best]))


def _inverse(edges):
    """Gradients of the local coordinates, (p, local, component), and determinants, (p,), of the maps
    x = sum of local coordinates times edges (p, local, component).

    Written out, as `numpy.linalg.inv` takes three times as long and stops at a flat cell, which just holds no point.
    """
    if edges.shape[1] == 2:
        (a, b), (c, d) = np.moveaxis(edges, 0, 2)
        adjoint = np.stack([d, -c, -b, a], axis=1).reshape(-1, 2, 2)
        determinant = a * d - b * c
    else:
        first, second, third = np.moveaxis(edges, 1, 0)
        adjoint = np.stack([np.cross(second, third), np.cross(third, first), np.cross(first, second)], axis=1)
        determinant = np.einsum("pi,pi->p", first, adjoint[:, 0])
    least = np.finfo(float).tiny ** 0.5
    return adjoint / np.where(np.abs(determinant) > least, determinant, least)[:, None, None], determinant


def slopes(inner, dim):
    """Derivatives of the quadratic shapes with respect to the barycentric coordinates, (p, 6 | 10, dim + 1)."""
    out = np.zeros((len(inner), dim + 1 + len(EDGES[dim]), dim + 1))
    corner = np.arange(dim + 1)
    out[:, corner, corner] = 4 * inner - 1
    for k, (a, b) in enumerate(EDGES[dim]):
        out[:, dim + 1 + k, a], out[:, dim + 1 + k, b] = 4 * inner[:, b], 4 * inner[:, a]
    return out


def by_coordinate(inner, x):
    """Derivatives of the quadratic map of cells or sides by each barycentric coordinate, (p, coordinates, component)."""
    return np.matmul(np.swapaxes(slopes(inner, inner.shape[1] - 1), 1, 2), x)
