r"""Moving the nodes with the material.

``explicit``: :math:`x+v\Delta t`.  ``etd2``, an exponential shift with one solve a step:

.. math:: x + \Delta t\,\varphi_1(L\Delta t)\,v + \Delta t^2\varphi_2(L\Delta t)\,v_t ,\qquad
          v_t=(v-v_{old})/\Delta t_{old}-\tfrac12(L+L_{old})(x-x_{old})/\Delta t_{old},

L the recovered nodal velocity gradient: exact for rigid rotation and steady linear flow, second order otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def explicit(x: np.ndarray, v: np.ndarray, dt: float) -> np.ndarray:
    """Positions after ``dt`` with constant nodal velocities, mm."""
    return x + dt * v


@dataclass(frozen=True)
class FlowMemory:
    """What ``etd2`` keeps of the last step: velocity (n, d), velocity gradient (n, d, d), positions (n, d), dt."""

    velocity: np.ndarray
    gradient: np.ndarray
    positions: np.ndarray
    dt: float


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


def put_on_tools(x: np.ndarray, tools, candidates: np.ndarray, held: dict[str, np.ndarray], reach: float) -> float:
    """Put boundary nodes onto the tools, in place: those that have sunk in, and those in contact that hover above.

    Parameters
    ----------
    x : (nodes, dim) positions, mm
    candidates : numbers of the nodes that a tool may touch
    held : tool name → (nodes,) whether a node is pressed against it
    reach : height up to which a pressed node is drawn down, mm: a node in contact follows its tool, a landing one lands

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
