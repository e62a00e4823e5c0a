"""Factorisation of the flow in the plane by fronts: a mesh, its order of elimination and the matrix on it."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from ..linear import DirectSolver
from . import kernels
from .blas import words
from .dissection import Fronts, fronts_of

VELOCITIES = 12     # of a triangle, before its pressures
EXACT = 1e-8        # residual relative to the right-hand side; 1e-13 is usual


class FrontalSolver:
    """Solve ``A x = b`` for the matrix by rows of a flow on triangles, whose values, not pattern, change from call to call.

    It takes less than half of the time of MUMPS, which has to look for pivots. Where the matrix is not definite as that of
    a flow is (a tangent far from its solution, a body that nothing holds) MUMPS does it.

    Parameters
    ----------
    A : on one rank · rows : (starts, columns, values) of it, the values that A has at any time
    corners (cells, 3, 2) : of the cells · dofs (cells, 15) : their unknowns, velocities first
    appended : which of these the unknowns behind them meet, (unknowns of cells, n), where there are any

    Attributes
    ----------
    by_fronts : whether the present factors are those of the fronts, not of MUMPS
    """

    def __init__(self, A: PETSc.Mat, rows, corners: np.ndarray, dofs: np.ndarray, appended: sp.csr_matrix | None = None):
        starts, columns, self._values = rows
        fronts = fronts_of(corners, dofs, VELOCITIES, appended)
        self._A, self._residual = A, A.createVecLeft()
        self._order, self._boundary = fronts.order, fronts.boundary
        self._words = words()
        self._fronts, room = _table(fronts)
        lower = (len(columns) + len(fronts.order)) // 2         # entries, of a symmetric pattern
        self._source, self._target = np.empty(lower, np.int32), np.empty(lower, np.int32)
        self._parts = np.empty(len(fronts.boundary), np.int64)
        kernels.places(starts, columns, fronts.order, fronts.boundary, self._fronts, self._source, self._target,
                       self._parts)
        own, boundary = self._fronts[:, 1], self._fronts[:, 2]
        self._panels, self._work = np.empty(int(own @ (own + boundary))), np.empty(room)
        self._mumps: DirectSolver | None = None
        self.by_fronts = self._checked = False

    def factorise(self) -> None:
        """Factorise the present values of the matrix.

        Raises
        ------
        ConvergenceError
            if neither this nor MUMPS can.
        """
        self._checked = False
        self.by_fronts = kernels.factorise(
            self._values, self._words, self._fronts, self._source, self._target, self._parts, self._panels, self._work)
        if not self.by_fronts:
            self._factorise_with_pivots()

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """With the factors; those of the fronts are looked at when they are used for the first time."""
        if not self.by_fronts:
            self._mumps.solve(b, x)
            return
        with b.localForm() as right, x.localForm() as found:
            kernels.solve(self._fronts, self._boundary, self._panels, self._order, right.array_r, found.array)
        if not self._checked:
            self._A.mult(x, self._residual)
            self._residual.axpy(-1.0, b)
            self._checked = self._residual.norm() <= EXACT * b.norm()
            if not self._checked:
                self._factorise_with_pivots()
                self._mumps.solve(b, x)

    def _factorise_with_pivots(self) -> None:
        self._mumps, self.by_fronts = self._mumps or DirectSolver(self._A), False
        self._mumps.factorise()


def _table(fronts: Fronts) -> tuple[np.ndarray, int]:
    """The numbers of each front as ``kernels.factorise`` wants them, and how much room the boundaries take."""
    count = len(fronts.parents)
    own, boundary = np.diff(fronts.first), np.diff(fronts.starts)
    table = np.full((count, 10), -1)
    table[:, 0], table[:, 1], table[:, 2] = fronts.velocities, own, boundary
    table[:, 3], table[:, 5] = fronts.first[:-1], fronts.starts[:-1]
    table[:, 4] = np.concatenate([[0], np.cumsum(own * (own + boundary))[:-1]])
    sides = fronts.slots % 2
    child = np.flatnonzero(fronts.parents >= 0)
    table[fronts.parents[child], 6 + sides[child]] = child
    room = np.zeros(fronts.slots.max() + 1, int)
    np.maximum.at(room, fronts.slots, boundary**2)
    table[:, 8] = (np.cumsum(room) - room)[fronts.slots]
    return table, int(room.sum())
