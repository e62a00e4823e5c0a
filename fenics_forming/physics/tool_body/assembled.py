r"""A tool of several parts that press and rub on one another: Newton's iteration over bulk and contact together.

The parts are disjoint in one mesh.  Contact adds nodal forces :math:`G^Tw\,t(Gu)` and the tangent of ``contact.parts`` in
displacements (FORMULATION.md 3): there the closing *displacement* takes the place of the closing speed, in a step of 1 s.
Strains are small, but parts may slide: in a load step points and sides are paired anew where parts have come to lie
opposite to other sides; where they turn with that, each feels the other in its own frame (``contact.surface_turn``).
Friction remembers what it held in the last accepted step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from ...errors import ConvergenceError
from ...laws import Friction, NoFriction
from ..contact.parts import UNLIMITED, PartContactField
from ..linear import DirectSolver
from ..parallel import highest, total
from .body import ToolBody
from .bulk import ElasticBulk, PlasticBulk
from .compliance import compliance, global_dofs
from .elastic import set_held_rows
from .field import at_nodes
from .plastic import PlasticSolver, ToolSettings

TOUCHING = 1e-3     # of the smallest side: parts with no wider gap hold each other in the first iteration, others where the
                    # gap is least: nothing else may hold them
SEARCH_FROM = 4     # increment of a step: contact that is still changing sides then may do so for ever with full increments
CREEP = 0.01        # of the stiffness, in the tangent of points that slip, in the second try of a step: see `holding.hold`
CREEP_ITERATIONS = 3    # times the usual ones, which it then takes
AUGMENTATIONS = {False: 40, True: 10}       # without and with friction
PAIRINGS = 5        # in a load step: by then parts that slide on by being paired anew do so by little
HALVINGS, ENOUGH = 6, 0.9     # of an increment, until the imbalance is less than this part of that before


@dataclass(frozen=True)
class PartContact:
    """Contact of two parts.

    Parameters
    ----------
    slave, master : (f,) owned exterior facets of this rank; the finer surface should be the slave
    interference : overlap that is declared, mm; points over the other part then start with it, whatever gap the mesh has.
        None: the gaps are those of the mesh
    holder : name of the part of the slave
    element : "integration_point" or "node"
    friction : a law of ``laws.friction``. One that does not depend on the pressure (Siebel) needs parts that can yield;
        Coulomb's is limited by the shear yield stress where there is one
    """

    slave: np.ndarray
    master: np.ndarray
    interference: float | None = None
    element: str = "integration_point"
    friction: Friction = NoFriction()
    holder: str = ""


class AssembledSolver(PlasticSolver):
    """Solve an assembled tool, elastic or elastic-plastic, for one set of loads after the other.

    Parameters
    ----------
    contacts : `PartContact` of its parts
    penalty_factor : penalty in units of the stiffness per area of the contact surfaces
    augmentations : how often at most the tractions found become the multipliers, which takes the penetration out; one is
        a single solve with the tangent that is there, and leaves about half of it where a node carries little surface.
        None: 40, with friction 10, as every one moves the places at which points hold
    penetration : of the greatest displacement, where that ends: overlap of what presses, and give of what friction holds

    Attributes
    ----------
    contacts : `PartContactField` of the parts, with pressures and forces
    factorisations : of the tangent; none where neither contact nor plastic flow have changed it
    """

    def __init__(self, body: ToolBody, contacts, settings: ToolSettings = ToolSettings(), *, penalty_factor: float = 10.0,
                 augmentations: int | None = None, penetration: float = 1e-6):
        super().__init__(body, settings)        # of a body that cannot yield without any state at its points
        self.penetration, self.factorisations = penetration, 0
        dofs = global_dofs(body, np.arange(body.nodes.count))
        self.contacts = [
            PartContactField(body.nodes, body.state.kinematics, c.slave, c.master, dofs=dofs, owned=body.owned,
                             free=~body.is_held, element=c.element, friction=c.friction) for c in contacts]
        self._friction = any(contact.has_friction for contact in self.contacts)
        self.augmentations = augmentations if augmentations is not None else AUGMENTATIONS[self._friction]
        self._limited = self._friction and body.yields
        self._merged: PETSc.Mat | None = None
        self._factorised: list[np.ndarray] | None = None
        self._merged_at: list = []
        self._start: list = []      # the contacts at the start of a step
        self._same = self._anew = False
        self._touching = self._fresh = True
        stiffness = self._stiffness()
        for contact, given in zip(self.contacts, contacts, strict=True):
            contact.holder = given.holder
            contact.search(body.nodes.x, 1.0)
            contact.set_penalty(stiffness, penalty_factor)
            contact.begin()
            contact.declare(given.interference)
        self._given = contacts
        self._start = [contact.snapshot() for contact in self.contacts]
        self._find_limits()
        self._refuse_unlimited()
        self._respond()
        self._balanced = self._forces
        self.bulk.accept(None)
        self._touching = False

    def _bulk(self) -> PlasticBulk | ElasticBulk:
        return PlasticBulk(self.body) if self.body.yields else ElasticBulk(self.body, self.factor.form)

    def set_interference(self, part: float) -> None:
        """Let the parts of the next solve overlap by a part of what is declared: a way to bring it on in steps."""
        for contact, given in zip(self.contacts, self._given, strict=True):
            contact.declare(None if given.interference is None else part * given.interference)
        self._touching = True
        self._forces = self.internal_forces()
        self._touching = False

    def _stiffness(self) -> np.ndarray:
        """Diagonal of the elastic stiffness at the nodes, mean over the components, (nodes,), N/mm."""
        matrix = fem_petsc.assemble_matrix(self.factor.form)
        matrix.assemble()
        return self.body.nodal_forces(matrix.getDiagonal()).mean(axis=1)

    def solve(self, loads=(), *, held: float = 1.0, steps: int | None = None) -> int:
        """See `PlasticSolver.solve`; then the penetration is taken out under the same loads."""
        spent = super().solve(loads, held=held, steps=steps)
        for _ in range(self.augmentations):
            if self.relative_penetration() <= self.penetration:
                break
            before = [contact.multipliers() for contact in self.contacts]
            for contact in self.contacts:
                contact.augment()
            self._same = True
            self._forces = self.internal_forces()
            self._same = False
            try:
                spent += self._equilibrate(self.force, held, 1.0)
            except ConvergenceError:        # what is found already is in balance, with some penetration
                for contact, multipliers in zip(self.contacts, before, strict=True):
                    contact.set_multipliers(multipliers)
                self._take_back()
                break
            self._accept(self.force)
        return spent

    def relative_penetration(self) -> float:
        """Overlap of what presses and give of what friction holds, relative to the greatest displacement. Collective."""
        moved = highest(self.body.nodes.comm, float(np.abs(self.body.displacement.x.array).max(initial=0.0)))
        worst = max((contact.penetration() for contact in self.contacts), default=0.0)
        return worst / moved if moved > 0 else 0.0

    @property
    def friction_work(self) -> float:
        """What friction between the parts took since the start, mJ. Collective."""
        return float(sum(contact.works()[0] for contact in self.contacts))

    @property
    def interference_work(self) -> float:
        """What overlaps gave to the parts that they press apart since the start, mJ. Collective."""
        return float(sum(contact.works()[1] for contact in self.contacts))

    def compliance(self, dofs: np.ndarray) -> np.ndarray:
        """See `compliance.compliance`, by the tangent of the parts and of the contact that is closed now. Collective."""
        self.bulk.use_accepted_tangent()
        self._factorise_tangent()
        return compliance(self.body, self._direct, dofs)

    def state(self) -> tuple:
        """See `PlasticSolver.state`; the contacts of the parts go along."""
        return (*super().state(), [contact.snapshot() for contact in self.contacts])

    def go_back(self, state: tuple) -> None:
        """Take over what :meth:`state` gave."""
        for contact, then in zip(self.contacts, state[-1], strict=True):
            self._restore(contact, then)
        self._start = state[-1]
        super().go_back(state[:-1])

    def go_on_with_contacts(self, fresh: bool) -> None:
        """The contacts have taken over an accepted state of an earlier run; ``fresh`` if nothing was accepted yet."""
        self._start, self._fresh = [contact.snapshot() for contact in self.contacts], fresh
        self._find_limits()

    def _restore(self, contact: PartContactField, then: tuple) -> None:
        """A contact as it was, with the pairing of then."""
        vector, body = None, self.body
        if then[0] is not None:
            vector, owned = body.new_vector(), body.dofs < body.owned
            vector.array[body.dofs[owned]] = then[0][owned]
        contact.restore(then, vector)

    def _advice(self) -> str:
        slide = "its parts slide or part, and nothing else holds them: try smaller loads, more friction or supports"
        return f"{slide}; or {super()._advice()}" if self.body.yields else slide

    # ------------------------------------------------------------------ contact in Newton's iteration
    def _step_elastically(self, target: PETSc.Vec, held: float) -> bool:
        """Contact opens and closes: one linear solve is no solution."""
        return False

    def internal_forces(self) -> PETSc.Vec:
        """Nodal forces that stresses, springs and contact hold in balance, N."""
        vector = super().internal_forces()
        for contact in self.contacts:
            limit = contact.softer(self._yield_stress) if self._limited and contact.has_friction else None
            touching = max(TOUCHING * contact.smallest_side, contact.least_gap()) if self._touching else None
            contact.respond(self.body.displacement.x.petsc_vec, flow_stress=limit, touching=touching, same=self._same,
                            anew=self._anew)
            vector.axpy(-1.0, contact.forces())
        return vector

    def _take_back(self) -> None:
        self._touching = self._fresh
        for contact, then in zip(self.contacts, self._start, strict=True):
            if contact.paired is not then[0]:
                self._restore(contact, then)
        super()._take_back()
        self._touching = False
        self.bulk.use_accepted_tangent()        # the next increment starts with it

    def _accept(self, force: PETSc.Vec) -> None:
        super()._accept(force)
        self._fresh = False
        for contact in self.contacts:
            contact.accept()
        self._find_limits()

    def _refuse_unlimited(self) -> None:
        """Friction that only the yield stress limits needs parts that can yield. Collective."""
        for number, contact in enumerate(self.contacts):
            if not contact.has_friction or contact.friction.sticks or contact.friction.law == "coulomb":
                continue
            limit = contact.softer(self._yield_stress) if self._limited else np.full(1, UNLIMITED)
            if highest(self.body.nodes.comm, float(limit.max(initial=0.0))) > 0.5 * UNLIMITED:
                raise ValueError(f"contact {number}: '{contact.friction.law}' friction is a part of the yield stress, and "
                                 "neither part can yield; give a yield_stress to one, or take 'coulomb'")

    def _find_limits(self) -> None:
        """Yield stress at the nodes, (nodes,) MPa, in the accepted state: it limits the friction of the step to come."""
        if not self._limited:
            return
        body = self.body
        strain = np.maximum(at_nodes(body, self.plastic.effective[:, None])[:, 0], 0.0)
        self._yield_stress = np.full(body.nodes.count, UNLIMITED)
        for law, cells in body.parts:
            own = np.unique(body.nodes.mesh.geometry.dofmap[cells])
            self._yield_stress[own] = np.minimum(law.yield_stress_at(strain[own]), UNLIMITED)

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

    def _usual_force(self, target: PETSc.Vec) -> float:
        """See `PlasticSolver._usual_force`; without the forces after the first increment, which flings off what contact
        does not hold yet."""
        return max(self._largest_force, target.norm(), self._driving)

    def _equilibrate(self, target: PETSc.Vec, held: float, heat: float) -> int:
        self._target, self._increments = target, 0
        self._start = [contact.snapshot() for contact in self.contacts]
        try:
            return super()._equilibrate(target, held, heat) + self._follow_slides(target)
        except ConvergenceError:
            if not self._friction:
                raise
        self._take_back()
        self._increments = 0
        self._let_creep(CREEP)
        try:
            return super()._equilibrate(target, held, heat) + self._follow_slides(target)
        finally:
            self._let_creep(0.0)

    def _follow_slides(self, target: PETSc.Vec) -> int:
        """Pair parts anew where the step has brought them, and find the balance there; the iterations. Collective."""
        spent = 0
        for _ in range(PAIRINGS):
            moved = self.body.nodal()
            slid = [contact for contact in self.contacts if contact.has_slid() and not contact.is_pressed_flat(moved)]
            if not slid:
                break
            for contact in slid:
                contact.pair_again(moved, self.body.displacement.x.petsc_vec)
            self._increments, self._anew = 0, True
            self._forces = self.internal_forces()
            self._anew = False
            self._elastic_increment(target)
            spent += self._iterate(target)
        return spent

    @property
    def _most_iterations(self) -> int:
        return (CREEP_ITERATIONS if any(contact.creep for contact in self.contacts) else 1) * self.settings.max_iterations

    def _let_creep(self, part: float) -> None:
        for contact in self.contacts:
            contact.creep = part

    def _tangent_increment(self) -> None:
        """The increment by the tangent; from the fourth on halved while it makes the imbalance worse."""
        before = self._out_of_balance.norm()
        super()._tangent_increment()
        self._increments += 1
        if self._increments < SEARCH_FROM:
            return
        for _ in range(HALVINGS):
            self._respond()
            if self._imbalance(self._target) < ENOUGH * before:
                break
            self._increment.x.array[:] *= 0.5
            self.body.displacement.x.array[:] -= self._increment.x.array

    def _factorise_tangent(self) -> None:
        now = [self.bulk.tangents] + [contact.tangents for contact in self.contacts]
        paired = [contact.paired for contact in self.contacts]
        if len(self._merged_at) == len(paired) and any(a is not b for a, b in zip(paired, self._merged_at, strict=True)):
            self._merged = self._direct = self._factorised = None
        self._merged_at = paired
        known = self._factorised is not None and all(map(np.array_equal, now, self._factorised))
        if total(self.body.nodes.comm, float(known)) == self.body.nodes.comm.size:
            return
        self._matrix = self.bulk.tangent(self._matrix)
        if self._merged is None:
            self._merged = self._matrix.copy()
            structure = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
        else:
            self._merged.zeroEntries()
            structure = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
            self._merged.axpy(1.0, self._matrix, structure=structure)
        for contact in self.contacts:
            self._merged.axpy(1.0, contact.tangent(), structure=structure)
        if self._direct is None:
            self._direct = DirectSolver(self._merged, symmetric=not self._friction)
        self._direct.factorise()
        self._factorised, self.factorisations = now, self.factorisations + 1
