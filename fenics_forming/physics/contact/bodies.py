r"""Contact between two bodies of one mesh: the gap operator and what the point law makes of it.

For a point m of the slave's surface and the side of the master that captures it, with the shape functions
:math:`N^s, N^m` at the point and at its foot, the relative velocity is
:math:`s_m=\sum_aN^s_av_a-\sum_bN^m_bv_b`, and that of a carrier of traction (``carriers``) the mean over its points,

.. math:: s_a = \sum_m W_{am}R_{am}s_m = (Gv)_a .

The law of a contact point (``point_law``) gives a traction t(s) on the slave, of virtual power :math:`-w\,t\cdot\delta s`
with the surface w of the carrier, so nodal forces are :math:`G^T w t`, the tangent :math:`G^T w(-\partial t/\partial s)G`.
The shape functions of either side add up to one, so the forces of the two bodies are opposite, and with the force along
the line from the point to its foot their moments are too.

The points are those of a quadrature rule on the slave's sides: many inner ones ("integration_point"), or the nodes
themselves ("node"), which is the classical node-to-facet element.  The surfaces are replicated on all ranks, so the number
of ranks does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from time import process_time

import numpy as np
from petsc4py import PETSc

from ..kinematics import Kinematics
from ..nodes import Nodes
from ..parallel import lowest, total
from ..surface import facet_sides
from . import point_law as law
from .capture import CapturingSurface
from .carriers import Carriers, means
from .gap_operator import NodeTraces, gap_operator
from .gap_rows import gap_rows, lesser_sums
from .overhanging import END, reaching_over, shortest_edges
from .slave_points import SlavePoints

ELEMENTS = ("integration_point", "node")
ONE_FACE, OTHER_FACE = 0.85, 0.6     # cosines between normals of points and their mean: they count, and do not
FACE_STEPS = 3
FACING = -0.2     # cosine between the normals of surfaces that can press on one another, at most


@dataclass
class CarrierState(law.PointState):
    """State of the carriers of this rank, and of which corners each of them is made: (all corners,)."""

    groups: np.ndarray = field(default_factory=lambda: np.empty(0, int))


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

    Attributes
    ----------
    state : `CarrierState` · weights : (carriers,) mm², the surface of each that is over the other body
    point_gap, point_weights : (points,) gaps that the points see, mm, and their surfaces, mm²
    unknowns : (nodes, dim) global numbers of the unknowns of both surfaces, on all ranks · free : (nodes, dim) 0 where held
    rows : `GapRows` of the last search, of the same nodes
    seconds : CPU time spent on search, operator, law, forces and tangent
    """

    sees_held = False       # whether unknowns that are given may be other than zero: relative motions and forces have them
    _frames: np.ndarray | None = None       # (points, dim, dim): motion of a foot, as the slave sees it in its own frame

    def __init__(self, nodes: Nodes, kinematics: Kinematics, slave: np.ndarray, master: np.ndarray, *, dofs: np.ndarray,
                 owned: int, free: np.ndarray | None = None, friction=None, element: str = "integration_point",
                 interference: float = 0.0, slip_regularisation: float = 1e-3):
        self.nodes, self.dim = nodes, nodes.dim
        self.points = SlavePoints(self._sides(slave), kinematics, nodes.dim, element)
        self._master = self._sides(master)
        self._owned = owned
        self.friction, self.interference, self.element = friction, interference, element
        self.slip_regularisation = self.slip0 = slip_regularisation
        self.coefficient = self.dt = 1.0
        self._soon = 0.0
        self._guessed = False       # whether the last response closed carriers on suspicion: they open without ado
        self.seconds = 0.0
        self._numbers = everywhere(nodes.comm, self._number(self._master))
        self._surface_of_master: CapturingSurface | None = None
        self.carriers = Carriers(nodes.comm, self._number(self.points.corners), self.dim)
        self.carriers.group(self.points.corner_normals(nodes.x))
        self.state = CarrierState.at_rest(self.carriers.count, self.dim)
        self.state.groups = self.carriers.groups
        self.silence()
        self.G = self._seen = self._K = self._inner = self._traces = None
        of_sides = [everywhere(nodes.comm, dofs[sides]) for sides in (self.points.sides, self._master)]
        every = np.concatenate(of_sides).reshape(-1, self.dim)
        self.unknowns = every[np.unique(every[:, 0], return_index=True)[1]]
        self._places, self._master_places = (
            np.searchsorted(self.unknowns[:, 0], numbers[..., 0]) for numbers in (dofs[self.points.sides], of_sides[1]))
        self.free = np.ones(self.unknowns.shape)
        if free is not None:
            frees = [everywhere(nodes.comm, free[sides].astype(float)) for sides in (self.points.sides, self._master)]
            self.free[np.searchsorted(self.unknowns[:, 0], every[:, 0])] = np.concatenate(frees).reshape(-1, self.dim)

    def _sides(self, facets: np.ndarray) -> np.ndarray:
        """Nodes of facets, (f, 3 | 6)."""
        return facet_sides(self.nodes, facets)

    def _number(self, local: np.ndarray) -> np.ndarray:
        """Numbers of nodes that all ranks share, of the same shape."""
        numbers = self.nodes.mesh.geometry.index_map().local_to_global(local.ravel().astype(np.int32))
        return np.asarray(numbers).reshape(local.shape)

    # ------------------------------------------------------------------ pairing
    def search(self, x: np.ndarray, dt: float, reach: float = np.inf, soon: float = np.inf, fade: float = 1.0) -> None:
        """Pair points and sides anew for nodes at ``x`` (nodes, dim); contact looks ahead by ``dt``, s. Collective.

        reach : gap, mm, beyond which a point meets nothing for now; carriers of none but such have no row in the operator
        soon, fade : mm; points with a gap beyond ``soon`` count the less in their carriers the wider it is, a quarter where
            it is wider by ``fade``: they press nothing yet, and must not hide what others overlap
        """
        start = process_time()
        self.dt, self._soon = dt, soon
        at = self.points.trace(x)
        master = everywhere(self.nodes.comm, x[self._master])
        if self._surface_of_master is None:
            self._surface_of_master = CapturingSurface(master, self._numbers,
                                                       with_edges=self.element == "node")
        else:
            self._surface_of_master.follow(master)
        found = self._surface_of_master.capture(at, reach + self.interference)
        self.point_weights, outward = self._surface(x)
        left = 1.0
        if self.element == "node":
            found, left = reaching_over(self._surface_of_master, found, at, outward, self._reach_of_ends(x))
        self._found = found
        facing = np.einsum("pi,pi->p", outward, found.normal) < FACING
        gap = np.where(found.over & facing, found.gap - self.interference, np.inf)
        gap[gap > reach] = np.inf
        self.point_gap, self._near = gap, np.isfinite(gap)
        beyond = np.maximum(np.where(self._near, gap, 0.0) - soon, 0.0) / fade
        self._counted = np.where(self._near, left * self.point_weights / (1.0 + beyond**2) ** 2, 0.0)
        self._normals = self.points.corner_normals(x)
        self._find_frames()
        self._carry()
        self.seconds += process_time() - start

    def _reach_of_ends(self, x: np.ndarray) -> np.ndarray:
        """How far the nodes of the sides may reach over the rim of the master, (points,) mm: only those of ends may."""
        return (self.carriers.ends() * (END * shortest_edges(x[self.points.sides[:, : self.dim]]))[:, None]).ravel()

    def _surface(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Surface of the points, (points,), and outward normals, (points, dim)."""
        return self.points.surface(x)

    def _find_frames(self) -> None:
        """Normals, and motions of the feet, are those of space: nothing to be turned into frames of the bodies."""

    def sharpen(self, flags: np.ndarray) -> None:
        """Make edges of the slave sharp that were so in an earlier run (``Carriers.sharp_edges``). Collective."""
        self.carriers.sharpen(flags)
        self._carry()

    def _carry(self) -> None:
        """Carriers, what they see, and their operator, for the points of the last search. Collective."""
        self.carriers.group(self._normals)
        self._follow_groups()
        self._build()

    def pairs(self) -> np.ndarray:
        """What may press on one another, each pair as one number: a carrier, by its first corner, and a side of the master,
        or of the slave itself whose nodes it moves."""
        near, side, point, corner = self._counting()
        masters = len(self._master_places)
        carrier = self.carriers.own[side[point], corner]
        first = self.carriers.first_corner[carrier] * np.int64(masters + self.carriers.corners)
        of_slave = masters + self.carriers.own_sides[side]
        return np.unique(np.concatenate([first + self._found.facet[near][point], first + of_slave[point]]))

    def _counting(self) -> tuple[np.ndarray, ...]:
        """The points that meet something (p,), their sides (p,), which of them (m,) count in which corners (m,) of
        their sides."""
        near = np.flatnonzero(self._near)
        side, place = np.divmod(near, self.points.per_side)
        return near, side, *np.nonzero(self.points.basis[place] > 0)

    def _follow_groups(self) -> None:
        """The state of carriers that are made of other corners than before: the mean of the corners. Collective."""
        state, carriers = self.state, self.carriers
        if np.array_equal(state.groups, carriers.groups):
            return
        for name, value in list(vars(state).items()):
            if name != "groups":
                mean = carriers.mine(means(carriers.everywhere(value)[state.groups], carriers.groups, carriers.total))
                setattr(state, name, mean > 0.5 if value.dtype == bool else mean)
        state.groups = carriers.groups
        self.silence()

    def _build(self) -> None:
        """Surface, gap, normal and gap operator of the carriers; rows of those over nothing are empty. Collective."""
        carriers, state, dim = self.carriers, self.state, self.dim
        near, side, point, corner = self._counting()
        facet = self._found.facet[near]
        self._share = self._counted[:, None] * np.tile(self.points.basis, (len(self.points.sides), 1))
        self._keep_one_face()
        sums = self._sums(np.column_stack([np.ones(len(self._near)), np.where(self._near, self.point_gap, 0.0),
                                           self._found.normal]))
        weight, length = sums[:, 0], np.linalg.norm(sums[:, 2:], axis=1)
        over = (weight > 0) & (length > 0)
        mean = sums[:, 1:] / np.where(over, weight, 1.0)[:, None]
        normal = np.where(over[:, None], sums[:, 2:] / np.where(over, length, 1.0)[:, None], np.eye(dim)[-1])
        carrier = carriers.own[side[point], corner]
        share = self._share[near[point], corner] * np.where(over, 1.0 / np.where(over, weight, 1.0), 0.0)[carrier]
        shape = self.points.shape[near % self.points.per_side]
        self.rows = gap_rows(carrier, point, share, nodes=len(self.unknowns), means=normal,
                             places=np.concatenate([self._places[side], self._master_places[facet]], axis=1),
                             shapes=np.concatenate([shape, -self._found.shapes[near]], axis=1),
                             normals=self._found.normal[near],
                             frames=None if self._frames is None else self._frames[near])
        self._back = carriers.mine(total(self.nodes.comm, self.rows.back))
        self.weights = carriers.mine(np.where(over, weight, 0.0))
        state.gap, state.normal = carriers.mine(np.where(over, mean[:, 0], np.inf)), carriers.mine(normal)
        for old in {id(m): m for m in (self.G, self._seen, self._K, self._inner) if m is not None}.values():
            old.destroy()
        self._K = self._inner = self._traces = None
        self.G = gap_operator(self.nodes.comm, carriers, self._owned, self.rows, unknowns=self.unknowns, free=self.free)
        self._seen = self.G
        if self.sees_held and not self.free.all():
            self._seen = gap_operator(self.nodes.comm, carriers, self._owned, self.rows, unknowns=self.unknowns,
                                      free=np.ones_like(self.free))

    def _keep_one_face(self) -> None:
        """Points whose normals are far from the mean of their carrier do not count in it: of two faces of the master around
        a sharp edge a carrier keeps the one that more of it is over. Collective."""
        if self._meets_one_face():
            return
        sides = np.repeat(np.arange(len(self.points.sides)), self.points.per_side)
        for _ in range(FACE_STEPS):
            normal = self._sums(self._found.normal)
            normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
            cosine = np.einsum("pki,pi->pk", normal[self.carriers.own[sides]], self._found.normal)
            if lowest(self.nodes.comm, float(cosine[self._share > 0].min(initial=1.0))) >= ONE_FACE:
                return
            self._share = self._share * np.clip((cosine - OTHER_FACE) / (ONE_FACE - OTHER_FACE), 0.0, 1.0)

    def _meets_one_face(self) -> bool:
        """Whether all normals are so near to their mean that none can be far from that of a carrier. Collective."""
        normal = self._found.normal[self._near]
        mean = total(self.nodes.comm, normal.sum(axis=0))
        half = np.sqrt((1.0 + ONE_FACE) / 2)       # cosine of half the angle: two such make the whole at most
        return lowest(self.nodes.comm, float((normal @ mean).min(initial=np.inf))) >= half * np.linalg.norm(mean)

    def _sums(self, values: np.ndarray) -> np.ndarray:
        """Surface integrals over the hats of all carriers of values (points, c), (all carriers, c). Collective."""
        shares = self._shares()
        return self.carriers.sums(np.einsum("fqk,fqc->fkc", shares, values.reshape(*shares.shape[:2], values.shape[1])))

    def _shares(self) -> np.ndarray:
        """Surface of the points in the hats of their corners, (f, points, corners), mm²."""
        return self._share.reshape(len(self.points.sides), self.points.per_side, self._share.shape[1])

    # ------------------------------------------------------------------ response
    def relative(self, unknowns: PETSc.Vec) -> np.ndarray:
        """Velocity (displacement) of the slave's carriers relative to what they face, (carriers, dim). Collective."""
        out = self._seen.createVecLeft()
        self._seen.mult(unknowns, out)
        return out.array.reshape(-1, self.dim).copy()

    def respond(self, unknowns: PETSc.Vec, *, flow_stress: np.ndarray | None = None, touching: float | None = None,
                grip: str = "new", held: bool = False) -> None:
        """Tractions on the slave and their tangents for the present unknowns.

        flow_stress : (carriers,) for friction that is limited by it; touching : gap below which every carrier is closed;
        grip : which carriers friction acts at, see ``point_law.follow_contact``; held : for the first guess of a warm
        start, what was closed stays closed where it can close in the step: sides that have moved over one another hover
        """
        start = process_time()
        state, relative, before = self.state, self.relative(unknowns), self.state.active
        closed = before & (state.gap <= self._soon) if held else None if touching is None else state.gap <= touching
        law.normal_pressure(state, relative, self.coefficient, self.dt, closed)
        traction, tangent = law.normal_response(state, self.coefficient)
        if self.has_friction:
            slip = law.slip_velocity(state, relative)
            law.follow_contact(state, before, "new" if self._guessed else grip)
            limit = self._limit(flow_stress)
            law.update_friction_stress(state, slip, limit, self.slip0)
            along, along_tangent = law.friction_response(state, limit, self.slip0)
            traction, tangent = traction + along, tangent + along_tangent
        self.traction, self._tangent, self._guessed = traction, tangent, touching is not None
        self.seconds += process_time() - start

    @property
    def has_friction(self) -> bool:
        return self.friction is not None and self.friction.law != "none"

    def softer(self, nodal: np.ndarray) -> np.ndarray:
        """A nodal field (nodes,) at the carriers, the less of the two bodies' values there, (carriers,). Collective."""
        points, found = self.points, self._found
        across = everywhere(self.nodes.comm, nodal[self._master])
        sums = lesser_sums(nodal, points.sides, points.shape, self._share, self.carriers.own, across, found.facet,
                           found.shapes, self.carriers.total)
        return self._per_weight(total(self.nodes.comm, sums))

    def opposite(self, nodal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A nodal field (nodes,) at the vertices of the sides that the points face, (points, dim), and the quadratic
        shapes of the nodes of these sides there. Collective."""
        return everywhere(self.nodes.comm, nodal[self._master[:, : self.dim]])[self._found.facet], self._found.shapes

    def mean(self, at_points: np.ndarray) -> np.ndarray:
        """Values at the points (points,) averaged over the hats of the carriers, (carriers,). Collective."""
        return self._per_weight(self._sums(at_points[:, None])[:, 0])

    def _per_weight(self, sums: np.ndarray) -> np.ndarray:
        """Surface integrals over the hats of all carriers → means over those of this rank."""
        return self.carriers.mine(sums) / np.where(self.weights > 0, self.weights, 1.0)

    def silence(self) -> None:
        """No traction: for the stiffness of the bodies alone."""
        count, dim = self.carriers.count, self.dim
        self.traction, self._tangent = np.zeros((count, dim)), np.zeros((count, dim, dim))

    def _limit(self, flow_stress):
        if self.friction.law == "sticking":
            return 2 / np.sqrt(3) * flow_stress       # a bound that the material never reaches, as against rigid tools
        over = flow_stress > 0      # a carrier over nothing has no strength to ask a law with
        return np.where(over, self.friction.limit(self.state.pressure, np.where(over, flow_stress, 1.0)), 0.0)

    def augment(self) -> None:
        """Augmented-Lagrange update: the pressure found so far becomes the multiplier."""
        state = self.state
        state.multiplier = np.where(state.active, np.maximum(state.pressure, 0.0), 0.0)[:, None] * state.normal

    # ------------------------------------------------------------------ what goes into the system
    def forces(self) -> PETSc.Vec:
        """Nodal forces of the contact on both bodies, G^T w t. Collective."""
        start = process_time()
        out = self._on_nodes(self.traction)
        self.seconds += process_time() - start
        return out

    def normal_forces(self) -> PETSc.Vec:
        """Those of the pressures alone, which a resumed run knows too. Collective."""
        return self._on_nodes(self.state.pressure[:, None] * self.state.normal)

    def _on_nodes(self, traction: np.ndarray) -> PETSc.Vec:
        load, out = self._seen.createVecLeft(), self._seen.createVecRight()
        load.array[:] = (self.weights[:, None] * traction).ravel()
        self._seen.multTranspose(load, out)
        return out

    def weighted_tangent(self) -> np.ndarray:
        """w (-dt/ds) of the carriers, (carriers, dim, dim)."""
        return self.weights[:, None, None] * self._tangent

    def tangent(self) -> PETSc.Mat:
        """G^T w (-dt/ds) G; the matrix is that of the last call until the next search. Collective."""
        start = process_time()
        dim, count = self.dim, self.carriers.count
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
        self.seconds += process_time() - start
        return self._K

    def diagonal(self) -> tuple[np.ndarray, np.ndarray]:
        """The blocks on the diagonal of the tangent, without the tangent: global number of the first unknown of each node
        of both surfaces (n,), and blocks (n, dim, dim), the same on all ranks. Collective."""
        start = process_time()
        if self._traces is None:
            self._traces = NodeTraces(self.G, self.unknowns)
        blocks = total(self.nodes.comm, self._traces.diagonal(self.weighted_tangent()))
        self.seconds += process_time() - start
        return self.unknowns[:, 0], blocks

    # ------------------------------------------------------------------ what the bodies feel
    def force(self) -> np.ndarray:
        """Force of the master on the slave, (dim,), N. Collective."""
        return total(self.nodes.comm, np.einsum("p,pij,pj->i", self.weights, self._back, self.traction))

    def corner_loads(self) -> tuple[np.ndarray, np.ndarray]:
        """What presses on the nodes of this rank's sides, N, and the surface that belongs to them, mm², both (f, corners).
        Collective."""
        surface = self._shares().sum(axis=1)
        return self.carriers.at_corners(self.state.pressure) * surface, surface


def nodal_pressure(nodes: Nodes, contacts) -> np.ndarray:
    """Mean pressure of some contacts at the nodes of the surfaces that hold their points, (nodes,), MPa; zero elsewhere.
    Collective."""
    sums = np.zeros((nodes.count, 2))
    for contact in contacts:
        corners = contact.points.corners.ravel()
        for column, values in enumerate(contact.corner_loads()):
            sums[:, column] += np.bincount(corners, values.ravel(), nodes.count)
    sums = nodes.sum_over_ranks(sums)
    return np.divide(sums[:, 0], sums[:, 1], out=np.zeros(len(sums)), where=sums[:, 1] > 0)


def everywhere(comm, values: np.ndarray) -> np.ndarray:
    """The rows of all ranks, one after the other, on every rank. Collective."""
    return np.concatenate(comm.allgather(values)) if comm.size > 1 else values
