"""The matrix that turns unknowns of two bodies into relative motion at the carriers of their contact."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from .carriers import Carriers


def gap_operator(comm, carriers: Carriers, owned: int, *, of_point: np.ndarray, share: np.ndarray, turn: np.ndarray,
                 shapes: np.ndarray, dofs: np.ndarray, free: np.ndarray) -> PETSc.Mat:
    """The gap operator, (carriers of this rank · dim) x unknowns. Collective.

    Parameters
    ----------
    owned : unknowns of this rank
    of_point, share : (p, k) carriers of every point and what it counts for in each · turn : (p, k, dim, dim)
    shapes : (p, n) shape functions of the slave, and those of the master taken negative
    dofs, free : (p, n, dim) global unknowns of their nodes, and 0 where one is given
    """
    points, dim = len(shapes), dofs.shape[2]
    _, one, node = np.unique(dofs[..., 0], return_index=True, return_inverse=True)
    dof_of, free_of = dofs.reshape(-1, dim)[one], free.reshape(-1, dim)[one]
    at = np.arange(points)
    at_nodes = np.repeat(at, shapes.shape[1]), node.ravel()
    at_carriers = of_point.ravel(), np.repeat(at, share.shape[1])
    trace = lambda values: sparse.csr_matrix((values.ravel(), at_nodes), (points, len(one)))  # noqa: E731
    mean = lambda values: sparse.csr_matrix((values.ravel(), at_carriers), (carriers.total, points))  # noqa: E731
    traces = trace(shapes)
    # a product leaves out what happens to be zero; the pattern must be that of the pairs alone
    place = (mean(np.ones_like(share)) @ trace(np.ones_like(shapes))).tocoo()
    rows, columns, values = [], [], []
    for i in range(dim):
        rows.append(place.row * dim + i)
        columns.append(dof_of[place.col, i])
        values.append(np.zeros(place.nnz))
        for j in range(dim):
            if i != j and not turn[:, :, i, j].any():
                continue
            found = (mean(share * turn[:, :, i, j]) @ traces).tocoo()
            rows.append(found.row * dim + i)
            columns.append(dof_of[found.col, j])
            values.append(found.data * free_of[found.col, j])
    rows, columns, values = _kept(comm, carriers, dim, *(np.concatenate(a) for a in (rows, columns, values)))
    unknown, column = np.unique(columns, return_inverse=True)
    matrix = sparse.coo_matrix((values, (rows, column.ravel())), (carriers.count * dim, len(unknown))).tocsr()
    matrix.sort_indices()
    index = PETSc.IntType
    return PETSc.Mat().createAIJ(
        ((carriers.count * dim, None), (owned, None)), comm=comm,
        csr=(matrix.indptr.astype(index), unknown[matrix.indices].astype(index), matrix.data))


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


def _kept(comm, carriers: Carriers, dim: int, rows, columns, values):
    """The entries of this rank's carriers, from all ranks, with rows counted from its first. Collective."""
    first, last = carriers.first * dim, (carriers.first + carriers.count) * dim
    if comm.size > 1:
        mine = (rows >= first) & (rows < last)
        foreign = [np.concatenate(parts) for parts in zip(*comm.allgather((rows[~mine], columns[~mine], values[~mine])),
                                                          strict=True)]
        chosen = (foreign[0] >= first) & (foreign[0] < last)
        rows, columns, values = (np.concatenate([own[mine], other[chosen]])
                                 for own, other in zip((rows, columns, values), foreign, strict=True))
    return rows - first, columns, values
