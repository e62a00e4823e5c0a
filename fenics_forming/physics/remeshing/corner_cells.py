"""Triangles with two sides on the boundary, without cutting them where the diagonal can be turned instead.

Cut at its centre, as `gmsh_arrays.split_corner_cells` does, the triangle of a right corner leaves cells with radius
ratios near 0.2; the other diagonal of the quadrangle that it forms with its neighbour often leaves better ones.
"""

from __future__ import annotations

import numpy as np

from .body_arrays import keys
from .quality import radius_ratio


def turned(x: np.ndarray, triangles: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """The triangles with the diagonal behind a corner turned wherever that beats cutting the corner's triangle.

    x : (n, 2); triangles : (m, 3), counter-clockwise; sides : (f, 2) vertices of the boundary, body on the left
    """
    edges = triangles[:, [[1, 2], [2, 0], [0, 1]]]               # opposite to vertex k
    key = keys(edges.reshape(-1, 2), len(x)).reshape(-1, 3)
    following = np.full(len(x), -1)
    following[sides[:, 0]] = sides[:, 1]
    outside = following[edges[..., 0]] == edges[..., 1]
    twice = outside.sum(axis=1) == 2
    cell = np.flatnonzero(twice)
    inner = np.argmin(outside[cell], axis=1)
    corner, (a, b) = triangles[cell, inner], edges[cell, inner].T

    # the neighbour across the inner edge, and its vertex opposite
    flat = np.where(twice[:, None], -1, key).ravel()
    order = np.flatnonzero(np.isin(flat, key[cell, inner]))
    if len(order) == 0:
        return triangles
    order = order[np.argsort(flat[order])]
    found = order[np.minimum(np.searchsorted(flat[order], key[cell, inner]), len(order) - 1)]
    neighbour, opposite = np.divmod(found, 3)
    far = triangles[neighbour, opposite]
    there = flat[found] == key[cell, inner]
    usable = there & ~outside[neighbour].any(axis=1)
    usable &= np.bincount(neighbour[there], minlength=len(triangles))[neighbour] == 1

    turned_pair = np.stack([np.stack([corner, a, far], axis=1), np.stack([corner, far, b], axis=1)], axis=1)
    better = usable & (_worst(x, turned_pair) > _worst_if_cut(x, triangles[cell]))
    triangles = triangles.copy()
    triangles[cell[better]], triangles[neighbour[better]] = turned_pair[better, 0], turned_pair[better, 1]
    return triangles


def _worst(x: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Smallest radius ratio of each group of triangles (k, g, 3); negative where one is turned over."""
    flat = groups.reshape(-1, 3)
    p = x[flat]
    e, f = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    sign = np.sign(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0])
    return (sign * radius_ratio(x, flat)).reshape(groups.shape[:2]).min(axis=1)


def _worst_if_cut(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    centre = len(x) + np.arange(len(triangles))
    parts = np.stack([np.where(np.arange(3) == k, centre[:, None], triangles) for k in range(3)], axis=1)
    return _worst(np.concatenate([x, x[triangles].mean(axis=1)]), parts)
