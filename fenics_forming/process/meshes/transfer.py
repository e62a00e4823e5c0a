"""From an old mesh to the points of a new one: strain, temperature, damage, velocity.

What history holds is nodal and linear between vertices (mid-nodes have the mean of their ends), so it stays so: no field
leaves the range of the old one, and no point is left without a value.
"""

from __future__ import annotations

from functools import cache, cached_property

import basix
import numpy as np

from ...physics.locating import Located, Locator, slopes
from ...physics.machine_code import compiled
from ...physics.nodes import quadratic_shapes
from .vertex_fits import fitted

INTEGRAND_DEGREE = 6     # quadratic value x radius x Jacobian (2-D); value x Jacobian is 5 in 3-D


class Transfer:
    """Values of an old mesh at given points; made once for all fields.

    Parameters
    ----------
    old : the old body, with ``x`` (n, dim), mm, and ``cells`` (m, 6 | 10)
    points : (p, dim) places in the new body, mm, for the history its vertices and mid-nodes; one outside the old body
        takes the value of the nearest place found
    locator : of the old body, if it is known

    Attributes
    ----------
    located : where the points lie in the straight simplices of the old mesh; its ``distance`` says how far outside
    """

    def __init__(self, old, points: np.ndarray, locator: Locator | None = None):
        self.points = np.ascontiguousarray(points, float)
        self.locator = Locator(old.x, old.cells) if locator is None else locator
        self.located: Located = self.locator.find(self.points)

    @cached_property
    def curved(self) -> Located:
        """Where the points lie in the curved cells of the old mesh."""
        return self.locator.find_curved(self.points, self.located)

    def linear(self, values: np.ndarray, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Values at the points, or ``rows`` of them, of a field linear between vertices, bounded: (n[, k]) to (p[, k]).

        u(x) = sum_i l_i [u_i + (2/3) g_i (x - x_i) + (1/6) (x - x_i) H_i (x - x_i)] with the barycentric coordinates l,
        the vertices x_i, and the slopes g_i and curvatures H_i of the cubics fitted there (``vertex_fits``): exact for
        cubic fields, as far as those are, where plain linear interpolation flattens every peak. The result is cut to the
        range of the vertices of the cell and of their neighbours: nothing falls below the least or rises above the
        greatest value near by; and above the vertices of its cell only by as much as these stand out from the least.

        Only the values at vertices are read.
        """
        mesh, found = self.locator, self.located
        old = np.asarray(values, float).reshape(len(mesh.x), -1)
        fits = fitted(mesh, old)
        out = _bounded(mesh.x, mesh.vertices, self.points[rows], found.cells[rows], found.barycentric[rows],
                       found.distance[rows], old, *_ranges(mesh.vertices, old), fits.values, fits.slopes, fits.curvatures)
        return out.reshape((len(out),) + np.shape(values)[1:])

    def quadratic(self, values: np.ndarray) -> np.ndarray:
        """Values at the points by the quadratic shapes of the curved cells: (n[, k]) old nodes to (p[, k]).

        For velocities and displacements, which have values of their own at mid-nodes; not bounded.
        """
        mesh, found = self.locator, self.curved
        shapes, values = quadratic_shapes(found.barycentric, mesh.dim), np.asarray(values, float)
        around = values.reshape(len(values), -1)[mesh.cells[found.cells]]
        return np.matmul(shapes[:, None], around).reshape((len(shapes),) + values.shape[1:])


@compiled
def _ranges(cells, fields):
    """Least and greatest value of the fields (n, k) at the vertices of the cells around every vertex, (n, k) twice."""
    lowest, highest = fields.copy(), fields.copy()
    for c in range(len(cells)):
        for k in range(fields.shape[1]):
            least = most = fields[cells[c, 0], k]
            for node in cells[c]:
                least, most = min(least, fields[node, k]), max(most, fields[node, k])
            for node in cells[c]:
                lowest[node, k], highest[node, k] = min(lowest[node, k], least), max(highest[node, k], most)
    return lowest, highest


@compiled
def _bounded(x, vertices, points, cells, inner, distance, fields, lowest, highest, values, slopes, curvatures):
    """What `Transfer.linear` gives at points whose places are known, (p, k)."""
    out = np.empty((len(points), fields.shape[1]))
    dim = x.shape[1]
    away, outside = np.empty((dim + 1, dim)), np.empty(dim)
    for p in range(len(points)):
        corners = vertices[cells[p]]
        for j in range(dim):
            place = 0.0
            for i in range(dim + 1):
                place += inner[p, i] * x[corners[i], j]
            outside[j] = points[p, j] - place
            for i in range(dim + 1):
                away[i, j] = place - x[corners[i], j]
        # under a curved side; a point farther out than its cell is large takes the value at the nearest place
        if distance[p] ** 2 > (away**2).sum(axis=1).max():
            outside[:] = 0.0
        for k in range(fields.shape[1]):
            guess = 0.0
            low = high = least = most = fields[corners[0], k]
            for i in range(dim + 1):
                at = corners[i]
                beside = values[at, k]
                for j in range(dim):
                    beside += slopes[at, k, j] * (2 / 3 * away[i, j] + outside[j])
                    for m in range(dim):
                        beside += away[i, j] * curvatures[at, k, j, m] * away[i, m] / 6
                guess += inner[p, i] * beside
                least, most = min(least, fields[at, k]), max(most, fields[at, k])
                low, high = min(low, lowest[at, k]), max(high, highest[at, k])
            # where all of a cell is as low as its neighbours, as beside a jump, nothing in it is higher than its vertices
            out[p, k] = min(max(guess, low, 2 * least - high), high, 2 * most - low)
    return out


def conservation(old, new, fields: dict[str, tuple[np.ndarray, np.ndarray]], *, axisymmetric: bool = False
                 ) -> dict[str, float]:
    """Relative change of the integral of each transferred field, by name.

    (I_new - I_old) / J with I = ∫ u w dV, J = ∫ |u| w dV over the old body, w = 2 pi r in axisymmetry, else 1; of a
    vector the length of the change; 0 for a field that was 0 everywhere.

    Parameters
    ----------
    old, new : bodies with ``x`` (n, dim), mm, and ``cells`` (m, 6 | 10)
    fields : name → (values at the old nodes, values at the new nodes), mid-nodes included, (n[, k])
    """
    before, after = _measure(old, axisymmetric), _measure(new, axisymmetric)
    report = {}
    for name, (at_old, at_new) in fields.items():
        at_old, at_new = _at_points(old, at_old), _at_points(new, at_new)
        size = np.einsum("cq,cq->", np.linalg.norm(at_old, axis=2), before)
        change = np.einsum("cqk,cq->k", at_new, after) - np.einsum("cqk,cq->k", at_old, before)
        change = change[0] if len(change) == 1 else np.linalg.norm(change)
        report[name] = float(change / size) if size > 0 else 0.0
    return report


def integral(body, values: np.ndarray, *, axisymmetric: bool = False) -> float:
    """∫ u w dV of a nodal field (n,) over the curved cells; w = 2 pi r in axisymmetry, else 1."""
    return float(np.einsum("cqk,cq->", _at_points(body, values), _measure(body, axisymmetric)))


@cache
def _points(dim):
    """Quadrature of positive weights (q,); there the quadratic shapes, (q, 6 | 10), and their derivatives along the edges
    from the first vertex, (q, 6 | 10, dim)."""
    kind = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}[dim]
    points, weights = basix.make_quadrature(kind, INTEGRAND_DEGREE)
    inner = np.concatenate([1.0 - points.sum(axis=1, keepdims=True), points], axis=1)
    slope = slopes(inner, dim)
    return weights, quadratic_shapes(inner, dim), slope[..., 1:] - slope[..., :1]


def _measure(body, axisymmetric):
    """Weights of the quadrature points in the body, (m, q), mm² or mm³."""
    dim = body.x.shape[1]
    weights, shapes, slope = _points(dim)
    if dim == 2:
        return _plane_measure(body.x, body.cells, weights, shapes, slope, axisymmetric)
    x = body.x[body.cells]
    tangents = [[x[..., i] @ slope[..., k].T for k in range(dim)] for i in range(dim)]
    return weights * np.abs(_volumes(tangents))


@compiled
def _plane_measure(x, cells, weights, shapes, slope, axisymmetric):
    """What `_measure` gives in the plane; shapes (q, 6) and slopes (q, 6, 2) of the quadratic cells."""
    out = np.empty((len(cells), len(weights)))
    for c in range(len(cells)):
        for q in range(len(weights)):
            radius = a = b = d = e = 0.0
            for i in range(cells.shape[1]):
                r, z = x[cells[c, i], 0], x[cells[c, i], 1]
                radius += shapes[q, i] * r
                a, b = a + slope[q, i, 0] * r, b + slope[q, i, 1] * r
                d, e = d + slope[q, i, 0] * z, e + slope[q, i, 1] * z
            out[c, q] = weights[q] * abs(a * e - b * d) * (2 * np.pi * radius if axisymmetric else 1.0)
    return out


def _volumes(tangents):
    """Determinants (m, q) of the tangents (m, q), by component and direction; `numpy.linalg.det` takes them one by one."""
    (a, b, c), (d, e, f), (g, h, i) = tangents
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def _at_points(body, values):
    """Values (n[, k]) at the quadrature points, (m, q, k)."""
    _, shapes, _ = _points(body.x.shape[1])
    values = np.asarray(values, float).reshape(len(body.x), -1)
    return np.stack([column[body.cells] @ shapes.T for column in values.T], axis=2)
