"""Closest points on quadratic facets and quadratic edges, compiled by numba.

A facet is ``S(u, v)`` with six nodes (vertices a, b, c, then the mid-nodes of bc, ac, ab), an edge ``C(t)`` with
three (ends, middle). The search goes over flat pieces of them (`physics.contact.bvh`); Newton's method on the
piece found does the rest, so that the answer lies on the curved surface to round-off.
"""

import numpy as np

from ..contact.bvh import _compile, build, nearest_triangles
from ..nodes import quadratic_shapes

PIECES = 4              # pieces along a side of a facet: their sagitta is 1/16 of the facet's
ITERATIONS = 30
SMALL = 1e-14           # of the parameter: rounding
ROUNDING = 1e-9         # of the square of the distance, which is flat at its minimum
# Of that square too: flat pieces so alike are equally near. Beside a common edge of two they are but for rounding, which
# differs between numbers of ranks; and the nearest places on their curved facets are not the same.
ALIKE = 1e-6


class Facets:
    """A set of quadratic facets, (m, 6, 3) in mm, that answers for the closest point on any of them."""

    def __init__(self, nodes: np.ndarray):
        self.nodes = np.ascontiguousarray(nodes)
        lattice, pieces = _lattice(PIECES)
        self._starts = lattice[pieces]                                   # (pieces, 3, 2): u, v of their corners
        shapes = quadratic_shapes(np.column_stack([1 - lattice.sum(axis=1), lattice]), 2)
        corners = np.einsum("pa,mak->mpk", shapes, self.nodes)[:, pieces].reshape(-1, 3, 3)
        order, boxes = build(corners.min(1), corners.max(1))
        self._flat, self._tree = corners, (corners[order], order, boxes)

    def closest(self, points: np.ndarray) -> np.ndarray:
        """Closest points (n, 3) of the points (n, 3), mm."""
        points = np.ascontiguousarray(points, float)
        piece, _, foot = nearest_triangles(*self._tree, points, np.inf, ALIKE)
        facet, part = np.divmod(piece, len(self._starts))
        start = np.einsum("ni,nik->nk", _barycentric(self._flat[piece], foot), self._starts[part])
        return _newton_facets(self.nodes, facet, start, points)


class Curves:
    """A set of quadratic edges, (m, 3, 3) in mm: ends, middle."""

    def __init__(self, nodes: np.ndarray):
        self.nodes = np.ascontiguousarray(nodes)
        self._count = 2 * PIECES
        t = np.linspace(0, 1, self._count + 1)
        along = np.stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)], axis=1)
        at = np.einsum("pa,mak->mpk", along, self.nodes)
        flat = np.stack([at[:, :-1], at[:, 1:], at[:, 1:]], axis=2).reshape(-1, 3, 3)    # triangles without width
        order, boxes = build(flat.min(1), flat.max(1))
        self._tree = flat[order], order, boxes

    def closest(self, points: np.ndarray) -> np.ndarray:
        """Closest points (n, 3) of the points (n, 3), mm."""
        points = np.ascontiguousarray(points, float)
        piece, _, _ = nearest_triangles(*self._tree, points, np.inf, ALIKE)
        edge, part = np.divmod(piece, self._count)
        return _newton_curves(self.nodes, edge, (part + 0.5) / self._count, points)


