"""Sizes that grow by no more than a share of the distance from where they are small."""

from __future__ import annotations

import numpy as np

from ..machine_code import compiled
from ..nodes import keys

GROWTH = 0.3              # of the size, per distance
ENOUGH = 1e-3             # of a size: what another sweep would take off


def over_mesh(size: np.ndarray, edges: np.ndarray, length: np.ndarray) -> np.ndarray:
    """The largest sizes (n,) below the given ones that grow by at most GROWTH per length of the edges (e, 2)."""
    return swept(size, edges, GROWTH * length)[1]


@compiled
def swept(size, edges, step):
    """The largest sizes (n,) below the given ones that grow by at most ``step`` (e,) along each of the edges (e, 2), (n,),
    before and after the last sweep, which takes off next to nothing."""
    while True:
        least, enough = size.copy(), True
        for e in range(len(edges)):
            a, b = edges[e, 0], edges[e, 1]
            least[a] = min(least[a], size[b] + step[e])
            least[b] = min(least[b], size[a] + step[e])
        for k in range(len(size)):
            enough &= least[k] >= size[k] * (1 - ENOUGH)
        if enough:
            return size, least
        size = least


def around_loop(size: np.ndarray, s: np.ndarray, length: float) -> np.ndarray:
    """The same at the places s along a closed loop of the given length, in order."""
    way, wanted = np.concatenate([s - length, s, s + length]), np.tile(size, 3)
    up = np.minimum.accumulate(wanted - GROWTH * way) + GROWTH * way
    down = (np.minimum.accumulate((wanted + GROWTH * way)[::-1]) - GROWTH * way[::-1])[::-1]
    return np.minimum(up, down)[len(s):2 * len(s)]


def edges_of(x: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges (e, 2) of triangles and their lengths (e,)."""
    a, b = np.divmod(np.unique(keys(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), len(x))), len(x))
    return np.stack([a, b], axis=1), np.linalg.norm(x[b] - x[a], axis=1)
