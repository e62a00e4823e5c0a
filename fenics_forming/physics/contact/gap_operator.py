"""The matrix that turns unknowns of two bodies into relative motion at the carriers of their contact."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from .bvh import _compile
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
    size = ((carriers.count * unknowns.shape[1], None), (owned, None))
    if comm.size == 1:
        starts, columns, values = _by_rows(rows.starts, rows.node, rows.blocks, unknowns, free)
        return PETSc.Mat().createAIJ(size, csr=(starts, columns, values), comm=comm)
    return PETSc.Mat().createAIJ(size, csr=_exchanged_rows(comm, carriers, rows, unknowns, free), comm=comm)


def _exchanged_rows(comm, carriers: Carriers, rows: GapRows, unknowns: np.ndarray, free: np.ndarray):
    """Starts, columns and values of the rows of this rank's carriers, with what other ranks' points give. Collective."""
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
    row, column, values = _exchanged(comm, first, last, (row, column, values))
    every, place = _places(unknowns, column)
    matrix = sparse.coo_matrix((values, (row - first, place)), (carriers.count * dim, len(every))).tocsr()
    matrix.sort_indices()
    index = PETSc.IntType
    return matrix.indptr.astype(index), every[matrix.indices].astype(index), matrix.data


@_compile
def _by_rows(starts, node, blocks, unknowns, free):
    """The same where one rank has all: starts, columns and values of rows in the order of carriers and axes."""
    dim, flat = unknowns.shape[1], blocks.shape[1] == 1
    width = 1 if flat else dim
    begin = np.zeros(dim * (len(starts) - 1) + 1, np.int32)
    columns, values = np.empty(dim * width * len(node), np.int32), np.empty(dim * width * len(node))
    at = 0
    for a in range(len(starts) - 1):
        for i in range(dim):
            for k in range(starts[a], starts[a + 1]):
                n = node[k]
                for j in range(dim):
                    if not flat or i == j:
                        columns[at] = unknowns[n, j]
                        values[at] = blocks[k, 0 if flat else i, 0 if flat else j] * free[n, j]
                        at += 1
            begin[a * dim + i + 1] = at
    return begin, columns, values


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
