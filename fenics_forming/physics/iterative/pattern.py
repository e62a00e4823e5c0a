"""Which nodes of a mesh meet in a cell, and where their blocks lie."""

from __future__ import annotations

import numpy as np

BITS = 10       # of a place along each axis


class Pattern:
    """The upper half of a symmetric pattern: pairs of nodes that share a cell, row by row.

    Parameters
    ----------
    groups : (cells, k) nodes that all meet
    count : number of nodes

    Attributes
    ----------
    starts, columns : of the pairs of a row with higher nodes, (count + 1,), (pairs,)
    places : (cells, k (k - 1) / 2) where the pairs a < b of a cell lie, -1 - place where b is the lower node
    """

    def __init__(self, groups: np.ndarray, count: int):
        self._count = count
        keys, upside_down = self._keys(groups)
        self._known, places = np.unique(keys, return_inverse=True)
        places = places.reshape(keys.shape).astype(np.int32)
        self.places = np.where(upside_down, -1 - places, places)
        self.columns = (self._known % count).astype(np.int32)
        self.starts = np.searchsorted(self._known, count * np.arange(count + 1, dtype=np.int64)).astype(np.int32)

    @property
    def rows(self) -> np.ndarray:
        """The lower node of every pair, (pairs,)."""
        return np.repeat(np.arange(self._count, dtype=np.int32), np.diff(self.starts))

    def places_of(self, groups: np.ndarray) -> np.ndarray:
        """Places of the pairs of other groups of nodes, all of which meet in a cell, as ``places``."""
        keys, upside_down = self._keys(groups)
        places = np.searchsorted(self._known, keys).astype(np.int32)
        return np.where(upside_down, -1 - places, places)

    def _keys(self, groups: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a, b = np.triu_indices(groups.shape[1], 1)
        a, b = groups[:, a].astype(np.int64), groups[:, b].astype(np.int64)
        return np.minimum(a, b) * self._count + np.maximum(a, b), a > b


class Incidence:
    """Which nodes share a cell with a vertex: the pattern of the divergence, (vertices, nodes).

    starts, columns, places (cells, corners x nodes of a cell) as in :class:`Pattern`
    """

    def __init__(self, corners: np.ndarray, cells: np.ndarray, vertices: int, nodes: int):
        keys = (corners[:, :, None].astype(np.int64) * nodes + cells[:, None, :]).reshape(len(cells), -1)
        known, places = np.unique(keys, return_inverse=True)
        self.places = places.reshape(keys.shape).astype(np.int32)
        self.columns = (known % nodes).astype(np.int32)
        self.starts = np.searchsorted(known, nodes * np.arange(vertices + 1, dtype=np.int64)).astype(np.int32)


def along_a_curve(places: np.ndarray) -> np.ndarray:
    """An order of points (n, 3) in which neighbours are near to one another: of the bits of their places, the first of all
    three axes, then the second ones, and so on (G. M. Morton, 1966). What is done to neighbours then finds their rows in
    the cache of the processor."""
    if len(places) == 0:
        return np.empty(0, np.int64)
    low, size = places.min(axis=0), np.ptp(places, axis=0).max()
    steps = ((places - low) / size * (2**BITS - 1)).astype(np.int64)
    key = np.zeros(len(places), np.int64)
    for bit in range(BITS):
        for axis in range(3):
            key |= ((steps[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")
