"""The vertices of all ranks, in an order that does not depend on how the mesh is divided.

Groups of vertices that are made in this order make what the solver finds independent of the number of ranks, to rounding; a
hierarchy over the ranks would not, since its levels follow the parts.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from .pattern import Pattern
from .sharing import Shared

ROUNDED = 1e-7      # of the size of the body: positions that differ by less are the same in the order


class Everywhere:
    """Gathers values, neighbours and blocks of the vertices.

    Parameters
    ----------
    pattern, shared : of the vertices of this rank · x : (vertices, 3) where they are at the start, which orders them ·
    body : (vertices,) the body that they belong to, since two may meet in one place

    Attributes
    ----------
    count : vertices of all ranks · places : (count, 3) where they are, in integers, in the common order
    numbers : (vertices,) of this rank's vertices in the common order
    """

    def __init__(self, shared: Shared, x: np.ndarray, body: np.ndarray):
        comm, owned = shared.comm, shared.owned
        self.comm, self._owned = comm, owned
        mine = x[:owned]
        parts = comm.allgather(mine)
        places = np.concatenate(parts)
        self.count = len(places)
        size = max(float(np.ptp(places, axis=0).max(initial=0.0)), 1e-300)
        rounded = np.floor((places - places.min(axis=0)) / (ROUNDED * size) + 0.1234567)
        rank_of = np.empty(self.count, np.int32)
        rank_of[np.lexsort([np.concatenate(comm.allgather(body[:owned])), *rounded.T])] = np.arange(self.count)
        first = int(np.sum([len(part) for part in parts[: comm.rank]]))
        numbers = np.full((shared.count, 1), -1.0)
        numbers[:owned, 0] = rank_of[first:first + owned]
        self.numbers = shared.hand_on(numbers).ravel().astype(np.int64)
        self._all_numbers = rank_of
        self.places = rounded[np.argsort(rank_of)].astype(np.int64)

    def graph(self, pattern: Pattern) -> sparse.csr_matrix:
        """Neighbours of all vertices, symmetric, none of itself. Collective."""
        rows, columns = self.numbers[pattern.rows], self.numbers[pattern.columns]
        mine = np.concatenate([rows * self.count + columns, columns * self.count + rows])
        keys = np.concatenate(self.comm.allgather(mine))
        rows, columns = np.divmod(np.unique(keys), self.count)
        return sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), 2 * (self.count,))

    def gather(self, values: np.ndarray) -> np.ndarray:
        """Values of the owned vertices of all ranks, (count[, k]), in the common order."""
        out = np.empty((self.count, *values.shape[1:]))
        out[self._all_numbers] = np.concatenate(self.comm.allgather(values[: self._owned])) if self.comm.size > 1 \
            else values[: self._owned]
        return out
