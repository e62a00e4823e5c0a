r"""A tool of several parts that press on one another: Newton's iteration over bulk and contact together.

The parts are disjoint in one mesh.  Contact adds nodal forces :math:`G^Tw\,t(Gu)` and the tangent of ``contact.bodies`` in
displacements (FORMULATION.md 3): there the closing *displacement* takes the place of the closing speed, in a step of 1 s.
Displacements are small, so points and sides are paired once.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ..contact.bodies import BodyContact
from ..linear import DirectSolver
from ..parallel import total
from .body import ToolBody
from .compliance import compliance, global_dofs
from .elastic import set_held_rows
from .plastic import PlasticSolver, ToolSettings

TOUCHING = 1e-9     # of the size of the tool: parts that touch at the start hold each other in the first iteration


@dataclass(frozen=True)
class PartContact:
    """Frictionless contact of two parts.

    Parameters
    ----------
    slave, master : (f,) owned exterior facets of this rank; the finer surface should be the slave
    interference : overlap that is declared, mm; points over the other part then start with it, whatever gap the mesh has.
        None: the gaps are those of the mesh
    element : "integration_point" or "node"
    """

    slave: np.ndarray
    master: np.ndarray
    interference: float | None = None
    element: str = "integration_point"


class AssembledSolver(PlasticSolver):
    """Solve an assembled tool, elastic or elastic-plastic, for one set of loads after the other.

    Parameters
    ----------
    contacts : `PartContact` of its parts
    penalty_factor : penalty in units of the stiffness per area of the contact surfaces
    augmentations : how often the pressure found becomes the multiplier, which takes the penetration out

    Attributes
    ----------
    contacts : `BodyContact` of the parts, with pressures and forces
    """

    def __init__(self, body: ToolBody, contacts, settings: ToolSettings = ToolSettings(), *, penalty_factor: float = 10.0,
                 augmentations: int = 2):
        super().__init__(body, settings)
        self.augmentations = augmentations
        dofs = global_dofs(body, np.arange(body.nodes.count))
        self.contacts = [BodyContact(body.nodes, body.state.kinematics, c.slave, c.master, dofs=dofs, owned=body.owned,
                                     free=~body.is_held, element=c.element) for c in contacts]
        self._merged: PETSc.Mat | None = None
        self._touching = self._touch = TOUCHING * float(np.linalg.norm(np.diff(body.nodes.extents(), axis=0)))
        stiffness = self._stiffness()
        for contact, given in zip(self.contacts, contacts, strict=True):
            contact.search(body.nodes.x, 1.0)
            _declare(contact, given.interference)
            contact.coefficient = penalty_factor * self._per_area(contact, stiffness)
        self._given = contacts
        self._respond()
        self._balanced, self._accepted_tangents = self._forces, self._tangents
        self._touching = None

    def set_interference(self, part: float) -> None:
        """Let the parts of the next solve overlap by a part of what is declared: a way to bring it on in steps."""
        for contact, given in zip(self.contacts, self._given, strict=True):
            _declare(contact, None if given.interference is None else part * given.interference)
        self._touching = self._touch
        self._forces = self.internal_forces()
        self._touching = None

    def _stiffness(self) -> np.ndarray:
        """Diagonal of the elastic stiffness at the nodes, mean over the components, (nodes,), N/mm."""
        matrix = fem_petsc.assemble_matrix(self.factor.form)
        matrix.assemble()
        return self.body.nodal_forces(matrix.getDiagonal()).mean(axis=1)

    def _per_area(self, contact: BodyContact, stiffness: np.ndarray) -> float:
        """Stiffness of the slave's nodes over the surface they share, N/mm³."""
        at_points = contact.points.trace(stiffness)
        side = contact.weights.reshape(-1, contact.points.per_side).sum(axis=1).repeat(contact.points.per_side)
        sums = total(self.body.nodes.comm, np.array([(at_points * contact.weights).sum(), (side * contact.weights).sum()]))
        return float(sums[0] / sums[1])

    def solve(self, loads=(), *, held: float = 1.0, steps: int | None = None) -> int:
        """See `PlasticSolver.solve`; then the penetration is taken out under the same loads."""
        spent = super().solve(loads, held=held, steps=steps)
        for _ in range(self.augmentations):
            for contact in self.contacts:
                contact.augment()
            self._forces = self.internal_forces()
            spent += self._equilibrate(self.force, held, 1.0)
            self._accept(self.force)
        return spent

    def compliance(self, dofs: np.ndarray) -> np.ndarray:
        """See `compliance.compliance`, by the tangent of the parts and of the contact that is closed now. Collective."""
        self._tangents = self._accepted_tangents
        self._factorise_tangent()
        return compliance(self.body, self._direct, dofs)

    def state(self) -> tuple:
        """See `PlasticSolver.state`; the contacts of the parts go along."""
        return (*super().state(), copy.deepcopy([contact.state for contact in self.contacts]))

    def go_back(self, state: tuple) -> None:
        """Take over what :meth:`state` gave."""
        for contact, then in zip(self.contacts, state[2], strict=True):
            contact.state = copy.deepcopy(then)
        super().go_back(state[:2])

    # ------------------------------------------------------------------ contact in Newton's iteration
    def _step_elastically(self, target: PETSc.Vec, held: float) -> bool:
        """Contact opens and closes: one linear solve is no solution."""
        return False

    def internal_forces(self) -> PETSc.Vec:
        """Nodal forces that stresses, springs and contact hold in balance, N."""
        vector = super().internal_forces()
        for contact in self.contacts:
            contact.respond(self.body.displacement.x.petsc_vec, touching=self._touching)
            vector.axpy(-1.0, contact.forces())
        return vector

    def _elastic_increment(self, target: PETSc.Vec) -> None:
        """The increment by the tangent that bulk and contact have now; supports that move go along."""
        body, load = self.body, target.copy()
        load.axpy(-1.0, self._forces)
        if body.moves_supports:
            lift = body.new_vector()
            fem_petsc.apply_lifting(lift, [self.factor.form], [body.conditions], x0=[body.displacement.x.petsc_vec])
            lift.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            load.axpy(1.0, lift)
        self._driving = load.norm()
        set_held_rows(body, load, body.displacement)
        self._out_of_balance = load
        self._tangent_increment()

    def _factorise_tangent(self) -> None:
        self._write_tangent()
        merged = self._matrix.copy()
        for contact in self.contacts:
            merged.axpy(1.0, contact.tangent(), structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        if self._merged is None:
            self._merged = merged
            self._direct = DirectSolver(self._merged)
        else:
            merged.copy(self._merged, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self._direct.factorise()


def _declare(contact: BodyContact, interference: float | None) -> None:
    """Points over the other part start with this overlap, mm, whatever gap the mesh has; nothing where it is None."""
    if interference is not None:
        contact.state.gap = np.where(np.isfinite(contact.state.gap), -interference, np.inf)
