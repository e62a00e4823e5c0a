"""Bounding-volume hierarchy: nearest triangle (3D) or nearest piece of a polyline (2D), compiled by numba.

The tree is balanced and has no pointers: node i owns items lo..hi of a reordered list, its children 2i+1 and
2i+2 own the two halves, so ranges are computed on the way down. Only tools that need a search import this
module.
"""

import numpy as np
from numba import njit

LEAF = 4


def _compile(function):
    """Compile, with the machine code kept on disk where some folder for that is writable."""
    try:
        return njit(cache=True)(function)
    except RuntimeError:        # numba found neither the source tree nor the user's cache folder writable
        return njit(function)


@_compile
def build(low, high):
    """Tree over items with bounding boxes.

    Parameters
    ----------
    low, high : array (m, d)
        Boxes of the items.

    Returns
    -------
    order : int array (m,)
        Items in the order of the tree.
    boxes : array (nodes, 2, d)
        Low and high corner per node.
    """
    m, d = low.shape
    depth = 0
    while (m + (1 << depth) - 1) >> depth > LEAF:
        depth += 1
    nodes = (1 << (depth + 1)) - 1
    boxes = np.empty((nodes, 2, d))
    order = np.arange(m)
    ranges = np.empty((nodes, 2), np.int64)
    ranges[0, 0], ranges[0, 1] = 0, m
    for node in range(nodes):
        lo, hi = ranges[node, 0], ranges[node, 1]
        for k in range(d):
            boxes[node, 0, k], boxes[node, 1, k] = np.inf, -np.inf
        axis, widest = 0, -1.0
        for k in range(d):
            least, most = np.inf, -np.inf
            for i in order[lo:hi]:
                boxes[node, 0, k] = min(boxes[node, 0, k], low[i, k])
                boxes[node, 1, k] = max(boxes[node, 1, k], high[i, k])
                centre = low[i, k] + high[i, k]
                least, most = min(least, centre), max(most, centre)
            if most - least > widest:
                axis, widest = k, most - least
        if 2 * node + 2 < nodes:
            part = order[lo:hi].copy()
            order[lo:hi] = part[np.argsort(low[part, axis] + high[part, axis])]
            middle = (lo + hi) // 2
            ranges[2 * node + 1, 0], ranges[2 * node + 1, 1] = lo, middle
            ranges[2 * node + 2, 0], ranges[2 * node + 2, 1] = middle, hi
    return order, boxes


