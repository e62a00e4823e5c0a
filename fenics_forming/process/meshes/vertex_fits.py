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
from ...physics.machine_code import compiled

DEGREE = 3
NEAREST = 0.3            # of the distance of the nearest vertices: nearer ones weigh no more
FALLS = 6                # even power of the distance by which weights fall; with 4 the errors are a fifth larger
HELD = 1e-6              # share of the weight by which curvatures are held to zero where too few vertices tell them
# misfit of the cubic relative to the rise of the field: up to the first it is trusted, from the second on the plane
SMOOTH, ROUGH = 0.05, 0.1
ROUGH_SLOPE = 0.75       # there: (2/3) 0.75 g (x - x_i), right for quadratic fields with the slope g of the plane
TOLD = 1e-3              # share of the weight that must remain for the neighbours to tell the value at the vertex itself
HIGHEST = 0.1            # of the height of a peak, that may be added to it


@dataclass(frozen=True)
class Fitted:
    """Fields at every node of the mesh; zero at mid-nodes.

    values : (n, k) those given, but at a vertex that is above (below) all of its patch the top of the peak between vertices
    slopes : (n, k, dim), per mm · curvatures : (n, k, dim, dim), per mm²
    """

    values: np.ndarray
    slopes: np.ndarray
    curvatures: np.ndarray


def fitted(mesh: Locator, fields: np.ndarray) -> Fitted:
    """The fits of the fields (n, k), of which only the values at vertices are read."""
    vertices, first, patch = _patches(mesh.vertices, len(mesh.x))
    terms = [term for degree in range(1, DEGREE + 1) for term in combinations_with_replacement(range(mesh.dim), degree)]
    number = {term: k for k, term in enumerate(terms)}
    made_of = np.array([(number.get(term[:-1], -1), term[-1], term[0] if len(term) == 2 else -1) for term in terms])
    return Fitted(*_fits(mesh.x, vertices, first, patch, made_of, np.ascontiguousarray(fields, float)))


@compiled
def _patches(cells, count):
    """The vertices (v,) of cells (m, dim + 1); the vertices of the cells around each and of their neighbours but itself,
    one patch after the other; and where each patch begins, (v + 1,)."""
    width = cells.shape[1]
    start = np.zeros(count + 1, np.int64)
    for node in cells.ravel():
        start[node + 1] += 1
    start = np.cumsum(start)
    around, filled = np.empty(start[-1], np.int64), start[:-1].copy()
    for c in range(len(cells)):
        for i in range(width):
            around[filled[cells[c, i]]] = c
            filled[cells[c, i]] += 1
    vertices = np.flatnonzero(start[1:] > start[:-1])
    # the neighbours of every vertex, one list after the other; then those of the neighbours as well
    seen, near, beside = np.full(count, -1), np.zeros(count + 1, np.int64), np.empty(width * len(around), np.int64)
    for node in range(count):
        found, seen[node] = near[node], node
        for c in around[start[node]:start[node + 1]]:
            for i in range(width):
                if seen[cells[c, i]] != node:
                    seen[cells[c, i]] = node
                    beside[found] = cells[c, i]
                    found += 1
        near[node + 1] = found
    seen[:], first, patch = -1, np.zeros(len(vertices) + 1, np.int64), np.empty(32 * len(vertices), np.int64)
    for row in range(len(vertices)):
        node, found = vertices[row], first[row]
        seen[node] = row
        for k in range(near[node] - 1, near[node + 1]):
            centre = node if k < near[node] else beside[k]
            while found + near[centre + 1] - near[centre] > len(patch):
                patch = np.concatenate((patch, np.empty_like(patch)))
            for other in beside[near[centre]:near[centre + 1]]:
                if seen[other] != row:
                    seen[other] = row
                    patch[found] = other
                    found += 1
        first[row + 1] = found
    return vertices, first, patch[:first[-1]]


