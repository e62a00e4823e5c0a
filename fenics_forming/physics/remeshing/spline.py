"""Cubic splines through points of the plane, and lengths of parabolas: compiled by numba.

Between knots s_i with the points y_i and the slopes d_i a spline is Hermite's cubic; the slopes make its curvature
continuous,

    h_i d_(i-1) + 2 (h_(i-1) + h_i) d_i + h_(i-1) d_(i+1) = 3 (h_i m_(i-1) + h_(i-1) m_i),

with h_i = s_(i+1) - s_i and m_i = (y_(i+1) - y_i) / h_i; at open ends the first (last) two cubics are one, "not a knot"
(C. de Boor, A Practical Guide to Splines, 1978, chapter IV).
"""

from __future__ import annotations

import numpy as np

from ..machine_code import compiled

GAUSS = np.polynomial.legendre.leggauss(4)


class Spline:
    """The cubic spline through points.

    Parameters
    ----------
    knots : (n,) rising, mm
    points : (n, 2) mm; of a closed one the last is the first
    """

    def __init__(self, knots: np.ndarray, points: np.ndarray, closed: bool):
        self._knots, self._points = knots, np.ascontiguousarray(points)
        self._slopes = _slopes_around(knots, self._points) if closed else _slopes(knots, self._points)

    def __call__(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and derivatives by s, (k, 2) each, at s (k,)."""
        return _evaluated(self._knots, self._points, self._slopes, s)


def half_lengths(points: np.ndarray) -> np.ndarray:
    """Lengths of both halves of the parabolas through (2 k + 1, 2) points: (2 k,)."""
    return _half_lengths(points, *GAUSS)


@compiled
def _evaluated(knots, points, slopes, s):
    values, derivatives = np.empty((len(s), 2)), np.empty((len(s), 2))
    for p in range(len(s)):
        i = min(max(np.searchsorted(knots, s[p], side="right") - 1, 0), len(knots) - 2)
        h = knots[i + 1] - knots[i]
        t = (s[p] - knots[i]) / h
        for c in range(2):
            rise = points[i + 1, c] - points[i, c]
            first, last = h * slopes[i, c] - rise, rise - h * slopes[i + 1, c]
            values[p, c] = points[i, c] + t * (rise + (1 - t) * ((1 - t) * first + t * last))
            derivatives[p, c] = (rise + (1 - t) * (1 - 3 * t) * first + t * (2 - 3 * t) * last) / h
    return values, derivatives


@compiled
def _solved(below, middle, above, right):
    """Solve a tridiagonal system, right (n, k) in place; ``middle`` is overwritten. Row i has below[i], middle[i],
    above[i]."""
    for i in range(1, len(middle)):
        share = below[i] / middle[i - 1]
        middle[i] -= share * above[i - 1]
        for c in range(right.shape[1]):
            right[i, c] -= share * right[i - 1, c]
    for i in range(len(middle) - 1, -1, -1):
        for c in range(right.shape[1]):
            if i < len(middle) - 1:
                right[i, c] -= above[i] * right[i + 1, c]
            right[i, c] /= middle[i]


@compiled
def _slopes(knots, points):
    """Slopes (n, 2) at the knots of an open spline."""
    n = len(knots)
    h, out = np.diff(knots), np.empty((n, 2))
    m = np.empty((n - 1, 2))
    for i in range(n - 1):
        for c in range(2):
            m[i, c] = (points[i + 1, c] - points[i, c]) / h[i]
    if n == 2:
        out[0], out[1] = m[0], m[0]
        return out
    below, middle, above = np.zeros(n), np.empty(n), np.zeros(n)
    for i in range(1, n - 1):
        below[i], middle[i], above[i] = h[i], 2 * (h[i - 1] + h[i]), h[i - 1]
        for c in range(2):
            out[i, c] = 3 * (h[i] * m[i - 1, c] + h[i - 1] * m[i, c])
    if n == 3:          # the parabola
        middle[0] = above[0] = middle[2] = below[2] = 1.0
        for c in range(2):
            out[0, c], out[2, c] = 2 * m[0, c], 2 * m[1, c]
    else:
        first, last = h[0] + h[1], h[-1] + h[-2]
        middle[0], above[0], middle[n - 1], below[n - 1] = h[1], first, h[-2], last
        for c in range(2):
            out[0, c] = ((h[0] + 2 * first) * h[1] * m[0, c] + h[0] ** 2 * m[1, c]) / first
            out[n - 1, c] = (h[-1] ** 2 * m[-2, c] + (2 * last + h[-1]) * h[-2] * m[-1, c]) / last
    _solved(below, middle, above, out)
    return out


@compiled
def _slopes_around(knots, points):
    """Slopes (n, 2) at the knots of a closed spline of three cubics at least: the corners of the matrix are one product of
    vectors, taken out by Sherman's and Morrison's formula."""
    n = len(knots) - 1
    h = np.diff(knots)
    right = np.empty((n, 3))             # of both components, and of the vector of the corners
    below, middle, above = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        before = h[i - 1]
        below[i], middle[i], above[i] = h[i], 2 * (before + h[i]), before
        for c in range(2):
            right[i, c] = 3 * (h[i] * (points[i, c] - points[i - 1 if i > 0 else n - 1, c]) / before
                               + before * (points[i + 1, c] - points[i, c]) / h[i])
        right[i, 2] = 0.0
    corner = -middle[0]
    up, down = below[0], above[n - 1]    # what couples the first with the last, and the last with the first
    right[0, 2], right[n - 1, 2] = corner, down
    middle[0] -= corner
    middle[n - 1] -= up * down / corner
    _solved(below, middle, above, right)
    out = np.empty((n + 1, 2))
    for c in range(2):
        share = (right[0, c] + up / corner * right[n - 1, c]) / (1.0 + right[0, 2] + up / corner * right[n - 1, 2])
        out[:n, c] = right[:, c] - share * right[:, 2]
    out[n] = out[0]
    return out


@compiled
def _half_lengths(points, nodes, weights):
    out = np.zeros(len(points) - 1)
    for k in range(len(out)):
        i = k // 2 * 2
        low = 0.5 * (k % 2)
        for q in range(len(nodes)):
            t, squares = low + 0.25 * (nodes[q] + 1), 0.0
            for c in range(points.shape[1]):
                speed = (4 * t - 3) * points[i, c] + (4 - 8 * t) * points[i + 1, c] + (4 * t - 1) * points[i + 2, c]
                squares += speed * speed
            out[k] += 0.25 * weights[q] * np.sqrt(squares)
    return out
