r"""What happens at one contact point: normal pressure, release, friction.  All points at once, compiled; no mesh, no MPI.

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

from ..machine_code import compiled

ROUNDING = 1e-9     # of the pressure of a surface at rest under the moving tool, see `pressing`


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


def trial_pressure(state: PointState, velocity: np.ndarray, coefficient: float | np.ndarray, dt: float,
                   tool_velocity: np.ndarray | None = None) -> np.ndarray:
    """Normal pressure that closed points would have, negative where they would be pulled, (points,), with one coefficient
    or one for each; also under a tool of another velocity (points, dim)."""
    tool_velocity = state.tool_velocity if tool_velocity is None else tool_velocity
    coefficient = np.full(len(state.gap), coefficient)
    return _trial_pressure(*_plain(state.multiplier, tool_velocity, velocity, state.normal, state.gap), coefficient,
                           float(dt))


def pressing(state: PointState, trial: np.ndarray, coefficient: float | np.ndarray, speed: float) -> np.ndarray:
    """Points (points,) bool that a trial pressure closes. Where it is rounding against that of a surface which stands still
    under a tool of that speed, its sign says nothing, and is another on another number of ranks: they stay as they are."""
    return np.where(np.abs(trial) < ROUNDING * coefficient * speed, state.active, trial > 0)


def normal_pressure(state: PointState, velocity: np.ndarray, coefficient: float, dt: float,
                    touching: np.ndarray | None = None, speed: float = 0.0) -> None:
    """Update ``pressure`` and ``active``, see `pressing`; points in ``touching`` count as active whatever their sign."""
    trial = trial_pressure(state, velocity, coefficient, dt)
    pressed = pressing(state, trial, coefficient, speed)
    state.active = pressed if touching is None else pressed | touching
    state.pressure = np.where(state.active, trial, 0.0)


def follow_contact(state: PointState, before: np.ndarray, grip: str) -> None:
    """Update ``grip`` after ``active``; ``before``, (points,), is what was active in the last iteration.

    A point that opens loses all of its friction, which may close it again: such cycles never end by themselves.

    "new": all of it where a point is closed, none elsewhere · "follows": the same, the more slowly the more often a point
    opens and closes; its pace is halved when it differs from ``before``, and grows slowly while it does not (more slowly
    than doubling: cycles of period three and four must lose pace too) · "held": as it is. Which points are closed is then
    the only question left, and has one answer, that of a convex potential: along a sticking die, where the pressure at a
    point hangs on the friction there, it is found where slower and slower changes are not. What opens or closes after that
    rubs accordingly in the next solve. · "before": where a point pressed in the solve before, to be held at: a set that
    no way of the iterations has part in. In a flash, what was closed in one iteration or in another made forces that differ
    by 8 %.
    """
    if grip == "new":
        state.pace, state.grip = np.ones(len(state.grip)), state.active.astype(float)
    elif grip == "follows":
        state.pace, state.grip = _followed(*_plain(before, state.active, state.pace, state.grip))
    elif grip == "before":
        state.pace, state.grip = np.ones(len(state.grip)), state.before.astype(float)


def slip_velocity(state: PointState, velocity: np.ndarray) -> np.ndarray:
    """Tangential velocity of the material relative to the tool, (points, dim), mm/s."""
    return _slip_velocity(*_plain(velocity, state.tool_velocity, state.normal))


def normal_response(state: PointState, coefficient: float) -> tuple[np.ndarray, np.ndarray]:
    """Normal traction on the body (points, dim) and its tangent (points, dim, dim)."""
    return _normal_response(*_plain(state.pressure, state.active, state.normal),
                            np.full(len(state.pressure), coefficient))


def friction_response(state: PointState, limit: np.ndarray, slip0: float) -> tuple[np.ndarray, np.ndarray]:
    """Friction traction on the body and its tangent for a limit (points,), N/mm²; nothing where contact is open."""
    return _friction_response(*_plain(state.slip, state.normal, state.friction_stress, state.grip, limit), float(slip0))


def update_friction_stress(state: PointState, new_slip: np.ndarray, limit: np.ndarray, slip0: float) -> None:
    """The friction stress (in the direction of the slip) after the increment of the slip, then the slip itself."""
    state.friction_stress = _updated_stress(
        *_plain(state.slip, new_slip, state.friction_stress, state.grip, limit), float(slip0))
    state.slip = new_slip


def powers(state: PointState, traction: np.ndarray, velocity: np.ndarray, weights: np.ndarray) -> tuple[float, ...]:
    """Powers, mW, of tractions (points, dim) on surfaces ``weights`` (points,), of which the body has the velocity (points,
    dim): given by the tool, lost in friction, and taken by the pressure where the body gives way along the normal."""
    return _powers(*_plain(traction, state.tool_velocity, velocity, state.normal, state.pressure, weights))


def landing_power(state: PointState, traction: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Power that the tool gives, mW, and ∫ p g dΓ, N mm, over points that have a gap and did not press before."""
    return _landing_power(*_plain(traction, state.tool_velocity, state.pressure, state.gap, weights, state.active,
                                  state.before))


