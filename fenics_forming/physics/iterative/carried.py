"""A gap operator laid out for many products on one rank: by carriers and nodes, compiled by numba.

A product passes once over the operator: the motion at a carrier, its traction, and the forces of that on the same nodes.
Where all normals are alike (flat surfaces) the operator is the same number for every axis, a third of the entries.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from .kernels import compiled


class CarriedProducts:
    """Products with G^T T G and its diagonal, for blocks T (carriers, 3, 3).

    Parameters
    ----------
    operator : gap operator of ``contact.gap_operator``, all of it on this rank
    node_of, axis_of : (unknowns,) node of every unknown, -1 where it is none, and its axis

    Attributes
    ----------
    nodes : (k,) that have a column
    """

    def __init__(self, operator: PETSc.Mat, node_of: np.ndarray, axis_of: np.ndarray):
        starts, columns, values = operator.getValuesCSR()
        carrier, row = np.divmod(np.repeat(np.arange(len(starts) - 1), np.diff(starts)), 3)
        self.nodes, node = np.unique(node_of[columns], return_inverse=True)
        places, place = np.unique(carrier * len(self.nodes) + node, return_inverse=True)
        blocks = np.zeros((len(places), 3, 3))
        blocks[place, row, axis_of[columns]] = values
        carrier, node = np.divmod(places, len(self.nodes))
        self._starts = np.searchsorted(carrier, np.arange((len(starts) - 1) // 3 + 1)).astype(np.int32)
        self._node = node.astype(np.int32)
        self._flat, self._blocks, self._free = None, blocks, np.ones((len(self.nodes), 3))
        self._flatten()

    def _flatten(self) -> None:
        """Keep one number instead of a block where all blocks are that times the unit, but for what is given."""
        each = np.einsum("kii->ki", self._blocks)
        g = each[np.arange(len(each)), np.abs(each).argmax(axis=1)]
        given = each == 0.0
        unit = g[:, None, None] * np.eye(3) * ~given[:, :, None]
        if np.abs(self._blocks - unit).max(initial=0.0) < 1e-14:
            self._free[:] = 0.0
            np.maximum.at(self._free, self._node, (~given).astype(float))
            self._flat, self._blocks = g, None

    def add_product(self, tangents: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with velocities x (all nodes, 3) to y."""
        here, out = x[self.nodes], np.zeros((len(self.nodes), 3))
        if self._flat is not None:
            here *= self._free
            _flat_product(self._starts, self._node, self._flat, tangents, here, out)
            out *= self._free
        else:
            _product(self._starts, self._node, self._blocks, tangents, here, out)
        y[self.nodes] += out

    def add_diagonal(self, tangents: np.ndarray, blocks: np.ndarray) -> None:
        """Add the blocks on the diagonal to ``blocks`` (all nodes, 9)."""
        out = np.zeros((len(self.nodes), 3, 3))
        if self._flat is not None:
            _flat_diagonal(self._starts, self._node, self._flat, tangents, out)
            out *= self._free[:, :, None] * self._free[:, None, :]
        else:
            _diagonal(self._starts, self._node, self._blocks, tangents, out)
        blocks[self.nodes] += out.reshape(-1, 9)


@compiled
def _flat_product(starts, node, g, tangents, x, y):
    for a in range(len(starts) - 1):
        s0 = s1 = s2 = 0.0
        for k in range(starts[a], starts[a + 1]):
            n = node[k]
            s0 += g[k] * x[n, 0]
            s1 += g[k] * x[n, 1]
            s2 += g[k] * x[n, 2]
        T = tangents[a]
        t0 = T[0, 0] * s0 + T[0, 1] * s1 + T[0, 2] * s2
        t1 = T[1, 0] * s0 + T[1, 1] * s1 + T[1, 2] * s2
        t2 = T[2, 0] * s0 + T[2, 1] * s1 + T[2, 2] * s2
        for k in range(starts[a], starts[a + 1]):
            n = node[k]
            y[n, 0] += g[k] * t0
            y[n, 1] += g[k] * t1
            y[n, 2] += g[k] * t2


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
            n, weight = node[k], g[k] * g[k]
            for i in range(3):
                for j in range(3):
                    out[n, i, j] += weight * T[i, j]


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
