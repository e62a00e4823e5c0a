"""Feet of perpendiculars on quadratic sides, compiled by numba: Gauss-Newton for one point after the other."""

from __future__ import annotations

import numpy as np

from .bvh import _compile

STEPS = 12          # of Gauss-Newton; the distance is small against the curvature
SETTLED = 1e-13     # of a barycentric coordinate: a foot that moves by less stays
FLAT = 1e-14        # of the metric, added to it: a side without extent stops no one
ON_EDGE = 1e-12     # a barycentric coordinate below is that of a point of the opposite edge


@_compile
def _shape_functions(inner, ends, shapes, slopes):
    """Quadratic shapes (n,) at barycentric coordinates (dim,), and their derivatives by the last dim - 1 of them."""
    dim = inner.size
    for a in range(dim):
        shapes[a] = inner[a] * (2 * inner[a] - 1)
        for t in range(dim - 1):
            slopes[a, t] = 4 * inner[a] - 1 if a == t + 1 else (1 - 4 * inner[0] if a == 0 else 0.0)
    for k in range(len(ends)):
        a, b = ends[k, 0], ends[k, 1]
        shapes[dim + k] = 4 * inner[a] * inner[b]
        for t in range(dim - 1):
            da = 1.0 if a == t + 1 else (-1.0 if a == 0 else 0.0)
            db = 1.0 if b == t + 1 else (-1.0 if b == 0 else 0.0)
            slopes[dim + k, t] = 4 * (da * inner[b] + db * inner[a])


@_compile
def _on_side(side, shapes, slopes, foot, tangents):
    """The foot (dim,) and the tangents (dim - 1, dim) there of a side with nodes (n, dim)."""
    for i in range(side.shape[1]):
        foot[i] = 0.0
        for t in range(len(tangents)):
            tangents[t, i] = 0.0
        for a in range(len(side)):
            foot[i] += shapes[a] * side[a, i]
            for t in range(len(tangents)):
                tangents[t, i] += slopes[a, t] * side[a, i]


@_compile
def _along_side(away, tangents):
    """By how much the last barycentric coordinates change on the way along the tangents that ``away`` goes."""
    dim = away.size
    m00 = m01 = m11 = r0 = r1 = 0.0
    for i in range(dim):
        r0 += tangents[0, i] * away[i]
        m00 += tangents[0, i] ** 2
        if dim == 3:
            r1 += tangents[1, i] * away[i]
            m01 += tangents[0, i] * tangents[1, i]
            m11 += tangents[1, i] ** 2
    least = FLAT * (m00 + m11)
    m00, m11 = m00 + least, m11 + least
    if dim == 2:
        return r0 / m00, 0.0
    det = m00 * m11 - m01 * m01
    return (m11 * r0 - m01 * r1) / det, (m00 * r1 - m01 * r0) / det


@_compile
def _advanced(inner, away, tangents):
    """A Gauss-Newton step of the barycentric coordinates towards the nearest place, within the side; by how much they
    change at most."""
    dim = inner.size
    s0, s1 = _along_side(away, tangents)
    whole = change = 0.0
    for k in range(dim):
        free = inner[k] + (-(s0 + s1) if k == 0 else (s0 if k == 1 else s1))
        whole += max(free, 0.0)
    for k in range(dim):
        free = max(inner[k] + (-(s0 + s1) if k == 0 else (s0 if k == 1 else s1)), 0.0) / whole
        change = max(change, abs(free - inner[k]))
        inner[k] = free
    return change


@_compile
def find_feet(points, facet, start, nodes, ends, rim, reach):
    """Feet of points on given quadratic sides.

    The shapes of a point beside the rim are those of the tangent that goes on beyond it, so that its foot is below it and
    moments balance.

    Parameters
    ----------
    points : (k, dim) · facet : (k,) side of each · start : (k, dim) barycentric coordinates there
    nodes : (f, n, dim) of the sides · ends : (edges, 2) vertices at whose middle the mid-nodes are
    rim : (f, dim) whether the surface ends, or turns sharply, at the edge opposite to a vertex
    reach : (k,) mm, by which a point may reach over the rim and still have a foot beyond it

    Returns
    -------
    shapes (k, n) at the feet, gap (k,) along the outward normal (k, dim), and how far they are beyond the rim (k,), mm
    """
    count, dim, n = len(points), points.shape[1], nodes.shape[1]
    shapes, gap, normal, beyond = np.empty((count, n)), np.empty(count), np.empty((count, dim)), np.zeros(count)
    slopes, foot, tangents, away = np.empty((n, dim - 1)), np.empty(dim), np.empty((dim - 1, dim)), np.empty(dim)
    inner = np.empty(dim)
    for p in range(count):
        side = nodes[facet[p]]
        inner[:] = start[p]
        for step in range(STEPS + 1):
            _shape_functions(inner, ends, shapes[p], slopes)
            _on_side(side, shapes[p], slopes, foot, tangents)
            for i in range(dim):
                away[i] = points[p, i] - foot[i]
            if step == STEPS or _advanced(inner, away, tangents) < SETTLED:
                break
        if dim == 2:
            normal[p, 0], normal[p, 1] = tangents[0, 1], -tangents[0, 0]
        else:
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                normal[p, i] = tangents[0, j] * tangents[1, k] - tangents[0, k] * tangents[1, j]
        length = np.sqrt((normal[p] ** 2).sum())
        gap[p] = 0.0
        for i in range(dim):
            normal[p, i] /= length
            gap[p] += away[i] * normal[p, i]
        beside, at_rim = 0.0, False
        for i in range(dim):
            beside += (away[i] - gap[p] * normal[p, i]) ** 2
            at_rim = at_rim or (inner[i] < ON_EDGE and rim[facet[p], i])
        if at_rim:
            beyond[p] = np.sqrt(beside)
            if beyond[p] <= reach[p]:
                way = _along_side(away, tangents)
                for a in range(n):
                    for t in range(dim - 1):
                        shapes[p, a] += slopes[a, t] * way[t]
    return shapes, gap, normal, beyond
