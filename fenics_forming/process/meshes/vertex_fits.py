"""Cubic polynomials through the values at the vertices of a simplex mesh: slopes and curvatures of a field known there.

Each vertex has the polynomial through its value that fits the vertices of the cells around it and of their neighbours best,
with weights that fall with the sixth power of the distance. Recovery by least squares in patches keeps polynomials of its
own degree: Zhang & Naga, SIAM J. Sci. Comput. 26 (2005) 1192-1213. Measured, ten transfers of a peak of 2.5 elements: with
cubics 1 % are lost in the mean square, with quadratics or with averaged slopes 4 to 6 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from ...physics.locating import Locator

DEGREE = 3
NEAREST = 0.3            # of the distance of the nearest vertices: nearer ones weigh no more
FALLS = 6                # power of the distance by which weights fall; with 4 the errors are a fifth larger
HELD = 1e-6              # share of the weight by which curvatures are held to zero where too few vertices tell them
# misfit of the cubic relative to the rise of the field: up to the first it is trusted, from the second on the plane
SMOOTH, ROUGH = 0.05, 0.1
ROUGH_SLOPE = 0.75       # there: (2/3) 0.75 g (x - x_i), right for quadratic fields with the slope g of the plane
TOLD = 1e-3              # share of the weight that must remain for the neighbours to tell the value at the vertex itself
PER_BATCH = 2_000_000    # numbers in the array of polynomials of a batch of vertices


@dataclass(frozen=True)
class Fitted:
    """One field at every node of the mesh; zero at mid-nodes.

    values : (n,) those given, but at a vertex that is above (below) all of its patch the top of the peak between vertices
    slopes : (n, dim), per mm · curvatures : (n, dim, dim), per mm²
    """

    values: np.ndarray
    slopes: np.ndarray
    curvatures: np.ndarray


class VertexFits:
    """The patches of a mesh and what fits any field on them; made once for all fields.

    Parameters
    ----------
    mesh : its ``x``, ``vertices`` are read
    """

    def __init__(self, mesh: Locator):
        self._mesh, dim = mesh, mesh.dim
        self._terms = [term for k in range(1, DEGREE + 1) for term in combinations_with_replacement(range(dim), k)]
        self._vertices, self._patch, self._is_other = _patches(mesh)
        count, terms = len(self._vertices), len(self._terms)
        self._length, self._whole = np.empty(count), np.empty(count)              # of the near edges; sum of the weights
        self._plane, self._inverse = np.empty((count, dim, dim)), np.empty((count, terms, terms))
        self._ones = np.empty((count, terms))                                     # moments of the constant 1
        held = np.diag([HELD**2 if len(term) == 1 else HELD for term in self._terms])
        for rows in self._batches():
            distance = np.where(self._is_other[rows], np.linalg.norm(self._away(rows), axis=2), np.inf)
            self._length[rows] = np.partition(distance, dim, axis=1)[:, : dim + 1].mean(axis=1)
            polynomials, weights = self._polynomials(rows)
            weighted = _turned(polynomials * weights[:, :, None])
            moments = np.matmul(weighted, polynomials)
            size = np.trace(moments[:, :dim, :dim], axis1=1, axis2=2)[:, None, None] / dim
            moments += size * held
            self._plane[rows], self._inverse[rows] = np.linalg.inv(moments[:, :dim, :dim]), np.linalg.inv(moments)
            self._ones[rows], self._whole[rows] = weighted.sum(axis=2), weights.sum(axis=1)

    def of(self, column: np.ndarray) -> Fitted:
        """The fit of one field (n,), of which only the values at vertices are read."""
        count, dim = len(self._mesh.x), self._mesh.dim
        fitted = Fitted(np.array(column, float), np.zeros((count, dim)), np.zeros((count, dim, dim)))
        for rows in self._batches():
            nodes, length = self._vertices[rows], self._length[rows]
            tops, factors = self._fit(rows, column[self._patch[rows]] - column[nodes, None])
            fitted.values[nodes] += tops
            fitted.slopes[nodes] = factors[:, :dim] / length[:, None]
            for term, factor in zip(self._terms, factors.T, strict=True):
                if len(term) == 2:
                    fitted.curvatures[nodes, term[0], term[1]] += factor / length**2
                    fitted.curvatures[nodes, term[1], term[0]] += factor / length**2
        return fitted

    def _fit(self, rows, rise):
        """What is to be added to the values at the vertices, (v,), and the factors of the monomials, (v, terms), for the
        rise of a field from each vertex to its patch, (v, patch)."""
        dim = self._mesh.dim
        polynomials, weights = self._polynomials(rows)
        is_top, is_bottom = rise.max(axis=1) <= 0, rise.min(axis=1) >= 0
        most = 0.1 * np.abs(rise).max(axis=1)
        # a plane first, and the rest on what it leaves: so linear fields are kept to round-off
        plane = _times(self._plane[rows], _times(_turned(polynomials[:, :, :dim]), weights * rise))
        rest = weights * (rise - _times(polynomials[:, :, :dim], plane))
        moments = _times(_turned(polynomials), rest)
        tops = self._missing(rows, rest.sum(axis=1), moments)
        tops = np.where(is_top, np.clip(tops, 0, most), np.where(is_bottom, np.clip(tops, -most, 0), 0.0))
        factors = _times(self._inverse[rows], moments - tops[:, None] * self._ones[rows])
        factors[:, :dim] += plane
        smooth = _smoothness(weights, rise, rise - tops[:, None] - _times(polynomials, factors))
        factors *= smooth[:, None]
        factors[:, :dim] += (1 - smooth)[:, None] * ROUGH_SLOPE * plane
        tops *= smooth
        return tops, factors

    def _missing(self, rows, sum_, moments):
        """By how much the value at each vertex lies below that with which a polynomial fits the patch best, (v,).

        It is added where nothing in the patch is above (below) the vertex, up to a tenth of the height: a value there that
        was cut to the range of an older mesh would else flatten its peak at every transfer.
        """
        of_ones = _times(self._inverse[rows], self._ones[rows])
        left = self._whole[rows] - np.einsum("nk,nk->n", self._ones[rows], of_ones)
        is_told = left > TOLD * self._whole[rows]
        return (sum_ - np.einsum("nk,nk->n", of_ones, moments)) / np.where(is_told, left, np.inf)

    # ------------------------------------------------------------------ patches
    def _batches(self):
        each = max(1, PER_BATCH // (self._patch.shape[1] * len(self._terms)))
        return [slice(first, first + each) for first in range(0, len(self._vertices), each)]

    def _away(self, rows):
        return self._mesh.x[self._patch[rows]] - self._mesh.x[self._vertices[rows], None]

    def _polynomials(self, rows):
        """Monomials of degree 1 to 3 of the way from each vertex to its patch, over the distance of the nearest vertices,
        (v, patch, terms), and the weights (v, patch)."""
        away = self._away(rows) / self._length[rows, None, None]
        distance = np.maximum(np.linalg.norm(away, axis=2), NEAREST)
        out, known = np.empty(away.shape[:2] + (len(self._terms),)), {}
        for k, term in enumerate(self._terms):
            known[term] = k
            out[..., k] = away[..., term[0]] if len(term) == 1 else out[..., known[term[:-1]]] * away[..., term[-1]]
        return out, self._is_other[rows] * distance**-FALLS


def _smoothness(weights, rise, misfit):
    """1 where a cubic follows the field of a patch, 0 where it does not, (v,).

    Beside a corner at which the strain is singular cubics swing: with them everywhere the force of a billet changes by up
    to 1 % on a new mesh, with this by less than half of that (test_folding_over).
    """
    misfit, rise = ((weights * values**2).sum(axis=1) for values in (misfit, rise))
    share = np.sqrt(misfit / np.maximum(rise, np.finfo(float).tiny))
    return np.clip((ROUGH - share) / (ROUGH - SMOOTH), 0, 1)


def _turned(matrices):
    return np.swapaxes(matrices, 1, 2)


def _times(matrices, vectors):
    """Products of matrices (v, a, b) with vectors (v, b), (v, a)."""
    return np.matmul(matrices, vectors[:, :, None])[:, :, 0]


def _patches(mesh):
    """The vertices (v,), the nodes of the patch around each, (v, widest), and which of these are other vertices."""
    from scipy.sparse import csr_matrix  # a tenth of a second, which a run that never remeshes saves
    corners = mesh.vertices
    width, count = corners.shape[1], len(mesh.x)
    pairs = np.repeat(corners, width, axis=1).ravel(), np.tile(corners, (1, width)).ravel()
    near = csr_matrix((np.ones(len(pairs[0]), np.int32), pairs), (count, count))
    vertices = np.unique(corners)
    patches = (near @ near)[vertices]
    counts = np.diff(patches.indptr)
    patch = np.repeat(vertices[:, None], counts.max(), axis=1)
    held = np.arange(counts.max()) < counts[:, None]
    patch[held] = patches.indices
    return vertices, patch, patch != vertices[:, None]
