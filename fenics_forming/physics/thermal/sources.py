"""Where heat comes from while a body flows: plastic work inside, friction on its surface."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem

from ..nodes import QUADRATURE_DEGREE
from ..terms import plastic
from .field import HeatField, of_cells


class PlasticHeat:
    r"""The share β of the plastic power that becomes heat: at nodes :math:`\int\beta\bar\sigma\dot{\bar\varepsilon}S\,dV`.

    The integrand is that of the plastic term itself, so that the nodes together get exactly β times the plastic power.

    Parameters
    ----------
    workpiece : whose present flow it is · field : with the hats S · fraction : β, of several bodies (cells,)
    """

    def __init__(self, workpiece, field: HeatField, fraction: float | np.ndarray):
        kin, mesh = workpiece.kinematics, workpiece.nodes.mesh
        v = ufl.split(workpiece.solution)[0]
        D, S = kin.strain_rate(v), ufl.TestFunction(field.nodes.scalar_space)
        rate = ufl.sqrt(2 / 3 * ufl.dot(D, D) + workpiece.rate0**2)
        weight = kin.weight(ufl.SpatialCoordinate(mesh)) * S * of_cells(mesh, fraction)
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": QUADRATURE_DEGREE[kin.dim],
                                                      "quadrature_rule": "default"})
        self.field = field
        self._form = fem.form(plastic(D, D, workpiece.flow_stress_at_points, rate, weight, dx))

    def rate(self) -> np.ndarray:
        """Heating of the nodes by themselves (nodes,), K/s. Collective."""
        return self.field.heating(self.field.nodal_sum(self._form))


def friction_heat(field: HeatField, contact) -> dict[str, np.ndarray]:
    """Friction power of every tool with friction, all of it given to the nodes: name → heating (nodes,), K/s. Collective.

    The power is that of the tractions along the surface on the slip, mW/mm², nowhere negative.
    """
    rates = {}
    for tool in contact.tools:
        if tool.has_friction:
            along = tool.traction - tool.state.pressure[:, None] * tool.state.normal
            power = np.maximum(-np.einsum("pi,pi->p", along, tool.state.slip), 0.0)
            rates[tool.name] = field.heating(field.surface_sum(contact.facets, power * contact.weights))
    return rates
