r"""Element matrices of the flow in the plane and in axisymmetry, compiled by numba: from the geometry to the insertion.

They are the tangents of ``terms.plastic_tangent``, ``terms.incompressibility`` and of the contact facets, more than twice
as fast as the general way by forms: half of a symmetric matrix is computed, and every entry of a cell knows its place.

With the gradients :math:`g_a` of the shape functions, :math:`h_a` these over the radius (0 in plane strain), the vectors
:math:`\tau_a=\hat\tau g_a+\hat\tau_\theta h_ae_r` and :math:`d_a=Dg_a+D_\theta h_ae_r`, the flow stress
:math:`\bar\sigma`, the regularised rate :math:`\dot{\bar\varepsilon}` and the softening c, the block of nodes a and b is

.. math:: \int\tfrac{2}{3\dot{\bar\varepsilon}}\Big[\bar\sigma\big(\tfrac12(g_a\!\cdot g_b\,I+g_b g_a^T)+h_ah_be_re_r^T\big)
   -\tfrac{c}{2\dot{\bar\varepsilon}}\big(\tau_ad_b^T+d_a\tau_b^T\big)\Big]dV .
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from .machine_code import compiled

SQRT1_2 = sqrt(0.5)


@compiled
def _at_point(x, cell, table, shape, axisymmetric, g, h):
    """Gradients by place (6, 2) and shape functions over the radius (6,) at one point, into ``g`` and ``h``; the volume per
    weight of the point."""
    j00 = j01 = j10 = j11 = r = 0.0
    for a in range(6):
        n = cell[a]
        j00 += x[n, 0] * table[a, 0]
        j01 += x[n, 0] * table[a, 1]
        j10 += x[n, 1] * table[a, 0]
        j11 += x[n, 1] * table[a, 1]
        r += x[n, 0] * shape[a]
    det = j00 * j11 - j01 * j10
    over = 1.0 / det
    for a in range(6):
        g[0, a] = (table[a, 0] * j11 - table[a, 1] * j10) * over
        g[1, a] = (table[a, 1] * j00 - table[a, 0] * j01) * over
    if not axisymmetric:
        return abs(det)
    for a in range(6):
        h[a] = shape[a] / r
    return abs(det) * 2.0 * pi * r


@compiled
def _strain_rate(solution, dofs, g, h):
    """Components rr, zz, hoop and rz of the strain rate."""
    rr = zz = hoop = rz = 0.0
    for a in range(6):
        vr, vz = solution[dofs[2 * a]], solution[dofs[2 * a + 1]]
        rr += g[0, a] * vr
        zz += g[1, a] * vz
        hoop += h[a] * vr
        rz += 0.5 * (g[1, a] * vr + g[0, a] * vz)
    return rr, zz, hoop, rz


@compiled
def _times(rr, zz, hoop, rz, g, h, out):
    """A symmetric tensor times the gradients: out (2, 6)."""
    for a in range(6):
        out[0, a] = rr * g[0, a] + rz * g[1, a] + hoop * h[a]
        out[1, a] = rz * g[0, a] + zz * g[1, a]


@compiled
def _add_point(g, h, t, d, mu, local):
    """Add mu (...) - (t_a d_b^T + d_a t_b^T) of one point for all pairs of nodes to ``local`` (rr, rz, zz; a; b)."""
    for a in range(6):
        g0, g1, h0, half0, half1 = mu * g[0, a], mu * g[1, a], mu * h[a], 0.5 * mu * g[0, a], 0.5 * mu * g[1, a]
        t0, t1, d0, d1 = t[0, a], t[1, a], d[0, a], d[1, a]
        for b in range(6):
            local[0, a, b] += g0 * g[0, b] + half1 * g[1, b] + h0 * h[b] - t0 * d[0, b] - d0 * t[0, b]
            local[1, a, b] += half1 * g[0, b] - t0 * d[1, b] - d0 * t[1, b]
            local[2, a, b] += g1 * g[1, b] + half0 * g[0, b] - t1 * d[1, b] - d1 * t[1, b]


@compiled
def _insert(local, constraint, places, values):
    """Add the blocks of a cell to the values of the matrix, at the places (15, 15) of its pairs of unknowns."""
    for a in range(6):
        for b in range(6):
            values[places[2 * a, 2 * b]] += local[0, a, b]
            values[places[2 * a, 2 * b + 1]] += local[1, a, b]
            values[places[2 * b + 1, 2 * a]] += local[1, a, b]
            values[places[2 * a + 1, 2 * b + 1]] += local[2, a, b]
    for m in range(3):
        for k in range(12):
            values[places[k, 12 + m]] += constraint[m, k]
            values[places[12 + m, k]] += constraint[m, k]


@compiled
def tangent(x, cells, dofs, weights, table, shape, hats, axisymmetric, solution, rate0, flow_stress, softening, stress,
            places, values):
    """Add the tangent of all cells to the values of a matrix.

    Parameters
    ----------
    x (nodes, 3), cells (cells, 6), dofs (cells, 15) unknowns: velocities node by node, then pressures · weights (points,),
    table (points, 6, 2) reference gradients, shape (points, 6), hats (points, 3) · solution (unknowns,), rate0
    regularisation, 1/s · flow_stress, softening (cells, points), stress (cells, points, 3 or 4) · places (cells, 15, 15)
    """
    last = stress.shape[2] - 1
    g, h, t, d = np.empty((2, 6)), np.zeros(6), np.empty((2, 6)), np.empty((2, 6))
    local, constraint = np.empty((3, 6, 6)), np.empty((3, 12))
    for c in range(len(cells)):
        local[:], constraint[:] = 0.0, 0.0
        for q in range(len(weights)):
            volume = weights[q] * _at_point(x, cells[c], table[q], shape[q], axisymmetric, g, h)
            rr, zz, hoop, rz = _strain_rate(solution, dofs[c], g, h)
            over = 1.0 / sqrt(2.0 / 3.0 * (rr * rr + zz * zz + hoop * hoop + 2.0 * rz * rz) + rate0 * rate0)
            factor = softening[c, q] * volume * over * over / 3.0
            _times(factor * rr, factor * zz, factor * hoop, factor * rz, g, h, d)
            tau = stress[c, q]
            _times(tau[0], tau[1], tau[2] if axisymmetric else 0.0, SQRT1_2 * tau[last], g, h, t)
            _add_point(g, h, t, d, volume * 2.0 / 3.0 * flow_stress[c, q] * over, local)
            for m in range(3):
                weighted = volume * hats[q, m]
                for a in range(6):
                    constraint[m, 2 * a] -= weighted * (g[0, a] + h[a])
                    constraint[m, 2 * a + 1] -= weighted * g[1, a]
        _insert(local, constraint, places[c], values)


@compiled
def strain_rates(x, cells, dofs, table, shape, axisymmetric, velocities, out):
    """Strain rates as Mandel vectors into ``out`` (cells, points, 3 or 4); arguments as of :func:`tangent`."""
    last = out.shape[2] - 1
    g, h = np.empty((2, 6)), np.zeros(6)
    for c in range(len(cells)):
        for q in range(len(table)):
            _at_point(x, cells[c], table[q], shape[q], axisymmetric, g, h)
            rr, zz, hoop, rz = _strain_rate(velocities, dofs[c], g, h)
            rates = out[c, q]
            rates[0], rates[1] = rr, zz
            if axisymmetric:
                rates[2] = hoop
            rates[last] = rz / SQRT1_2


@compiled
def facet_tangent(shape, weighted, places, values):
    """Add the contact tangents ``weighted`` (facets, points, 4), each times its surface, by the shape functions (points, 3)
    of the nodes of a facet, at the places (facets, 6, 6) of its velocities."""
    for f in range(len(weighted)):
        for q in range(len(shape)):
            for a in range(3):
                for b in range(3):
                    m = shape[q, a] * shape[q, b]
                    for i in range(2):
                        for j in range(2):
                            values[places[f, 2 * a + i, 2 * b + j]] += m * weighted[f, q, 2 * i + j]


@compiled
def places_of(starts, columns, dofs):
    """Where the pairs of unknowns (groups, k) lie in a matrix by rows with rising columns, (groups, k, k)."""
    count = dofs.shape[1]
    out = np.empty((len(dofs), count, count), np.int32)
    for c in range(len(dofs)):
        for i in range(count):
            first, end = starts[dofs[c, i]], starts[dofs[c, i] + 1]
            for j in range(count):
                low, high, wanted = first, end, dofs[c, j]
                while low < high:
                    middle = (low + high) // 2
                    if columns[middle] < wanted:
                        low = middle + 1
                    else:
                        high = middle
                out[c, i, j] = low
    return out
