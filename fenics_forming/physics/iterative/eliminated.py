r"""Unknown motions of tools, eliminated from the linear system and so part of the products of the iterative solver.

With the border of ``physics.bordering``, :math:`da = C^{-1}(r - B^T dv)`, and what is left to solve is

.. math:: (A - B\,C^{-1} B^T)\,dv = b - B\,C^{-1} r .

The tangent D of a penalty in A and the resistance R of a tool in :math:`C = R + \Phi^T D\Phi` so act in series, on every
level of the preconditioner: a tool that yields takes the stiffness out of its contact.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.linalg import lapack

from ...errors import ConvergenceError
from ..parallel import total


class InSeries:
    """Products with -B C^-1 B^T and its diagonal, over nodes or over vertices.

    Parameters
    ----------
    columns : (3 · owned, n) owned rows of B · inverse : (n, n), C^-1
    of_all : (3 · all vertices, n) where these are vertices, in the common order
    """

    def __init__(self, comm, columns: sparse.csr_matrix, inverse: np.ndarray, of_all: sparse.csr_matrix | None = None):
        self._comm, self._inverse, self._of_all = comm, inverse, of_all
        filled = np.diff(columns.indptr).reshape(-1, 3).any(axis=1)
        self._near = np.flatnonzero(filled)
        self._columns = columns[(3 * self._near[:, None] + np.arange(3)).ravel()]
        self._onto = self._columns.T.tocsr()
        self._diagonal: np.ndarray | None = None

    def prepare(self) -> None:
        """Find the diagonal, which a smoother asks for: blocks (near, 3, 3)."""
        full = self._columns.toarray()
        pressed = (self._columns @ self._inverse).reshape(len(self._near), 3, -1)
        self._diagonal = pressed @ full.reshape(pressed.shape).swapaxes(1, 2)

    def add_product(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with velocities x (count, 3) to the owners' rows of y. Collective."""
        along = total(self._comm, self._onto @ x[self._near].ravel())
        y[self._near] -= (self._columns @ (self._inverse @ along)).reshape(-1, 3)

    def add_diagonal(self, blocks: np.ndarray) -> None:
        """Add the blocks on the diagonal to the owners' of ``blocks`` (count, 9)."""
        if self._diagonal is None:
            self.prepare()
        blocks[self._near] -= self._diagonal.reshape(-1, 9)

    def add_on_groups(self, groups, matrix: np.ndarray) -> None:
        """Add the Galerkin product on the motions of ``aggregates.RigidGroups`` to their ``matrix`` (m, m). Collective."""
        reached = (groups.operator().T @ self._of_all).toarray()
        matrix -= reached @ self._inverse @ reached.T


class Eliminated:
    """Motions of tools for the system of one iteration.

    Parameters
    ----------
    columns : (owned unknowns, n) of B · corner : C (n, n), on all ranks

    Raises
    ------
    ConvergenceError
        where a motion is resisted by nothing.
    """

    def __init__(self, columns: sparse.csr_matrix, corner: np.ndarray, comm):
        scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(corner)), 1e-300))
        factor, failed = lapack.dpotrf(scale[:, None] * corner * scale, lower=1)
        lower, failed = lapack.dpotri(factor, lower=1) if failed == 0 else (factor, failed)
        if failed:
            raise ConvergenceError("a motion of a tool meets no stiffness against the rest")
        self.inverse = scale[:, None] * (np.tril(lower) + np.tril(lower, -1).T) * scale
        self.columns, self._comm = columns.tocsr(), comm

    def over(self, rows: np.ndarray) -> sparse.csr_matrix:
        """B at velocities ``rows`` (owned nodes, 3) of the owned unknowns, (3 · owned nodes, n)."""
        return self.columns[rows.ravel()]

    def reduced(self, b, right: np.ndarray):
        """A new right-hand side b - B C^-1 r."""
        less = b.copy()
        less.array[:] -= self.columns @ (self.inverse @ right)
        return less

    def found(self, x: np.ndarray, right: np.ndarray) -> np.ndarray:
        """The motions (n,) that belong to owned unknowns x. Collective."""
        return self.inverse @ (right - total(self._comm, self.columns.T @ x))


class OntoVertices:
    """Columns over the owned nodes of a rank as those over all vertices, by velocities that are linear in every cell.

    Parameters
    ----------
    levels : the two levels of ``multigrid`` · everywhere : the common order of the vertices · owned : nodes
    """

    def __init__(self, levels, everywhere, owned: int):
        self._everywhere = everywhere
        nodes, ends, weights = levels.ends(owned)
        scalar = sparse.csr_matrix((weights, (everywhere.numbers[ends], nodes)), (everywhere.count, owned))
        self._restriction = sparse.kron(scalar, sparse.identity(3), format="csr")

    def __call__(self, columns: sparse.csr_matrix) -> sparse.csr_matrix:
        """(3 · owned nodes, n) → (3 · all vertices, n), the sum over the ranks. Collective."""
        mine = (self._restriction @ columns).tocoo()
        parts = self._everywhere.comm.allgather((mine.row, mine.col, mine.data))
        rows, across, values = (np.concatenate(part) for part in zip(*parts, strict=True))
        found = sparse.csr_matrix((values, (rows, across)), mine.shape)
        found.sum_duplicates()
        return found
