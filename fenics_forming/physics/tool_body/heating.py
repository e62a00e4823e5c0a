r"""Thermal strain of a tool: :math:`\varepsilon_{th}=\alpha\,(T-T_0)` in every direction, which stresses nothing by itself.

Built only for a tool that is given a temperature.
"""

from __future__ import annotations

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ...errors import FormingError
from . import terms


class Heating:
    """Thermal strains at the points of a `ToolBody`, and the forces that would hold them back.

    Attributes
    ----------
    strain : (p,) of now · wanted : (p,) that the next solve goes to
    """

    def __init__(self, body):
        self.body = body
        mesh, k = body.nodes.mesh, len(body.state.held)
        element = basix.ufl.quadrature_element(mesh.basix_cell().name, value_shape=(k,), degree=body.degree)
        self._stress = fem.Function(fem.functionspace(mesh, element), name="thermal_stress")
        w = ufl.TestFunction(body.space)
        self._form = fem.form(terms.internal(self._stress, body.strain(w), body.weight, body.measure))
        self.strain = np.zeros(len(body.volumes))
        self.wanted = self.strain

    def set_temperature(self, temperature, stress_free: float) -> None:
        """Temperature at the nodes (nodes,) or everywhere, degC, and that at which the tool has no thermal strain.

        Raises
        ------
        FormingError
            if a part has no expansion.
        """
        body = self.body
        nodal = np.broadcast_to(np.asarray(temperature, float), body.nodes.count)
        points = body.reference_points
        hats = np.column_stack([1 - points.sum(axis=1), points])
        above = (nodal[body.nodes.vertices] @ hats.T).ravel() - stress_free
        self.wanted = np.empty(len(body.volumes))
        for law, cells in body.parts:
            if law.expansion is None:
                raise FormingError("a tool with a temperature needs the expansion of its material")
            rows = body.points_of(cells)
            self.wanted[rows] = law.expansion * above[rows]

    def forces(self, strain: np.ndarray) -> PETSc.Vec:
        """Nodal forces of the stresses that thermal strains (p,) cause by themselves, N: what drives the expansion."""
        full = np.zeros((len(strain), self.body.state.components))
        full[:, :3] = strain[:, None]
        narrow = self.body.state.narrowed(self.body.hooke(full))
        self._stress.x.array[: narrow.size] = narrow.ravel()
        vector = self.body.new_vector()
        fem_petsc.assemble_vector(vector, self._form)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return vector
