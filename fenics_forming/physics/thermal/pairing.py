"""Points on the surface of one mesh, and the places on the surface of another one that they touch."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..locating import slopes
from ..nodes import quadratic_shapes

NEIGHBOURS = 8      # sides that are tried for every point: those with the nearest middles, and around the nearest vertex


def dense_points(x: np.ndarray, parts: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points spread evenly over curved sides, ``parts`` along each edge: places (f, q, dim), mm, surface that belongs to
    each (f, q), mm² (mm), and the hats of the vertices there, (q, dim).

    Parameters
    ----------
    x : (f, 3 | 6, dim) nodes of the sides, the vertices first
    """
    dim = x.shape[2]
    if dim == 2:
        s = (np.arange(parts) + 0.5) / parts
        hats = np.column_stack([1 - s, s])
    else:
        i, j = (k.ravel() for k in np.meshgrid(np.arange(parts), np.arange(parts), indexing="ij"))
        up, down = i + j < parts, i + j < parts - 1
        inner = np.concatenate([np.column_stack([i + 1 / 3, j + 1 / 3])[up], np.column_stack([i + 2 / 3, j + 2 / 3])[down]])
        hats = np.column_stack([1 - inner.sum(axis=1) / parts, inner / parts])
    along = np.einsum("qak,fad->fqkd", slopes(hats, dim - 1), x)
    along = along[:, :, 1:] - along[:, :, :1]
    stretch = np.linalg.norm(along[:, :, 0], axis=-1) if dim == 2 else \
        0.5 * np.linalg.norm(np.cross(along[:, :, 0], along[:, :, 1]), axis=-1)
    return np.einsum("qa,fad->fqd", quadratic_shapes(hats, dim - 1), x), stretch / len(hats), hats


def normals_of(x: np.ndarray) -> np.ndarray:
    """Unit normals of sides (f, 3 | 6, dim) as if they were straight, towards either side, (f, dim)."""
    dim = x.shape[2]
    edges = x[:, 1:dim] - x[:, :1]
    across = edges[:, 0, ::-1] * [1.0, -1.0] if dim == 2 else np.cross(edges[:, 0], edges[:, 1])
    return across / np.linalg.norm(across, axis=1, keepdims=True)


class TouchedSides:
    """The straight sides of a surface, to find places on it.

    Parameters
    ----------
    x : (v, dim) vertices, mm · sides : (f, dim) their numbers
    """

    def __init__(self, x: np.ndarray, sides: np.ndarray):
        self.x, self.sides = x, sides
        self._middles = cKDTree(x[sides].mean(axis=1))
        self.finest = float(np.linalg.norm(x[sides[:, 1]] - x[sides[:, 0]], axis=1).min())

    def find(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (p, dim) of the side that is nearest to each point, and the hats (p, dim) of its nearest place: they are
        not negative, and their sum is 1."""
        _, tried = self._middles.query(points, k=min(NEIGHBOURS, len(self.sides)))
        tried = tried.reshape(len(points), -1)
        corners = self.x[self.sides[tried]]                                      # p, k, dim, dim
        hats = _hats(corners, points[:, None, :])
        away = np.linalg.norm(np.einsum("pka,pkai->pki", hats, corners) - points[:, None, :], axis=2)
        best = np.argmin(away, axis=1)
        rows = np.arange(len(points))
        return self.sides[tried[rows, best]], hats[rows, best]


def _hats(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (…, dim) in segments or triangles (…, dim, dim) of the projections of points (…, dim), drawn
    onto them where they are outside."""
    edges = corners[..., 1:, :] - corners[..., :1, :]
    along = np.einsum("...ei,...i->...e", edges, points - corners[..., 0, :])
    inner = np.linalg.solve(np.einsum("...ei,...fi->...ef", edges, edges), along[..., None])[..., 0]
    hats = np.concatenate([1.0 - inner.sum(axis=-1, keepdims=True), inner], axis=-1)
    hats = np.maximum(hats, 0.0)
    return hats / hats.sum(axis=-1, keepdims=True)


def conductances(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray], strength: np.ndarray
                 ) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (m, 2) of vertices of two surfaces and the conductances (m,) between them, mW/K.

    A point p of strength s, mW/K, conducts s φ_i(p) N_a(p) between the vertex i of one surface and a of the other: both
    sets of hats have the sum 1, and neither surface can overshoot.

    Parameters
    ----------
    first, second : vertices (p, k) and hats (p, k) of the points in each surface · strength : (p,)
    """
    (i, hats_i), (a, hats_a) = first, second
    shape = (len(strength), i.shape[1], a.shape[1])
    values = (strength[:, None, None] * hats_i[:, :, None] * hats_a[:, None, :]).ravel()
    acts, many = values > 0, int(a.max(initial=0)) + 1
    number = (np.broadcast_to(i[:, :, None], shape) * many + np.broadcast_to(a[:, None, :], shape)).ravel()[acts]
    pairs, place = np.unique(number, return_inverse=True)      # of one number: ten times as fast as of two
    return np.column_stack([pairs // many, pairs % many]), np.bincount(place.ravel(), values[acts], len(pairs))
