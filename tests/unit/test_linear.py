"""The direct solver: solves, says when it cannot, and can again when the values have changed."""

import numpy as np
import pytest
from petsc4py import PETSc

from fenics_forming import ConvergenceError
from fenics_forming.physics.linear import DirectSolver


def matrix(values):
    A = PETSc.Mat().createAIJ((3, 3), nnz=3, comm=PETSc.COMM_SELF)
    A.setValues(range(3), range(3), values)
    A.assemble()
    return A


def test_solver_recovers_from_a_singular_matrix():
    regular = np.array([[2.0, 1, 0], [1, 3, 1], [0, 1, 4]])
    A = matrix(np.zeros((3, 3)))
    solver = DirectSolver(A)
    with pytest.raises(ConvergenceError, match="could not factorise"):
        solver.factorise()
    A.setValues(range(3), range(3), regular)
    A.assemble()
    solver.factorise()
    x, b = A.createVecs()
    b.array[:] = regular @ [1, -2, 3]
    solver.solve(b, x)
    assert x.array == pytest.approx([1, -2, 3])
