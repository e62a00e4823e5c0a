"""Conditions on the velocity of a body: where it is given, and by what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from .nodes import Nodes


@dataclass(frozen=True)
class FixedVelocity:
    """Velocity component ``component`` on ``facets`` is ``value`` (mm/s): a number or f(x (n, dim)) → (n,)."""

    facets: np.ndarray
    component: int
    value: float | object = 0.0


class Conditions:
    """The conditions on the velocity of a `Workpiece`; mixed into it."""

    def _fix(self, pressure_datum: bool):
        self._values = fem.Function(self.space)
        chosen = []
        for condition in self.fixed:
            nodes = facet_nodes(self.nodes, condition.facets)
            dofs = self.velocity_dofs[nodes, condition.component]
            value = condition.value
            self._values.x.array[dofs] = value(self.nodes.x[nodes]) if callable(value) else value
            chosen.append(dofs)
        if pressure_datum:
            at = self.nodes.comm.allgather(self.owned > 0).index(True)
            if self.nodes.comm.rank == at:
                owned = self.pressure_dofs[(self.pressure_dofs >= 0) & (self.pressure_dofs < self.owned)]
                chosen.append(owned[:1])
        dofs = np.unique(np.concatenate(chosen)) if chosen else np.empty(0, dtype=np.int32)
        dofs = self._share(dofs)
        self.fixed_dofs = dofs
        self._values.x.scatter_forward()
        self.conditions = [fem.dirichletbc(self._values, dofs.astype(np.int32))]

    def _share(self, dofs: np.ndarray) -> np.ndarray:
        """The same dofs as every rank sees them: a facet's owner need not own its dofs."""
        mark = fem.Function(self.space)
        mark.x.array[dofs] = 1.0
        if self.nodes.comm.size > 1:
            from dolfinx import la
            values = self._values.x
            values.array[np.setdiff1d(np.arange(len(mark.x.array)), dofs)] = 0.0
            shares = fem.Function(self.space)
            shares.x.array[:] = values.array
            counts = fem.Function(self.space)
            counts.x.array[dofs] = 1.0
            for f in (shares, counts):
                f.x.scatter_reverse(la.InsertMode.add)
                f.x.scatter_forward()
            found = counts.x.array > 0
            values.array[found] = shares.x.array[found] / counts.x.array[found]
            return np.flatnonzero(found).astype(np.int32)
        return dofs

    def held(self) -> np.ndarray:
        """Which velocity components of which nodes are given as zero, (nodes, dim), as on mirror planes."""
        zero = np.zeros(len(self._values.x.array), dtype=bool)
        zero[self.fixed_dofs] = self._values.x.array[self.fixed_dofs] == 0.0
        return zero[self.velocity_dofs]


def facet_nodes(nodes: Nodes, facets: np.ndarray) -> np.ndarray:
    """All nodes (vertices and mid-nodes) on the given facets."""
    if len(facets) == 0:
        return np.empty(0, dtype=np.int32)
    mesh, dim = nodes.mesh, nodes.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    mesh.topology.create_connectivity(dim, dim - 1)
    to_cell, to_facet = mesh.topology.connectivity(dim - 1, dim), mesh.topology.connectivity(dim, dim - 1)
    layout = mesh.geometry.cmap.create_dof_layout()
    cells = to_cell.array[to_cell.offsets[facets]]
    local = np.argmax(to_facet.array.reshape(-1, dim + 1)[cells] == np.asarray(facets)[:, None], axis=1)
    closure = np.array([layout.entity_closure_dofs(dim - 1, i) for i in range(dim + 1)])
    return np.unique(mesh.geometry.dofmap[cells[:, None], closure[local]])
