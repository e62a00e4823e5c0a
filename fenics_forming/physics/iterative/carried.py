"""A gap operator laid out for many products on one rank: by carriers and nodes, compiled by numba.

A product passes once over the operator: the motion at a carrier, its traction, and the forces of that on the same nodes.
Where all normals are alike (flat surfaces) one number stands for a block, and velocities that are given must be zero.
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
        # no numbers from the end, which a kernel would have to look for, and lines of nine: a third of a product
        self._starts, self._node = rows.starts.astype(np.uint32), node_of[rows.node].astype(np.uint32)
        kept = free[rows.node]
        self._flat = rows.blocks[:, 0, 0].copy() if rows.blocks.shape[1] == 1 else None
        self._blocks = (rows.blocks * kept[:, None, :]).reshape(-1, 9) if self._flat is None else None

    def add_product(self, tangents: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with velocities x (all nodes, 3), zero where they are given, to y; rows of these mean nothing."""
        if self._flat is not None:
            _flat_product(self._starts, self._node, self._flat, tangents, x, y)
        else:
            _product(self._starts, self._node, self._blocks, tangents, x, y)

    def add_diagonal(self, tangents: np.ndarray, blocks: np.ndarray) -> None:
        """Add the blocks on the diagonal to ``blocks`` (all nodes, 9); those of given velocities mean nothing."""
        out = blocks.reshape(-1, 3, 3)
        if self._flat is not None:
            _flat_diagonal(self._starts, self._node, self._flat, tangents, out)
        else:
            _diagonal(self._starts, self._node, self._blocks, tangents, out)


@compiled
def _flat_product(starts, node, g, tangents, x, y):
    for a in range(len(starts) - 1):
        T = tangents[a]
        if T[0, 0] == 0.0 and T[1, 1] == 0.0 and T[2, 2] == 0.0:        # open
            continue
        s0 = s1 = s2 = 0.0
        for k in range(starts[a], starts[a + 1]):
            n, w = node[k], g[k]
            s0 += w * x[n, 0]
            s1 += w * x[n, 1]
            s2 += w * x[n, 2]
        t0 = T[0, 0] * s0 + T[0, 1] * s1 + T[0, 2] * s2
        t1 = T[1, 0] * s0 + T[1, 1] * s1 + T[1, 2] * s2
        t2 = T[2, 0] * s0 + T[2, 1] * s1 + T[2, 2] * s2
        for k in range(starts[a], starts[a + 1]):
            n, w = node[k], g[k]
            y[n, 0] += w * t0
            y[n, 1] += w * t1
            y[n, 2] += w * t2


@compiled
def _product(starts, node, blocks, tangents, x, y):
    for a in range(len(starts) - 1):
        T = tangents[a]
        if T[0, 0] == 0.0 and T[1, 1] == 0.0 and T[2, 2] == 0.0:        # open
            continue
        s0 = s1 = s2 = 0.0
        for k in range(starts[a], starts[a + 1]):
            b, n = blocks[k], node[k]
            x0, x1, x2 = x[n, 0], x[n, 1], x[n, 2]
            s0 += b[0] * x0 + b[1] * x1 + b[2] * x2
            s1 += b[3] * x0 + b[4] * x1 + b[5] * x2
            s2 += b[6] * x0 + b[7] * x1 + b[8] * x2
        t0 = T[0, 0] * s0 + T[0, 1] * s1 + T[0, 2] * s2
        t1 = T[1, 0] * s0 + T[1, 1] * s1 + T[1, 2] * s2
        t2 = T[2, 0] * s0 + T[2, 1] * s1 + T[2, 2] * s2
        for k in range(starts[a], starts[a + 1]):
            b, n = blocks[k], node[k]
            y[n, 0] += b[0] * t0 + b[3] * t1 + b[6] * t2
            y[n, 1] += b[1] * t0 + b[4] * t1 + b[7] * t2
            y[n, 2] += b[2] * t0 + b[5] * t1 + b[8] * t2


@compiled
def _flat_diagonal(starts, node, g, tangents, out):
    for a in range(len(starts) - 1):
        T = tangents[a]
        for k in range(starts[a], starts[a + 1]):
            n, w = node[k], g[k] ** 2
            for i in range(3):
                for j in range(3):
                    out[n, i, j] += w * T[i, j]


@compiled
def _diagonal(starts, node, blocks, tangents, out):
    for a in range(len(starts) - 1):
        T = tangents[a]
        for k in range(starts[a], starts[a + 1]):
            b, n = blocks[k], node[k]
            for j in range(3):
                t0 = T[0, 0] * b[j] + T[0, 1] * b[3 + j] + T[0, 2] * b[6 + j]
                t1 = T[1, 0] * b[j] + T[1, 1] * b[3 + j] + T[1, 2] * b[6 + j]
                t2 = T[2, 0] * b[j] + T[2, 1] * b[3 + j] + T[2, 2] * b[6 + j]
                for i in range(3):
                    out[n, i, j] += b[i] * t0 + b[3 + i] * t1 + b[6 + i] * t2
