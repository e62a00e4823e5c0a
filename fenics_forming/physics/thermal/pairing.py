"""Points on the surface of one mesh, and the places on the surface of another one that they touch."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

NEIGHBOURS = 8      # sides that are tried for every point: those with the nearest middles, and around the nearest vertex


class TouchedSides:
    """The straight sides of a surface, to find places on it.

    Parameters
    ----------
    x : (v, dim) vertices, mm · sides : (f, dim) their numbers
    """

    def __init__(self, x: np.ndarray, sides: np.ndarray):
        self.x, self.sides = x, sides
        self._middles = cKDTree(x[sides].mean(axis=1))

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
    ends = np.stack([np.broadcast_to(i[:, :, None], shape), np.broadcast_to(a[:, None, :], shape)], axis=-1).reshape(-1, 2)
    values = (strength[:, None, None] * hats_i[:, :, None] * hats_a[:, None, :]).ravel()
    pairs, place = np.unique(ends, axis=0, return_inverse=True)
    return pairs, np.bincount(place.ravel(), values, len(pairs))
