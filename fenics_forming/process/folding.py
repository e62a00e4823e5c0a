"""Where the free surface of a body touches or crosses itself, or its image behind a mirror plane.

Nothing holds the surfaces apart there (self-contact is not modelled), so a fold is found and reported. A node of the
surface that lies in a cell of which it is no node has crossed the surface; one that hovers just above a side that faces it
touches. Sides that meet in an edge or lie on a tool do neither, whatever their angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..physics.locating import by_coordinate
from ..physics.nodes import EDGES, quadratic_shapes
from ..physics.parallel import lowest
from .volume import FreeSurface

TOUCHING = 0.02       # of a side: a node so near above a side that faces it touches it
FACING = -0.5         # cosine between the normals of surfaces that face one another, at most
LEAST_DEPTH = 0.01    # of the height of a cell: a node less deep in it has not crossed the surface
CANDIDATES = 8        # sides from which the depth of a node that has crossed is measured
ROUNDING = 1e-9       # of a side
FOUND = 1e-12         # of a cell: a Newton step so small is the last
TURNS = 6             # Newton steps in a curved cell or on a curved side
FEW = 200_000         # pairs that are compared faster than a search tree is imported and built
APART = 3.0           # element sizes between the nodes of two folds


@dataclass(frozen=True)
class Folds:
    """The folds of a surface: the place of each where it is deepest (k, dim), mm, and the depth there (k,), mm."""

    places: np.ndarray
    depths: np.ndarray


@dataclass(frozen=True)
class _Points:
    """Nodes of the free surface: numbers that all ranks share, positions (p, dim), normals (p, dim), element sizes (p,)."""

    numbers: np.ndarray
    x: np.ndarray
    normals: np.ndarray
    sizes: np.ndarray

    def gathered(self, comm) -> _Points:
        """Those of all ranks, on all of them."""
        if comm.size == 1:
            return self
        parts = comm.allgather((self.numbers, self.x, self.normals, self.sizes))
        return _Points(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def some(self, rows: np.ndarray) -> _Points:
        return _Points(self.numbers[rows], self.x[rows], self.normals[rows], self.sizes[rows])


class FoldFinder:
    """Finds folds of a body; built anew for a new mesh.

    Parameters
    ----------
    free : the free surface of the body, on all ranks
    cells : (m, 6 | 10) nodes of the cells of this rank, basix order
    """

    def __init__(self, free: FreeSurface, cells: np.ndarray):
        self.free, self._comm = free, free.surface.comm
        self._numbers, self._owned = free.surface.numbering(len(free.nodes))
        self._mine = np.flatnonzero(free.nodes & self._owned)
        self._cells = cells[free.nodes[cells].any(axis=1)]

    def find(self, x: np.ndarray) -> Folds:
        """The folds with the nodes at ``x`` (n, dim). Collective."""
        mine = self._surface_points(x)
        points = mine.gathered(self._comm)
        sides = _Sides.of(self.free, x, self._numbers)
        crossed = np.unique(_all(self._comm, self._crossed(x, points)))
        touching = np.unique(_all(self._comm, self._touching(sides, points)))
        behind, depth = self._behind_mirrors(mine)
        met = points.some(crossed)
        found = ((met.x, self._below(sides, met), met.sizes),
                 (points.x[touching], np.zeros(len(touching)), points.sizes[touching]),
                 tuple(_all(self._comm, a[behind]) for a in (mine.x, depth, mine.sizes)))
        return _gathered_to_folds(*(np.concatenate(column) for column in zip(*found, strict=True)))

    # ------------------------------------------------------------------ points
    def _surface_points(self, x: np.ndarray) -> _Points:
        """The nodes of the free surface that this rank owns. Collective."""
        surface, chosen = self.free.surface, self.free.sides
        normals, _ = surface.normals(x, chosen)
        sides, size = surface.sides[chosen], surface.lengths(x)[chosen]
        weight = np.stack([np.bincount(sides.ravel(), np.repeat(size, sides.shape[1]), len(x)),
                           np.bincount(sides.ravel(), minlength=len(x))], axis=1)
        size, count = surface.summed(weight).T
        mine = self._mine
        return _Points(self._numbers[mine], x[mine], normals[mine], size[mine] / count[mine])

    # ------------------------------------------------------------------ the three kinds
    def _crossed(self, x: np.ndarray, points: _Points) -> np.ndarray:
        """Which points lie in a cell of this rank that is not theirs."""
        p = x[self._cells]
        centres = p.mean(axis=1)
        cell, point = _near(points.x, centres, np.linalg.norm(p - centres[:, None], axis=2).max(axis=1, initial=0.0))
        foreign = ~(self._numbers[self._cells[cell]] == points.numbers[point, None]).any(axis=1)
        cell, point = cell[foreign], point[foreign]
        inner = _straight_coordinates(p[cell, : self.free.surface.dim + 1], points.x[point])
        close = (inner > np.maximum(_least_coordinates(p[cell]), -0.5)).all(axis=1)
        cell, point = cell[close], point[close]
        if not close.any():
            return point
        inner = _curved_coordinates(p[cell], points.x[point], inner[close])
        return point[(inner > LEAST_DEPTH).all(axis=1)]

    def _touching(self, sides: _Sides, points: _Points) -> np.ndarray:
        """Which points hover just above a side of this rank that faces them."""
        reach = (1 + TOUCHING) * np.linalg.norm(sides.p - sides.centres[:, None], axis=2).max(axis=1, initial=0.0)
        side, point = _near(points.x, sides.centres, reach)
        opposed = np.einsum("pi,pi->p", points.normals[point], sides.normals[side]) < FACING / 2
        foreign = ~(sides.numbers[side] == points.numbers[point, None]).any(axis=1)
        side, point = side[opposed & foreign], point[opposed & foreign]
        if not len(point):
            return point
        place, normal, within = self.free.surface.foot(sides.p[side], points.x[point])
        above = np.einsum("pi,pi->p", points.x[point] - place, normal) / sides.lengths[side]
        facing = np.einsum("pi,pi->p", points.normals[point], normal) < FACING
        # what lies behind a side of a thin body faces it too, and is no fold
        return point[within & facing & (above > -ROUNDING) & (above < TOUCHING)]

    def _behind_mirrors(self, points: _Points) -> tuple[np.ndarray, np.ndarray]:
        """Which points of this rank have met their image, and how deep: they are behind a mirror plane, or just before one
        that their normal points to."""
        found, depth = np.zeros(len(points.x), bool), np.zeros(len(points.x))
        for axis, value in self.free.mirrors.items():
            above = points.x[:, axis] - value
            loose = ~self.free.on_plane[axis][self._mine]
            behind = loose & (above < -LEAST_DEPTH * points.sizes)
            before = loose & (np.abs(above) < TOUCHING / 2 * points.sizes) & (points.normals[:, axis] < FACING)
            found |= behind | before
            depth = np.maximum(depth, np.where(behind, -above, 0.0))
        return found, depth

    def _below(self, sides: _Sides, points: _Points) -> np.ndarray:
        """Distance of points inside from the nearest side that is not theirs and faces them, (p,) mm. Collective."""
        depth = np.full(len(points.x), np.inf)
        if len(points.x) and len(sides.p):
            square = ((points.x[:, None] - sides.centres) ** 2).sum(axis=2)
            square[points.normals @ sides.normals.T > FACING / 2] = np.inf
            square[(sides.numbers[None] == points.numbers[:, None, None]).any(axis=2)] = np.inf
            near = np.argsort(square, axis=1)[:, :CANDIDATES]
            side, point = near.ravel(), np.repeat(np.arange(len(points.x)), near.shape[1])
            place, _, within = self.free.surface.foot(sides.p[side], points.x[point])
            away = np.linalg.norm(points.x[point] - place, axis=1)
            to_nodes = np.linalg.norm(points.x[point][:, None] - sides.p[side], axis=2).min(axis=1)
            away = np.where(within, away, to_nodes).reshape(near.shape)
            away[~np.isfinite(np.take_along_axis(square, near, axis=1))] = np.inf
            depth = away.min(axis=1)
        depth = lowest(self._comm, depth)
        return np.where(np.isfinite(depth), depth, 0.0)


@dataclass(frozen=True)
class _Sides:
    """Sides of the free surface of this rank: numbers (f, 3 | 6) and positions of their nodes, and of each its centre, unit
    normal there and length."""

    numbers: np.ndarray
    p: np.ndarray
    centres: np.ndarray
    normals: np.ndarray
    lengths: np.ndarray

    @classmethod
    def of(cls, free: FreeSurface, x: np.ndarray, numbers: np.ndarray) -> _Sides:
        surface = free.surface
        nodes = surface.sides[free.sides]
        centres, normals = surface.centres(x)
        return cls(numbers[nodes], x[nodes], centres[free.sides], normals[free.sides], surface.lengths(x)[free.sides])


def _all(comm, values: np.ndarray) -> np.ndarray:
    """What the ranks have found, one after the other."""
    return values if comm.size == 1 else np.concatenate(comm.allgather(values))


def _near(points: np.ndarray, centres: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (centre, point) of points within reach of centres, each (pairs,)."""
    if len(points) == 0 or len(centres) == 0:
        return np.empty(0, int), np.empty(0, int)
    if len(points) * len(centres) < FEW:
        square = sum((centres[:, None, k] - points[:, k]) ** 2 for k in range(points.shape[1]))
        return np.nonzero(square <= reach[:, None] ** 2)
    from scipy.spatial import cKDTree
    found = cKDTree(points).query_ball_point(centres, reach, return_sorted=False)
    counts = np.fromiter(map(len, found), int, len(found))
    return np.repeat(np.arange(len(centres)), counts), np.concatenate(found).astype(int)


