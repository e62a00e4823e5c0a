r"""Rigid-(visco)plastic flow of one body: the terms, the spaces and the state at the integration points.

Find velocity v and pressure p (mean stress -p) with, for all w and q,

.. math:: \int \tfrac{2\bar\sigma}{3\dot{\bar\varepsilon}} D(v):D(w) - \int p\,\nabla\!\cdot w - \int q\,\nabla\!\cdot v
          - \int t\cdot w\,d\Gamma - \int f\cdot w = 0 .

The linearisation keeps the deviatoric stress :math:`\tau` as an independent field (stress-velocity Newton of Rudi, Shih
and Stadler, arXiv 2003.11115); it lives here because it is a warm start from one solve to the next.
"""

from __future__ import annotations

from functools import cached_property

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from .conditions import Conditions
from .flow_results import FlowResults
from .kinematics import Kinematics
from .nodes import QUADRATURE_DEGREE, Nodes
from .plane_element import PlaneElement
from .point_data import PointData
from .rate_continuity import RateContinuity
from .settings import NewtonSettings
from .sliding import slides_freely
from .terms import body_force_power, drag, incompressibility, plastic, plastic_tangent

# One of several bodies may be free to move as a whole, and so is a block between smooth platens, which would make the
# system singular: a drag holds it where it is, that takes this share of the power of plastic flow where a body moves at the
# speed of the tools.
DRAG = 1e-6


class Workpiece(Conditions, PointData, FlowResults):
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
        self.fixed = tuple(fixed)
        self._compile(points, body_force, degree)
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

    def _slides(self) -> bool:
        if self.contact is None or self.kinematics.name == "axisymmetric":
            return False
        return slides_freely(self.contact.tools, {c.component for c in self.fixed}, self.nodes.dim)

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
        self._dragged = "inertia" not in terms and (self.parts is not None or self._slides())
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
        self.element = PlaneElement(self.nodes, kin, self.space.dofmap.list) if kin.dim == 2 else None
        if self.element is None:
            self._rate_of_increment = fem.Expression(D(ufl.split(self.increment)[0]), points)
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

    # ------------------------------------------------------------------ what a solve starts from

    def forget_flow(self) -> None:
        """Start from nothing: no velocity, no stress."""
        self.solution.x.array[:] = 0.0
        self.strain_rate[:] = 0.0
        self.tau[:] = 0.0

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

    @property
    def flow_stress_at_points(self) -> fem.Function:
        """Flow stress of the last solve at the integration points, MPa, as forms take it."""
        return self._sigma