# ---------------------------------------------------------------------- compiled, point by point
def _plain(*arrays) -> tuple[np.ndarray, ...]:
    """The arrays as the kernels are compiled for: with no steps between their numbers."""
    return tuple(map(np.ascontiguousarray, arrays))


@compiled
def _trial_pressure(multiplier, tool_velocity, velocity, normal, gap, coefficient, dt):
    out = np.empty(len(gap))
    for p in range(len(gap)):
        closing = before = 0.0
        for i in range(normal.shape[1]):
            closing += (tool_velocity[p, i] - velocity[p, i]) * normal[p, i]
            before += multiplier[p, i] * normal[p, i]
        out[p] = before + coefficient[p] * (closing - gap[p] / dt)
    return out


@compiled
def _followed(before, active, pace, grip):
    paces, grips = np.empty(len(grip)), np.empty(len(grip))
    for p in range(len(grip)):
        paces[p] = min(1.0, 1.2 * pace[p]) if before[p] == active[p] else 0.5 * pace[p]
        grips[p] = grip[p] + paces[p] * ((1.0 if active[p] else 0.0) - grip[p])
    return paces, grips


@compiled
def _slip_velocity(velocity, tool_velocity, normal):
    slip = velocity - tool_velocity
    for p in range(len(slip)):
        along = _product(slip[p], normal[p])
        for i in range(slip.shape[1]):
            slip[p, i] -= along * normal[p, i]
    return slip


@compiled
def _normal_response(pressure, active, normal, coefficient):
    count, dim = normal.shape
    traction, tangent = np.empty((count, dim)), np.empty((count, dim, dim))
    for p in range(count):
        stiffness = coefficient[p] if active[p] else 0.0
        for i in range(dim):
            traction[p, i] = pressure[p] * normal[p, i]
            for j in range(dim):
                tangent[p, i, j] = stiffness * normal[p, i] * normal[p, j]
    return traction, tangent


@compiled
def _powers(traction, tool_velocity, velocity, normal, pressure, weights):
    given = lost = penalty = 0.0
    for p in range(len(weights)):
        along = of_tool = of_slip = 0.0
        for i in range(traction.shape[1]):
            relative = velocity[p, i] - tool_velocity[p, i]
            of_tool += traction[p, i] * tool_velocity[p, i]
            of_slip += traction[p, i] * relative
            along += relative * normal[p, i]
        given += of_tool * weights[p]
        lost -= of_slip * weights[p]
        penalty -= pressure[p] * along * weights[p]
    return given, lost - penalty, penalty


@compiled
def _landing_power(traction, tool_velocity, pressure, gap, weights, active, before):
    given = landing = 0.0
    for p in range(len(weights)):
        for i in range(traction.shape[1]):
            given += traction[p, i] * tool_velocity[p, i] * weights[p]
        if active[p] and not before[p] and gap[p] > 0:
            landing += pressure[p] * gap[p] * weights[p]
    return given, landing


@compiled
def _product(a, b):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@compiled
def _share_within(stress, limit):
    """What a vector is multiplied by that must not be longer than ``limit``."""
    length = np.sqrt(_product(stress, stress))
    return limit / length if length > limit else 1.0


@compiled
def _friction_response(slip, normal, stress, grip, limit, slip0):
    count, dim = slip.shape
    traction, tangent = np.empty((count, dim)), np.empty((count, dim, dim))
    for p in range(count):
        over, most = 1.0 / np.sqrt(_product(slip[p], slip[p]) + slip0 * slip0), grip[p] * limit[p]
        share = _share_within(stress[p], most)
        for i in range(dim):
            traction[p, i] = -most * over * slip[p, i]
            for j in range(dim):
                cross = 0.5 * share * (stress[p, i] * slip[p, j] + slip[p, i] * stress[p, j]) * over
                across = (1.0 if i == j else 0.0) - normal[p, i] * normal[p, j]
                tangent[p, i, j] = (most * across - cross) * over
    return traction, tangent


@compiled
def _updated_stress(slip, new_slip, stress, grip, limit, slip0):
    out = np.empty_like(stress)
    for p in range(len(slip)):
        over, most = 1.0 / np.sqrt(_product(slip[p], slip[p]) + slip0 * slip0), grip[p] * limit[p]
        share, change = _share_within(stress[p], most), 0.0
        for i in range(slip.shape[1]):
            change += slip[p, i] * (new_slip[p, i] - slip[p, i])
        for i in range(slip.shape[1]):
            out[p, i] = (most * new_slip[p, i] - share * stress[p, i] * change * over) * over
    return out
