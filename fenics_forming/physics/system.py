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

    rows = None     # of a matrix of one body in the plane, see `PlaneMatrix`

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

    def lift(self, b: PETSc.Vec, body) -> None:
        """Add to the residual what given velocities that are not met yet do to the other equations, ghosts not summed."""
        fem_petsc.apply_lifting(b, [self._form], [body.conditions], x0=[body.solution.x.petsc_vec], alpha=-1.0)


class CoupledMatrix:
    """The matrix of the flow without contact between bodies, and of that contact, whose pattern follows their pairing.

    The couplings never go into the pattern of the form one by one: both patterns are merged as a whole, where pairs have
    come that the present one does not hold.

    Attributes
    ----------
    petsc : the matrix; another one after :meth:`follow` has said so
    """

    rows = None

    def __init__(self, bulk, interfaces):
        self._bulk, self._interfaces = bulk, interfaces
        self.petsc = self._bulk.petsc

    def follow(self, conditions) -> bool:
        """Make place for new pairs; whether the matrix is another one now. Collective."""
        if not self._interfaces.has_new_pairs:
            return False
        self._bulk.assemble(conditions)     # an empty matrix would lose its pattern
        self.petsc = self._interfaces.merged(self._bulk.petsc)
        return True

    def assemble(self, conditions) -> None:
        """Values anew; rows and columns of the conditions are those of the identity. Collective."""
        self._bulk.assemble(conditions)
        self.petsc.zeroEntries()
        self.petsc.axpy(1.0, self._bulk.petsc, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        self._interfaces.add_tangent(self.petsc)
