r"""The temperature of one body: linear between the vertices of its order-2 mesh, which moves with the material."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem

from ..gather import gather_nodal, numbering
from ..kinematics import Kinematics
from ..nodes import Nodes
from ..parallel import highest, lowest, total


def storage(density_times_specific_heat, S, weight, dx):
    r"""Heat capacity of the nodes, :math:`\int\rho c\,S\,dV`, mJ/K, with the hats S."""
    return density_times_specific_heat * S * weight * dx


def conduction(T, S, conductivity, weight, dx):
    r"""Heat conducted, :math:`\int\lambda\,\nabla T\cdot\nabla S\,dV`, mW (Fourier's law)."""
    return conductivity * ufl.inner(ufl.grad(T), ufl.grad(S)) * weight * dx


def of_cells(mesh, value: float | np.ndarray):
    """A number, or one for each cell of this rank (cells,), for forms."""
    if np.ndim(value) == 0:
        return fem.Constant(mesh, float(value))
    found = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    found.x.array[:] = value
    return found


class HeatField:
    """Capacities of the nodes and conductances between them.

    The capacities are those of the mesh as it is when the field is made, and stay with the nodes: they follow the
    material, whose mass does not change. (Incompressible flow keeps ∫ S dV of every hat, since the pressures are
    combinations of the hats; what integration in time leaves of that is no change of mass.)

    Parameters
    ----------
    conductivity : mJ/s/mm/K · volumetric_capacity : density times specific heat, mJ/mm³/K; of several bodies (cells,),
        ghosts included

    Attributes
    ----------
    capacity : (nodes,) mJ/K; at mid-nodes of no meaning
    """

    def __init__(self, nodes: Nodes, kinematics: Kinematics, *, conductivity: float | np.ndarray,
                 volumetric_capacity: float | np.ndarray):
        self.nodes, self.kinematics = nodes, kinematics
        mesh, space = nodes.mesh, nodes.scalar_space
        weight = kinematics.weight(ufl.SpatialCoordinate(mesh))
        T, S = ufl.TrialFunction(space), ufl.TestFunction(space)
        exactly = kinematics.dim + 1 + 2 * (kinematics.name == "axisymmetric")      # Jacobian, hat, radius
        dx = lambda degree: ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degree})  # noqa: E731
        self._storage = fem.form(storage(of_cells(mesh, volumetric_capacity), S, weight, dx(exactly)))
        self._conduction = fem.form(conduction(T, S, of_cells(mesh, conductivity), weight, dx(3)))
        self._matrix = fem.create_matrix(self._conduction)
        self.capacity = self.nodal_sum(self._storage)

    def nodal_sum(self, form) -> np.ndarray:
        """A linear form of the hats, assembled, at the nodes (nodes,). Collective."""
        vector = fem.assemble_vector(form)
        nodal = np.zeros(self.nodes.count)
        vertices = self.nodes.is_vertex
        nodal[vertices] = vector.array[self.nodes.scalar_dofs[vertices]]
        return self.nodes.sum_over_ranks(nodal)

    def surface_sum(self, facets, values: np.ndarray) -> np.ndarray:
        """Values at the points of facets, which carry their share of the surface already, (points,), shared among
        the hats of their vertices: (nodes,). Collective."""
        corners = facets.facet_nodes[:, : self.nodes.dim]
        by_facet = values.reshape(len(corners), facets.points_per_facet)
        shares = np.einsum("fq,qa->fa", by_facet, facets.hats)
        return self.nodes.sum_over_ranks(np.bincount(corners.ravel(), shares.ravel(), self.nodes.count))

    def heating(self, power: np.ndarray) -> np.ndarray:
        """What a power given to the nodes (nodes,), mW, does to them by itself, (nodes,), K/s."""
        vertices, rate = self.nodes.is_vertex, np.zeros(self.nodes.count)
        rate[vertices] = power[vertices] / self.capacity[vertices]
        return self.nodes.with_mids(rate)

    def content(self, temperature: np.ndarray) -> float:
        """Heat above 0 degC, mJ. Collective."""
        return self.total(self.capacity * temperature)

    def mean(self, temperature: np.ndarray) -> float:
        """Mean temperature by mass, degC. Collective."""
        return self.content(temperature) / self.total(self.capacity)

    def total(self, nodal: np.ndarray) -> float:
        """Sum over the vertices of all ranks of what their hats share, (nodes,). Collective."""
        return float(total(self.nodes.comm, float(nodal[self._owned_vertices].sum())))

    @cached_property
    def vertex_count(self) -> int:
        """Vertices of all ranks. Collective."""
        return int(total(self.nodes.comm, len(self._owned_vertices)))

    @cached_property
    def _owned_vertices(self):
        return np.flatnonzero(self.nodes.is_vertex[: self.nodes.mesh.geometry.index_map().size_local])

    # ------------------------------------------------------------------ from mesh to mesh
    def keep_mass_of(self, other: HeatField, theirs: np.ndarray | bool = True, mine: np.ndarray | bool = True) -> None:
        """Scale the capacities so that a body weighs what it did on its mesh before; of several the nodes of one, (nodes,)
        of bool there and here. Collective."""
        ratio = other.total(other.capacity * theirs) / self.total(self.capacity * mine)
        self.capacity = np.where(mine, ratio * self.capacity, self.capacity)

    def with_content(self, temperature: np.ndarray, content: float, mine: np.ndarray | bool = True) -> np.ndarray:
        """The temperatures (nodes,), all higher or lower by the same, as far as their range allows, so that their heat is
        ``content``, mJ; of several bodies those of the nodes of one, (nodes,) of bool. Collective.

        A few secants find the shift; what is left then, and rounding, is a share of the room that the nodes have.
        """
        comm, stored = self.nodes.comm, lambda values: self.total(np.where(mine, self.capacity * values, 0.0))
        missing = content - stored(temperature)
        hot = highest(comm, float(np.where(mine, temperature, -np.inf).max(initial=-np.inf)))
        cold = lowest(comm, float(np.where(mine, temperature, np.inf).min(initial=np.inf)))
        shift = missing / stored(np.ones_like(temperature))
        for _ in range(20):
            shifted = np.where(mine, np.clip(temperature + shift, cold, hot), temperature)
            got = stored(shifted - temperature)
            if got == 0.0 or abs(got - missing) < 1e-6 * abs(missing) or abs(shift) > hot - cold:
                break
            shift *= missing / got
        missing, towards = content - stored(shifted), np.where(mine, (hot if missing > 0 else cold) - shifted, 0.0)
        room = stored(towards)
        return shifted if room == 0 else shifted + min(missing / room, 1.0) * towards

    # ------------------------------------------------------------------ on rank 0
    @cached_property
    def vertex_numbers(self) -> np.ndarray:
        """Number of every local node among the vertices of all ranks, in the order of the gathered rows. Collective."""
        comm = self.nodes.comm
        mark = comm.bcast(gather_nodal(self.nodes, self.nodes.is_vertex), 0)
        return (np.cumsum(mark) - 1)[numbering(self.nodes).node_rows]

    @cached_property
    def _pattern(self):
        """Which entries of the local matrix are pairs, and, on rank 0, their vertices and where they go. Collective."""
        nodes, dofs = self.nodes, self.nodes.scalar_space.dofmap.index_map
        number_of = np.empty(dofs.size_global, int)      # of a dof by its global number; columns may be ghosts of ghosts
        mine = self._owned_vertices
        known = nodes.comm.allgather((dofs.local_to_global(nodes.scalar_dofs[mine]), self.vertex_numbers[mine]))
        for dof, number in known:
            number_of[dof] = number
        rows = np.repeat(np.arange(len(self._matrix.indptr) - 1), np.diff(self._matrix.indptr))
        ends = [number_of[self._matrix.index_map(k).local_to_global(local.astype(np.int32))]
                for k, local in enumerate((rows, self._matrix.indices))]
        upper = ends[0] < ends[1]
        parts = self.nodes.comm.gather(np.column_stack(ends)[upper], 0)
        if parts is None:
            return upper, None, None
        pairs, place = np.unique(np.concatenate(parts), axis=0, return_inverse=True)
        return upper, pairs, place.ravel()

    def network(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Capacities (v,) mJ/K, pairs (m, 2) and their conductances (m,) mW/K of all ranks, as the mesh lies now: on
        rank 0, None elsewhere. Collective."""
        self._matrix.data[:] = 0.0
        fem.assemble_matrix(self._matrix, self._conduction)
        upper, pairs, place = self._pattern
        parts = self.nodes.comm.gather(-self._matrix.data[upper], 0)
        capacity = self.gathered(self.capacity)
        if parts is None:
            return None
        return capacity, pairs, np.bincount(place, np.concatenate(parts), len(pairs))

    def gathered(self, nodal: np.ndarray) -> np.ndarray | None:
        """Nodal values (nodes[, k]) of the vertices of all ranks (v[, k]) on rank 0, None elsewhere. Collective."""
        rows, values = self._vertex_rows, gather_nodal(self.nodes, nodal)
        return None if values is None else values[rows]

    @cached_property
    def _vertex_rows(self):
        """Rows of the vertices among the gathered nodes, on rank 0. Collective."""
        mark = gather_nodal(self.nodes, self.nodes.is_vertex)
        return None if mark is None else np.flatnonzero(mark)

    def scattered(self, values: np.ndarray | None) -> np.ndarray:
        """The local part (nodes[, k]) of what :meth:`gathered` gave; mid-nodes have the mean of their edge. Collective."""
        values = self.nodes.comm.bcast(values, 0)
        return self.nodes.with_mids(values[self.vertex_numbers])