def _lattice(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (u, v) of a regular lattice on the unit triangle and the (n², 3) triangles between them."""
    j, i = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    inside = i + j <= n
    number = np.full(i.shape, -1)
    number[inside] = np.arange(inside.sum())
    up = [(a, b) for a in range(n) for b in range(n - a)]
    down = [(a, b) for a in range(n) for b in range(n - a - 1)]
    pieces = [(number[a, b], number[a + 1, b], number[a, b + 1]) for a, b in up]
    pieces += [(number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]) for a, b in down]
    return np.stack([i[inside], j[inside]], axis=1) / n, np.array(pieces)


def _barycentric(corners, points):
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = points - corners[:, 0]
    aa, ab, bb = (np.einsum("nk,nk->n", s, t) for s, t in ((a, a), (a, b), (b, b)))
    pa, pb = np.einsum("nk,nk->n", p, a), np.einsum("nk,nk->n", p, b)
    det = aa * bb - ab * ab
    det = np.where(det > 0, det, 1.0)
    weights = np.clip(np.stack([(bb * pa - ab * pb) / det, (aa * pb - ab * pa) / det], axis=1), 0, 1)
    weights /= np.maximum(weights.sum(1, keepdims=True), 1.0)
    return np.concatenate([1 - weights.sum(1, keepdims=True), weights], axis=1)


@_compile
def _newton_facets(nodes, facet, start, points):
    """Minimise |S(u, v) - x|² over the facet: Newton, along the sides where it would leave the facet."""
    out = np.empty((len(points), 3))
    for p in range(len(points)):
        f, u, v = nodes[facet[p]], start[p, 0], start[p, 1]
        best = np.inf
        for _ in range(ITERATIONS):
            w = 1.0 - u - v
            gu = gv = huu = huv = hvv = guu = guv = gvv = value = 0.0
            for k in range(3):
                s = (w * (2 * w - 1) * f[0, k] + u * (2 * u - 1) * f[1, k] + v * (2 * v - 1) * f[2, k]
                     + 4 * u * v * f[3, k] + 4 * w * v * f[4, k] + 4 * w * u * f[5, k])
                su = (1 - 4 * w) * f[0, k] + (4 * u - 1) * f[1, k] + 4 * v * (f[3, k] - f[4, k]) + 4 * (w - u) * f[5, k]
                sv = (1 - 4 * w) * f[0, k] + (4 * v - 1) * f[2, k] + 4 * u * (f[3, k] - f[5, k]) + 4 * (w - v) * f[4, k]
                r = s - points[p, k]
                value += r * r
                gu += r * su
                gv += r * sv
                huu += su * su
                huv += su * sv
                hvv += sv * sv
                guu += r * 4 * (f[0, k] + f[1, k] - 2 * f[5, k])
                guv += r * 4 * (f[0, k] + f[3, k] - f[4, k] - f[5, k])
                gvv += r * 4 * (f[0, k] + f[2, k] - 2 * f[4, k])
            if value <= best * (1.0 + ROUNDING):
                best = min(best, value)
                for k in range(3):
                    out[p, k] = (w * (2 * w - 1) * f[0, k] + u * (2 * u - 1) * f[1, k] + v * (2 * v - 1) * f[2, k]
                                 + 4 * u * v * f[3, k] + 4 * w * v * f[4, k] + 4 * w * u * f[5, k])
            auu, auv, avv = huu + guu, huv + guv, hvv + gvv
            if auu <= 0.1 * huu or auu * avv - auv * auv <= 0.01 * (huu * hvv - huv * huv):
                auu, auv, avv = huu, huv, hvv           # far from the surface: Gauss-Newton descends
            det = auu * avv - auv * auv
            if det <= 0.0:
                break
            du, dv = -(avv * gu - auv * gv) / det, -(auu * gv - auv * gu) / det
            # on a side and pushed outwards: go along the side
            eu = ev = 0.0
            if u <= SMALL and du < 0:
                ev = 1.0
            elif v <= SMALL and dv < 0:
                eu = 1.0
            elif w <= SMALL and du + dv > 0:
                eu, ev = 1.0, -1.0
            if eu != 0.0 or ev != 0.0:
                curvature = eu * eu * auu + 2 * eu * ev * auv + ev * ev * avv
                along = -(gu * eu + gv * ev) / curvature
                du, dv = along * eu, along * ev
            step = 1.0
            if du < 0 and u + du < 0:
                step = min(step, u / -du)
            if dv < 0 and v + dv < 0:
                step = min(step, v / -dv)
            if du + dv > 0 and w - du - dv < 0:
                step = min(step, w / (du + dv))
            step = max(step, 0.0)
            u, v = u + step * du, v + step * dv
            u, v = max(u, 0.0), max(v, 0.0)
            if u + v > 1.0:
                u, v = u / (u + v), v / (u + v)
            if step * (abs(du) + abs(dv)) < SMALL:
                break
    return out


@_compile
def _newton_curves(nodes, edge, start, points):
    """Minimise |C(t) - x|² over 0 <= t <= 1."""
    out = np.empty((len(points), 3))
    for p in range(len(points)):
        c, t, best = nodes[edge[p]], start[p], np.inf
        for _ in range(ITERATIONS):
            g = h = bend = value = 0.0
            for k in range(3):
                s = (1 - t) * (1 - 2 * t) * c[0, k] + t * (2 * t - 1) * c[1, k] + 4 * t * (1 - t) * c[2, k]
                d = (4 * t - 3) * c[0, k] + (4 * t - 1) * c[1, k] + 4 * (1 - 2 * t) * c[2, k]
                r = s - points[p, k]
                value += r * r
                g += r * d
                h += d * d
                bend += r * 4 * (c[0, k] + c[1, k] - 2 * c[2, k])
            if value <= best * (1.0 + ROUNDING):
                best = min(best, value)
                for k in range(3):
                    out[p, k] = (1 - t) * (1 - 2 * t) * c[0, k] + t * (2 * t - 1) * c[1, k] + 4 * t * (1 - t) * c[2, k]
            if h <= 0.0:
                break
            new = t - g / (h + bend if h + bend > 0.1 * h else h)
            new = min(max(new, 0.0), 1.0)
            moved, t = abs(new - t), new
            if moved < SMALL:
                break
    return out
