"""A gap operator laid out for many products on one rank: by carriers and nodes, compiled by numba.

A product passes once over the operator: the motion at a carrier, its traction, and the forces of that on the same nodes.
Where all normals are alike (flat surfaces) there is a number for each axis, a third of the entries.
"""

from __future__ import annotations

import numpy as np

from ..contact.gap_rows import GapRows
from ..machine_code import compiled


class CarriedProducts:
    """Products with G^T T G and its diagonal, for blocks T (carriers, 3, 3).

    Parameters
    ----------
    rows : of a gap operator, all of it on this rank · node_of : (nodes of the rows,) among all nodes
    free : (nodes of the rows, 3) 0 where a velocity is given
    """

    def __init__(self, rows: GapRows, node_of: np.ndarray, free: np.ndarray):
        self._starts, self._node = rows.starts.astype(np.int32), node_of[rows.node].astype(np.int32)
        kept = free[rows.node]
        self._flat = rows.blocks[:, 0, 0, None] * kept if rows.blocks.shape[1] == 1 else None
        self._blocks = rows.blocks * kept[:, None, :] if self._flat is None else None

    def add_product(self, tangents: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with velocities x (all nodes, 3) to y."""
        if self._flat is not None:
            _flat_product(self._starts, self._node, self._flat, tangents, x, y)
        else:
            _product(self._starts, self._node, self._blocks, tangents, x, y)

    def add_diagonal(self, tangents: np.ndarray, blocks: np.ndarray) -> None:
        """Add the blocks on the diagonal to ``blocks`` (all nodes, 9)."""
        out = blocks.reshape(-1, 3, 3)
        if self._flat is not None:
            _flat_diagonal(self._starts, self._node, self._flat, tangents, out)
        else:
            _diagonal(self._starts, self._node, self._blocks, tangents, out)


@compiled
def _flat_product(starts, node, g, tangents, x, y):
    for a in range(len(starts) - 1):
        s0 = s1 = s2 = 0.0
        for k in range(starts[a], starts[a + 1]):
            n = node[k]
            s0 += g[k, 0] * x[n, 0]
            s1 += g[k, 1] * x[n, 1]
            s2 += g[k, 2] * x[n, 2]
        T = tangents[a]
        t0 = T[0, 0] * s0 + T[0, 1] * s1 + T[0, 2] * s2
        t1 = T[1, 0] * s0 + T[1, 1] * s1 + T[1, 2] * s2
        t2 = T[2, 0] * s0 + T[2, 1] * s1 + T[2, 2] * s2
        for k in range(starts[a], starts[a + 1]):
            n = node[k]
            y[n, 0] += g[k, 0] * t0
            y[n, 1] += g[k, 1] * t1
            y[n, 2] += g[k, 2] * t2


@compiled
def _product(starts, node, blocks, tangents, x, y):
    for a in range(len(starts) - 1):
        s0 = s1 = s2 = 0.0
        for k in range(starts[a], starts[a + 1]):
            B, n = blocks[k], node[k]
            x0, x1, x2 = x[n, 0], x[n, 1], x[n, 2]
            s0 += B[0, 0] * x0 + B[0, 1] * x1 + B[0, 2] * x2
            s1 += B[1, 0] * x0 + B[1, 1] * x1 + B[1, 2] * x2
            s2 += B[2, 0] * x0 + B[2, 1] * x1 + B[2, 2] * x2
        T = tangents[a]
        t0 = T[0, 0] * s0 + T[0, 1] * s1 + T[0, 2] * s2
        t1 = T[1, 0] * s0 + T[1, 1] * s1 + T[1, 2] * s2
        t2 = T[2, 0] * s0 + T[2, 1] * s1 + T[2, 2] * s2
        for k in range(starts[a], starts[a + 1]):
            B, n = blocks[k], node[k]
            y[n, 0] += B[0, 0] * t0 + B[1, 0] * t1 + B[2, 0] * t2
            y[n, 1] += B[0, 1] * t0 + B[1, 1] * t1 + B[2, 1] * t2
            y[n, 2] += B[0, 2] * t0 + B[1, 2] * t1 + B[2, 2] * t2


@compiled
def _flat_diagonal(starts, node, g, tangents, out):
    for a in range(len(starts) - 1):
        T = tangents[a]
        for k in range(starts[a], starts[a + 1]):
            n = node[k]
            for i in range(3):
                for j in range(3):
                    out[n, i, j] += g[k, i] * g[k, j] * T[i, j]


@compiled
def _diagonal(starts, node, blocks, tangents, out):
    for a in range(len(starts) - 1):
        T = tangents[a]
        for k in range(starts[a], starts[a + 1]):
            B, n = blocks[k], node[k]
            for j in range(3):
                t0 = T[0, 0] * B[0, j] + T[0, 1] * B[1, j] + T[0, 2] * B[2, j]
                t1 = T[1, 0] * B[0, j] + T[1, 1] * B[1, j] + T[1, 2] * B[2, j]
                t2 = T[2, 0] * B[0, j] + T[2, 1] * B[1, j] + T[2, 2] * B[2, j]
                for i in range(3):
                    out[n, i, j] += B[0, i] * t0 + B[1, i] * t1 + B[2, i] * t2
