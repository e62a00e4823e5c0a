"""Contact of two parts of a tool, in displacements: friction with memory, work, multipliers."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from ..parallel import highest, lowest, total
from . import point_law as law
from .bodies import BodyContact
from .holding import Hold, augmented, held_places, hold

STEEPEST = 1.0       # friction over pressure, at most, of laws that know no pressure: what opens lets go little by little
UNLIMITED = 1e30     # yield stress of a part that cannot yield, MPa: its friction is not limited by it


class PartContactField(BodyContact):
    """What two parts of a tool do to one another, from one accepted load step to the next.

    ``respond`` gives the tractions of a trial; ``accept`` makes the trial the state that friction remembers.

    Attributes
    ----------
    coefficient : (carriers,) penalty, N/mm³
    friction_work, interference_work : mJ of this rank, done since the start by friction (a loss), and by the normal
        tractions (what an interference gives to the parts)
    """

    friction_work = interference_work = 0.0
    creep = 0.0         # see `holding.hold`

    def begin(self) -> None:
        """Nothing has been carried yet, whatever overlap the parts have. Collective."""
        ends = self.nodes.x[self.points.sides[:, :2]]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        self.smallest_side = lowest(self.nodes.comm, float(length.min(initial=np.inf)))
        count, dim = len(self.weights), self.dim
        self._hold = Hold(np.zeros((count, dim)), np.zeros((count, dim, dim)), np.zeros((count, dim)),
                          np.zeros(count, bool))
        self._carried = np.zeros((count, dim)), np.zeros((count, dim)), np.zeros((count, dim))

    def respond(self, unknowns: PETSc.Vec, *, flow_stress: np.ndarray | None = None,
                touching: float | None = None, same: bool = False) -> None:
        """Tractions on the slave and their tangents for the present displacements.

        flow_stress : (carriers,) yield stress that limits friction; touching : gap below which every carrier is closed;
        same : what slipped slips, what held holds, as multipliers have changed that leave an imbalance for once
        """
        state, relative = self.state, self.relative(unknowns)
        closed = None if touching is None else state.gap <= touching
        law.normal_pressure(state, relative, self.coefficient, self.dt, closed)
        self.traction, self._tangent = law.normal_response(state, self.coefficient)
        self._relative = relative
        if self.has_friction:
            pressure, yield_stress = state.pressure, UNLIMITED if flow_stress is None else flow_stress
            limit, rise = self.friction.limit(pressure, yield_stress), self.friction.rise(pressure, yield_stress)
            if not (self.friction.depends_on_pressure or self.friction.sticks):
                steep = pressure < limit / STEEPEST
                limit, rise = np.where(steep, STEEPEST * pressure, limit), np.where(steep, STEEPEST, rise)
            if closed is not None:
                limit = np.where(closed & ~self._hold.slips, UNLIMITED, limit)      # what touches holds in the first guess
            self._hold = hold(state, relative, limit, rise, stiffness=self.coefficient, penalty=self.coefficient,
                              slips=self._hold.slips if same else None, creep=self.creep)
            self.traction = self.traction + self._hold.traction
            self._tangent = self._tangent + self._hold.tangent

    def least_gap(self) -> float:
        """The least gap of a carrier, mm; infinite where none is over the other part. Collective."""
        return lowest(self.nodes.comm, float(self.state.gap.min(initial=np.inf)))

    def accept(self) -> None:
        """The state of the last trial is that of the parts now."""
        across = self.traction - self._hold.traction
        before_across, before_along, before = self._carried
        way = (self._relative - before) * self.weights[:, None]
        self.interference_work += 0.5 * float(np.einsum("pi,pi->", across + before_across, way))
        self.friction_work -= 0.5 * float(np.einsum("pi,pi->", self._hold.traction + before_along, way))
        self._carried = across, self._hold.traction, self._relative
        if self.has_friction:
            self.state.slip = held_places(self.state, self._hold, self.coefficient)
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
