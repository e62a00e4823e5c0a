"""The matrix that turns unknowns of two bodies into relative motion at the carriers of their contact."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from .carriers import Carriers


def gap_operator(comm, carriers: Carriers, owned: int, *, point: np.ndarray, carrier: np.ndarray, share: np.ndarray,
                 turn: np.ndarray, shapes: np.ndarray, dofs: np.ndarray, free: np.ndarray) -> PETSc.Mat:
    """The gap operator, (carriers of this rank · dim) x unknowns. Collective.

    Parameters
    ----------
    owned : unknowns of this rank
    point, carrier, share : (m,) points and the carriers in which they count, and how much · turn : (m, dim, dim)
    shapes : (p, n) at the points the shape functions of the slave, and those of the master taken negative
    dofs, free : (p, n, dim) global unknowns of their nodes, and 0 where one is given
    """
    points, dim = len(shapes), dofs.shape[2]
    _, one, node = np.unique(dofs[..., 0], return_index=True, return_inverse=True)
    dof_of, free_of = dofs.reshape(-1, dim)[one].ravel(), free.reshape(-1, dim)[one].ravel()
    at_nodes = np.repeat(np.arange(points), shapes.shape[1]), node.ravel()
    trace = lambda values: sparse.csr_matrix((values.ravel(), at_nodes), (points, len(one)))  # noqa: E731
    mean = lambda values: sparse.csr_matrix((values, (carrier, point)), (carriers.total, points))  # noqa: E731
    traces = trace(shapes)
    # a product leaves out what happens to be zero; the pattern must be that of the pairs alone
    place = (mean(np.ones_like(share)) @ trace(np.ones_like(shapes))).tocoo()
    flat = bool(np.abs(turn - np.eye(dim)).max(initial=0.0) < 1e-14)
    alike = (mean(share) @ traces).tocoo() if flat else None        # for every axis
    rows, columns, values = [], [], []
    for i in range(dim):
        rows.append(place.row * dim + i)
        columns.append(place.col * dim + i)
        values.append(np.zeros(place.nnz))
        for j in range(dim):
            if i != j and (flat or not turn[:, i, j].any()):
                continue
            found = alike if flat else (mean(share * turn[:, i, j]) @ traces).tocoo()
            rows.append(found.row * dim + i)
            columns.append(found.col * dim + j)
            values.append(found.data * free_of[columns[-1]])
    rows, columns, values = (np.concatenate(a) for a in (rows, columns, values))
    first, last = carriers.first * dim, (carriers.first + carriers.count) * dim
    mine = (rows >= first) & (rows < last)
    foreign = _from_others(comm, first, last, (rows[~mine], dof_of[columns[~mine]], values[~mine]))
    unknown = np.unique(np.concatenate([dof_of, foreign[1]]))
    rows, values = np.concatenate([rows[mine], foreign[0]]) - first, np.concatenate([values[mine], foreign[2]])
    columns = np.concatenate([np.searchsorted(unknown, dof_of)[columns[mine]], np.searchsorted(unknown, foreign[1])])
    matrix = sparse.coo_matrix((values, (rows, columns)), (carriers.count * dim, len(unknown))).tocsr()
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


def _from_others(comm, first: int, last: int, entries) -> tuple[np.ndarray, ...]:
    """Of entries (rows, columns, values) that ranks have found for rows of others, those for this one's. Collective."""
    every = [np.concatenate(parts) for parts in zip(*comm.allgather(entries), strict=True)]
    chosen = (every[0] >= first) & (every[0] < last)
    return tuple(part[chosen] for part in every)
