"""Contact of two parts of a tool, in displacements: friction with memory, work, multipliers, pairing where they slide."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from ..parallel import highest, lowest, total
from . import point_law as law
from .bodies import BodyContact, everywhere
from .holding import Hold, augmented, held_places, hold
from .slave_points import SlavePoints
from .surface_turn import BENT, Turned, turned_with

STEEPEST = 1.0       # friction over pressure, at most, of laws that know no pressure: what opens lets go little by little
UNLIMITED = 1e30     # yield stress of a part that cannot yield, MPa: its friction is not limited by it
MOSTLY = 0.5         # of the greatest displacement of a surface: if it slides by less, its bending is not that of a belt
SLIDE = 0.1          # of the smallest side: parts that have slid farther since they were paired meet other sides


class PartContactField(BodyContact):
    """What two parts of a tool do to one another, from one accepted load step to the next.

    ``respond`` gives the tractions of a trial; ``accept`` makes the trial the state that friction remembers.

    Attributes
    ----------
    coefficient, holding : (carriers,) penalty across the surface, and along it where points hold, N/mm³
    holder : name of the part of the slave
    paired : (nodes, dim) mm, displacement at which points and sides were paired, None as the mesh lies
    friction_work, interference_work : mJ of this rank, done since the start by friction (a loss), and by the normal
        tractions (what an interference gives to the parts)
    """

    sees_held = True
    friction_work = interference_work = 0.0
    holder = ""
    creep = 0.0         # see `holding.hold`
    paired: np.ndarray | None = None
    _turned: tuple[np.ndarray, np.ndarray] | None = None        # rotations of the sides of slave and master, as paired
    _grouped_by: np.ndarray | None = None
    _interference: float | None = None      # declared

    def begin(self) -> None:
        """Nothing has been carried yet, whatever overlap the parts have. Collective."""
        self._base = self._known = self.state.gap.copy()
        ends = self.nodes.x[self.points.sides[:, :2]]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        self.smallest_side = lowest(self.nodes.comm, float(length.min(initial=np.inf)))
        count, dim = len(self.weights), self.dim
        self._hold = Hold(np.zeros((count, dim)), np.zeros((count, dim, dim)), np.zeros((count, dim)),
                          np.zeros(count, bool))
        self._carried = np.zeros((count, dim)), np.zeros((count, dim)), np.zeros((count, dim))

    def set_penalty(self, stiffness: np.ndarray, factor: float) -> None:
        """Penalties from the diagonal of the elastic stiffness, (nodes,) N/mm, of both surfaces per area. Collective.

        Across the surface ``factor`` times the greater of the two, k_s and k_m: where the mesh is fine or the metal stiff
        the surface is stiff.  Along it sqrt(k_s k_m): with the greater one parts of very unequal stiffness hold and slip by
        turns, with the lesser one ten multipliers do not take out the give.
        """
        master = SlavePoints(self._master, self.points.kinematics, self.dim, self.element)
        of_slave, of_master = (_per_area(points, self.nodes.x, stiffness) for points in (self.points, master))
        of_slave = of_slave.repeat(self.points.per_side)
        of_master = everywhere(self.nodes.comm, of_master)[self._found.facet]
        self.coefficient, self.holding = (factor * self._mean_or_usual(of_both) for of_both in (
            np.maximum(of_slave, of_master), np.sqrt(of_slave * of_master)))

    def _mean_or_usual(self, at_points: np.ndarray) -> np.ndarray:
        """Means over the carriers, (carriers,); of those over nothing yet, the mean of the others. Collective."""
        found = np.where(self.weights > 0, self.mean(at_points), 0.0)
        sums = total(self.nodes.comm, np.array([found.sum(), (found > 0).sum()]))
        return np.where(found > 0, found, sums[0] / max(sums[1], 1.0))

    def respond(self, unknowns: PETSc.Vec, *, flow_stress: np.ndarray | None = None,
                touching: float | None = None, same: bool = False, anew: bool = False) -> None:
        """Tractions on the slave and their tangents for the present displacements.

        flow_stress : (carriers,) yield stress that limits friction; touching : gap below which every carrier is closed;
        same : what slipped slips, what held holds, as multipliers have changed that leave an imbalance for once
        anew : just paired anew: what pressed is closed, whatever the new gaps say for once, and slips or holds as it did
        """
        state, relative = self.state, self.relative(unknowns)
        closed = state.active & (self.weights > 0) if anew else None if touching is None else state.gap <= touching
        law.normal_pressure(state, relative, self.coefficient, self.dt, closed)
        self.traction, self._tangent = law.normal_response(state, self.coefficient)
        self._relative = relative
        if self.has_friction:
            pressure, yield_stress = state.pressure, UNLIMITED if flow_stress is None else flow_stress
            limit, rise = self.friction.limit(pressure, yield_stress), self.friction.rise(pressure, yield_stress)
            if not (self.friction.depends_on_pressure or self.friction.sticks):
                steep = pressure < limit / STEEPEST
                limit, rise = np.where(steep, STEEPEST * pressure, limit), np.where(steep, STEEPEST, rise)
            if touching is not None:
                limit = np.where(closed & ~self._hold.slips, UNLIMITED, limit)      # what touches holds in the first guess
            self._hold = hold(state, relative, limit, rise, stiffness=self.holding, penalty=self.coefficient,
                              slips=self._hold.slips if same or anew else None, creep=self.creep)
            self.traction = self.traction + self._hold.traction
            self._tangent = self._tangent + self._hold.tangent

    # ------------------------------------------------------------------ pairing
    def declare(self, interference: float | None) -> None:
        """Points over the other part overlap by this at the start, mm, whatever gap the mesh has; None: by that gap."""
        self._interference = interference
        gap = self._base
        if interference is not None:
            known = np.isfinite(self._known)
            usual = total(self.nodes.comm, np.array([self._known[known].sum(), known.sum()]))
            gap = gap - np.where(known, self._known, usual[0] / max(usual[1], 1.0)) - interference
        self.state.gap = np.where(np.isfinite(self._base), gap, np.inf)

    def has_slid(self) -> bool:
        """Whether parts that press on one another have slid so far that they meet other sides. Collective."""
        return self._slide(self._paired_at()) > SLIDE * self.smallest_side

    def _slide(self, since: np.ndarray | float) -> float:
        """How far points that press on one another have slid, mm, since a relative displacement. Collective."""
        slid = np.linalg.norm(self._along(self._relative - since), axis=1)[self.state.active]
        return highest(self.nodes.comm, float(slid.max(initial=0.0)))

    def is_pressed_flat(self, displacement: np.ndarray) -> bool:
        """Whether displacements (nodes, dim) bend a surface without that it slides, as a ball that is pressed flat: it lies
        as it is, as small strains have it, and keeps the sides that it meets. Collective."""
        return any(turned.bent > BENT and self._slide(0.0) < MOSTLY * turned.most for turned in self._turns(displacement))

    def _turns(self, displacement: np.ndarray) -> list[Turned]:
        """How displacements (nodes, dim) turn the surfaces of slave and master. Collective."""
        return [turned_with(self.nodes, sides, displacement) for sides in (self.points.sides, self._master)]

    def _paired_at(self) -> np.ndarray:
        """Relative displacement at which the parts were paired, (carriers, dim)."""
        return np.zeros((len(self.weights), self.dim)) if self.paired is None else self._relative_then

    def pair_again(self, displacement: np.ndarray, unknowns: PETSc.Vec) -> None:
        """Pair points and sides where a trial has brought them, nodal displacements (nodes, dim), also as ``unknowns``:
        what they have slid in the step, and held at its start, stays what it is. Collective."""
        before, over, pressed = self._relative, self.weights > 0, self.state.active
        self.pair_at(displacement, unknowns)
        further = self._relative_then - before
        # what has come over the other part in this step, or left it, has slid in it as the others have
        way = np.where(pressed[:, None], before - self._carried[2], 0.0)
        sums = total(self.nodes.comm, np.array([*way.sum(axis=0), pressed.sum()]))
        over &= self.weights > 0
        start = np.where(over[:, None], self._carried[2] + further, self._relative_then - sums[:-1] / max(sums[-1], 1.0))
        if self.has_friction:
            self.state.slip = np.where(over[:, None], self.state.slip + self._along(self._relative_then) - self._hold.along,
                                       self._along(start))
        self._carried = *self._carried[:2], start

    def pair_at(self, displacement: np.ndarray | None, unknowns: PETSc.Vec | None) -> None:
        """Pair points and sides at these displacements (nodes, dim), also given as ``unknowns``. Collective."""
        self._turned, x = None, self.nodes.x
        if displacement is not None:
            own, other = self._turns(displacement)
            x = own.x
            x[self._master] = other.x[self._master]
            self._turned = own.rotation.repeat(self.points.per_side, axis=0), everywhere(self.nodes.comm, other.rotation)
        self.search(x, self.dt)
        self.paired, gap = displacement, self.state.gap
        relative = self._relative_then = np.zeros((len(self.weights), self.dim)) if displacement is None else \
            self.relative(unknowns)
        self._base = gap - np.where(np.isfinite(gap), np.einsum("pi,pi->p", relative, self.state.normal), 0.0)
        self.declare(self._interference)

    def _along(self, relative: np.ndarray) -> np.ndarray:
        normal = self.state.normal
        return relative - np.einsum("pi,pi->p", relative, normal)[:, None] * normal

    def _surface(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """That of the mesh: tractions are over it, as stresses of small strains are; normals where the parts are now."""
        return self.points.surface(self.nodes.x)[0], self.points.surface(x)[1]

    def _find_frames(self) -> None:
        """Each part in the frames that its sides have turned with: normals as the slave sees them."""
        self._frames = None
        if self._turned is not None:
            own, other = self._turned
            self._frames = own.swapaxes(1, 2) @ other[self._found.facet]
            self._found = replace(self._found, normal=np.einsum("pj,pji->pi", self._found.normal, own))

    def _carry(self) -> None:
        """As at the start: elastic displacements make no edge sharp. Collective."""
        if self._grouped_by is None:
            self._grouped_by = self._normals
        self._normals = self._grouped_by
        super()._carry()

    # ------------------------------------------------------------------ going back
    def snapshot(self) -> tuple:
        """The accepted state, for :meth:`restore`."""
        return (self.paired, copy.deepcopy(self.state), self._hold, self._carried, self.friction_work,
                self.interference_work)

    def restore(self, snapshot: tuple, unknowns: PETSc.Vec | None) -> None:
        """Take over what :meth:`snapshot` gave; ``unknowns`` of the displacement that parts are paired at. Collective."""
        if self.paired is not snapshot[0]:
            self.pair_at(snapshot[0], unknowns)
        self.state = copy.deepcopy(snapshot[1])
        self._hold, self._carried, self.friction_work, self.interference_work = snapshot[2:]

    def least_gap(self) -> float:
        """The least gap of a carrier, mm; infinite where none is over the other part. Collective."""
        return lowest(self.nodes.comm, float(self.state.gap.min(initial=np.inf)))

    def accept(self) -> None:
        """The state of the last trial is that of the parts now."""
        surface = self.weights[:, None]
        across, along = surface * (self.traction - self._hold.traction), surface * self._hold.traction
        before_across, before_along, before = self._carried
        way = self._relative - before
        self.interference_work += 0.5 * float(np.einsum("pi,pi->", across + before_across, way))
        self.friction_work -= 0.5 * float(np.einsum("pi,pi->", along + before_along, way))
        self._carried = across, along, self._relative
        if self.has_friction:
            self.state.slip = held_places(self.state, self._hold, self.holding)
            self.state.friction_stress = np.where(self.state.active[:, None], self.state.friction_stress, 0.0)

    def augment(self) -> None:
        """Augmented-Lagrange update: pressure and friction of the accepted state become the multipliers."""
        super().augment()
        if self.has_friction:
            self.state.friction_stress, self.state.slip = augmented(self.state, self._hold)

    def multipliers(self) -> tuple[np.ndarray, ...]:
        """What :meth:`augment` changes: multipliers of pressure and friction, and where points hold."""
        return self.state.multiplier, self.state.friction_stress, self.state.slip

    def set_multipliers(self, multipliers: tuple[np.ndarray, ...]) -> None:
        """Take back what :meth:`augment` has done since :meth:`multipliers`."""
        self.state.multiplier, self.state.friction_stress, self.state.slip = multipliers

    def penetration(self) -> float:
        """Greatest overlap left where pressure acts, and greatest give of points that hold, mm. Collective."""
        state = self.state
        closing = -np.einsum("pi,pi->p", self._relative, state.normal)
        overlap = np.abs(closing - state.gap / self.dt)[state.active]
        worst = float(overlap.max(initial=0.0))
        if self.has_friction:
            held = state.active & ~self._hold.slips
            worst = max(worst, float(np.linalg.norm(self._hold.along - state.slip, axis=1)[held].max(initial=0.0)))
        return highest(self.nodes.comm, worst)

    @property
    def tangents(self) -> np.ndarray:
        """The tangents of the last response, (points, dim, dim), N/mm³."""
        return self._tangent

    def works(self) -> np.ndarray:
        """Friction work and interference work of all ranks, (2,), mJ. Collective."""
        return total(self.nodes.comm, np.array([self.friction_work, self.interference_work]))


def _per_area(points: SlavePoints, x: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Mean stiffness of the nodes of every side over its surface, (sides,) N/mm³."""
    shape = len(points.sides), points.per_side
    at_points, surface = points.trace(stiffness).reshape(shape), points.surface(x)[0].reshape(shape)
    return np.einsum("fq,fq->f", at_points, surface) / surface.sum(axis=1) ** 2
