"""Divergence, and the pressure mass that stands for the Schur complement."""

from __future__ import annotations

import numpy as np

from .pattern import Incidence, Pattern
from .products import both_times, columns_times, rows_times, scalar_product
from .sharing import Shared

# Eigenvalues of a P1 mass matrix over its diagonal on tetrahedra (A. Wathen, IMA J. Numer. Anal. 7, 1987): they hold cell
# by cell, so also where every cell has a weight of its own.
LEAST, MOST = 0.5, 2.5
SWEEPS = 4


class Divergence:
    """B: minus the divergence of nodal velocities (nodes, 3) tested with the hats of the vertices, (vertices,)."""

    def __init__(self, pattern: Incidence, vertices: Shared, nodes: Shared):
        self.pattern, self._vertices, self._nodes = pattern, vertices, nodes
        self.blocks = np.zeros((len(pattern.columns), 3))

    def times(self, v: np.ndarray) -> np.ndarray:
        """B v, for v known to all copies; rows of copies are not added up yet."""
        y, p = np.empty(self._vertices.count), self.pattern
        rows_times(p.starts, p.columns, self.blocks, v, y)
        return y

    def transposed_times(self, q: np.ndarray) -> np.ndarray:
        """B^T q, for q known to all copies; rows of copies are not added up yet."""
        y, p = np.empty((self._nodes.count, 3)), self.pattern
        columns_times(p.starts, p.columns, self.blocks, q, y)
        return y

    def both_times(self, v: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """B^T q and B v: the blocks are read once."""
        y, z, p = np.empty((self._nodes.count, 3)), np.empty(self._vertices.count), self.pattern
        both_times(p.starts, p.columns, self.blocks, v, q, y, z)
        return y, z


class PressureMass:
    """Mass matrix of the pressure over the viscosity, and a few Chebyshev steps as its inverse.

    diagonal (vertices,), upper (pairs,) : what this rank gives, in the order of ``pattern``
    """

    def __init__(self, pattern: Pattern, shared: Shared):
        self._pattern, self._shared = pattern, shared
        self.diagonal, self.upper = np.zeros(shared.count), np.zeros(len(pattern.columns))
        self.free = np.ones(shared.count)

    def clear(self) -> None:
        self.diagonal[:] = 0.0
        self.upper[:] = 0.0

    def prepare(self) -> None:
        self._inverse = self.free / self._shared.add_for_all(self.diagonal.copy())

    def solve(self, b: np.ndarray) -> np.ndarray:
        """About M^-1 b, for b known to all copies: to 4 % in the worst mode."""
        middle, half = 0.5 * (MOST + LEAST), 0.5 * (MOST - LEAST)
        r, y, p = b * self.free, np.empty_like(b), self._pattern
        d = self._inverse * r / middle
        x, rho = d.copy(), half / middle
        for _ in range(SWEEPS - 1):
            scalar_product(p.starts, p.columns, self.diagonal, self.upper, d, y)
            r = r - self._shared.add_for_all(y) * self.free
            after = 1.0 / (2.0 * middle / half - rho)
            d = after * rho * d + (2.0 * after / half) * self._inverse * r
            x += d
            rho = after
        return x
