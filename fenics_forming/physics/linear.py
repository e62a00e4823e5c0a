"""Direct linear solver for the symmetric, indefinite flow systems: MUMPS LDL^T, its symbolic phase reused; LU where Coulomb
friction between parts of a tool makes a system unsymmetric."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from ..errors import ConvergenceError

_OUT_OF_WORKSPACE = (-8, -9, -11, -12, -14, -15, -17, -18, -20)


class DirectSolver:
    """Solve ``A x = b`` for a matrix, symmetric if not said otherwise, whose values, not pattern, change from call to call.

    ICNTL(12)=1 keeps the ordering from pairing pivots by the first matrix; without it rigid zones delay thousands
    of pivots, the workspace overflows, and PETSc's ``preonly`` hands back NaN without a word.  So INFOG(1) is
    looked at after every factorisation and the workspace is doubled where MUMPS asks for it.
    """

    def __init__(self, A: PETSc.Mat, *, symmetric: bool = True):
        self._A, self._kind = A, "cholesky" if symmetric else "lu"
        A.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
        self._workspace = 100
        self._build()

    def _build(self):
        self._ksp = PETSc.KSP().create(self._A.comm)
        self._ksp.setType("preonly")
        self._ksp.setOperators(self._A)
        pc = self._ksp.getPC()
        pc.setType(self._kind)
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        self._factor = pc.getFactorMatrix()
        self._factor.setMumpsIcntl(12, 1)
        self._factor.setMumpsIcntl(14, self._workspace)

    def factorise(self) -> None:
        """Factorise the present values of the matrix.

        Raises
        ------
        ConvergenceError
            if MUMPS reports an error that more workspace does not cure.
        """
        for _ in range(6):
            self._ksp.setOperators(self._A)
            self._ksp.setUp()
            info = self._factor.getMumpsInfog(1)
            if info >= 0:
                return
            if info not in _OUT_OF_WORKSPACE:
                break
            self._workspace *= 2
            self._build()
        second = self._factor.getMumpsInfog(2)
        self._build()       # PETSc would not factorise anew with one that has failed, whatever the values
        raise ConvergenceError(f"MUMPS could not factorise the system (INFOG(1) = {info}, INFOG(2) = {second}): "
                               "the body may be free to move as a whole, or a cell is inverted")

    def solve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        self._ksp.solve(b, x)

    def solve_units(self, rows: np.ndarray) -> np.ndarray:
        """Solve for many right-hand sides at once, the k-th with a one in the row (of this rank) ``rows[k]``, nothing where
        that is -1: owned rows (n, k) of the solutions. Sparse ones, which MUMPS gets from one rank, take half the time.
        Collective."""
        comm, own, count = self._A.comm, self._A.getLocalSize()[0], len(rows)
        ones = np.flatnonzero(rows >= 0)
        found = PETSc.Mat().createDense(((own, None), (None, count)), comm=comm)
        found.setUp()
        found.assemble()
        if comm.size == 1:
            starts = np.append(0, np.cumsum(rows >= 0)).astype(PETSc.IntType)
            turned = PETSc.Mat().createAIJ((count, own), csr=(starts, rows[ones].astype(PETSc.IntType), np.ones(len(ones))),
                                           comm=comm)
            right = PETSc.Mat().createTranspose(turned)
        else:
            columns = np.zeros((own, count), order="F")
            columns[rows[ones], ones] = 1.0
            right = PETSc.Mat().createDense(((own, None), (None, count)), array=columns, comm=comm)
            right.assemble()
        self._factor.matSolve(right, found)
        return found.getDenseArray().copy()
