r"""Moving the nodes with the material: positions after a time step from velocities, and nothing else.

``explicit``: :math:`x+v\Delta t`.  ``etd2``, an exponential shift with one solve a step:

.. math:: x + \Delta t\,\varphi_1(L\Delta t)\,v + \Delta t^2\varphi_2(L\Delta t)\,v_t ,\qquad
          v_t=(v-v_{old})/\Delta t_{old}-\tfrac12(L+L_{old})(x-x_{old})/\Delta t_{old},

L the recovered nodal velocity gradient: exact for rigid rotation and steady linear flow, second order otherwise.
``turned`` treats the spin W so in closed form, and the strain rate D to first order only; from the start of a step

.. math:: x + \Delta t\,\varphi_1(W\Delta t)\,v + \Delta t^2\varphi_1'(W\Delta t)\,D\,v ,\qquad
          \varphi_1'=\varphi_1-\varphi_2 ,

with :math:`\varphi_0=e^A`, :math:`\varphi_{k+1}(A)=(\varphi_k(A)-1/k!)/A`: no spin, however fast, makes it grow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def explicit(x: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
    """Positions after ``dt`` with constant nodal velocities, mm."""
    return x + dt * v


@dataclass(frozen=True)
class FlowMemory:
    """What ``etd2`` keeps of the last step: velocity (n, d), velocity gradient (n, d, d), positions (n, d), dt, and the
    pace of what drives it, mm/s."""

    velocity: np.ndarray
    gradient: np.ndarray
    positions: np.ndarray
    dt: float
    pace: float = 1.0

    def at_pace(self, pace: float) -> FlowMemory:
        """The same way at another pace."""
        share = pace / self.pace
        return FlowMemory(share * self.velocity, share * self.gradient, self.positions, self.dt / share, pace)


def etd2(x: np.ndarray, v: np.ndarray, gradient: np.ndarray, dt: float, memory: FlowMemory | None = None,
         terms: int = 14) -> np.ndarray:
    """Positions after ``dt`` by the exponential shift.

    Parameters
    ----------
    x, v : (n, d) positions mm, velocities mm/s
    gradient : (n, d, d) velocity gradient, 1/s
    memory : the last step; without it the unsteady part is left out (first step)
    terms : of the series; 14 reach round-off for \\|L\\| dt up to one
    """
    moved = x + dt * _phi(gradient * dt, v, 1, terms)
    if memory is not None:
        mean = 0.5 * (gradient + memory.gradient)
        unsteady = (v - memory.velocity - np.einsum("nij,nj->ni", mean, x - memory.positions)) / memory.dt
        moved += dt**2 * 0.5 * _phi(gradient * dt, unsteady, 2, terms)
    return moved


def _phi(A, vector, order, terms):
    """order! times phi_order(A) applied to vectors: sum of A^k order!/(k + order)!."""
    term = total = vector
    for k in range(1, terms):
        term = np.einsum("nij,nj->ni", A, term) / (k + order)
        total = total + term
    return total


# ---------------------------------------------------------------------- local spin
def turned(v: np.ndarray, gradient: np.ndarray, dt: float, *, known_at: str = "start") -> np.ndarray:
    """Mean velocity over a step that a material point meets in its local flow field, the spin exactly.

    Rigid motion through any angle ends exactly where it should. In steady flow second order; a stretch of rate e in a
    body that spins gives 1 + e dt + (e dt)²/2 up to a 24th of (e dt)² times the square of the angle.

    Parameters
    ----------
    v : (n, d) velocities at the "start", the "middle" or the "end" of the way, mm/s
    gradient : (n, d, d) velocity gradient there, 1/s
    """
    other = np.swapaxes(gradient, 1, 2)
    angle, stretched = 0.5 * dt * (gradient - other), 0.5 * dt * np.einsum("nij,nj->ni", gradient + other, v)
    size = np.sqrt(0.5 * np.einsum("nij,nij->n", angle, angle))
    half = 0.5 * size
    if known_at == "middle":
        # 2 sinh(A/2)/A and its derivative
        return _applied(angle, v, 1.0, 0.0, 0.25 * _bend(half)) + \
            _applied(angle, stretched, 0.0, 0.25 * (0.5 * _sinc(0.5 * half) ** 2 - _bend(half)), 0.0)
    sign = {"start": 1.0, "end": -1.0}[known_at]
    c1, c2 = 0.5 * _sinc(half) ** 2, _bend(size)
    d2 = c2 - 0.125 * (1 + _sinc(half)) * _bend(half)
    return _applied(sign * angle, v, 1.0, c1, c2) + sign * _applied(sign * angle, stretched, 0.5, c1 - c2, d2)


def _applied(A, v, c0, c1, c2):
    """(c0 + c1 A + c2 A²) v: every function of a skew matrix of at most three rows is of that form."""
    Av = np.einsum("nij,nj->ni", A, v)
    AAv = np.einsum("nij,nj->ni", A, Av)
    return c0 * v + np.reshape(c1, (-1, 1)) * Av + np.reshape(c2, (-1, 1)) * AAv


def _sinc(angle):
    return np.sinc(angle / np.pi)


def _bend(angle):
    """(1 - sin(a)/a)/a², 1/6 at zero, free of cancellation."""
    small = np.abs(angle) < 0.3
    square = angle**2
    series = (1 - square / 20 * (1 - square / 42 * (1 - square / 72 * (1 - square / 110)))) / 6
    return np.where(small, series, (1 - _sinc(angle)) / np.where(small, 1.0, square))


# ---------------------------------------------------------------------- contact
def put_on_tools(x: np.ndarray, tools, candidates: np.ndarray, held: dict[str, np.ndarray],
                 reach: np.ndarray | float) -> float:
    """Put boundary nodes onto the tools, in place: those that have sunk in, and those in contact that hover above.

    Parameters
    ----------
    x : (nodes, dim) positions, mm
    candidates : numbers of the nodes that a tool may touch
    held : tool name → (nodes,) whether a node is pressed against it
    reach : height up to which a pressed node is drawn down, mm, of all or of each candidate: a node in contact follows
        its tool, a landing one lands

    Returns
    -------
    The greatest depth that was taken back, mm.
    """
    depth = 0.0
    for tool in tools:
        gap, normal = tool.gap(x[candidates])
        off = gap < 0
        if off.any():
            depth = max(depth, float(-gap.min()))
        if tool.name in held:
            off |= held[tool.name][candidates] & (gap < reach)
        if off.any():
            x[candidates[off]] -= gap[off, None] * normal[off]
    return depth
