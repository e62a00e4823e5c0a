r"""What happens at one contact point: normal pressure, release, friction.  Vectorised; no mesh, no MPI.

Normal: with the gap :math:`g` (open positive), the normal :math:`n` out of the tool and the closing speed
:math:`c_n=(v-v_t)\cdot(-n)`,

.. math:: p = \langle \lambda + C\,(c_n - g/\Delta t)\rangle_+ ,

so a point that will reach the tool within the step lands on it.  Friction is a rate potential and gets the
stress-velocity linearisation of the flow itself (FORMULATION.md 1): with the slip
:math:`v_s=(I-nn)(v-v_t)`, :math:`|v_s|^2=v_s\cdot v_s+v_0^2` and the limit :math:`\tau_l`,

.. math:: t=-\tau_l v_s/|v_s|,\qquad
          -\partial t/\partial v \approx \big(\tau_l (I-nn) - \mathrm{sym}(\hat s\otimes v_s)/|v_s|\big)/|v_s| ,

where :math:`\hat s`, the friction stress carried along as an independent field, is cut to the limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class PointState:
    """Data of one tool at the contact points: (points,) scalars, (points, dim) vectors.

    gap mm · normal · tool_velocity mm/s · multiplier N/mm² (vector) · friction_stress N/mm² · slip mm/s ·
    pressure N/mm² · active · grip, the share of the friction limit that acts: 1 closed, 0 open, between where a point
    grazes (any value is admissible at zero pressure) · pace of the grip in an iteration · before, whether it was active in
    the solve before
    """

    gap: np.ndarray
    normal: np.ndarray
    tool_velocity: np.ndarray
    multiplier: np.ndarray
    friction_stress: np.ndarray
    slip: np.ndarray
    pressure: np.ndarray
    active: np.ndarray
    grip: np.ndarray
    pace: np.ndarray
    before: np.ndarray

    @classmethod
    def at_rest(cls, count: int, dim: int) -> PointState:
        vector = lambda: np.zeros((count, dim))  # noqa: E731
        return cls(np.full(count, np.inf), vector(), vector(), vector(), vector(), vector(), np.zeros(count),
                   np.zeros(count, dtype=bool), np.zeros(count), np.ones(count), np.zeros(count, dtype=bool))


def trial_pressure(state: PointState, velocity: np.ndarray, coefficient: float, dt: float,
                   tool_velocity: np.ndarray | None = None) -> np.ndarray:
    """Normal pressure that closed points would have, negative where they would be pulled, (points,); also under a tool of
    another velocity (points, dim)."""
    tool_velocity = state.tool_velocity if tool_velocity is None else tool_velocity
    closing = np.einsum("pi,pi->p", tool_velocity - velocity, state.normal)
    multiplier = np.einsum("pi,pi->p", state.multiplier, state.normal)
    return multiplier + coefficient * (closing - state.gap / dt)


def normal_pressure(state: PointState, velocity: np.ndarray, coefficient: float, dt: float,
                    touching: np.ndarray | None = None) -> None:
    """Update ``pressure`` and ``active``; points in ``touching`` count as active whatever their sign."""
    trial = trial_pressure(state, velocity, coefficient, dt)
    state.active = trial > 0 if touching is None else (trial > 0) | touching
    state.pressure = np.where(state.active, trial, 0.0)


def follow_contact(state: PointState, before: np.ndarray | None) -> None:
    """Update ``grip``: at once where ``before`` is None, else the more slowly the more often a point opens and closes.

    A point that opens loses all of its friction, which may close it again: such cycles never end by themselves. The pace
    of a point is halved when it differs from ``before``, (points,) active in the last iteration, and grows slowly while it
    does not (more slowly than doubling: cycles of period three and four must lose pace too).
    """
    if before is None:
        state.pace = np.ones(len(state.grip))
    else:
        state.pace = np.where(before == state.active, np.minimum(1.0, 1.2 * state.pace), 0.5 * state.pace)
    state.grip = state.grip + state.pace * (state.active - state.grip)


def slip_velocity(state: PointState, velocity: np.ndarray) -> np.ndarray:
    """Tangential velocity of the material relative to the tool, (points, dim), mm/s."""
    relative = velocity - state.tool_velocity
    return relative - np.einsum("pi,pi->p", relative, state.normal)[:, None] * state.normal


def regularised_norm(slip: np.ndarray, slip0: float) -> np.ndarray:
    return np.sqrt(np.einsum("pi,pi->p", slip, slip) + slip0**2)


def normal_response(state: PointState, coefficient: float) -> tuple[np.ndarray, np.ndarray]:
    """Normal traction on the body (points, dim) and its tangent (points, dim, dim)."""
    n = state.normal
    traction = state.pressure[:, None] * n
    tangent = np.where(state.active, coefficient, 0.0)[:, None, None] * n[:, :, None] * n[:, None, :]
    return traction, tangent


def friction_response(state: PointState, limit: np.ndarray, slip0: float) -> tuple[np.ndarray, np.ndarray]:
    """Friction traction on the body and its tangent for a limit (points,), N/mm²; nothing where contact is open."""
    slip, n = state.slip, state.normal
    norm = regularised_norm(slip, slip0)
    limit = state.grip * limit
    stress = cut_to_limit(state.friction_stress, limit)
    projector = np.eye(slip.shape[1]) - n[:, :, None] * n[:, None, :]
    cross = stress[:, :, None] * slip[:, None, :]
    cross = 0.5 * (cross + cross.swapaxes(1, 2)) / norm[:, None, None]
    tangent = (limit[:, None, None] * projector - cross) / norm[:, None, None]
    return -(limit / norm)[:, None] * slip, tangent


def update_friction_stress(state: PointState, new_slip: np.ndarray, limit: np.ndarray, slip0: float) -> None:
    """The friction stress (in the direction of the slip) after the increment of the slip, then the slip itself."""
    norm = regularised_norm(state.slip, slip0)
    limit = state.grip * limit
    stress = cut_to_limit(state.friction_stress, limit)
    increment = np.einsum("pi,pi->p", state.slip, new_slip - state.slip)
    state.friction_stress = (limit[:, None] * new_slip - stress * (increment / norm)[:, None]) / norm[:, None]
    state.slip = new_slip


def cut_to_limit(stress: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """The vectors of ``stress`` shortened where they are longer than ``limit``."""
    length = np.sqrt(np.einsum("pi,pi->p", stress, stress))
    factor = np.minimum(1.0, np.divide(limit, length, out=np.ones_like(length), where=length > 0))
    return stress * factor[:, None]
