r"""Columns of tool below the points of contact: semi-infinite, each by itself, without a mesh.

A flux q into a half space of effusivity e raises its surface by :math:`\frac1e\int_0^t q(s)/\sqrt{\pi(t-s)}\,ds`
(Carslaw and Jaeger, Conduction of Heat in Solids, 2.5). With

.. math:: \frac1{\sqrt{\pi t}}=\frac2\pi\int_0^\infty e^{-ty^2}dy\approx\sum_m w_m e^{-s_mt},
          \qquad y=e^u,\ \text{trapezoids in}\ u,

the integral is the sum of a few modes that each fade by themselves, :math:`\dot a_m=-s_ma_m+q`: a step needs the modes, not
the past. For times from 1e-5 s to 1e4 s the sum is within 1e-4 of the kernel's integral (a test says so).
"""

from __future__ import annotations

import numpy as np

SHORTEST, LONGEST = 1e-5, 1e4     # s: times that the modes resolve
SPACING = 0.6                     # of the trapezoids in u


def _modes() -> tuple[np.ndarray, np.ndarray]:
    """Rates s (m,), 1/s, and weights w (m,), s^-1/2, the slowest one standing for all slower ones."""
    first, last = np.log(0.1 / np.sqrt(LONGEST)), np.log(4.0 / np.sqrt(SHORTEST))
    y = np.exp(np.arange(first, last, SPACING))
    weights = 2 / np.pi * SPACING * y
    rest = 2 / np.pi * y[0] * (1 / (1 - np.exp(-SPACING)) - 1) * SPACING      # of the trapezoids below the first
    return np.append(0.0, y**2), np.append(rest, weights)


RATES, WEIGHTS = _modes()
# fast modes follow the flux at once: what those beyond the last one would add, s^½ · (2/π) ∫ dy/y²
AT_ONCE = 2 / np.pi * SPACING * np.exp(-0.5 * np.log(RATES[-1])) / (np.exp(SPACING) - 1)


def resistance(dt: float) -> float:
    """Rise of the surface times the effusivity for a unit flux that lasts for a step of ``dt``, s^½: about 2 √(dt/π)."""
    return float(WEIGHTS @ _gains(dt)) + AT_ONCE


def rise(modes: np.ndarray, dt: float) -> np.ndarray:
    """Rise of the surface times the effusivity after a step of ``dt`` without flux: (n, m) modes → (n,), mJ/mm²/s^½."""
    return modes @ (WEIGHTS * np.exp(-RATES * dt))


def advanced(modes: np.ndarray, flux: np.ndarray, dt: float) -> np.ndarray:
    """The modes (n, m), mJ/mm², after a step of ``dt``, s, with a steady flux (n,), mJ/s/mm²."""
    return modes * np.exp(-RATES * dt) + flux[:, None] * _gains(dt)


def at_rest(count: int) -> np.ndarray:
    """Modes of ``count`` columns that have got no heat yet."""
    return np.zeros((count, len(RATES)))


def _gains(dt: float) -> np.ndarray:
    """What a mode gains from a unit flux in a step, s: (1 - exp(-s dt)) / s."""
    z = RATES * dt
    return dt * np.divide(-np.expm1(-z), z, out=np.ones_like(z), where=z > 0)
