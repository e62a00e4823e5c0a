r"""Contact between two bodies of one mesh: the gap operator and what the point law makes of it.

For a point m of the slave's surface and the side of the master that captures it, with the shape functions
:math:`N^s, N^m` at the point and at its foot, the relative velocity is

.. math:: s = \sum_a N^s_a v_a - \sum_b N^m_b v_b = (Gv)_m .

The law of a contact point (``point_law``) gives a traction t(s) on the slave, of virtual power :math:`-w\,t\cdot\delta s`
with the surface w of the point, so nodal forces are :math:`G^T w t` and the tangent :math:`G^T w(-\partial t/\partial s)G`.
The shape functions of either side add up to one, so the forces of the two bodies are opposite, and with the force along
the line from the point to its foot their moments are too.

The points are those of a quadrature rule on the slave's sides: many inner ones ("integration_point"), or the nodes
themselves ("node"), which is the classical node-to-facet element.  The surfaces are replicated on all ranks, so the number
of ranks does not matter.
"""

from __future__ import annotations

import basix
import numpy as np
from petsc4py import PETSc

from ..kinematics import Kinematics
from ..nodes import Nodes
from ..parallel import total
from ..surface import facet_sides
from . import point_law as law
from .capture import CapturingSurface, side_lattice
from .facets import seen_from_vertices

ELEMENTS = ("integration_point", "node")
FACING = -0.2     # cosine between the normals of surfaces that can press on one another, at most
# Vertices of the master lie anywhere between the points, and the integrand has kinks there: so a side is cut into equal
# parts with a low rule on each. Patch test, greatest stress error in the plane: 0.3 % with 6 x 2 points, 1.2 % with one
# rule of 6, 2.3 % with 2 x 2; in space 1e-5 with 9 triangles of 3 points, 1.3 % with one rule of 16.
PARTS, DEGREE = {2: 6, 3: 3}, {2: 3, 3: 2}


