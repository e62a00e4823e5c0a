r"""Element matrices of the flow in space, compiled by numba: tangent, its coarse copy, pressure mass, divergence.

All of a cell is done at once, from its geometry to the insertion, and only upper halves of symmetric matrices are kept.
Insertion costs nothing: every pair of nodes of a cell knows its place. That makes them three times as fast as the general
way, with forms and a matrix that looks for its columns (``benchmarks/solver3d.py``). Only the iterative solver imports
them.

With the gradients :math:`g_a` of the shape functions, the flow stress :math:`\bar\sigma`, the regularised rate
:math:`\dot{\bar\varepsilon}`, the strain rate D, the independent stress :math:`\hat\tau` and the softening c, the block of
nodes a and b of ``terms.plastic_tangent`` is

.. math:: \int\tfrac{2}{3\dot{\bar\varepsilon}}\Big[\tfrac{\bar\sigma}{2}\big(g_a\!\cdot g_b\,I+g_b g_a^T\big)
   -\tfrac{c}{2\dot{\bar\varepsilon}}\big((\hat\tau g_a)(Dg_b)^T+(Dg_a)(\hat\tau g_b)^T\big)\Big]dV .
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..machine_code import compiled

SQRT1_2 = sqrt(0.5)


@compiled
def _mapping(x, cell, table, inverse):
    """Inverse (3, 3) of the derivative of the cell map at one point, into ``inverse``; the determinant, positive."""
    j = np.zeros((3, 3))
    for a in range(10):
        n = cell[a]
        for i in range(3):
            for k in range(3):
                j[i, k] += x[n, i] * table[a, k]
    c00 = j[1, 1] * j[2, 2] - j[1, 2] * j[2, 1]
    c01 = j[1, 2] * j[2, 0] - j[1, 0] * j[2, 2]
    c02 = j[1, 0] * j[2, 1] - j[1, 1] * j[2, 0]
    det = j[0, 0] * c00 + j[0, 1] * c01 + j[0, 2] * c02
    r = 1.0 / det
    inverse[0, 0], inverse[1, 0], inverse[2, 0] = c00 * r, c01 * r, c02 * r
    inverse[0, 1] = (j[0, 2] * j[2, 1] - j[0, 1] * j[2, 2]) * r
    inverse[1, 1] = (j[0, 0] * j[2, 2] - j[0, 2] * j[2, 0]) * r
    inverse[2, 1] = (j[0, 1] * j[2, 0] - j[0, 0] * j[2, 1]) * r
    inverse[0, 2] = (j[0, 1] * j[1, 2] - j[0, 2] * j[1, 1]) * r
    inverse[1, 2] = (j[0, 2] * j[1, 0] - j[0, 0] * j[1, 2]) * r
    inverse[2, 2] = (j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]) * r
    return abs(det)


@compiled
def _tensor(mandel, factor, out):
    """A Mandel vector times ``factor`` as a symmetric (3, 3) tensor."""
    for i in range(3):
        out[i, i] = mandel[i] * factor
    out[1, 2] = out[2, 1] = mandel[3] * factor * SQRT1_2
    out[0, 2] = out[2, 0] = mandel[4] * factor * SQRT1_2
    out[0, 1] = out[1, 0] = mandel[5] * factor * SQRT1_2


@compiled
def _add_tangent(g, s, t, mu, local):
    """Add mu/2 (g_a·g_b I + g_b g_a^T) - (t_a s_b^T + s_a t_b^T) for all pairs a <= b to ``local`` (pairs, 9)."""
    pair = 0
    for a in range(len(g)):
        g0, g1, g2 = 0.5 * mu * g[a, 0], 0.5 * mu * g[a, 1], 0.5 * mu * g[a, 2]
        s0, s1, s2 = s[a, 0], s[a, 1], s[a, 2]
        t0, t1, t2 = t[a, 0], t[a, 1], t[a, 2]
        for b in range(a, len(g)):
            h0, h1, h2 = g[b, 0], g[b, 1], g[b, 2]
            p0, p1, p2 = s[b, 0], s[b, 1], s[b, 2]
            q0, q1, q2 = t[b, 0], t[b, 1], t[b, 2]
            e = g0 * h0 + g1 * h1 + g2 * h2
            out = local[pair]
            out[0] += e + h0 * g0 - t0 * p0 - s0 * q0
            out[1] += h0 * g1 - t0 * p1 - s0 * q1
            out[2] += h0 * g2 - t0 * p2 - s0 * q2
            out[3] += h1 * g0 - t1 * p0 - s1 * q0
            out[4] += e + h1 * g1 - t1 * p1 - s1 * q1
            out[5] += h1 * g2 - t1 * p2 - s1 * q2
            out[6] += h2 * g0 - t2 * p0 - s2 * q0
            out[7] += h2 * g1 - t2 * p1 - s2 * q1
            out[8] += e + h2 * g2 - t2 * p2 - s2 * q2
            pair += 1


@compiled
def _insert(local, nodes, place, diagonal, upper):
    """Add the blocks (pairs, 9) of a cell to those of the whole body; a place below 0 is that of the transposed block."""
    pair = off = 0
    count = len(nodes)
    for a in range(count):
        block = diagonal[nodes[a]]
        for i in range(9):
            block[i] += local[pair, i]
        pair += 1
        for _ in range(a + 1, count):
            at, out = place[off], local[pair]
            if at >= 0:
                block = upper[at]
                for i in range(9):
                    block[i] += out[i]
            else:
                block = upper[-1 - at]
                for i in range(3):
                    for j in range(3):
                        block[3 * i + j] += out[3 * j + i]
            off += 1
            pair += 1


@compiled
def _by_place(table, inverse, tensor, out, gradient):
    """Gradients by place (n, 3) of shape functions, and a tensor times each of them."""
    for a in range(len(table)):
        for i in range(3):
            gradient[a, i] = table[a, 0] * inverse[0, i] + table[a, 1] * inverse[1, i] + table[a, 2] * inverse[2, i]
    _times(tensor, gradient, len(table), out)


@compiled
def _times(tensor, gradient, count, out):
    for a in range(count):
        for i in range(3):
            out[a, i] = tensor[i, 0] * gradient[a, 0] + tensor[i, 1] * gradient[a, 1] + tensor[i, 2] * gradient[a, 2]


@compiled
def tangent(order, x, cells, corners, weights, table, hats, hat_table, flow_stress, rate, softening, strain_rate, stress,
            places, diagonal, upper, coarse_places, coarse_diagonal, coarse_upper, mass_diagonal, mass_upper):
    """Add the tangent of all cells: on the nodes, on the vertices alone, and the pressure mass over the viscosity.

    Parameters
    ----------
    order (cells,) in which they are taken · x (nodes, 3), cells (cells, 10), corners (cells, 4) numbers of the vertices ·
    weights (points,), table (points, 10, 3) reference gradients, hats (points, 4), hat_table (4, 3) · flow_stress, rate,
    softening (cells, points), strain_rate, stress (cells, points, 6) · places (cells, 45), diagonal (nodes, 9), upper
    (pairs, 9) · the same
    of the vertices · mass_diagonal (vertices,), mass_upper (pairs,)
    """
    g, s, t = np.empty((10, 3)), np.empty((10, 3)), np.empty((10, 3))
    h, hs, ht = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    D, T, inverse = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    local, coarse, pressures = np.empty((55, 9)), np.empty((10, 9)), np.empty(10)
    for c in order:
        local[:], coarse[:], pressures[:] = 0.0, 0.0, 0.0
        for q in range(len(weights)):
            volume = weights[q] * _mapping(x, cells[c], table[q], inverse)
            r = 1.0 / rate[c, q]
            mu = volume * 2.0 / 3.0 * flow_stress[c, q] * r
            _tensor(strain_rate[c, q], softening[c, q] * volume * r * r / 3.0, D)
            _tensor(stress[c, q], 1.0, T)
            _by_place(table[q], inverse, D, s, g)
            _times(T, g, 10, t)
            _add_tangent(g, s, t, mu, local)
            _by_place(hat_table, inverse, D, hs, h)
            _times(T, h, 4, ht)
            _add_tangent(h, hs, ht, mu, coarse)
            pair = 0
            for a in range(4):
                for b in range(a, 4):
                    pressures[pair] += volume * volume / mu * hats[q, a] * hats[q, b]
                    pair += 1
        _insert(local, cells[c], places[c], diagonal, upper)
        _insert(coarse, corners[c], coarse_places[c], coarse_diagonal, coarse_upper)
        pair = off = 0
        for a in range(4):
            mass_diagonal[corners[c, a]] += pressures[pair]
            pair += 1
            for _ in range(a + 1, 4):
                at = coarse_places[c, off]
                mass_upper[at if at >= 0 else -1 - at] += pressures[pair]
                off += 1
                pair += 1


@compiled
def divergence(x, cells, weights, table, hats, places, blocks):
    r"""Add :math:`-\int q\,\nabla\!\cdot v` of all cells: to the blocks (pairs of vertex and node, 3) at the places (cells,
    40)."""
    inverse, g, none, local = np.empty((3, 3)), np.empty((10, 3)), np.zeros((3, 3)), np.empty((40, 3))
    spare = np.empty((10, 3))
    for c in range(len(cells)):
        local[:] = 0.0
        for q in range(len(weights)):
            volume = weights[q] * _mapping(x, cells[c], table[q], inverse)
            _by_place(table[q], inverse, none, spare, g)
            for a in range(4):
                for b in range(10):
                    for i in range(3):
                        local[10 * a + b, i] -= volume * hats[q, a] * g[b, i]
        for k in range(40):
            for i in range(3):
                blocks[places[c, k], i] += local[k, i]


@compiled
def volumes(x, cells, weights, table, out):
    """Volume that belongs to the points, (cells, points), mm³."""
    inverse = np.empty((3, 3))
    for c in range(len(cells)):
        for q in range(len(weights)):
            out[c, q] = weights[q] * _mapping(x, cells[c], table[q], inverse)


@compiled
def mass_blocks(cells, shape, weighted, places, diagonal, upper):
    """Add a term c v·w, with ``weighted`` (cells, points) c times the volume of the points, by the shape functions (points,
    k) of the nodes (cells, k)."""
    count = shape.shape[1]
    local = np.zeros((count * (count + 1) // 2, 9))
    for c in range(len(cells)):
        pair = 0
        for a in range(count):
            for b in range(a, count):
                m = 0.0
                for q in range(len(shape)):
                    m += weighted[c, q] * shape[q, a] * shape[q, b]
                local[pair, 0] = local[pair, 4] = local[pair, 8] = m
                pair += 1
        _insert(local, cells[c], places[c], diagonal, upper)


@compiled
def facet_blocks(nodes, shape, weighted, places, diagonal, upper):
    """Add the contact tangents ``weighted`` (facets, points, 9), each times its surface, to the nodes (facets, k) of the
    facets, by the shape functions (points, k) of these."""
    count = shape.shape[1]
    local = np.empty((count * (count + 1) // 2, 9))
    for f in range(len(nodes)):
        local[:] = 0.0
        for q in range(len(shape)):
            pair = 0
            for a in range(count):
                for b in range(a, count):
                    m = shape[q, a] * shape[q, b]
                    for i in range(9):
                        local[pair, i] += m * weighted[f, q, i]
                    pair += 1
        _insert(local, nodes[f], places[f], diagonal, upper)
