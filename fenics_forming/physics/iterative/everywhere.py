"""The matrix of the vertices on every rank, in an order that does not depend on how the mesh is divided.

The coarse level has an eighth of the nodes. Solved by every rank for itself, in this order, it makes what the solver finds
independent of the number of ranks, to rounding; a hierarchy over the ranks would not, since its levels follow the parts.
"""

from __future__ import annotations

import numpy as np

from ..machine_code import compiled
from .pattern import Pattern
from .sharing import Shared

ROUNDED = 1e-7      # of the size of the body: positions that differ by less are the same in the order


class Everywhere:
    """Gathers blocks and vectors of the vertices.

    Parameters
    ----------
    pattern, shared : of the vertices of this rank · x : (vertices, 3) where they are at the start, which orders them ·
    body : (vertices,) the body that they belong to, since two may meet in one place

    Attributes
    ----------
    count : vertices of all ranks · starts, columns : the whole pattern of blocks, row by row, (count + 1,), (blocks,)
    numbers : (vertices,) of this rank's vertices in the common order
    """

    def __init__(self, pattern: Pattern, shared: Shared, x: np.ndarray, body: np.ndarray):
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
        self._find(pattern, len(x))

    def _find(self, pattern: Pattern, vertices: int):
        """The whole pattern, and where the blocks of every rank lie in it: on and above the diagonal, then mirrored."""
        own, rows, columns = self.numbers, self.numbers[pattern.rows], self.numbers[pattern.columns]
        direct = np.concatenate([own * self.count + own, rows * self.count + columns])
        mirrored = columns * self.count + rows
        self._keys = self.comm.allgather(direct), self.comm.allgather(mirrored)
        self.hold(np.empty(0, np.int64))

    def hold(self, others: np.ndarray) -> None:
        """Make place for further blocks, row · count + column of each."""
        direct, mirrored = self._keys
        self._known = known = np.unique(np.concatenate([*direct, *mirrored, others]))
        self.starts = np.searchsorted(known, self.count * np.arange(self.count + 1, dtype=np.int64)).astype(np.int32)
        self.columns = (known % self.count).astype(np.int32)
        self._direct = [np.searchsorted(known, keys).astype(np.int32) for keys in direct]
        self._mirrored = [np.searchsorted(known, keys).astype(np.int32) for keys in mirrored]

    def gather_blocks(self, blocks: np.ndarray, kept: np.ndarray, out: np.ndarray, others=None) -> None:
        """Sum of the blocks (vertices + pairs, 9) of all ranks into the values ``out`` of a matrix of numbers, row by row,
        of which only rows and columns that are ``kept`` (count · 3) count, and the diagonal; and of ``others``, keys and
        blocks that all ranks have."""
        out[:] = 0.0
        parts = self.comm.allgather(blocks) if self.comm.size > 1 else [blocks]
        for part, direct, mirrored in zip(parts, self._direct, self._mirrored, strict=True):
            _spread(part, direct, self.starts, self.columns, False, out)
            _spread(part[len(part) - len(mirrored):], mirrored, self.starts, self.columns, True, out)
        if others is not None:
            keys, sums = others
            _spread(sums, np.searchsorted(self._known, keys).astype(np.int32), self.starts, self.columns, False, out)
        _mask(self.starts, self.columns, kept, out)

    def sum_of(self, rows: np.ndarray, columns: np.ndarray, blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Further blocks (m, 9) of all ranks, those at the same place added up: row · count + column, and the sums."""
        parts = self.comm.allgather((rows * self.count + columns, blocks))
        keys, at = np.unique(np.concatenate([keys for keys, _ in parts]), return_inverse=True)
        every = np.concatenate([blocks for _, blocks in parts])
        sums = np.stack([np.bincount(at, every[:, k], len(keys)) for k in range(9)], axis=1)
        return keys, sums

    def holds(self, keys: np.ndarray) -> bool:
        """Whether there is place for all of these blocks."""
        return bool(np.isin(keys, self._known).all())

    def gather(self, values: np.ndarray) -> np.ndarray:
        """Values of the owned vertices of all ranks, (count[, k]), in the common order."""
        out = np.empty((self.count, *values.shape[1:]))
        out[self._all_numbers] = np.concatenate(self.comm.allgather(values[: self._owned])) if self.comm.size > 1 \
            else values[: self._owned]
        return out


@compiled
def _spread(blocks, places, starts, columns, mirrored, out):
    """Add blocks (m, 9) at block ``places`` (m,) to the rows of a matrix of numbers."""
    row = 0
    count = len(starts) - 1
    for k in range(len(places)):
        at = places[k]
        if not starts[row] <= at < starts[row + 1]:
            low, high = 0, count
            while high - low > 1:
                middle = (low + high) // 2
                if starts[middle] <= at:
                    low = middle
                else:
                    high = middle
            row = low
        first, width = starts[row], starts[row + 1] - starts[row]
        base = 9 * first + 3 * (at - first)
        for i in range(3):
            for j in range(3):
                out[base + 3 * width * i + j] += blocks[k, 3 * j + i] if mirrored else blocks[k, 3 * i + j]


@compiled
def _mask(starts, columns, kept, out):
    at = 0
    for row in range(len(starts) - 1):
        for i in range(3):
            for k in range(starts[row], starts[row + 1]):
                for j in range(3):
                    if not (kept[3 * row + i] and kept[3 * columns[k] + j]) and not (columns[k] == row and i == j):
                        out[at] = 0.0
                    at += 1
