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
def fill_mids(nodal, mids, ends):
    """Put at the mid-nodes (m,) of values (nodes, k), in place, the mean of the ``ends`` (m, 2) of their edges."""
    for m in range(len(mids)):
        for k in range(nodal.shape[1]):
            nodal[mids[m], k] = 0.5 * (nodal[ends[m, 0], k] + nodal[ends[m, 1], k])


@compiled
def means_at_nodes(vertices, weight, values, mids, ends, count):
    """Weighted mean per node of ``values`` (cells, vertices, k) of the cells (cells,) that meet there, and at mid-nodes
    (m,) that of the ``ends`` (m, 2) of their edge: (count, k)."""
    sums = sums_at_vertices(vertices, weight, values, count)
    width = values.shape[2]
    out = np.zeros((count, width))
    for n in range(count):
        if sums[n, 0] != 0.0:
            for k in range(width):
                out[n, k] = sums[n, 1 + k] / sums[n, 0]
    fill_mids(out, mids, ends)
    return out


@compiled
def areas(x, triangles):
    """Areas of straight-sided triangles (cells, 3) between places ``x``, (cells,)."""
    out = np.empty(len(triangles))
    for c in range(len(triangles)):
        a, b, d = triangles[c, 0], triangles[c, 1], triangles[c, 2]
        out[c] = 0.5 * abs((x[b, 0] - x[a, 0]) * (x[d, 1] - x[a, 1]) - (x[b, 1] - x[a, 1]) * (x[d, 0] - x[a, 0]))
    return out


@compiled
def least_jacobian(x, cells, gradients, orientation):
    """Least determinant of the maps of plane cells (cells, a), times their orientation, of reference gradients (2, points,
    a) at places ``x``; infinite without cells, NaN where one is."""
    least = np.inf
    for c in range(len(cells)):
        for q in range(gradients.shape[1]):
            xs = xt = ys = yt = 0.0
            for a in range(cells.shape[1]):
                node = cells[c, a]
                xs += gradients[0, q, a] * x[node, 0]
                ys += gradients[0, q, a] * x[node, 1]
                xt += gradients[1, q, a] * x[node, 0]
                yt += gradients[1, q, a] * x[node, 1]
            found = (xs * yt - ys * xt) * orientation[c]
            if found < least or found != found:
                least = found
    return least


@compiled
def lengths(vectors):
    """Lengths of vectors (cells, points, k): (cells, points)."""
    out = np.empty(vectors.shape[:2])
    for c in range(vectors.shape[0]):
        for q in range(vectors.shape[1]):
            square = 0.0
            for k in range(vectors.shape[2]):
                square += vectors[c, q, k] * vectors[c, q, k]
            out[c, q] = np.sqrt(square)
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
def sums_of_squares(values, others, chosen):
    """Of the chosen ones of some numbers, and of others: (2,)."""
    out = np.zeros(2)
    for i in chosen:
        out[0] += values[i] * values[i]
        out[1] += others[i] * others[i]
    return out


@compiled
def greatest(values, others):
    """Greatest size of some numbers (n, k), and of their differences from others; NaN where one is."""
    size = change = 0.0
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            number, away = abs(values[i, k]), abs(values[i, k] - others[i, k])
            if number > size or number != number:
                size = number
            if away > change or away != away:
                change = away
    return size, change


@compiled
def moments(values, sizes):
    """Sums of the squares of values (cells · points,) and of the values, each times the size (cells,) of its cell: (2,)."""
    out, points = np.zeros(2), len(values) // max(len(sizes), 1)
    for c in range(len(sizes)):
        for p in range(c * points, (c + 1) * points):
            out[0] += sizes[c] * values[p] * values[p]
            out[1] += sizes[c] * values[p]
    return out
