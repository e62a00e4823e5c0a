"""The velocity block of the linearised flow on the nodes of one mesh, and its smoother."""

from __future__ import annotations

import numpy as np

from ...errors import ConvergenceError
from ..parallel import highest
from .pattern import Pattern
from .products import apply_blocks, invert_blocks, product
from .sharing import Shared

# Best polynomials of the fourth kind for a given number of products (J. Lottes, Numer. Lin. Alg. Appl. 2023, table 1).
WEIGHTS = {1: (1.125,), 2: (1.02387287570313, 1.26408905371085),
           3: (1.00842544782028, 1.08867839208730, 1.33753125909618),
           4: (1.00391310427285, 1.04035811188593, 1.14863498546254, 1.38268869241000),
           6: (1.00128517255940, 1.01304293035233, 1.04678215124113, 1.11616489419675, 1.23829020218444, 1.43524297106744)}
LARGER = 1.1        # than a few power iterations say is the largest eigenvalue
FIRST, LATER = 10, 3     # power iterations: of the first matrix, and of one that follows another


class VelocityBlock:
    """A symmetric matrix of 3 x 3 blocks over nodes, of which every rank keeps what its own cells and facets give.

    So no row ever travels: a product hands the values of the nodes on, and adds up what the ranks found.

    Attributes
    ----------
    diagonal, upper : blocks (nodes, 9), (pairs, 9) that this rank gives, in the order of ``pattern``
    free : (nodes, 3) 1 where the velocity is sought, 0 where it is given
    """

    def __init__(self, pattern: Pattern, shared: Shared, start: np.ndarray, dtype=np.float64):
        self.pattern, self.shared = pattern, shared
        self.diagonal = np.zeros((shared.count, 9))
        self.upper = np.zeros((len(pattern.columns), 9), dtype)
        self.free = np.ones((shared.count, 3))
        self._direction = start
        self.largest = 0.0
        self._inverse = np.empty((shared.count, 9))
        self.others: tuple = ()     # further operators with ``add_product`` and ``add_diagonal``

    def clear(self) -> None:
        self.diagonal[:] = 0.0
        self.upper[:] = 0.0

    # ------------------------------------------------------------------ products
    def times(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """y = A x for x that is zero where the velocity is given, known to all copies; rows of copies are not added up yet,
        and rows where the velocity is given mean nothing."""
        self.own_times(x, y)
        for other in self.others:
            other.add_product(x, y)
        return y

    def own_times(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The same without the further operators, for any x, with all rows."""
        p = self.pattern
        product(p.starts, p.columns, self.diagonal, self.upper, x, y)
        return y

    def free_times(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """y = A x among the free velocities, for all copies."""
        self.times(x, y)
        self.shared.add_for_all(y)
        y *= self.free
        return y

    def stiffness(self) -> np.ndarray:
        """The diagonal of the matrix with rows of the identity where the velocity is given, (nodes, 3)."""
        blocks = self.diagonal.copy()
        for other in self.others:
            other.add_diagonal(blocks)
        return np.where(self.free > 0, self.shared.add_for_all(blocks[:, ::4].copy()), 1.0)

    # ------------------------------------------------------------------ smoother
    def prepare_smoother(self) -> None:
        """Invert the diagonal blocks of the free velocities and find the largest eigenvalue. Collective.

        Raises
        ------
        ConvergenceError
            where a block is singular, as it is where velocities of an iteration are beyond all measure.
        """
        blocks = self._whole = self.diagonal.copy()
        for other in self.others:
            other.add_diagonal(blocks)
        self._invert(self._of_free(blocks.copy()))
        x = self._direction * self.free
        y, z = np.empty_like(x), np.empty_like(x)
        for _ in range(FIRST if self.largest == 0.0 else LATER):
            x /= self._norm(x)
            self.free_times(x, y)
            apply_blocks(self._inverse, y, z)
            self.largest = LARGER * self._norm(z)
            x, z = z, x
        self._direction = x

    def _of_free(self, blocks: np.ndarray) -> np.ndarray:
        """Blocks (nodes, 9) that this rank gives to the diagonal → those of all ranks, (nodes, 3, 3), with rows of the
        identity where the velocity is given. Collective."""
        blocks = self.shared.add_for_all(blocks).reshape(-1, 3, 3)
        blocks *= self.free[:, :, None] * self.free[:, None, :]
        rows, axes = np.nonzero(self.free == 0.0)
        blocks[rows, axes, axes] = 1.0
        return blocks

    def without(self, more: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What takes forces on nodes to those that the matrix without ``more`` (nodes, 9) and without the further operators
        on its diagonal needs for the same velocities, node by node: the owned nodes (near,) where that is not the same, and
        the blocks there and back, (near, 3, 3) each. Collective."""
        alone = self.diagonal - more
        near = np.flatnonzero(self.shared.add_for_all(self._whole - alone)[: self.shared.owned].any(axis=1))
        there = self._of_free(alone)[near] @ self._inverse[near].reshape(-1, 3, 3)
        return near, there, np.linalg.inv(there)

    def _invert(self, blocks: np.ndarray) -> None:
        regular = invert_blocks(blocks.reshape(-1, 9), self._inverse)
        if highest(self.shared.comm, float(not regular)) > 0:
            raise ConvergenceError("a node has no stiffness against the rest")

    def _norm(self, x: np.ndarray) -> float:
        mine = x[: self.shared.owned].ravel()
        return float(np.sqrt(self.shared.comm.allreduce(float(mine @ mine))))

    def smooth(self, x: np.ndarray, r: np.ndarray, order: int, *, last: bool) -> None:
        """Improve x and bring its residual r up to date, unless this is the ``last`` that is done to them.

        Chebyshev polynomials of the fourth kind in the inverse blocks: they need no lower bound of the spectrum.
        """
        weights, z, y = WEIGHTS[order], np.zeros_like(x), np.empty_like(x)
        for k in range(1, order + 1):
            apply_blocks(self._inverse, r, y)
            z *= (2 * k - 3) / (2 * k + 1)
            y *= (8 * k - 4) / ((2 * k + 1) * self.largest)
            z += y
            x += weights[k - 1] * z
            if k < order or not last:
                self.free_times(z, y)
                r -= y