class SlavePoints:
    """The points of a quadrature rule on sides of a body.

    Parameters
    ----------
    sides : (f, 3 | 6) nodes of this rank's sides, turned as ``physics.surface`` wants them
    element : "integration_point" or "node"
    """

    def __init__(self, sides: np.ndarray, kinematics: Kinematics, dim: int, element: str):
        self.sides, self._kinematics, self.dim = sides, kinematics, dim
        cell = {2: basix.CellType.interval, 3: basix.CellType.triangle}[dim]
        shapes = basix.create_element(basix.ElementFamily.P, cell, 2, basix.LagrangeVariant.gll_warped)
        if element == "node":
            # Simpson's rule; on triangles that of the four triangles between vertices and mid-nodes: all weights positive
            points, self._weights = shapes.points, np.array({2: [1, 1, 4], 3: [1, 1, 1, 3, 3, 3]}[dim]) / {2: 6, 3: 24}[dim]
        else:
            points, self._weights = _in_parts(cell, dim)
        table = shapes.tabulate(1, points)[..., 0]
        self.shape, self._gradient = table[0], table[1:]
        self.hats = basix.create_element(basix.ElementFamily.P, cell, 1).tabulate(0, points)[0, :, :, 0]
        w = self._weights
        self._projection = self.hats @ np.linalg.solve(self.hats.T @ (w[:, None] * self.hats), self.hats.T * w)
        self.per_side = self.points_per_facet = len(points)
        self.count = len(sides) * self.per_side

    def trace(self, nodal: np.ndarray) -> np.ndarray:
        """A nodal field (nodes[, k]) at the points, (points[, k])."""
        values = np.tensordot(nodal[self.sides], self.shape, axes=(1, 1))
        return np.moveaxis(values, -1, 1).reshape(self.count, *nodal.shape[1:])

    def surface(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Surface that belongs to each point, mm² (mm in plane strain, 2 pi r included in axisymmetry), (points,), and
        the outward unit normals, (points, dim)."""
        tangents = np.einsum("kqa,fad->kfqd", self._gradient, x[self.sides])
        across = tangents[0][..., ::-1] * [1.0, -1.0] if self.dim == 2 else np.cross(tangents[0], tangents[1])
        length = np.linalg.norm(across, axis=-1)
        surface = (length * self._weights).ravel()
        return surface * self._kinematics.weight_at(self.trace(x)), (across / length[..., None]).reshape(-1, self.dim)

    def points_from(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The sides as seen from their vertices in rising order of ``rows`` (nodes,), as ``ContactFacets.points_from``."""
        return seen_from_vertices(rows[self.sides[:, : self.dim]], self.hats)

    def linear_part(self, values: np.ndarray) -> np.ndarray:
        """Least-squares linear part, side by side, of values at the points (points,)."""
        return (values.reshape(-1, self.per_side) @ self._projection.T).ravel()


class BodyContact:
    """Contact of the ``slave`` sides with the ``master`` sides of one mesh, in velocities or displacements.

    Parameters
    ----------
    nodes : of the mesh that holds both bodies
    slave, master : (f,) owned exterior facets of this rank; the finer surface should be the slave
    dofs : (nodes, dim) global numbers of the unknowns; owned : how many of them this rank owns
    free : (nodes, dim) which of them are not given, all where None: held ones have no column in the gap operator
    friction : a law of ``laws.friction`` or None
    interference : overlap that the bodies have at the start, mm, taken for a gap of minus that
    """

    def __init__(self, nodes: Nodes, kinematics: Kinematics, slave: np.ndarray, master: np.ndarray, *, dofs: np.ndarray,
                 owned: int, free: np.ndarray | None = None, friction=None, element: str = "integration_point",
                 interference: float = 0.0, slip_regularisation: float = 1e-3):
        self.nodes, self.dim = nodes, nodes.dim
        self.points = SlavePoints(facet_sides(nodes, slave), kinematics, nodes.dim, element)
        self._master = facet_sides(nodes, master)
        self._dofs, self._owned = dofs, owned
        self.friction, self.interference = friction, interference
        self.slip_regularisation = self.slip0 = slip_regularisation
        self.state = law.PointState.at_rest(self.points.count, self.dim)
        self.silence()
        self.coefficient = self.dt = 1.0
        numbers = nodes.mesh.geometry.index_map().local_to_global(self._master.ravel().astype(np.int32))
        self._numbers = _everywhere(nodes.comm, np.asarray(numbers).reshape(self._master.shape))
        self._columns = _everywhere(nodes.comm, dofs[self._master])
        self._free = np.ones(dofs.shape) if free is None else free.astype(float)
        self._free_master = _everywhere(nodes.comm, self._free[self._master])
        self.G = self._K = self._inner = None

    # ------------------------------------------------------------------ pairing
    def search(self, x: np.ndarray, dt: float, reach: float = np.inf) -> None:
        """Pair points and sides anew for nodes at ``x`` (nodes, dim); contact looks ahead by ``dt``, s. Collective.

        reach : gap, mm, beyond which a point meets nothing for now; it then has no row in the gap operator
        """
        self.dt = dt
        at = self.points.trace(x)
        surface = CapturingSurface(_everywhere(self.nodes.comm, x[self._master]), self._numbers)
        found = surface.capture(at)
        self.weights, outward = self.points.surface(x)
        facing = np.einsum("pi,pi->p", outward, found.normal) < FACING
        state = self.state
        state.gap = np.where(found.over & facing, found.gap - self.interference, np.inf)
        state.gap[state.gap > reach] = np.inf
        state.normal = found.normal
        self._found, self._near = found, np.isfinite(state.gap)
        self._build()

    def pairs(self) -> np.ndarray:
        """Pairs of a slave side of this rank and a master side that may press on one another, each as one number."""
        near = np.flatnonzero(self._near)
        return np.unique(near // self.points.per_side * np.int64(len(self._columns)) + self._found.facet[near])

    def _build(self) -> None:
        """The gap operator, (points · dim) x unknowns; rows of points that are over nothing are empty. Collective."""
        dim, count, near = self.dim, self.points.count, np.flatnonzero(self._near)
        side, facet = near // self.points.per_side, self._found.facet[near]
        shape = self.points.shape[near % self.points.per_side]
        columns = np.concatenate([self._dofs[self.points.sides[side]], self._columns[facet]], axis=1)
        free = np.concatenate([self._free[self.points.sides[side]], self._free_master[facet]], axis=1)
        value = np.concatenate([shape, -self._found.shapes[near]], axis=1)[..., None] * free
        width = columns.shape[1]
        columns, value = (np.swapaxes(a, 1, 2).reshape(-1, width) for a in (columns, value))
        order = np.argsort(columns, axis=1)
        index = PETSc.IntType
        for old in (self.G, self._K, self._inner):
            if old is not None:
                old.destroy()
        self._K = self._inner = None
        self.G = PETSc.Mat().createAIJ(
            ((count * dim, None), (self._owned, None)), comm=self.nodes.comm,
            csr=(np.append(0, np.cumsum(np.repeat(self._near * width, dim))).astype(index),
                 np.take_along_axis(columns, order, axis=1).ravel().astype(index),
                 np.take_along_axis(value, order, axis=1).ravel()))

    # ------------------------------------------------------------------ response
    def relative(self, unknowns: PETSc.Vec) -> np.ndarray:
        """Velocity (displacement) of the slave's points relative to their feet, (points, dim). Collective."""
        out = self.G.createVecLeft()
        self.G.mult(unknowns, out)
        return out.array.reshape(-1, self.dim).copy()

    def respond(self, unknowns: PETSc.Vec, *, flow_stress: np.ndarray | None = None, touching: float | None = None,
                again: bool = False) -> None:
        """Tractions on the slave and their tangents for the present unknowns.

        flow_stress : (points,) for friction that is limited by it; touching : gap below which every point is closed;
        again : in the same solve, where points that open and close must calm down
        """
        state, relative, before = self.state, self.relative(unknowns), self.state.active
        closed = None if touching is None else state.gap <= touching
        law.normal_pressure(state, relative, self.coefficient, self.dt, closed)
        traction, tangent = law.normal_response(state, self.coefficient)
        if self.has_friction:
            slip = law.slip_velocity(state, relative)
            law.follow_contact(state, before if again else None)
            limit = self._limit(flow_stress)
            law.update_friction_stress(state, slip, limit, self.slip0)
            along, along_tangent = law.friction_response(state, limit, self.slip0)
            traction, tangent = traction + along, tangent + along_tangent
        self.traction, self._tangent = traction, tangent

    @property
    def has_friction(self) -> bool:
        return self.friction is not None and self.friction.law != "none"

    def softer(self, nodal: np.ndarray) -> np.ndarray:
        """A nodal field (nodes,) at the points, the less of the two bodies' values at each, (points,). Collective."""
        master = _everywhere(self.nodes.comm, nodal[self._master])[self._found.facet]
        return np.minimum(self.points.trace(nodal), np.einsum("pa,pa->p", self._found.shapes, master))

    def silence(self) -> None:
        """No traction: for the stiffness of the bodies alone."""
        count, dim = self.points.count, self.dim
        self.traction, self._tangent = np.zeros((count, dim)), np.zeros((count, dim, dim))

    def _limit(self, flow_stress):
        if self.friction.law == "sticking":
            return 2 / np.sqrt(3) * flow_stress       # a bound that the material never reaches, as against rigid tools
        pressure = self.state.pressure
        if self.friction.depends_on_pressure:
            pressure = np.maximum(self.points.linear_part(pressure), 0.0)
        return self.friction.limit(pressure, flow_stress)

    def augment(self) -> None:
        """Augmented-Lagrange update: the pressure found so far, linear on every side, becomes the multiplier."""
        state = self.state
        pressure = np.where(state.active, np.maximum(self.points.linear_part(state.pressure), 0.0), 0.0)
        state.multiplier = pressure[:, None] * state.normal

    # ------------------------------------------------------------------ what goes into the system
    def forces(self) -> PETSc.Vec:
        """Nodal forces of the contact on both bodies, G^T w t. Collective."""
        load, out = self.G.createVecLeft(), self.G.createVecRight()
        load.array[:] = (self.weights[:, None] * self.traction).ravel()
        self.G.multTranspose(load, out)
        return out

    def tangent(self) -> PETSc.Mat:
        """G^T w (-dt/ds) G; the matrix is that of the last call until the next search. Collective."""
        dim, count = self.dim, self.points.count
        index = PETSc.IntType
        first = self.G.getOwnershipRange()[0]
        rows = (np.arange(count * dim + 1) * dim).astype(index)
        columns = (first + np.repeat(np.arange(count) * dim, dim)[:, None] + np.arange(dim)).ravel().astype(index)
        values = (self.weights[:, None, None] * self._tangent).ravel()
        if self._inner is None:
            self._inner = PETSc.Mat().createAIJ(((count * dim, None), (count * dim, None)), comm=self.nodes.comm,
                                                csr=(rows, columns, values))
            self._K = self._inner.PtAP(self.G)
        else:
            self._inner.setValuesCSR(rows, columns, values)
            self._inner.assemble()
            self._inner.PtAP(self.G, result=self._K)
        return self._K

    def force(self) -> np.ndarray:
        """Force of the master on the slave, (dim,), N. Collective."""
        return total(self.nodes.comm, (self.weights[:, None] * self.traction).sum(axis=0))


def _in_parts(cell, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of a low rule on each of the equal parts of a side."""
    points, weights = basix.make_quadrature(cell, DEGREE[dim])
    lattice, parts = side_lattice(dim, PARTS[dim])
    corners = lattice[parts[:, :dim], 1:]
    edges = corners[:, 1:] - corners[:, :1]
    return (corners[:, :1] + points @ edges).reshape(-1, dim - 1), np.tile(weights / len(parts), len(parts))


def _everywhere(comm, values: np.ndarray) -> np.ndarray:
    """The rows of all ranks, one after the other, on every rank. Collective."""
    return np.concatenate(comm.allgather(values)) if comm.size > 1 else values
