"""The first triangle that a ray meets, compiled by numba; only bodies in space that are remeshed import it."""

import numpy as np

from ..contact.bvh import _compile, build

NEAR = 1e-9     # of the reach: nearer than this a ray only meets the side that it starts from


def first_hits(corners, origins, directions, reach):
    """Distance and number of the first triangle on each ray, not farther than `reach`.

    Parameters
    ----------
    corners : (m, 3, 3) triangles
    origins, directions : (n, 3), unit directions

    Returns
    -------
    distance (n,), inf for none; triangle (n,), -1 for none
    """
    order, boxes = build(corners.min(axis=1), corners.max(axis=1))
    return _first_hits(np.ascontiguousarray(corners[order]), order, boxes, np.ascontiguousarray(origins),
                       np.ascontiguousarray(directions), reach)


@_compile
def _meets_box(boxes, node, o, d, most):
    low, high = 0.0, most
    for k in range(3):
        if abs(d[k]) < 1e-300:
            if o[k] < boxes[node, 0, k] or o[k] > boxes[node, 1, k]:
                return False
        else:
            a, b = (boxes[node, 0, k] - o[k]) / d[k], (boxes[node, 1, k] - o[k]) / d[k]
            low, high = max(low, min(a, b)), min(high, max(a, b))
    return low <= high * (1 + 1e-12)


@_compile
def _distance_along(t, i, o, d):
    """Where the ray meets triangle i, inf if it does not (Moeller and Trumbore, J. Graphics Tools 2 (1997) 21-28)."""
    e1, e2, s = t[i, 1] - t[i, 0], t[i, 2] - t[i, 0], o - t[i, 0]
    p = np.cross(d, e2)
    det = (e1 * p).sum()
    if det == 0.0:
        return np.inf
    u = (s * p).sum() / det
    if u < -1e-12 or u > 1 + 1e-12:
        return np.inf
    q = np.cross(s, e1)
    v = (d * q).sum() / det
    if v < -1e-12 or u + v > 1 + 1e-12:
        return np.inf
    return (e2 * q).sum() / det


@_compile
def _first_hits(triangles, order, boxes, origins, directions, reach):
    n, m = len(origins), len(triangles)
    distance, hit = np.full(n, np.inf), np.full(n, -1, np.int64)
    stack = np.empty((128, 3), np.int64)
    inner = len(boxes) // 2
    for i in range(n):
        o, d, best = origins[i], directions[i], reach
        stack[0, 0], stack[0, 1], stack[0, 2] = 0, 0, m
        top = 1
        while top > 0:
            top -= 1
            node, lo, hi = stack[top, 0], stack[top, 1], stack[top, 2]
            if not _meets_box(boxes, node, o, d, best):
                continue
            if node >= inner:
                for j in range(lo, hi):
                    along = _distance_along(triangles, j, o, d)
                    if NEAR * reach < along <= best:
                        best, distance[i], hit[i] = along, along, order[j]
            else:
                middle = (lo + hi) // 2
                stack[top, 0], stack[top, 1], stack[top, 2] = 2 * node + 1, lo, middle
                stack[top + 1, 0], stack[top + 1, 1], stack[top + 1, 2] = 2 * node + 2, middle, hi
                top += 2
    return distance, hit