@_compile
def refit(triangles, boxes):
    """The boxes of a tree, in place, for triangles (m, 3, 3), sorted as the tree is, that have moved since it was built."""
    nodes = len(boxes)
    ranges = np.empty((nodes, 2), np.int64)
    ranges[0, 0], ranges[0, 1] = 0, len(triangles)
    for node in range((nodes - 1) // 2):
        lo, hi = ranges[node, 0], ranges[node, 1]
        middle = (lo + hi) // 2
        ranges[2 * node + 1, 0], ranges[2 * node + 1, 1] = lo, middle
        ranges[2 * node + 2, 0], ranges[2 * node + 2, 1] = middle, hi
    for node in range(nodes - 1, -1, -1):
        for k in range(3):
            least, most = np.inf, -np.inf
            if 2 * node + 2 < nodes:
                least = min(boxes[2 * node + 1, 0, k], boxes[2 * node + 2, 0, k])
                most = max(boxes[2 * node + 1, 1, k], boxes[2 * node + 2, 1, k])
            else:
                for i in range(ranges[node, 0], ranges[node, 1]):
                    for corner in range(3):
                        least, most = min(least, triangles[i, corner, k]), max(most, triangles[i, corner, k])
            boxes[node, 0, k], boxes[node, 1, k] = least, most


@_compile
def _box_distance2(boxes, node, x):
    total = 0.0
    for k in range(x.size):
        away = max(boxes[node, 0, k] - x[k], x[k] - boxes[node, 1, k], 0.0)
        total += away * away
    return total


@_compile
def _push_children(boxes, node, lo, hi, x, best, stack, reach, top):
    """Put the children that may hold something nearer than `best` on the stack, the nearer one on top."""
    left, right, middle = 2 * node + 1, 2 * node + 2, (lo + hi) // 2
    left2, right2 = _box_distance2(boxes, left, x), _box_distance2(boxes, right, x)
    for turn in range(2):
        is_left = (left2 > right2) == (turn == 0)
        distance2 = left2 if is_left else right2
        if distance2 < best:
            stack[top, 0] = left if is_left else right
            stack[top, 1] = lo if is_left else middle
            stack[top, 2] = middle if is_left else hi
            reach[top] = distance2
            top += 1
    return top


@_compile
def _closest_on_triangle(t, i, x, c):
    """Closest point c of triangle i; returns the feature: 0..2 corner, 3..5 edge ab, bc, ca, 6 face.

    C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
    """
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for k in range(3):
        ab, ac = t[i, 1, k] - t[i, 0, k], t[i, 2, k] - t[i, 0, k]
        d1 += ab * (x[k] - t[i, 0, k])
        d2 += ac * (x[k] - t[i, 0, k])
        d3 += ab * (x[k] - t[i, 1, k])
        d4 += ac * (x[k] - t[i, 1, k])
        d5 += ab * (x[k] - t[i, 2, k])
        d6 += ac * (x[k] - t[i, 2, k])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v = w = 0.0
    if d1 <= 0 and d2 <= 0:
        feature = 0
    elif d3 >= 0 and d4 <= d3:
        feature, v = 1, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        feature, v = 3, d1 / (d1 - d3)
    elif d6 >= 0 and d5 <= d6:
        feature, w = 2, 1.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        feature, w = 5, d2 / (d2 - d6)
    elif va <= 0 and d4 >= d3 and d5 >= d6:
        feature, w = 4, (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        feature, v, w = 6, vb / (va + vb + vc), vc / (va + vb + vc)
    for k in range(3):
        c[k] = t[i, 0, k] + v * (t[i, 1, k] - t[i, 0, k]) + w * (t[i, 2, k] - t[i, 0, k])
    return feature


@_compile
def _height2(t, i, x, c):
    """Squared part of x - c, c on triangle i, that is square to its plane; to its line where it has no width."""
    ab, ac = t[i, 1] - t[i, 0], t[i, 2] - t[i, 0]
    n0, n1, n2 = ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]
    a0, a1, a2 = x[0] - c[0], x[1] - c[1], x[2] - c[2]
    length2 = n0 * n0 + n1 * n1 + n2 * n2
    if length2 > 0:
        return (a0 * n0 + a1 * n1 + a2 * n2) ** 2 / length2
    along2 = (a0 * ab[0] + a1 * ab[1] + a2 * ab[2]) ** 2 / (ab[0] ** 2 + ab[1] ** 2 + ab[2] ** 2)
    return a0 * a0 + a1 * a1 + a2 * a2 - along2


@_compile
def nearest_triangles(triangles, order, boxes, points, within=np.inf, slack=0.0, upright=False):
    """Nearest triangle of every point.

    Parameters
    ----------
    triangles : array (m, 3, 3)
        Corners of the triangles, sorted as the tree is: ``corners[order]``.
    order, boxes
        From `build`.
    points : array (n, 3)
    within : float
        Squared distance beyond which nothing is looked for.
    slack : float
        Of the squared distance: among triangles that are as near but for that, the one of the lowest number is taken.
    upright : bool
        Of those the one is taken instead that the point is most nearly above: beside the edge of two faces that of the face
        which it lies before.

    Returns
    -------
    nearest : int array (n,)
        Number of the triangle before sorting, -1 where none is near enough.
    feature : int array (n,)
        What of it is nearest: 0..2 its corner, 3..5 its edge ab, bc, ca, 6 its face.
    closest : array (n, 3)
        Closest point.
    """
    n, leaves = len(points), (len(boxes) - 1) // 2
    nearest, feature, closest = np.full(n, -1), np.zeros(n, np.int64), np.zeros((n, 3))
    stack, reach, c = np.empty((64, 3), np.int64), np.empty(64), np.empty(3)
    for p in range(n):
        x, best, at = points[p], within, 0
        stack[0, 0], stack[0, 1], stack[0, 2], reach[0], top = 0, 0, len(order), 0.0, 1
        while top > 0:
            top -= 1
            if reach[top] >= best * (1 + slack):
                continue
            node, lo, hi = stack[top, 0], stack[top, 1], stack[top, 2]
            if node < leaves:
                top = _push_children(boxes, node, lo, hi, x, best * (1 + slack), stack, reach, top)
                continue
            for i in range(lo, hi):
                kind = _closest_on_triangle(triangles, i, x, c)
                distance2 = (x[0] - c[0]) ** 2 + (x[1] - c[1]) ** 2 + (x[2] - c[2]) ** 2
                alike = slack > 0 and nearest[p] >= 0 and distance2 <= best * (1 + slack)
                if alike and upright:
                    alike = _height2(triangles, i, x, c) > _height2(triangles, at, x, closest[p]) + slack * best
                elif alike:
                    alike = nearest[p] > order[i]
                if distance2 < best * (1 - slack) or alike:
                    at = i
                    best, nearest[p], feature[p] = min(best, distance2), order[i], kind
                    closest[p, 0], closest[p, 1], closest[p, 2] = c[0], c[1], c[2]
    return nearest, feature, closest


@_compile
def _piece_distance2(a, b, centre, radius, middle, cos_half, x):
    """Squared distance to a segment (radius 0) or an arc; the arc ends lie within cos_half of its middle."""
    if radius > 0:
        r0, r1 = x[0] - centre[0], x[1] - centre[1]
        r = np.sqrt(r0 * r0 + r1 * r1)
        if r0 * middle[0] + r1 * middle[1] >= cos_half * r:
            return (r - radius) ** 2
        return min((x[0] - a[0]) ** 2 + (x[1] - a[1]) ** 2, (x[0] - b[0]) ** 2 + (x[1] - b[1]) ** 2)
    d0, d1, e0, e1 = b[0] - a[0], b[1] - a[1], x[0] - a[0], x[1] - a[1]
    t = min(max((e0 * d0 + e1 * d1) / (d0 * d0 + d1 * d1), 0.0), 1.0)
    return (e0 - t * d0) ** 2 + (e1 - t * d1) ** 2


@_compile
def nearest_pieces(starts, ends, centres, radii, middles, cos_halves, order, boxes, points):
    """Nearest piece (n,) of a polyline of segments and arcs; the piece arrays are sorted as the tree is."""
    n, leaves = len(points), (len(boxes) - 1) // 2
    nearest = np.zeros(n, np.int64)
    stack, reach = np.empty((64, 3), np.int64), np.empty(64)
    for p in range(n):
        x, best = points[p], np.inf
        stack[0, 0], stack[0, 1], stack[0, 2], reach[0], top = 0, 0, len(order), 0.0, 1
        while top > 0:
            top -= 1
            if reach[top] >= best:
                continue
            node, lo, hi = stack[top, 0], stack[top, 1], stack[top, 2]
            if node < leaves:
                top = _push_children(boxes, node, lo, hi, x, best, stack, reach, top)
                continue
            for i in range(lo, hi):
                distance2 = _piece_distance2(starts[i], ends[i], centres[i], radii[i], middles[i],
                                             cos_halves[i], x)
                if distance2 < best:
                    best, nearest[p] = distance2, order[i]
    return nearest
