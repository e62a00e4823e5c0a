r"""How much of an increment of the Newton is taken, where all of it would go too far.

Along an increment :math:`d` the residual of a dissipative flow does the power :math:`g(s)=R(v+s\,d)\cdot d`, which rises
with the share :math:`s` from below zero. Where little holds a body, a strip between rolls that only friction drives, the
linearised flow knows next to no resistance until friction turns round: the whole increment then has :math:`g(1)\gg 0`. The
share for which the power is nearly nothing is found by the false position with the step of Illinois (M. Dowell,
P. Jarratt, BIT 11, 1971, 168).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from .contact import point_law as law
from .contact.rigid import RigidContact
from .node_kernels import sums_of_squares
from .parallel import total
from .workpiece import Workpiece

LARGE = 0.8         # of the velocities: smaller increments are taken as they are, and so find rigid zones sooner
UPHILL = 0.5        # of the power at the start: what a whole increment may do
SETTLED = 0.3       # of the power at the start: what may be left
MOST = 20           # evaluations of the residual


def share_of(power: Callable[[float], float]) -> float:
    """The share of an increment that is taken, for the power g(share) of the residual on the increment, mW."""
    start, end = power(0.0), power(1.0)
    if not start < 0 or end <= UPHILL * abs(start):
        return 1.0
    low, high, below, above, side, share = 0.0, 1.0, start, end, 0, 1.0
    for count in range(MOST):
        # every third time in the middle: a residual of many powers of ten holds the false position up
        share = 0.5 * (low + high) if count % 3 == 1 else (low * above - high * below) / (above - below)
        now = power(share)
        if abs(now) < SETTLED * abs(start):
            break
        if now < 0:
            low, below, above = share, now, above / 2 if side < 0 else above
        else:
            high, above, below = share, now, below / 2 if side > 0 else below
        side = -1 if now < 0 else 1
    return share


class LineSearch:
    """The shares that a workpiece takes of its increments."""

    def __init__(self, workpiece: Workpiece):
        self._body = workpiece

    @staticmethod
    def fits(workpiece: Workpiece) -> bool:
        """Whether known tools are all that touches the body, and no inertia holds it."""
        return workpiece.contact is not None and workpiece.interfaces is None and workpiece.mass is None

    def share(self, residual_power: Callable[[PETSc.Vec], float]) -> float:
        """How much of the increment is taken; less than all where it is large and all would go too far. Collective.

        Parameters
        ----------
        residual_power : f(vector) → power of the residual at the present velocities on other ones, mW; collective. Not
            kept: a solver that its own line search knows would outlive its mesh until garbage is collected
        """
        body = self._body
        v, dv = body.solution.x.array, body.increment.x.array
        squares = total(body.nodes.comm, sums_of_squares(dv, v + dv, body.owned_velocity_dofs))
        if squares[0] <= LARGE**2 * squares[1]:
            return 1.0
        traction = body.contact.facets.traction_function.x.array
        kept = v.copy(), traction.copy()

        def power(share: float) -> float:
            v[:] = kept[0] + share * dv
            there = tractions(body.contact, body.velocity)
            traction[: there.size] = there.ravel()
            return residual_power(body.increment.x.petsc_vec)

        share = share_of(power)
        v[:], traction[:] = kept
        return share


def tractions(contact: RigidContact, velocity: np.ndarray) -> np.ndarray:
    """Tractions of all tools on the body (points, dim), N/mm², at other nodal velocities (nodes, dim), with the flow stress
    of the last response; nothing is kept."""
    v, found = contact.facets.trace(velocity), np.zeros((contact.facets.count, contact.facets.dim))
    for tool in contact.tools:
        state = tool.state
        trial = law.trial_pressure(state, v, contact.coefficient, contact.dt)
        pressure, closed = np.maximum(trial, 0.0), trial > 0
        found += pressure[:, None] * state.normal
        if tool.has_friction:
            slip = law.slip_velocity(state, v)
            limit = np.where(closed, contact.limit_under(tool, pressure, closed.astype(float)), 0.0)
            found -= (limit / np.sqrt(np.einsum("pi,pi->p", slip, slip) + contact.slip0_now**2))[:, None] * slip
    return found
