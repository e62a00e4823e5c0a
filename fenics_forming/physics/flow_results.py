"""What is read off a solved flow: fields at the nodes, volume, powers."""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from .node_kernels import lengths
from .parallel import total


class FlowResults:
    """What a `Workpiece` says of its flow; mixed into it."""

    @property
    def velocity(self) -> np.ndarray:
        """Nodal velocities (nodes, dim), mm/s (a copy)."""
        return self.solution.x.array[self.velocity_dofs]

    @property
    def mean_stress(self) -> np.ndarray:
        """Mean stress at the nodes (nodes,), MPa, tension positive."""
        nodal = np.zeros(self.nodes.count)
        v = self.nodes.is_vertex
        nodal[v] = -self.solution.x.array[self.pressure_dofs[v]]
        return self.nodes.with_mids(nodal)

    def nodal_rate(self) -> np.ndarray:
        """Effective strain rate at the nodes (nodes,), 1/s."""
        return self.nodes.vertex_mean(np.sqrt(2 / 3) * lengths(self._strain_rate_at_vertices()))

    def _strain_rate_at_vertices(self):
        cells = len(self.nodes.cells)
        return self.nodes.fit_to_vertices(self.strain_rate.reshape(cells, -1, self.kinematics.components))

    def nodal_damage_rate(self, damage, strain: np.ndarray, temperature: np.ndarray | None) -> np.ndarray:
        """Rate of a damage law at the nodes (nodes,), 1/s, with the stress of the present flow.

        The deviator is 2/3 flow stress / effective rate times the strain rate, fitted to the vertices as for
        :meth:`nodal_rate`, so that it never exceeds the flow stress; the mean stress comes from the pressure.

        Parameters
        ----------
        damage : law of ``laws.damage`` · strain : (nodes,) · temperature : (nodes,) degC, or None
        """
        D, corners = self._strain_rate_at_vertices(), self.nodes.vertices
        rate = np.sqrt(2 / 3 * np.einsum("cvk,cvk->cv", D, D))
        regular = np.hypot(rate, float(self.rate0.value))
        flow_stress = self._corner_law(strain[corners], regular, None if temperature is None else temperature[corners])
        flow_stress = np.broadcast_to(flow_stress, rate.shape)
        largest = flow_stress / regular * 2 / 3 * self.kinematics.largest_principal(D) + self.mean_stress[corners]
        return self.nodes.vertex_mean(damage.rate(largest, flow_stress) * rate)

    def nodal_velocity_gradient(self) -> np.ndarray:
        """Velocity gradient at the nodes (nodes, dim, dim), 1/s; row i is the gradient of component i."""
        return self.nodes.gradient(self.velocity)

    def nodal_areas(self) -> np.ndarray:
        """Surface of the contact facets that belongs to each node (nodes,), mm² (2 pi r included)."""
        from petsc4py import PETSc
        b = fem_petsc.assemble_vector(self._nodal_area)
        b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        b.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        with b.localForm() as local:
            return local.array[self.velocity_dofs[:, 0]].copy()

    def volume(self) -> float:
        """Volume of the body, mm³ (mm² in plane strain)."""
        return self._total(self._volume)

    def plastic_power(self) -> float:
        """Power dissipated by plastic flow, mW."""
        return self._total(self._plastic_power)

    def body_force_power(self) -> float:
        return self._total(self._force_power) if self._force_power is not None else 0.0

    def drag_power(self) -> float:
        """Power that the drag takes from bodies that move, mW; of a single body, which has none, zero."""
        return self._total(self._drag_power) if self._drag_power is not None else 0.0

    def mass_powers(self) -> dict[str, float]:
        """Power that inertia takes and that the weight gives, mW, as far as they act."""
        return {name: self._total(form) for name, form in self._mass_powers.items()}

    def _total(self, form) -> float:
        return float(total(self.nodes.comm, fem.assemble_scalar(form)))
