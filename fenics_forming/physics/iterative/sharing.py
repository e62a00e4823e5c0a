"""Arrays over nodes or vertices of which neighbouring ranks hold copies."""

from __future__ import annotations

import numpy as np
from dolfinx import la


class Shared:
    """Adds up and hands on arrays (count, k) over the entries of an index map; owned entries come first.

    Attributes
    ----------
    owned, count : entries that this rank owns, and all that it holds
    """

    def __init__(self, index_map):
        self.map, self.comm = index_map, index_map.comm
        self.owned = index_map.size_local
        self.count = index_map.size_local + index_map.num_ghosts
        self._vectors: dict[int, la.Vector] = {}

    def _vector(self, values: np.ndarray) -> la.Vector:
        width = values.size // max(self.count, 1)
        if width not in self._vectors:
            self._vectors[width] = la.vector(self.map, width)
        return self._vectors[width]

    def hand_on(self, values: np.ndarray) -> np.ndarray:
        """Give the owners' values to the copies, in place."""
        if self.comm.size > 1:
            vector = self._vector(values)
            vector.array[:] = values.ravel()
            vector.scatter_forward()
            values.ravel()[:] = vector.array
        return values

    def add_up(self, values: np.ndarray) -> np.ndarray:
        """Add what all ranks have to the owners' values, in place; copies keep what they had."""
        if self.comm.size > 1:
            vector = self._vector(values)
            vector.array[:] = values.ravel()
            vector.scatter_reverse(la.InsertMode.add)
            values.ravel()[:] = vector.array
        return values

    def add_for_all(self, values: np.ndarray) -> np.ndarray:
        """Add what all ranks have, for all of them, in place."""
        return self.hand_on(self.add_up(values))
