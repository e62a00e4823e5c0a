"""A size field: the least of what several sources ask for, none of which grows faster than wanted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DIRECT = 48             # so many points are compared with all, more are searched by trees
ALIKE = 0.1             # sizes within this of each other share a tree


@dataclass(frozen=True)
class Sizes:
    """Wanted length of the sides of elements, mm: ``sizes(points (n, dim)) -> (n,)``.

    Attributes
    ----------
    base : size where no source asks for less
    least : what sources other than domains may ask for at least
    growth : change of size per unit of distance, at most
    sources : callables of the same kind, each with that growth
    nodal : (n,) what all of them come to at the vertices of the body, where that is known; infinite at its mid-nodes
    """

    base: float
    least: float
    growth: float
    sources: tuple = ()
    nodal: np.ndarray | None = None

    def __call__(self, points: np.ndarray) -> np.ndarray:
        points = np.asarray(points, dtype=float)
        size = np.full(len(points), self.base)
        for source in self.sources:
            np.minimum(size, source(points), out=size)
        return size

    def and_also(self, *sources) -> Sizes:
        """The same with more sources."""
        return Sizes(self.base, self.least, self.growth, (*self.sources, *sources))


@dataclass(frozen=True)
class Around:
    """``size`` up to ``distance`` from something, growing from there.

    apart : callable, points (n, dim) to their distances (n,) from it, mm; of either sign
    """

    apart: object
    distance: float
    size: float
    growth: float

    def __call__(self, points: np.ndarray) -> np.ndarray:
        return self.size + self.growth * np.maximum(np.abs(self.apart(points)) - self.distance, 0.0)


class AtPoints:
    """Sizes at points, growing from each of them: min over i of (size_i + growth |x - x_i|).

    Parameters
    ----------
    points : (k, dim) mm
    size : (k,) mm, or one for all
    growth : per unit of distance
    most : larger sizes are of no interest
    """

    def __init__(self, points: np.ndarray, size, growth: float, most: float):
        self.points = np.asarray(points, dtype=float)
        self.size = np.array(np.broadcast_to(size, len(self.points)), dtype=float)
        self.growth, self.most = growth, most
        self._groups = [] if len(self.points) <= DIRECT else self._alike()

    def _alike(self):
        from scipy.spatial import cKDTree

        level = np.floor(np.log(self.size / self.size.min()) / np.log1p(ALIKE)).astype(int)
        rows = [np.flatnonzero(level == k) for k in np.unique(level)]
        return [(cKDTree(self.points[r]), self.size[r]) for r in rows if self.size[r].min() < self.most]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        size = np.full(len(points), self.most)
        if not self._groups:
            for at, there in zip(self.points, self.size, strict=True):
                np.minimum(size, there + self.growth * np.sqrt(((points - at) ** 2).sum(axis=1)), out=size)
            return size
        for tree, there in self._groups:
            reach = (self.most - there.min()) / self.growth
            distance, number = tree.query(points, distance_upper_bound=reach)
            found = np.isfinite(distance)
            size[found] = np.minimum(size[found], there[number[found]] + self.growth * distance[found])
        return size


class AtNodes:
    """Sizes at the vertices of a mesh, linear between them.

    Parameters
    ----------
    body : `BodyArrays`
    size : (n,) mm; only those of the vertices are read
    """

    def __init__(self, body, size: np.ndarray):
        self.body, self.size = body, size

    def __call__(self, points: np.ndarray) -> np.ndarray:
        return self.body.locator.interpolated(self.size, points)


class Remembered:
    """Sizes that are found once at some points of the plane, which are asked for again and again; elsewhere every time.

    Parameters
    ----------
    sizes : callable, points (k, 2) to wanted sizes (k,)
    points : (n, 2) mm
    known : (n,) sizes at the points; infinite where they are to be asked for
    """

    def __init__(self, sizes, points: np.ndarray, known: np.ndarray | None = None):
        self.sizes = sizes
        order = np.argsort(_number(points))
        self.points = points[order]
        self.size = np.full(len(points), np.inf) if known is None else known[order]
        unknown = np.isinf(self.size)
        self.size[unknown], self._numbers = sizes(self.points[unknown]), _number(self.points)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        at = np.minimum(np.searchsorted(self._numbers, _number(points)), len(self.points) - 1)
        size, unknown = self.size[at], (self.points[at] != points).any(axis=1)
        if unknown.any():
            size[unknown] = self.sizes(points[unknown])
        return size


def _number(points):
    """One number for each point of the plane; hardly ever the same for two."""
    return points[:, 0] + np.sqrt(2) * points[:, 1]


def graded(size: np.ndarray, x: np.ndarray, cells: np.ndarray, growth: float) -> np.ndarray:
    """The largest sizes below the given ones that grow by ``growth`` per unit of length along the edges at most.

    Parameters
    ----------
    size : (n,) at the vertices; inf where nothing is asked for
    x : (n, dim) vertices
    cells : (m, dim + 1) vertices of the cells
    """
    from ..remeshing.gradation import swept  # compiled where something is graded

    ends = edges_of(cells)
    step = growth * np.linalg.norm(x[ends[:, 0]] - x[ends[:, 1]], axis=1)
    return swept(np.array(size, dtype=float), ends, step)[0]


def edges_of(cells: np.ndarray) -> np.ndarray:
    """Ends (e, 2) of the edges of simplices (m, dim + 1), once for every cell at an edge."""
    first, second = np.triu_indices(cells.shape[1], 1)
    return np.stack([cells[:, first], cells[:, second]], axis=2).reshape(-1, 2).astype(np.int64)
