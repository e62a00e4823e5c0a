"""The matrix that turns unknowns of two bodies into relative motion at the carriers of their contact."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from .carriers import Carriers
from .gap_rows import GapRows


def gap_operator(comm, carriers: Carriers, owned: int, rows: GapRows, *, unknowns: np.ndarray,
                 free: np.ndarray) -> PETSc.Mat:
    """The gap operator, (carriers of this rank · dim) x unknowns. Collective.

    Parameters
    ----------
    owned : unknowns of this rank · rows : what this rank's points give
    unknowns, free : (nodes, dim) global numbers of the unknowns of the nodes, and 0 where one is given
    """
    dim, carrier, flat = unknowns.shape[1], rows.carrier, rows.blocks.shape[1] == 1
    parts = []
    for i in range(dim):
        for j in range(dim):
            # the pattern must be that of the pairs: what happens to be zero stays in, on the diagonal
            values = rows.blocks[:, 0, 0] if flat else rows.blocks[:, i, j]
            if i == j or not flat and values.any():
                parts.append((carrier * dim + i, unknowns[rows.node, j], values * free[rows.node, j]))
    row, column, values = (np.concatenate(a) for a in zip(*parts, strict=True))
    first, last = carriers.first * dim, (carriers.first + carriers.count) * dim
    if comm.size > 1:
        row, column, values = _exchanged(comm, first, last, (row, column, values))
    every, place = _places(unknowns, column)
    matrix = sparse.coo_matrix((values, (row - first, place)), (carriers.count * dim, len(every))).tocsr()
    matrix.sort_indices()
    index = PETSc.IntType
    return PETSc.Mat().createAIJ(
        ((carriers.count * dim, None), (owned, None)), comm=comm,
        csr=(matrix.indptr.astype(index), every[matrix.indices].astype(index), matrix.data))


def _places(unknowns: np.ndarray, column: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of unknowns in rising order, and where in them the ``column`` of each entry is."""
    every = np.sort(unknowns, axis=None)
    place = np.empty(every[-1] - every[0] + 1, np.int64)
    place[every - every[0]] = np.arange(len(every))
    return every, place[column - every[0]]


class NodeTraces:
    """A gap operator by the nodes and axes of its columns.

    Parameters
    ----------
    operator : of `gap_operator` · unknowns : (nodes, dim) global numbers of the unknowns of all nodes that it may hold
    """

    def __init__(self, operator: PETSc.Mat, unknowns: np.ndarray):
        starts, columns, values = operator.getValuesCSR()
        order = np.argsort(unknowns, axis=None)
        place = order[np.searchsorted(unknowns.ravel()[order], columns)]
        node, axis = np.divmod(place, unknowns.shape[1])
        row, size = np.repeat(np.arange(len(starts) - 1), np.diff(starts)), (len(starts) - 1, len(unknowns))
        self._of_axis = [sparse.csr_matrix((values[axis == i], (row[axis == i], node[axis == i])), size)
                         for i in range(unknowns.shape[1])]

    def diagonal(self, weighted: np.ndarray) -> np.ndarray:
        """Blocks on the diagonal of G^T T G for blocks T (carriers, dim, dim): what this rank's carriers give, (nodes, dim,
        dim)."""
        count, dim = len(weighted), len(self._of_axis)
        at = sparse.bsr_matrix((weighted, np.arange(count), np.arange(count + 1)), 2 * (count * dim,)).tocsr()
        blocks = np.zeros((self._of_axis[0].shape[1], dim, dim))
        for j, trace in enumerate(self._of_axis):
            pressed = at @ trace
            for i, other in enumerate(self._of_axis):
                blocks[:, i, j] = other.multiply(pressed).sum(axis=0)
        return blocks


def _exchanged(comm, first: int, last: int, entries) -> tuple[np.ndarray, ...]:
    """Of entries (rows, columns, values) those of the rows of this rank, its own and what others have found. Collective."""
    mine = (entries[0] >= first) & (entries[0] < last)
    others = comm.allgather(tuple(part[~mine] for part in entries))
    every = [np.concatenate([part[mine], *found]) for part, found in zip(entries, zip(*others, strict=True), strict=True)]
    chosen = (every[0] >= first) & (every[0] < last)
    return tuple(part[chosen] for part in every)
