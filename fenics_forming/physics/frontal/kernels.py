r"""Factorisation of the flow's matrix by fronts, and solution with the factors, compiled by numba.

With velocities before pressures on every front, none of them needs a pivot: what is left of the velocities is positive
definite, what is left of the pressures negative definite, and

.. math:: \begin{pmatrix}A&B^T\\B&-C\end{pmatrix}=L\begin{pmatrix}I&\\&-I\end{pmatrix}L^T

is two factorisations of Cholesky (R. J. Vanderbei, SIAM J. Optim. 5, 1995, 100). A panel holds the columns of L of a front:
its own unknowns and below them its boundary, column after column.
"""

from __future__ import annotations

import numpy as np

from ..machine_code import compiled
from .blas import GEMM, POTRF, SYRK, TRSM, address, call

DOUBLE = 8      # bytes


@compiled
def places(starts, columns, order, boundary, fronts, source, target, parts):
    """Which entry of the symmetric matrix by rows (``starts``, ``columns``) goes where in the panels: fills ``source``,
    ``target`` and ``parts`` of :func:`factorise`, and into ``fronts`` where the entries of each end."""
    rank, place = np.empty(len(order), np.int64), np.empty(len(order), np.int64)
    for k in range(len(order)):
        rank[order[k]] = k
    count = 0
    for f in range(len(fronts)):
        own, many, first, begin = fronts[f, 1], fronts[f, 2], fronts[f, 3], fronts[f, 5]
        for k in range(own):
            place[first + k] = k
        for k in range(many):
            place[boundary[begin + k]] = own + k
        for child in fronts[f, 6:8]:
            if child >= 0:
                for k in range(fronts[child, 5], fronts[child, 5] + fronts[child, 2]):
                    parts[k] = place[boundary[k]]
        for k in range(own):
            row = order[first + k]
            for entry in range(starts[row], starts[row + 1]):
                met = rank[columns[entry]]
                if met >= first + k:
                    source[count], target[count] = entry, k * (own + many) + place[met]
                    count += 1
        fronts[f, 9] = count


@compiled
def factorise(values, words, fronts, source, target, parts, panels, work):
    """Factors of the matrix of ``values`` into ``panels``; whether every front could be factorised.

    words : of :class:`blas.Words`, which has to outlive the call
    fronts (fronts, 10) : own velocities, own unknowns, boundary, first own unknown, where the panel begins, where the
        boundary begins in its list, the two fronts that it consists of (or -1), where in ``work`` what is left of the
        boundary's matrix lies, where its entries end
    source, target (entries,) : which value goes where in the panel of its front
    parts (all,) : place of a front's boundary among the unknowns of the front it is a part of, own ones first
    """
    entry = 0
    for f in range(len(fronts)):
        velocities, own, boundary, begin, rest = fronts[f, 0], fronts[f, 1], fronts[f, 2], fronts[f, 4], fronts[f, 8]
        size = own + boundary
        panel, left = panels[begin: begin + own * size], work[rest: rest + boundary * boundary]
        panel[:] = 0.0
        left[:] = 0.0
        for e in range(entry, fronts[f, 9]):
            panel[target[e]] = values[source[e]]
        entry = fronts[f, 9]
        for child in fronts[f, 6:8]:
            if child >= 0:
                many, start, there = fronts[child, 2], fronts[child, 5], fronts[child, 8]
                _take(work[there: there + many * many], parts[start: start + many], own, size, panel, left)
        if not _eliminate(panel, left, velocities, own, size, words):
            return False
    return True


@compiled
def _take(given, places, own, size, panel, left):
    """Add what is left of a part to the lower half of a front."""
    many, boundary = len(places), size - own
    for j in range(many):
        column = places[j]
        if column < own:
            into, offset = panel, column * size
        else:
            into, offset = left, (column - own) * boundary - own
        for i in range(j, many):
            into[offset + places[i]] += given[j * many + i]


@compiled
def _eliminate(panel, left, velocities, own, size, words):
    """The own unknowns of a front; whether both halves of them are definite."""
    routines, counts = words.routines, words.counts
    n, one, lower = address(counts), address(words.signs), address(words.letters)
    first, rest = address(panel), address(left)
    rows, ld, info = n + 4, n + 8, n + 12
    minus, plain, turned, right = one + DOUBLE, lower + 1, lower + 2, lower + 3
    boundary, pressures = size - own, own - velocities
    counts[2] = size
    for pressing in range(2):
        start, count = (velocities, pressures) if pressing else (0, velocities)
        if count == 0:
            continue
        corner = first + DOUBLE * start * (size + 1)
        below = corner + DOUBLE * count
        counts[0], counts[1] = count, size - start - count
        call(routines[POTRF], (lower, n, corner, ld, info))
        if counts[3] != 0:
            return False
        if counts[1] > 0:
            call(routines[TRSM], (right, lower, turned, plain, rows, n, one, corner, ld, below, ld))
        if not pressing and pressures > 0:
            counts[3] = pressures
            call(routines[GEMM], (plain, turned, rows, info, n, minus, below, ld, below, ld, one,
                                  below + DOUBLE * size * count, ld))
            for k in range(velocities * size, own * size):
                panel[k] = -panel[k]
        if boundary > 0:
            counts[1] = boundary
            call(routines[SYRK], (lower, plain, rows, n, one if pressing else minus, corner + DOUBLE * (own - start), ld,
                                  one, rest, rows))
    return True


@compiled
def solve(fronts, boundary, panels, order, b, x):
    """The answer ``x`` to the right-hand side ``b`` with the factors, both (unknowns,) in the order of the matrix."""
    y, below = b[order], np.empty(fronts[:, 2].max())
    for f in range(len(fronts)):
        velocities, own, many, first, begin, start = fronts[f, :6]
        size, mine = own + many, y[first: first + own]
        below[:many] = 0.0
        for j in range(own):
            column = panels[begin + j * size: begin + (j + 1) * size]
            mine[j] /= column[j]
            met = mine[j]
            for i in range(j + 1, own):
                mine[i] -= column[i] * met
            for i in range(many):
                below[i] += column[own + i] * met
        for i in range(many):
            y[boundary[start + i]] -= below[i]
        for j in range(velocities, own):
            mine[j] = -mine[j]
    for f in range(len(fronts) - 1, -1, -1):
        velocities, own, many, first, begin, start = fronts[f, :6]
        size, mine = own + many, y[first: first + own]
        for i in range(many):
            below[i] = y[boundary[start + i]]
        for j in range(own - 1, -1, -1):
            column = panels[begin + j * size: begin + (j + 1) * size]
            met = mine[j]
            for i in range(j + 1, own):
                met -= column[i] * mine[i]
            for i in range(many):
                met -= column[own + i] * below[i]
            mine[j] = met / column[j]
    for k in range(len(order)):
        x[order[k]] = y[k]
