"""Points that close and open are settled together with the increment, not one Newton iteration after the other.

Contact is linear in the velocity but for the question which points are closed. An increment of the linearised flow that
was found with the wrong ones pulls open points to the tool, or lets pressing ones go; the stress of the material follows
that, and takes iterations to recover. So the linear system is solved again with the points that its own answer closes,
until these are the same: that is the linearised flow under unilateral contact, whose increment has no such faults (the
semi-smooth Newton of M. Hintermueller, K. Ito, K. Kunisch, SIAM J. Optim. 13, 2002, 865, within each iteration). It pays
where solving again is cheap: by iterations that start from the answer before, or by the factors of before where few points
have changed (``resolving``), not by another factorisation.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from .contact import point_law as law
from .parallel import total
from .workpiece import Workpiece

MOST = 3        # times that an iteration is solved again


class Settling:
    """The closed points of the contact of a workpiece with its tools, for one linear system after another.

    Parameters
    ----------
    most : points that may close or open; more are left to the next iteration of the Newton. None: any number
    """

    def __init__(self, workpiece: Workpiece, most: int | None = None):
        self._body, self._contact, self._most = workpiece, workpiece.contact, most

    def settle(self, system, b: PETSc.Vec, solve, border) -> None:
        """Follow the contact of the increment that was found, with that of the motions of tools that a ``border`` seeks,
        and ``solve(b)`` again. Collective."""
        self.begin()
        for _ in range(MOST):
            change = self._follow({} if border is None else border.coming())
            if change is None:
                return
            self._add_forces(b, change)
            system.follow_contact()
            solve(b)
            if system.stands:
                return

    def begin(self) -> None:
        """No point has closed or opened yet."""
        self._seen = {tool.name: np.zeros(len(tool.state.active), bool) for tool in self._contact.tools}

    def _follow(self, coming: dict[str, np.ndarray]) -> np.ndarray | None:
        """Close the points that the increment closes, and no others; the change of the tractions on the body at the contact
        points (points, dim), N/mm², or None where there is none. ``coming``: new velocities of tools that are not given."""
        body, contact = self._body, self._contact
        v, dv = body.velocity, body.increment.x.array[body.velocity_dofs]
        before, after = contact.facets.trace(v), contact.facets.trace(v + dv)
        pressures = [law.trial_pressure(t.state, after, contact.coefficient, contact.dt, coming.get(t.name))
                     for t in contact.tools]
        closed = [self._allowed(t, law.pressing(t.state, pressure, contact.coefficient, contact.speed))
                  for t, pressure in zip(contact.tools, pressures, strict=True)]
        changed = sum(np.count_nonzero(c != t.state.active) for c, t in zip(closed, contact.tools, strict=True))
        changed = total(contact.facets.comm, float(changed))
        if changed == 0 or self._most is not None and changed > self._most:
            return None
        old = sum(t.traction for t in contact.tools)
        for tool, now in zip(contact.tools, closed, strict=True):
            self._take_over(tool, now, before)
        new = sum(t.traction for t in contact.tools)
        contact.facets.set_traction(new, sum(t.tangent for t in contact.tools))
        return new - old

    def _allowed(self, tool, closed: np.ndarray) -> np.ndarray:
        """Which of the points ``closed`` (points,) bool by the increment are taken for closed."""
        return closed

    def _take_over(self, tool, now: np.ndarray, velocity: np.ndarray) -> None:
        """The points ``now`` (points,) bool are closed: traction and tangent of the tool at the velocities (points, dim) of
        before the increment. A point that closes and opens for its friction is calmed: see `point_law.follow_contact`."""
        state, contact, seen = tool.state, self._contact, self._seen[tool.name]
        changes = now != state.active
        state.pace = np.where(changes & seen, 0.5 * state.pace, state.pace)
        state.grip = np.where(changes, state.grip + state.pace * (now - state.grip), state.grip)
        self._seen[tool.name] = seen | changes
        state.active = now
        state.pressure = np.where(now, law.trial_pressure(state, velocity, contact.coefficient, contact.dt), 0.0)
        tool.traction, tool.tangent = law.normal_response(state, contact.coefficient)
        if tool.has_friction:
            rubbing, resistance = law.friction_response(state, contact.limit(tool), contact.slip0_now)
            tool.traction, tool.tangent = tool.traction + rubbing, tool.tangent + resistance

    def _add_forces(self, b: PETSc.Vec, traction: np.ndarray) -> None:
        """Add the nodal forces of tractions (points, dim) to the right-hand side, where velocities are sought."""
        body, facets = self._body, self._contact.facets
        forces = facets.nodal_forces(traction)
        added = np.zeros(len(body.solution.x.array))
        np.add.at(added, body.velocity_dofs.ravel(), forces.ravel())
        added[body.fixed_dofs] = 0.0
        change = b.duplicate()
        with change.localForm() as local:
            local.array[:] = added
        change.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        b.axpy(1.0, change)
        change.destroy()
