"""Contact between the bodies of an assembly, all pairs of them together, as terms of one velocity solve."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

import numpy as np
from petsc4py import PETSc

from ..kinematics import Kinematics
from ..nodes import Nodes
from ..parallel import highest, total
from . import point_law as law
from .bodies import BodyContact, nodal_pressure
from .rigid import RigidContact

REACH = 0.5      # of the size of a side: gaps up to this stay paired, so that sliding changes the pairing rarely
FADE = 0.1       # of the size of a side: wider gaps, of what cannot close in a step, count little in the mean of a node
SETTLED = 0.01   # of an interference: what is left of it then does no longer push the bodies apart
TRAVEL = 4.0     # times the way of the tools in a step: a gap beyond cannot close in it


@dataclass(frozen=True)
class Pair:
    """Two bodies that may touch: a name, owned exterior facets of each, friction law or None, overlap that the meshes do
    not have, how it is looked at, which body holds the points, and the overlap at the start, drawn or not."""

    name: str
    slave: np.ndarray
    master: np.ndarray
    friction: object | None = None
    interference: float = 0.0
    element: str = "integration_point"
    holder: str = ""
    overlap: float = 0.0


class Interfaces:
    """Contact of several pairs of bodies in one mesh; the penalty and the slip regularisation are those of the tools.

    Parameters
    ----------
    tools : contact of the same bodies with tools, which knows penalty, speed and step
    dofs : (nodes, dim) global numbers of the velocities; owned : unknowns of this rank; free : (nodes, dim) not given
    """

    def __init__(self, nodes: Nodes, kinematics: Kinematics, pairs: list[Pair], tools: RigidContact, *, dofs: np.ndarray,
                 owned: int, free: np.ndarray):
        self.names, self.slaves = [pair.name for pair in pairs], {pair.name: pair.holder for pair in pairs}
        self.contacts = [BodyContact(nodes, kinematics, pair.slave, pair.master, dofs=dofs, owned=owned, free=free,
                                     friction=pair.friction, element=pair.element, interference=pair.interference)
                         for pair in pairs]
        self._nodes, self._tools, self._overlaps = nodes, tools, [pair.overlap for pair in pairs]
        self._unknowns = PETSc.Vec().createMPI((owned, None), comm=nodes.comm)
        first = self._unknowns.getOwnershipRange()[0]
        self._mine = (dofs >= first) & (dofs < first + owned)
        self._places = dofs[self._mine] - first
        self._axisymmetric = kinematics.name == "axisymmetric"
        self._size = [side_length(nodes, contact.points.sides) for contact in self.contacts]
        self._known = [np.empty(0, np.int64) for _ in pairs]
        self._merging = 0.0
        self.has_new_pairs = True       # since the matrix was last made to hold them

    @property
    def by_name(self) -> dict[str, BodyContact]:
        """Pair → its contact."""
        return dict(zip(self.names, self.contacts, strict=True))

    # ------------------------------------------------------------------ pairing
    def search(self, x: np.ndarray, dt: float, speed: float) -> None:
        """Pair all points anew for nodes at ``x``, of which none comes nearer than ``speed`` allows. Collective."""
        new = False
        for k, (contact, size) in enumerate(zip(self.contacts, self._size, strict=True)):
            contact.search(x, dt, max(TRAVEL * speed * dt, REACH * size), speed * dt, FADE * size)
            new |= not np.isin(contact.pairs(), self._known[k]).all()
        if highest(self._nodes.comm, float(new)):
            self.has_new_pairs = True

    def interferes(self, least: float) -> bool:
        """Whether bodies overlap by an interference that they were given, by more than ``least``, mm. Collective."""
        given = ((contact, overlap) for contact, overlap in zip(self.contacts, self._overlaps, strict=True) if overlap > 0)
        worst = max((-contact.state.gap.min(initial=np.inf) - max(least, SETTLED * overlap) for contact, overlap in given),
                    default=-np.inf)
        return highest(self._nodes.comm, float(worst)) > 0

    def gaps(self) -> dict[str, np.ndarray]:
        """Pair → (sides, corners) the gaps of the last search, mm. Collective."""
        return {name: contact.carriers.at_corners(contact.state.gap) for name, contact in self.by_name.items()}

    def set_gaps(self, gaps: dict[str, np.ndarray]) -> None:
        """Close earlier gaps instead of the present ones, where a surface was over the other body then. Collective."""
        for name, contact in self.by_name.items():
            now, then = contact.state.gap, contact.carriers.from_corners(gaps[name])
            contact.state.gap = np.where(np.isfinite(now) & np.isfinite(then), then, now)

    def merged(self, bulk: PETSc.Mat) -> PETSc.Mat:
        """A matrix that holds ``bulk`` and all present pairs. Collective."""
        start, inside = process_time(), sum(contact.seconds for contact in self.contacts)
        out = bulk.copy()
        for k, contact in enumerate(self.contacts):
            contact.silence()
            out.axpy(1.0, contact.tangent(), structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
            self._known[k] = contact.pairs()
        self.has_new_pairs = False
        self._merging += process_time() - start - sum(contact.seconds for contact in self.contacts) + inside
        return out

    @property
    def seconds(self) -> float:
        """CPU time of contact between bodies: search, operator, law, forces, tangents, and what they add to the matrix, or
        to the products of a solver that has none."""
        return self._merging + sum(contact.seconds for contact in self.contacts)

    def book(self, seconds: float) -> None:
        """Count CPU time that a solver has spent on contact between bodies."""
        self._merging += seconds

    # ------------------------------------------------------------------ response, as of contact with tools
    @property
    def needs_flow_stress(self) -> bool:
        return any(contact.has_friction for contact in self.contacts)

    def respond(self, velocity: np.ndarray, *, flow_stress: np.ndarray | None = None, touching: float | None = None,
                slip0: float | None = None, grip: str = "new", held: bool = False) -> None:
        """Tractions at nodal velocities (nodes, dim); flow_stress (nodes,), the rest as in ``RigidContact.respond``."""
        unknowns = self._unknowns_of(velocity)
        for contact in self.contacts:
            contact.coefficient = self._tools.coefficient
            contact.slip0 = self._tools.slip0 if slip0 is None else slip0
            softer = contact.softer(flow_stress) if contact.has_friction else None
            contact.respond(unknowns, flow_stress=softer, touching=touching, grip=grip, held=held)

    def silence(self) -> None:
        """No traction: for the stiffness of the bodies alone."""
        for contact in self.contacts:
            contact.silence()

    def rebuild_stress(self) -> None:
        """Forget friction stresses and multipliers: the next solve starts from nothing."""
        for contact in self.contacts:
            contact.state.friction_stress[:] = contact.state.slip[:] = contact.state.multiplier[:] = 0.0

    def release(self) -> None:
        """No body presses on another: all that is remembered is zero."""
        self.rebuild_stress()
        self.silence()
        for contact in self.contacts:
            contact.state.pressure[:] = contact.state.grip[:] = 0.0
            contact.state.active[:] = False

    def augment(self) -> None:
        """Augmented-Lagrange update of all pairs."""
        for contact in self.contacts:
            contact.augment()

    def _unknowns_of(self, velocity: np.ndarray) -> PETSc.Vec:
        self._unknowns.array[self._places] = velocity[self._mine]
        return self._unknowns

    # ------------------------------------------------------------------ what goes into the system
    def add_forces(self, residual: PETSc.Vec) -> None:
        """Subtract the nodal forces of the contacts from the residual. Collective."""
        for contact in self.contacts:
            residual.axpy(-1.0, contact.forces())

    def add_tangent(self, matrix: PETSc.Mat) -> None:
        """Add the tangents of the contacts to a matrix that holds all pairs. Collective."""
        for contact in self.contacts:
            tangent, start = contact.tangent(), process_time()
            matrix.axpy(1.0, tangent, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
            self._merging += process_time() - start

    # ------------------------------------------------------------------ what the bodies feel
    def forces(self) -> np.ndarray:
        """Forces of the masters on the slaves, (pairs, dim), N (N/mm in plane strain). Collective."""
        return np.array([contact.force() for contact in self.contacts])

    def resultants(self) -> np.ndarray:
        """Forces as far as they are resultants, (pairs, k): in axisymmetry along the axis only. Collective."""
        return self.forces()[:, int(self._axisymmetric):]

    def powers(self, velocity: np.ndarray) -> dict[str, float]:
        """Power, mW: lost in friction between bodies, taken by the penalty and by landing points. Collective."""
        friction = penalty = 0.0
        unknowns = self._unknowns_of(velocity)
        for contact in self.contacts:
            relative = contact.relative(unknowns)
            lost = -np.einsum("pi,pi,p->", contact.traction, relative, contact.weights)
            normal = np.einsum("pi,pi->p", relative, contact.state.normal)
            in_normal = -np.einsum("p,p,p->", contact.state.pressure, normal, contact.weights)
            friction, penalty = friction + lost - in_normal, penalty + in_normal
        sums = total(self._nodes.comm, np.array([friction, penalty]))
        return {"friction": float(sums[0]), "penalty": float(sums[1])}

    def friction_powers(self, velocity: np.ndarray) -> dict[str, np.ndarray]:
        """Pair → power that friction takes at its carriers, (carriers,) mW/mm², nowhere negative. Collective."""
        unknowns, found = self._unknowns_of(velocity), {}
        for name, contact in self.by_name.items():
            if contact.has_friction:
                relative, state = contact.relative(unknowns), contact.state
                along = contact.traction - state.pressure[:, None] * state.normal
                found[name] = np.maximum(-np.einsum("pi,pi->p", along, relative), 0.0)
        return found

    def nodal_pressure(self) -> np.ndarray:
        """Pressure between bodies at the nodes (nodes,), MPa, on the surfaces that hold the points. Collective."""
        return nodal_pressure(self._nodes, self.contacts)

    def nodal_pressures(self) -> dict[str, np.ndarray]:
        """The same of each pair. Collective."""
        return {name: nodal_pressure(self._nodes, [contact]) for name, contact in self.by_name.items()}

    def pressed_by_pair(self) -> dict[str, np.ndarray]:
        """Pair → nodes (nodes,) of either body that feel the other one. Collective."""
        found = {}
        for name, contact in self.by_name.items():
            felt = np.zeros(self._mine.shape)
            felt[self._mine] = np.abs(contact.normal_forces().array_r[self._places])
            found[name] = self._nodes.sum_at_all(felt.sum(axis=1)) > 0
        return found

    def pressed_nodes(self) -> np.ndarray:
        """The nodes (nodes,) that feel another body. Collective."""
        return np.any([*self.pressed_by_pair().values()], axis=0)

    # ------------------------------------------------------------------ memory
    def memory(self) -> dict[str, np.ndarray]:
        """What the next solve starts from, pair by pair, (corners of the slave's sides, 3 + dim): pressure, grip, friction
        stress, sharp edges. Collective."""
        found = {}
        for name, contact in self.by_name.items():
            state = contact.state
            rows = contact.carriers.at_corners(np.column_stack([state.pressure, state.grip, state.friction_stress]))
            rows = np.concatenate([rows, contact.carriers.sharp_edges()[..., None]], axis=2)
            found[name] = rows.reshape(-1, rows.shape[-1])
        return found

    def resume(self, memory: dict[str, np.ndarray], velocity: np.ndarray) -> None:
        """Take over what :meth:`memory` gave, with the nodal velocities of then, on the pairs of the last search."""
        unknowns = self._unknowns_of(velocity)
        for name, contact in self.by_name.items():
            state, corners = contact.state, contact.points.corners.shape
            rows = memory[name].reshape(*corners, memory[name].shape[1])
            contact.sharpen(rows[..., -1])
            of_pair = contact.carriers.from_corners(rows)
            state.pressure, state.grip, state.friction_stress = of_pair[:, 0], of_pair[:, 1], of_pair[:, 2:-1]
            state.active = state.pressure > 0
            state.slip = law.slip_velocity(state, contact.relative(unknowns))

    def resume_from_nodes(self, pressures: dict[str, np.ndarray], velocity: np.ndarray) -> None:
        """Start from nodal pressures (nodes,) of every pair, on other meshes than they were found on, with nodal velocities
        (nodes, dim), on the pairs of the last search."""
        unknowns = self._unknowns_of(velocity)
        for name, contact in self.by_name.items():
            state = contact.state
            at_carriers = contact.carriers.from_corners(pressures[name][contact.points.corners])
            state.pressure = np.where(contact.weights > 0, np.maximum(at_carriers, 0.0), 0.0)
            state.active = state.pressure > 0
            state.grip = state.active.astype(float)
            state.slip = law.slip_velocity(state, contact.relative(unknowns))


def side_length(nodes: Nodes, sides: np.ndarray) -> float:
    """Mean length of the sides of a surface, mm, over all ranks. Collective."""
    ends = nodes.x[sides[:, :2]]
    sums = total(nodes.comm, np.array([np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum(), len(sides)]))
    return float(sums[0] / max(sums[1], 1.0))