def _least_coordinates(p: np.ndarray) -> np.ndarray:
    """Least barycentric coordinates, in the straight cells, that points of quadratic cells (p, 6 | 10, dim) can have,
    (p, dim + 1): those of the control points, of which a cell is the weighted mean."""
    dim = p.shape[2]
    ends, at_corners = np.array(EDGES[dim]), np.eye(dim + 1)
    middles = p[:, dim + 1:]
    at_middles = _straight_coordinates(np.repeat(p[:, : dim + 1], len(ends), axis=0), middles.reshape(-1, dim))
    control = 2 * at_middles.reshape(len(p), len(ends), dim + 1) - 0.5 * at_corners[ends].sum(axis=1)
    return np.minimum(control.min(axis=1), 0.0)


def _straight_coordinates(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (p, dim + 1) of points in straight cells."""
    local = np.linalg.solve(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2), (points - corners[:, 0])[:, :, None])
    return np.concatenate([1.0 - local.sum(axis=1), local[:, :, 0]], axis=1)


def _curved_coordinates(p: np.ndarray, points: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (p, dim + 1) in quadratic cells, by Newton from those in the straight ones."""
    inner = inner.copy()
    for _ in range(TURNS):
        miss = points - np.einsum("pa,pai->pi", quadratic_shapes(inner, points.shape[1]), p)
        slopes = by_coordinate(inner, p)
        tangents = np.swapaxes(slopes[:, 1:] - slopes[:, :1], 1, 2)
        singular = np.abs(np.linalg.det(tangents)) == 0
        tangents[singular] = np.eye(points.shape[1])
        step = np.clip(np.linalg.solve(tangents, miss[:, :, None])[:, :, 0], -1.0, 1.0)
        inner[:, 1:] += step
        inner[:, 0] -= step.sum(axis=1)
        if np.abs(step).max(initial=0.0) < FOUND:
            break
    return inner


def _gathered_to_folds(x: np.ndarray, depth: np.ndarray, size: np.ndarray) -> Folds:
    """One fold for all points that hang together, where they are deepest."""
    if len(x) == 0:
        return Folds(x, depth)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree
    order = np.lexsort((*x.T, -depth))           # the deepest first, whatever rank they come from
    x, depth, size = x[order], depth[order], size[order]
    pairs = cKDTree(x).query_pairs(APART * size.max(), output_type="ndarray")
    number, group = connected_components(coo_array((np.ones(len(pairs)), pairs.T), shape=(len(x), len(x))), directed=False)
    first = np.sort(np.unique(group, return_index=True)[1])
    return Folds(x[first], depth[first])
