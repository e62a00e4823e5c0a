r"""Friction that remembers where a point holds: the increment of a load step, in displacements.

With the tangential relative displacement :math:`s_t=(I-nn)s`, the place :math:`s_h` where the point held last, the friction
stress :math:`\lambda` it held with there, and a stiffness C along the surface,

.. math:: t^*=\lambda-C\,(s_t-s_h),\qquad t=t^*\ \text{if}\ |t^*|\le\tau_l(p),\qquad
          t=\tau_l\,d,\ d=t^*/|t^*|\ \text{otherwise.}

This is Coulomb's (Siebel's) law by backward Euler: no slip velocity is regularised, but a point that holds gives by
:math:`|t|/C`, which :func:`augmented` takes out.  The tangent is that of the increment,

.. math:: -\frac{\partial t}{\partial s}=C(I-nn)\ \text{(holds)},\qquad
          \frac{\tau_l C}{|t^*|}(I-nn-dd)+\tau_l'\,C_n\,d\otimes n\ \text{(slips)},

whose last part, by which pressure raises the limit, is not symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .point_law import PointState

AT_LIMIT = 1e-8     # of the limit: a point that was left on it holds at first, whatever the rounding


@dataclass(frozen=True)
class Hold:
    """Friction at points after an increment: traction (points, dim) on the slave, N/mm²; its tangent (points, dim, dim);
    along (points, dim), the tangential relative displacement, mm; slips (points,)."""

    traction: np.ndarray
    tangent: np.ndarray
    along: np.ndarray
    slips: np.ndarray


def hold(state: PointState, relative: np.ndarray, limit: np.ndarray, rise: np.ndarray, *, stiffness: np.ndarray,
         penalty: np.ndarray, slips: np.ndarray | None = None, creep: float = 0.0) -> Hold:
    """Friction for relative displacements (points, dim), a limit (points,) and its derivative by the pressure.

    stiffness : along the surface, penalty : across it, both (points,) N/mm³; s_h is ``state.slip``, lambda
        ``state.friction_stress``
    slips : (points,) which slip and which hold, where that is not to be found
    creep : part of the stiffness with which points that slip resist in the tangent, not in the traction: an iteration that
        would let everything slip at once then goes a small way
    """
    n = state.normal
    projector = np.eye(n.shape[1]) - n[:, :, None] * n[:, None, :]
    along = np.einsum("pij,pj->pi", projector, relative)
    trial = np.einsum("pij,pj->pi", projector, state.friction_stress) - stiffness[:, None] * (along - state.slip)
    length = np.linalg.norm(trial, axis=1)
    slips = state.active & (length > (1 + AT_LIMIT) * limit if slips is None else slips)
    share = np.divide(limit, length, out=np.ones_like(length), where=slips & (length > 0))
    direction = np.divide(trial, length[:, None], out=np.zeros_like(trial), where=(slips & (length > 0))[:, None])
    tangent = (stiffness * share)[:, None, None] * (projector - direction[:, :, None] * direction[:, None, :])
    if creep > 0:
        tangent += (creep * stiffness * slips)[:, None, None] * projector
    tangent += (np.where(slips, rise, 0.0) * penalty)[:, None, None] * direction[:, :, None] * n[:, None, :]
    closed = state.active.astype(float)
    return Hold((closed * share)[:, None] * trial, closed[:, None, None] * tangent, along, slips)


def held_places(state: PointState, found: Hold, stiffness: np.ndarray) -> np.ndarray:
    """Where points hold from now on, (points, dim): those that slipped where they came to, open ones where they are."""
    slid = found.along - (state.friction_stress - found.traction) / stiffness[:, None]
    return np.where(found.slips[:, None], slid, np.where(state.active[:, None], state.slip, found.along))


def augmented(state: PointState, found: Hold) -> tuple[np.ndarray, np.ndarray]:
    """Friction stress and places to hold at, with which the next solve leaves no give in points that hold."""
    return found.traction.copy(), np.where((state.active & ~found.slips)[:, None], state.slip, found.along)
