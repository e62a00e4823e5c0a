r"""Rigid-(visco)plastic flow of one body: the terms, the spaces and the state at the integration points.

Find velocity v and pressure p (mean stress -p) with, for all w and q,

.. math:: \int \tfrac{2\bar\sigma}{3\dot{\bar\varepsilon}} D(v):D(w) - \int p\,\nabla\!\cdot w - \int q\,\nabla\!\cdot v
          - \int t\cdot w\,d\Gamma - \int f\cdot w = 0 .

The linearisation keeps the deviatoric stress :math:`\tau` as an independent field (stress-velocity Newton of Rudi, Shih
and Stadler, arXiv 2003.11115); it lives here because it is a warm start from one solve to the next.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc

from .kinematics import Kinematics
from .nodes import QUADRATURE_DEGREE, Nodes
from .parallel import total
from .settings import NewtonSettings
from .terms import body_force_power, drag, incompressibility, plastic, plastic_tangent

# Of several bodies one may be free to move as a whole, which would make the system singular: a drag holds it where it
# is, that takes this share of the power of plastic flow where a body moves at the speed of the tools.
DRAG = 1e-6


# ---------------------------------------------------------------------- conditions on the velocity
@dataclass(frozen=True)
class FixedVelocity:
    """Velocity component ``component`` on ``facets`` is ``value`` (mm/s): a number or f(x (n, dim)) → (n,)."""

    facets: np.ndarray
    component: int
    value: float | object = 0.0


MOST_TIED = 0.05     # of the flow stress, by which the tie to the rates of the solve before may change it


@dataclass(frozen=True)
class RateContinuity:
    r"""Ties the strain rate of a material point to that of the solve before, as an implicit step would.

    The velocities of rigid-plastic flow are not unique (a smooth block in plane strain may flow in any bands), and in
    compression it is the change of shape and the hardening *during the step* that decide. Both enter to first order as
    :math:`\bar\sigma\,[1+\Delta t(\dot{\bar\varepsilon}-\dot{\bar\varepsilon}_{ref})]`: nothing where the rate goes on
    as before, an increment of the size of the strain increment where it jumps, 5 % at most: a small push decides, and a
    die that is just full sends the whole flow elsewhere (in steps of a tenth of its flash, 25 % too much force uncapped).

    rate : (points,) 1/s, the rates of the solve before, scaled by the change of the characteristic rate · step : s
    """

    rate: np.ndarray
    step: float

    def factor(self, rate: np.ndarray) -> np.ndarray:
        """What the flow stress is multiplied by, (points,)."""
        return np.clip(1.0 + self.step * (rate - self.rate), 1.0 - MOST_TIED, 1.0 + MOST_TIED)


class Workpiece:
    """Spaces, terms and point data of one flowing body.

    Parameters
    ----------
    nodes : the order-2 mesh by its nodes
    kinematics : geometry kind
    flow_stress : law, f(strain, rate, temperature) → MPa (``laws.flow_stress``); of several bodies one for each
    parts : which cells and nodes belong to which body, where there are several; then ``pairs`` of them may touch
    fixed : conditions on the velocity
    contact : ``RigidContact`` or None
    body_force : UFL vector or tuple of numbers, N/mm³, or None
    pressure_datum : pin the pressure at one vertex (needed where the whole boundary has its normal velocity given)
    mass : ``mass.MassProperties`` where inertia or weight act, or None
    """

    def __init__(self, nodes: Nodes, *, kinematics: Kinematics, flow_stress, fixed=(), contact=None, body_force=None,
                 pressure_datum: bool = False, settings: NewtonSettings = NewtonSettings(), parts=None, pairs=(),
                 mass=None):
        self.nodes, self.kinematics, self.parts = nodes, kinematics, parts
        self.contact, self.settings = contact, settings
        mesh, dim = nodes.mesh, nodes.dim
        cell = mesh.basix_cell()
        self.space = W = fem.functionspace(mesh, basix.ufl.mixed_element([
            basix.ufl.element("Lagrange", cell, 2, shape=(dim,)), basix.ufl.element("Lagrange", cell, 1)]))
        self.solution = fem.Function(W, name="velocity_and_pressure")
        self.increment = fem.Function(W)
        self._number_dofs()

        degree = QUADRATURE_DEGREE[dim]
        quadrature = lambda shape: fem.functionspace(  # noqa: E731
            mesh, basix.ufl.quadrature_element(cell.name, value_shape=shape, degree=degree))
        self._sigma = fem.Function(quadrature(()), name="flow_stress")
        self._softening = fem.Function(self._sigma.function_space)
        self._tau = fem.Function(quadrature((kinematics.components,)), name="deviatoric_stress")
        self.rate0 = fem.Constant(mesh, 1.0)
        points, _ = basix.make_quadrature(cell, degree)
        self._hats = basix.create_element(basix.ElementFamily.P, cell, 1).tabulate(0, points)[0, :, :, 0]
        self._take_laws(flow_stress, len(points))
        self.mass = None
        if mass is not None:
            from .mass import Mass
            self.mass = Mass(nodes, kinematics, mass, W, self.velocity_dofs)
        self._compile(points, body_force, degree)

        self.fixed = tuple(fixed)
        self._fix(pressure_datum)
        self.interfaces = self._interfaces(pairs) if pairs else None
        self.strain_rate = np.zeros((len(nodes.cells) * len(points), kinematics.components))
        self.tau = np.zeros_like(self.strain_rate)
        self.is_cold = True
        self.stress_is_unknown = False      # of a start whose velocities are known: it follows from them
        self.continuity: RateContinuity | None = None
        self._hardened_at = self._hardened = None      # flow stress of a law without rate, and the strains it is of
        self.last_rate: tuple[np.ndarray, float] | None = None

    # ------------------------------------------------------------------ several bodies
    def _take_laws(self, flow_stress, points: int):
        """The law at points and nodes, ``law`` and ``nodal_law``; of several bodies that of whose they are."""
        self.law = self.nodal_law = self._corner_law = flow_stress
        if self.parts is not None:
            from .parts import LawsByRow
            of_cell, corners = self.parts.of_cell, self.nodes.vertices.shape
            self.law = LawsByRow(flow_stress, np.repeat(of_cell, points))
            self.nodal_law = LawsByRow(flow_stress, self.parts.of_node)
            self._corner_law = LawsByRow(flow_stress, np.broadcast_to(of_cell[:, None], corners))

    def _interfaces(self, pairs):
        from .contact.interfaces import Interfaces
        local = self.velocity_dofs
        number = self.space.dofmap.index_map.local_to_global(local.ravel()).reshape(local.shape)
        return Interfaces(self.nodes, self.kinematics, list(pairs), self.contact, dofs=number.astype(np.int64),
                          owned=self.owned, free=~np.isin(local, self.fixed_dofs))

    def set_drag(self, usual: float) -> None:
        """Hold back bodies that are free to move; ``usual`` power of plastic flow, mW/mm³, at the speed of the tools."""
        if not self._dragged:
            return
        speed = self.contact.speed if self.contact is not None else 1.0
        self.drag.value = DRAG * usual / speed**2

    @property
    def contacts(self) -> tuple:
        """Contact with tools and between bodies, as far as there is."""
        return tuple(part for part in (self.contact, self.interfaces) if part is not None)

    # ------------------------------------------------------------------ forms
    def _compile(self, points, body_force, degree):
        mesh, kin = self.nodes.mesh, self.kinematics
        dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": degree, "quadrature_rule": "default"})
        x = ufl.SpatialCoordinate(mesh)
        weight = kin.weight(x)
        v, p = ufl.split(self.solution)
        w, q = ufl.TestFunctions(self.space)
        dv, dp = ufl.TrialFunctions(self.space)
        D = kin.strain_rate
        rate = ufl.sqrt(2 / 3 * ufl.dot(D(v), D(v)) + self.rate0**2)

        terms = {"plastic": plastic(D(v), D(w), self._sigma, rate, weight, dx),
                 "incompressibility": incompressibility(v, p, w, q, kin.divergence, weight, dx)}
        tangents = {"plastic": plastic_tangent(D(v), D(dv), D(w), self._sigma, rate, self._tau, self._softening,
                                               weight, dx),
                    "incompressibility": incompressibility(dv, dp, w, q, kin.divergence, weight, dx)}
        if body_force is not None:
            f = ufl.as_vector(body_force) if isinstance(body_force, (tuple, list)) else body_force
            terms["body_force"] = body_force_power(f, w, weight, dx)
        meters = {}
        if self.mass is not None:
            of_mass, of_tangent, meters = self.mass.terms(v, dv, w, weight)
            terms, tangents = terms | of_mass, tangents | of_tangent
        self._dragged = self.parts is not None and "inertia" not in terms
        if self._dragged:
            self.drag = fem.Constant(mesh, 0.0)
            terms["drag"], tangents["drag"] = drag(v, w, self.drag, weight, dx), drag(dv, w, self.drag, weight, dx)
        entity_maps = {}
        if self.contact is not None:
            terms["contact"] = self.contact.facets.virtual_power(w, weight)
            tangents["contact"] = self.contact.facets.tangent(dv, w, weight)
            entity_maps = self.contact.facets.entity_maps
        self.terms = tuple(terms)

        self.residual_form = fem.form(sum(terms.values()), entity_maps=entity_maps)
        self.tangents, self._entity_maps = tangents, entity_maps
        exactly = {"quadrature_degree": kin.dim + (2 if kin.name == "axisymmetric" else 0), "quadrature_rule": "default"}
        self._volume = fem.form(weight * ufl.Measure("dx", domain=mesh, metadata=exactly))
        self._plastic_power = fem.form(plastic(D(v), D(v), self._sigma, rate, weight, dx))
        self._force_power = fem.form(-body_force_power(f, v, weight, dx)) if body_force is not None else None
        self._drag_power = fem.form(drag(v, v, self.drag, weight, dx)) if self._dragged else None
        self._mass_powers = {name: fem.form(meter) for name, meter in meters.items()}
        self._nodal_area = fem.form(w[0] * weight * self.contact.facets.measure) \
            if self.contact is not None else None
        u = ufl.split(self.increment)[0]
        self._rate_of_increment = fem.Expression(D(u), points)
        self._owned_cells = np.arange(len(self.nodes.cells), dtype=np.int32)

    @cached_property
    def tangent_form(self) -> fem.Form:
        """The tangent as one form, compiled where it is asked for: the iterative solver has kernels of its own."""
        return fem.form(sum(self.tangents.values()), entity_maps=self._entity_maps)

    # ------------------------------------------------------------------ numbering and conditions
    def _number_dofs(self):
        n, W = self.nodes, self.space
        velocity = n.cells.shape[1] * n.dim
        cells, dofs = n.mesh.geometry.dofmap, W.dofmap.list
        self.velocity_dofs = np.full((n.count, n.dim), -1, dtype=np.int32)
        self.velocity_dofs[cells] = dofs[:, :velocity].reshape(cells.shape + (n.dim,))
        self.pressure_dofs = np.full(n.count, -1, dtype=np.int32)
        self.pressure_dofs[cells[:, : n.dim + 1]] = dofs[:, velocity:]
        self.owned = W.dofmap.index_map.size_local
        all_v = self.velocity_dofs.ravel()
        self.owned_velocity_dofs = np.sort(all_v[all_v < self.owned])

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

    # ------------------------------------------------------------------ views of the solution
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

    def held(self) -> np.ndarray:
        """Which velocity components of which nodes are given as zero, (nodes, dim), as on mirror planes."""
        zero = np.zeros(len(self._values.x.array), dtype=bool)
        zero[self.fixed_dofs] = self._values.x.array[self.fixed_dofs] == 0.0
        return zero[self.velocity_dofs]

    def forget_flow(self) -> None:
        """Start from nothing: no velocity, no stress."""
        self.solution.x.array[:] = 0.0
        self.strain_rate[:] = 0.0
        self.tau[:] = 0.0

    @contextmanager
    def newtonian(self, rate: float):
        """For a while a fluid of constant viscosity, that of the flow stress at ``rate``, 1/s, without mass."""
        fields = [f.x.array for f in (self.solution, self._tau)]
        constants = [self.rate0] + ([] if self.mass is None else [self.mass.per_step])
        kept = [a.copy() for a in fields], [float(c.value) for c in constants]
        for array in fields:
            array[:] = 0.0
        for constant, value in zip(constants, (rate, 0.0), strict=False):
            constant.value = value
        yield
        for array, before in zip(fields, kept[0], strict=True):
            array[:] = before
        for constant, value in zip(constants, kept[1], strict=True):
            constant.value = value

    def set_start(self, velocity: np.ndarray, mean_stress: np.ndarray) -> None:
        """Take nodal velocities and mean stresses of an earlier solve as the start of the next one."""
        v = self.nodes.is_vertex
        self.solution.x.array[self.velocity_dofs] = velocity
        self.solution.x.array[self.pressure_dofs[v]] = -mean_stress[v]
        self.is_cold = False

    def guess(self, velocity: np.ndarray, mean_stress: np.ndarray, rate: np.ndarray, rate_scale: float) -> None:
        """Start the next solve from nodal velocities, mean stresses and effective strain rates found on another mesh; the
        rates belong to the characteristic rate ``rate_scale``, 1/s. The deviatoric stress follows from the velocities."""
        self.set_start(velocity, mean_stress)
        self.last_rate = (self.at_points(rate), rate_scale)
        self.stress_is_unknown = True

    def point_data(self) -> tuple[np.ndarray, np.ndarray]:
        """Per owned cell: deviatoric stress, and the rate that the next solve is tied to, at the integration points."""
        cells = len(self.nodes.cells)
        rate = np.zeros(len(self.tau)) if self.last_rate is None else self.last_rate[0]
        return self.tau.reshape(cells, -1), rate.reshape(cells, -1)

    def set_point_data(self, stress: np.ndarray, rate: np.ndarray, rate_scale: float) -> None:
        """Take over what :meth:`point_data` gave; the rates belong to the characteristic rate ``rate_scale``, 1/s."""
        self.tau[:] = stress.reshape(self.tau.shape)
        self.rate0.value = self.settings.regularisation * rate_scale
        self.refresh_strain_rate()
        self.last_rate = (rate.ravel(), rate_scale)

    @property
    def flow_stress_at_points(self) -> fem.Function:
        """Flow stress of the last solve at the integration points, MPa, as forms take it."""
        return self._sigma

    def nodal_rate(self) -> np.ndarray:
        """Effective strain rate at the nodes (nodes,), 1/s."""
        corners = self._strain_rate_at_vertices()
        return self.nodes.vertex_mean(np.sqrt(2 / 3 * np.einsum("cvk,cvk->cv", corners, corners)))

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

    # ------------------------------------------------------------------ point data
    def at_points(self, nodal: np.ndarray) -> np.ndarray:
        """A nodal field at the integration points of the cells, (cells * points,)."""
        return (nodal[self.nodes.vertices] @ self._hats.T).ravel()

    def point_rate(self) -> np.ndarray:
        """Regularised effective strain rate at the integration points, 1/s."""
        d = self.strain_rate
        return np.sqrt(2 / 3 * np.einsum("pi,pi->p", d, d) + float(self.rate0.value) ** 2)

    def set_flow_stress(self, strain, rate, temperature) -> None:
        """Flow stress and its rate sensitivity at the integration points."""
        if self.law.depends_on_rate or strain is not self._hardened_at:
            self._hardened = np.broadcast_to(self.law(strain, rate, temperature), rate.shape)
            self._hardened_at = strain
        sigma = self._hardened
        c = np.ones_like(rate)
        if self.law.depends_on_rate:
            c -= rate * self.law.rate_derivative(strain, rate, temperature) / sigma
        if self.continuity is not None:
            factor = self.continuity.factor(rate)
            sigma = sigma * factor
            c -= self.continuity.step * rate / factor
        c = np.clip(c, 0.0, 1.0)
        self.sigma = sigma
        self._sigma.x.array[: sigma.size] = sigma
        self.softening = c
        self._softening.x.array[: c.size] = c

    def keep_rate(self, rate: np.ndarray, characteristic_rate: float) -> None:
        """Remember the rates of a converged solve for the next one."""
        self.last_rate = (rate, characteristic_rate)

    def tie_to_last_rate(self, characteristic_rate: float, step: float | None) -> None:
        """Use the remembered rates in the solve to come, over a step in s; without either, nothing is tied."""
        self.continuity = None
        if self.last_rate is not None and step is not None:
            rate, before = self.last_rate
            self.continuity = RateContinuity(rate * characteristic_rate / before, step)

    def stress_from_rate(self, rate) -> None:
        """The deviatoric stress that belongs to the strain rates, where it is not known otherwise."""
        if self.stress_is_unknown:
            self.tau = (2 * self.sigma / (3 * rate))[:, None] * self.strain_rate
            self.stress_is_unknown = False

    def cut_stress(self, rate) -> None:
        """Cut the independent stress to the flow stress and hand it to the tangent."""
        length = np.sqrt(1.5 * np.einsum("pi,pi->p", self.tau, self.tau))
        over = length > self.sigma
        if over.any():
            self.tau[over] *= (self.sigma[over] / length[over])[:, None]
        self._tau.x.array[: self.tau.size] = self.tau.ravel()

    def update_stress(self, rate, increment_rate) -> None:
        """Stress and strain rate after the increment: the stress-velocity update."""
        change = 2 / 3 * np.einsum("pi,pi->p", self.strain_rate, increment_rate) / rate**2
        self.strain_rate += increment_rate
        self.tau *= -(self.softening * change)[:, None]
        self.tau += (2 * self.sigma / (3 * rate))[:, None] * self.strain_rate

    def rate_of_increment(self) -> np.ndarray:
        return self._rate_of_increment.eval(self.nodes.mesh, self._owned_cells).reshape(self.strain_rate.shape)

    def refresh_strain_rate(self) -> None:
        """Strain rate at the points anew from the velocity, on the present geometry."""
        self.increment.x.array[:] = self.solution.x.array
        self.strain_rate = self.rate_of_increment().copy()

    def nodal_areas(self) -> np.ndarray:
        """Surface of the contact facets that belongs to each node (nodes,), mm² (2 pi r included)."""
        from petsc4py import PETSc
        b = fem_petsc.assemble_vector(self._nodal_area)
        b.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        b.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        with b.localForm() as local:
            return local.array[self.velocity_dofs[:, 0]].copy()


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
