"""The tangent of a flow in two dimensions, on one rank: kernels for what every flow has, a form for the rest."""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from . import plane_kernels as kernels
from .workpiece import Workpiece

KNOWN_TERMS = ("plastic", "incompressibility", "contact")      # whose tangents the kernels compute


class PlaneMatrix:
    """The matrix (``petsc``) of the tangent of a workpiece: velocities and pressures, assembled again and again.

    Attributes
    ----------
    rows : (starts, columns, values) by rows, the values those that PETSc reads
    """

    def __init__(self, workpiece: Workpiece):
        self._body = body = workpiece
        others = [term for name, term in body.tangents.items() if name not in KNOWN_TERMS]
        self._others = fem.form(sum(others)) if others else None
        self._rest = fem.create_matrix(self._others) if others else None      # of the same pattern
        self._lay_out()

    def _lay_out(self):
        """The pattern, and where the entries of cells and of contact facets lie in it."""
        body, dofs = self._body, self._body.element.dofs
        n = body.space.dofmap.index_map.size_local
        keys = np.unique(dofs[:, :, None] * np.int64(n) + dofs[:, None, :])
        starts = np.searchsorted(keys, n * np.arange(n + 1, dtype=np.int64)).astype(PETSc.IntType)
        columns = (keys % n).astype(PETSc.IntType)
        self._values = np.zeros(len(keys))
        self._places = kernels.places_of(starts, columns, dofs)
        if body.contact is not None:
            velocities = body.velocity_dofs[body.contact.facets.facet_nodes].reshape(-1, 6)
            self._facet_places = kernels.places_of(starts, columns, velocities)
        fixed = np.zeros(n, dtype=bool)
        fixed[body.fixed_dofs] = True
        rows = np.repeat(np.arange(n), np.diff(starts))
        self._given = np.flatnonzero(fixed[rows] | fixed[columns])
        self._ones = np.flatnonzero(fixed[rows] & (rows == columns))
        self.rows = starts, columns, self._values
        self.petsc = PETSc.Mat().createAIJWithArrays((n, n), self.rows, comm=body.nodes.comm)

    def assemble(self, conditions) -> None:
        """Values anew; rows and columns of the conditions, which are those of the workpiece, are those of the identity."""
        self._assemble()
        self._values[self._given] = 0.0
        self._values[self._ones] = 1.0
        self.petsc.stateIncrease()      # the values came from behind PETSc's back: factorise anew

    def lift(self, b: PETSc.Vec, body: Workpiece) -> None:
        """Add to the residual what given velocities that are not met yet do to the other equations."""
        unmet = np.zeros(len(body.solution.x.array))
        fixed = body.fixed_dofs
        unmet[fixed] = body._values.x.array[fixed] - body.solution.x.array[fixed]
        self._assemble()
        starts, columns, values = self.petsc.getValuesCSR()
        b.array[:] += np.add.reduceat(values * unmet[columns], starts[:-1])
        self.assemble(body.conditions)

    def _assemble(self):
        body, element, values = self._body, self._body.element, self._values
        values[:] = 0.0
        if self._others is not None:
            self._rest.data[:] = 0.0
            values += fem.assemble_matrix(self._rest, self._others).data
        kernels.tangent(body.nodes.mesh.geometry.x, body.nodes.cells, element.dofs, element.weights, element.table,
                        element.shape, element.hats, element.axisymmetric, body.solution.x.array,
                        float(body.rate0.value), *body.handed_over(), self._places, values)
        if body.contact is not None:
            facets = body.contact.facets
            weighted = facets.weighted_tangent(body.contact.weights)      # of the last search, on the present geometry
            kernels.facet_tangent(facets.shape, weighted, self._facet_places, values)
