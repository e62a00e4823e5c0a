"""The linearised flow in space, solved by flexible GMRES with a block-triangular preconditioner."""

from __future__ import annotations

import basix
import numpy as np
from petsc4py import PETSc

from ...errors import ConvergenceError
from ..nodes import QUADRATURE_DEGREE
from ..parallel import highest, total
from ..workpiece import Workpiece
from . import kernels
from .coarse import CoarseSolver
from .eliminated import Eliminated, InSeries, OntoVertices
from .krylov import KrylovResult, fgmres
from .multigrid import TwoLevels
from .pattern import Incidence, Pattern, along_a_curve
from .pressure_block import Divergence, PressureMass
from .sharing import Shared
from .velocity_block import VelocityBlock

ALSO = 1e-4     # tolerance of further right-hand sides: what is found from them is small, and must be exact
# Relative change of the increment by the last iteration: where a body is next to rigid its flow is large in velocity and
# small in force, and a Newton that does not hear of it stops too early.
SETTLED = 0.05
NOTHING = 1e-12     # of the right-hand side of before, when contact has opened since: what is left where all of it did
SCHUR = 0.5     # of the pressure mass over the viscosity: what the pressure is scaled by


class IterativeSystem:
    """The tangent of a workpiece in blocks, and its Krylov solver; answers what ``direct.DirectSystem`` answers.

    Attributes
    ----------
    iterations : of the last solve · stood : whether that, after a change of contact, kept what was found before but for one
    tolerance : of its residual, relative; most : iterations of a solve
    """

    def __init__(self, workpiece: Workpiece, *, tolerance: float = 5e-3, most: int = 100):
        self._body, self.tolerance, self.most = workpiece, tolerance, most
        self.iterations, self.stood = 0, False
        n = self._n = workpiece.nodes
        self._reference_cell()
        nodes, vertices = Shared(n.mesh.geometry.index_map()), Shared(n.scalar_space.dofmap.index_map)
        self._nodes, self._vertices = nodes, vertices
        self._corners = n.scalar_dofs[n.vertices]
        self._order = along_a_curve(n.x[n.vertices].mean(axis=1))
        self._vertex_nodes = np.empty(vertices.count, np.int32)
        at = np.flatnonzero(n.is_vertex)
        self._vertex_nodes[n.scalar_dofs[at]] = at
        free = np.ones(len(workpiece.solution.x.array))
        free[workpiece.fixed_dofs] = 0.0
        anything = np.cos(7.0 * n.x / np.ptp(n.extents()) + np.arange(3))      # the same on any number of ranks
        self.block = VelocityBlock(Pattern(n.cells, nodes.count), nodes, anything)
        self.block.free[:] = free[workpiece.velocity_dofs]
        linear = Pattern(self._corners, vertices.count)
        body = np.zeros(n.count, int) if workpiece.parts is None else workpiece.parts.of_node
        self.coarse = CoarseSolver(linear, vertices, self.block.free[self._vertex_nodes], n.x[self._vertex_nodes],
                                   body[self._vertex_nodes], anything[self._vertex_nodes])
        self.mass = PressureMass(linear, vertices)
        self.mass.free[:] = free[workpiece.pressure_dofs[self._vertex_nodes]]
        self.divergence = Divergence(Incidence(self._corners, n.cells, vertices.count, nodes.count), vertices, nodes)
        self.levels = TwoLevels(n, self.block, self.coarse, self._vertex_nodes)
        if workpiece.contact is not None:
            facets = workpiece.contact.facets.facet_nodes
            self._facet_corners = n.scalar_dofs[facets[:, :3]]
            self._facet_places = self.block.pattern.places_of(facets)
            self._facet_coarse_places = linear.places_of(self._facet_corners)
        if workpiece.interfaces is not None:
            from .between import BetweenBodies
            from .on_vertices import OnVertices
            between = BetweenBodies(workpiece, workpiece.interfaces, nodes, self.coarse.everywhere)
            self.block.others = (between,)
            self.coarse.block.others = (OnVertices(between, workpiece.interfaces, vertices, self.coarse.everywhere),)
        self._others, self._onto_vertices = (self.block.others, self.coarse.block.others), None
        self._own_velocity = workpiece.velocity_dofs[: nodes.owned]
        self._own_pressure = workpiece.pressure_dofs[self._vertex_nodes[: vertices.owned]]
        self._split, self._scale = 3 * nodes.owned, 1.0
        self._of_contact = np.zeros((nodes.count, 9))      # what contact with tools gives to the diagonal

    def _reference_cell(self):
        cell = self._n.mesh.basix_cell()
        points, self._weights = basix.make_quadrature(cell, QUADRATURE_DEGREE[3])
        table = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped).tabulate(1, points)
        self._shape, self._table = table[0, :, :, 0].copy(), np.moveaxis(table[1:, :, :, 0], 0, 2).copy()
        hats = basix.create_element(basix.ElementFamily.P, cell, 1).tabulate(1, points)
        self._hats, self._hat_table = hats[0, :, :, 0].copy(), hats[1:, 0, :, 0].T.copy()

    # ------------------------------------------------------------------ what the Newton asks
    def follow(self) -> None:
        """Make ready for the present geometry. Collective."""
        self.divergence.blocks[:] = 0.0
        kernels.divergence(self._n.x, self._n.cells, self._weights, self._table, self._hats, self.divergence.pattern.places,
                           self.divergence.blocks)
        self.coarse.place(self._n.x[self._vertex_nodes])

    def assemble(self) -> None:
        """The tangent at the present state."""
        body, block, coarse, mass = self._body, self.block, self.coarse.block, self.mass
        for part in (block, coarse, mass):
            part.clear()
        self._of_contact[:] = 0.0
        shape = (len(self._n.cells), len(self._weights))
        kernels.tangent(self._order, self._n.x, self._n.cells, self._corners, self._weights, self._table, self._hats,
                        self._hat_table, body.sigma.reshape(shape), body.point_rate().reshape(shape),
                        body.softening.reshape(shape), body.strain_rate.reshape(*shape, 6), body.tau.reshape(*shape, 6),
                        block.pattern.places, block.diagonal, block.upper, coarse.pattern.places, coarse.diagonal,
                        coarse.upper, mass.diagonal, mass.upper)
        if "drag" in body.tangents:
            kernels.volumes(self._n.x, self._n.cells, self._weights, self._table, volumes := np.empty(shape))
            self._add_mass(self._shape, self._hats, float(body.drag.value) * volumes)
        if "inertia" in body.tangents:
            self._add_mass(*body.mass.inertia_of_points())
        if body.contact is not None:
            self._add_contact()

    def _add_mass(self, shape: np.ndarray, hats: np.ndarray, weighted: np.ndarray):
        """Add ∫ c v·w, with shape functions and c times volume (cells, points) at points of a rule of its own."""
        block, coarse = self.block, self.coarse.block
        kernels.mass_blocks(self._n.cells, shape, weighted, block.pattern.places, block.diagonal, block.upper)
        kernels.mass_blocks(self._corners, hats, weighted, coarse.pattern.places, coarse.diagonal, coarse.upper)

    def _add_contact(self):
        self._contact = self._body.contact.facets.weighted_tangent()
        self._add_to_facets(slice(None), self._contact)

    def follow_contact(self) -> None:
        """Take over the tangents of contact anew, which have changed since :meth:`assemble` while the flow has not."""
        weighted = self._body.contact.facets.weighted_tangent()
        changed = np.flatnonzero((weighted != self._contact).any(axis=(1, 2)))
        self._add_to_facets(changed, weighted[changed] - self._contact[changed])
        self._contact = weighted

    def _add_to_facets(self, chosen, weighted: np.ndarray):
        facets = self._body.contact.facets
        self.block.diagonal -= self._of_contact
        kernels.facet_blocks(facets.facet_nodes[chosen], facets.shape, weighted, self._facet_places[chosen],
                             self._of_contact, self.block.upper)
        self.block.diagonal += self._of_contact
        kernels.facet_blocks(self._facet_corners[chosen], facets.hats, weighted, self._facet_coarse_places[chosen],
                             self.coarse.block.diagonal, self.coarse.block.upper)

    def lift(self, b: PETSc.Vec) -> None:
        """Add to the residual what given velocities that are not met yet do to the other equations, ghosts not summed."""
        body = self._body
        missing = np.zeros(len(body.solution.x.array))
        missing[body.fixed_dofs] = body._values.x.array[body.fixed_dofs] - body.solution.x.array[body.fixed_dofs]
        v = missing[body.velocity_dofs]
        with b.localForm() as local:
            forces = self.block.own_times(v, np.empty_like(v))
            np.add.at(local.array_w, body.velocity_dofs.ravel(), forces.ravel())
            rows = body.pressure_dofs[self._vertex_nodes]
            np.add.at(local.array_w, rows, self.divergence.times(v))

    def stiffness(self) -> np.ndarray:
        """Diagonal of the velocities, (nodes, dim), N s/mm."""
        return self.block.stiffness()

    def take_motions(self, motions: Eliminated | None) -> None:
        """Unknown motions of tools that are eliminated from the next solves; None where there are none. Collective."""
        self.block.others, self.coarse.block.others = self._others
        if motions is None:
            return
        if self._onto_vertices is None:
            self._onto_vertices = OntoVertices(self.levels, self.coarse.everywhere, self._nodes.owned)
        columns, comm = motions.over(self._own_velocity), self._n.comm
        of_all = self._onto_vertices(columns)
        numbers = self.coarse.everywhere.numbers[: self._vertices.owned]
        mine = of_all[(3 * numbers[:, None] + np.arange(3)).ravel()]
        self.block.others += (InSeries(comm, columns, motions.inverse),)
        self.coarse.block.others += (InSeries(comm, mine, motions.inverse, of_all),)

    def solve(self, b: PETSc.Vec, *, again: bool = False) -> None:
        """Set the preconditioner up, and solve for the increment; ``again`` after :meth:`follow_contact`, from what was
        found before.

        Raises
        ------
        ConvergenceError
            if the residual does not fall below the tolerance.
        """
        self.block.prepare_smoother()
        self._near, self._lighter, self._heavier = self.block.without(self._of_contact)
        self.coarse.prepare(again=again)
        if not again:
            self.mass.prepare()
        if again:
            start, nothing = self._found.x, NOTHING * self._usual_size
        else:
            start, nothing = None, 0.0
        found = self._found = self._solve(b, self._body.increment.x.petsc_vec, self.tolerance, start, nothing)
        self.stood = again and found.iterations <= 1 and found.size > nothing
        if not again:
            self._usual_size = found.size
        self._body.increment.x.scatter_forward()

    def solve_also(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """The same for another right-hand side, with the preconditioner that is set up."""
        self._solve(b, x, ALSO)

    def _solve(self, b: PETSc.Vec, x: PETSc.Vec, tolerance: float, start: np.ndarray | None = None,
               nothing: float = 0.0) -> KrylovResult:
        self._scale = self._usual_stress()
        rhs = self._owned(b.array[self._own_velocity] * self.block.free[: self._nodes.owned],
                          b.array[self._own_pressure] * self.mass.free[: self._vertices.owned])
        found = fgmres(self._n.comm, lambda z: self._measured(self._times(z)),
                       lambda r: self._precondition(self._measured(r, back=True)), self._measured(rhs),
                       tolerance=tolerance, most=self.most, settled=SETTLED, start=start, nothing=nothing)
        self.iterations = found.iterations
        if not found.reduction <= tolerance:
            raise ConvergenceError(f"{found.iterations} Krylov iterations leave {found.reduction:.1e} of the residual")
        x.array[:] = b.array        # where velocities are given
        free, owned = self.block.free[: self._nodes.owned] > 0, found.x[: self._split].reshape(-1, 3)
        x.array[self._own_velocity[free]] = owned[free]
        free = self.mass.free[: self._vertices.owned] > 0
        x.array[self._own_pressure[free]] = self._scale * found.x[self._split:][free]
        return found

    def _usual_stress(self) -> float:
        """Flow stress over speed, MPa s/mm, which pressures and volume rates are measured by: so the residual has one unit,
        and whether it is small does not depend on those of the scene. Collective."""
        body = self._body
        speed = body.contact.speed if body.contact is not None else max(
            highest(self._n.comm, float(np.abs(a.x.array).max(initial=0.0))) for a in (body._values, body.solution))
        sums = total(self._n.comm, np.array([body.sigma.sum(), body.sigma.size]))
        return float(sums[0] / sums[1]) / speed if speed > 0 else 1.0

    # ------------------------------------------------------------------ operator and preconditioner
    def _known_to_all(self, owned: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocities (nodes, 3) and pressures (vertices,) with their copies, of the owned unknowns, scaled to mm/s."""
        v, p = np.zeros((self._nodes.count, 3)), np.zeros(self._vertices.count)
        v[: self._nodes.owned] = owned[: self._split].reshape(-1, 3)
        p[: self._vertices.owned] = self._scale * owned[self._split:]
        return self._nodes.hand_on(v), self._vertices.hand_on(p)

    def _owned(self, v: np.ndarray, q: np.ndarray) -> np.ndarray:
        """The owned part of forces (nodes, 3) and volume rates (vertices,), as one vector in N."""
        return np.concatenate([v[: self._nodes.owned].ravel(), self._scale * q[: self._vertices.owned]])

    def _measured(self, r: np.ndarray, *, back: bool = False) -> np.ndarray:
        """A residual as it is measured: by the forces that its velocities would need without contact. A penalty that is
        stiff against the body would let the rest of a residual look small, and leave tractions as wrong as it is stiff."""
        y = r.copy()
        forces = y[: self._split].reshape(-1, 3)
        forces[self._near] = np.matmul(self._heavier if back else self._lighter, forces[self._near, :, None])[:, :, 0]
        return y

    def _times(self, z: np.ndarray) -> np.ndarray:
        v, p = self._known_to_all(z)
        y = self.block.times(v, np.empty_like(v))
        forces, rates = self.divergence.both_times(v, p)
        y += forces
        y = self._nodes.add_up(y) * self.block.free
        q = self._vertices.add_up(rates) * self.mass.free
        return self._owned(y, q)

    def _precondition(self, r: np.ndarray) -> np.ndarray:
        v, p = self._known_to_all(r)
        p /= self._scale**2
        p = -SCHUR * self.mass.solve(p)
        load = self._nodes.add_for_all(self.divergence.transposed_times(p))
        v -= load * self.block.free
        return self._owned(self.levels(v), p / self._scale**2)