@compiled
def _polynomials(x, node, patch, made_of, polynomials, weights):
    """Monomials of degree 1 to 3 of the way from a vertex to its patch, over the distance of the nearest vertices, put into
    ``polynomials`` (patch, terms), and ``weights`` (patch,); that distance, mm.

    made_of : (terms, 2 …) monomial and direction whose product it is, from the second degree on
    """
    dim, count, least = x.shape[1], len(patch), np.full(x.shape[1] + 1, np.inf)      # squares of the nearest distances
    for p in range(count):
        squares = 0.0
        for i in range(dim):
            polynomials[p, i] = x[patch[p], i] - x[node, i]
            squares += polynomials[p, i] ** 2
        weights[p] = squares
        for i in range(dim + 1):
            if squares < least[i]:
                squares, least[i] = least[i], squares
    length = 0.0
    for i in range(dim + 1):
        length += np.sqrt(least[i]) / (dim + 1)
    for p in range(count):
        weights[p] = max(weights[p] / length**2, NEAREST**2) ** -(FALLS // 2)
        for i in range(dim):
            polynomials[p, i] /= length
        for k in range(dim, len(made_of)):
            polynomials[p, k] = polynomials[p, made_of[k, 0]] * polynomials[p, made_of[k, 1]]
    return length


@compiled
def _factorise(matrix):
    """Cholesky's factor of a matrix, in its lower half, with one over its diagonal."""
    for i in range(len(matrix)):
        for j in range(i + 1):
            left = matrix[i, j]
            for k in range(j):
                left -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = 1.0 / np.sqrt(max(left, 1e-300)) if i == j else left * matrix[j, j]


@compiled
def _solve(factor, right):
    """Solve with a factor of `_factorise`, in place."""
    for i in range(len(right)):
        left = right[i]
        for k in range(i):
            left -= factor[i, k] * right[k]
        right[i] = left * factor[i, i]
    for i in range(len(right) - 1, -1, -1):
        left = right[i]
        for k in range(i + 1, len(right)):
            left -= factor[k, i] * right[k]
        right[i] = left * factor[i, i]


@compiled
def _fits(x, vertices, first, patches, made_of, fields):
    """What `Fitted` holds."""
    (count, kinds), dim, terms = fields.shape, x.shape[1], len(made_of)
    values, slopes, curvatures = fields.copy(), np.zeros((count, kinds, dim)), np.zeros((count, kinds, dim, dim))
    widest = (first[1:] - first[:-1]).max()
    polynomials, weights, rise = np.empty((widest, terms)), np.empty(widest), np.empty(widest)
    cubic, flat, factors, plane = np.empty((terms, terms)), np.empty((dim, dim)), np.empty(terms), np.empty(dim)
    for row in range(len(vertices)):
        node, patch = vertices[row], patches[first[row]:first[row + 1]]
        length = _polynomials(x, node, patch, made_of, polynomials, weights)
        ones, whole, size = np.zeros(terms), 0.0, 0.0
        cubic[:] = 0.0
        for p in range(len(patch)):
            whole += weights[p]
            for k in range(terms):
                weighted = weights[p] * polynomials[p, k]
                ones[k] += weighted
                for j in range(k + 1):
                    cubic[k, j] += weighted * polynomials[p, j]
        for i in range(dim):
            size += cubic[i, i] / dim
        for k in range(terms):
            cubic[k, k] += size * (HELD * HELD if k < dim else HELD)
        flat[:] = cubic[:dim, :dim]
        _factorise(flat)
        _factorise(cubic)
        of_ones = ones.copy()
        _solve(cubic, of_ones)
        left = whole
        for k in range(terms):
            left -= ones[k] * of_ones[k]
        left = left if left > TOLD * whole else np.inf
        for kind in range(kinds):
            for p in range(len(patch)):
                rise[p] = fields[patch[p], kind] - fields[node, kind]
            top = _fit(rise[:len(patch)], polynomials, weights, flat, cubic, ones, of_ones, left, factors,
                       plane)
            values[node, kind] += top
            for k in range(terms):
                if k < dim:
                    slopes[node, kind, k] = factors[k] / length
                elif made_of[k, 2] >= 0:
                    curvatures[node, kind, made_of[k, 1], made_of[k, 2]] += factors[k] / length**2
                    curvatures[node, kind, made_of[k, 2], made_of[k, 1]] += factors[k] / length**2
    return values, slopes, curvatures


@compiled
def _fit(rise, polynomials, weights, flat, cubic, ones, of_ones, left, factors, plane):
    """What is to be added to the value at a vertex, for the ``rise`` (patch,) of a field from there; its ``factors`` of the
    monomials (terms,) and of those of a ``plane`` (dim,) are overwritten.

    By how much the value at the vertex lies below that with which a polynomial fits the patch best is added where nothing
    in the patch is above (below) the vertex, up to a tenth of the height: a value there that was cut to the range of an
    older mesh would else flatten its peak at every transfer.

    flat, cubic : factors of the moments of the monomials of degree 1, and of all · ones, of_ones : (terms,) moments of the
    constant 1, and its fit · left : what that leaves of the sum of the weights; infinite: too little to tell
    """
    dim, terms = len(flat), len(cubic)
    factors[:] = 0.0
    lowest, highest = min(rise.min(), 0.0), max(rise.max(), 0.0)
    if lowest == highest:       # an even field, as a pressure away from the tools
        return 0.0
    # a plane first, and the rest on what it leaves: so linear fields are kept to round-off
    missing = 0.0
    plane[:] = 0.0
    for p in range(len(rise)):
        for i in range(dim):
            plane[i] += weights[p] * rise[p] * polynomials[p, i]
    _solve(flat, plane)
    for p in range(len(rise)):
        rest = rise[p]
        for i in range(dim):
            rest -= polynomials[p, i] * plane[i]
        rest *= weights[p]
        missing += rest
        for k in range(terms):
            factors[k] += rest * polynomials[p, k]
    for k in range(terms):
        missing -= of_ones[k] * factors[k]
    top = 0.0
    if highest <= 0.0:
        top = min(max(missing / left, 0.0), -HIGHEST * lowest)
    elif lowest >= 0.0:
        top = max(min(missing / left, 0.0), -HIGHEST * highest)
    for k in range(terms):
        factors[k] -= top * ones[k]
    _solve(cubic, factors)
    for i in range(dim):
        factors[i] += plane[i]
    smooth = _smoothness(rise, polynomials, weights, factors, top)
    for k in range(terms):
        factors[k] *= smooth
        if k < dim:
            factors[k] += (1.0 - smooth) * ROUGH_SLOPE * plane[k]
    return smooth * top


@compiled
def _smoothness(rise, polynomials, weights, factors, top):
    """1 where a cubic follows the field of a patch, 0 where it does not.

    Beside a corner at which the strain is singular cubics swing: with them everywhere the force of a billet changes by up
    to 1 % on a new mesh, with this by less than half of that (test_folding_over).
    """
    missed, risen = 0.0, 0.0
    for p in range(len(rise)):
        miss = rise[p] - top
        for k in range(len(factors)):
            miss -= polynomials[p, k] * factors[k]
        missed += weights[p] * miss**2
        risen += weights[p] * rise[p] ** 2
    share = np.sqrt(missed / max(risen, 1e-300))
    return min(max((ROUGH - share) / (ROUGH - SMOOTH), 0.0), 1.0)
