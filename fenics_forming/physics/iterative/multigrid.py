"""Two levels in the degree of the velocities: quadratic, and linear on the same cells."""

from __future__ import annotations

import numpy as np

from ..nodes import Nodes
from .coarse import CoarseSolver
from .velocity_block import VelocityBlock

ORDER = 3       # of the smoother, before and after


class TwoLevels:
    """One V-cycle for the velocity block: smooth, correct by linear velocities, smooth.

    Linear functions are quadratic ones on the same cells, curved ones too, so the form of the vertices is the Galerkin
    product: it is assembled, never multiplied out.
    """

    def __init__(self, nodes: Nodes, block: VelocityBlock, coarse: CoarseSolver, vertex_nodes: np.ndarray):
        self._block, self._coarse, self._vertex_nodes = block, coarse, vertex_nodes
        mids, ends = nodes.edge_middles()
        self._mids, self._ends = mids, nodes.scalar_dofs[ends]
        self._mine = mids < block.shared.owned
        self._count = len(vertex_nodes)

    def ends(self, owned: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Owned nodes, the vertices that linear velocities at them follow, and by how much; a node may come twice."""
        vertices = np.flatnonzero(self._vertex_nodes < owned)
        mids, ends = self._mids[self._mine], self._ends[self._mine]
        return (np.concatenate([self._vertex_nodes[vertices], mids, mids]), np.concatenate([vertices, *ends.T]),
                np.repeat([1.0, 0.5], [len(vertices), 2 * len(mids)]))

    def restricted(self, r: np.ndarray) -> np.ndarray:
        """Residual of the nodes (nodes, 3), owners' part, at the vertices; to be added up over the ranks."""
        out = np.zeros((self._count, 3))
        out[:] = r[self._vertex_nodes]
        out[self._coarse.block.shared.owned:] = 0.0
        half = 0.5 * r[self._mids[self._mine]]
        first, second = self._ends[self._mine].T
        for k in range(3):
            out[:, k] += np.bincount(first, half[:, k], self._count) + np.bincount(second, half[:, k], self._count)
        return self._coarse.block.shared.add_up(out)

    def prolonged(self, x: np.ndarray) -> np.ndarray:
        """Linear velocities of the vertices (vertices, 3) at all nodes, for all copies."""
        out = np.zeros((self._block.shared.count, 3))
        out[self._vertex_nodes] = x
        out[self._mids] = 0.5 * (x[self._ends[:, 0]] + x[self._ends[:, 1]])
        return out

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """About A^-1 r for the free velocities; r is known to all copies and is lost."""
        block = self._block
        x, y = np.zeros_like(r), np.empty_like(r)
        block.smooth(x, r, ORDER, last=False)
        e = self.prolonged(self._coarse.solve(self.restricted(r))) * block.free
        x += e
        r -= block.free_times(e, y)
        block.smooth(x, r, ORDER, last=True)
        return x
