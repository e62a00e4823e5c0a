"""Sums over the cells and unknowns of a mesh, compiled by numba."""

from __future__ import annotations

import numpy as np

from .machine_code import compiled


@compiled
def sums_at_vertices(vertices, weight, values, count):
    """Per node the sum of the weights (cells,) of the cells that meet there, and of ``values`` (cells, vertices, k) times
    these: (count, 1 + k)."""
    out = np.zeros((count, 1 + values.shape[2]))
    for c in range(len(vertices)):
        for a in range(vertices.shape[1]):
            row = out[vertices[c, a]]
            row[0] += weight[c]
            for k in range(values.shape[2]):
                row[1 + k] += weight[c] * values[c, a, k]
    return out


@compiled
def products(matrix, values):
    """A matrix (m, n) times each of ``values`` (cells, n, k): (cells, m, k)."""
    out = np.zeros((len(values), len(matrix), values.shape[2]))
    for c in range(len(values)):
        for i in range(matrix.shape[0]):
            for j in range(matrix.shape[1]):
                for k in range(values.shape[2]):
                    out[c, i, k] += matrix[i, j] * values[c, j, k]
    return out


@compiled
def sum_of_squares(values, chosen):
    """Of the chosen ones of some numbers."""
    total = 0.0
    for i in chosen:
        total += values[i] * values[i]
    return total
