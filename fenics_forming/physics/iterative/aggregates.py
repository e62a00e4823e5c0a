r"""Rigid motions of groups of vertices, blended: the lowest level of the velocities, small enough for every rank.

A group A of neighbouring vertices moves by :math:`u_A+\omega_A\times(x-X_A)`; a vertex i follows its group and those next
to it by weights :math:`w_{iA}\ge0` that sum to one, so motions of the whole body as a rigid one are among them exactly,
wherever its vertices have gone. With :math:`R_i` for the motion about the origin, the block of two groups in the Galerkin
product is

.. math:: M_{AB} = \sum_{ij} w_{iA}\,w_{jB}\,R_i^T A_{ij} R_j ,

which every rank sums over what its own cells give. Groups are boxes of the body at the start, cut in two again and again
across their longest side: across flat cells they are as thin as they are there, which is the direction that couples
strongly. They and the weights hold for as long as the mesh; none of it depends on how the mesh is divided among ranks, but
for rounding.

References
----------
Smoothed aggregation: P. Vanek, J. Mandel, M. Brezina, Computing 56 (1996) 179; here the weights are smoothed, not the
motions.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.csgraph import connected_components

from ...errors import ConvergenceError
from ..machine_code import compiled
from ..parallel import total
from .everywhere import Everywhere
from .velocity_block import VelocityBlock

BLENDED = 2 / 3     # of the weights of a vertex are the mean of its neighbours', in every pass
RIDGE = 1e-11       # of the diagonal: a group of one vertex has no turning of its own


def groups_of(places: np.ndarray, graph: sparse.csr_matrix, most: int) -> np.ndarray:
    """Group of every vertex, (vertices,): boxes of at most ``most`` vertices, and of these the parts that hang together.

    Parameters
    ----------
    places : (vertices, 3) integers, in an order that decides between equal ones · graph : neighbours
    """
    group, waiting, known = np.empty(len(places), np.int64), [np.arange(len(places))], 0
    while waiting:
        box = waiting.pop()
        boxes = -(-len(box) // most)
        if boxes <= 1:
            group[box], known = known, known + 1
            continue
        axis = int(np.argmax(np.ptp(places[box], axis=0)))
        box = box[np.argsort(places[box, axis], kind="stable")]
        first = len(box) * (boxes // 2) // boxes
        waiting += [np.sort(box[:first]), np.sort(box[first:])]
    links = graph.tocoo()
    within = group[links.row] == group[links.col]
    inside = sparse.csr_matrix((np.ones(within.sum()), (links.row[within], links.col[within])), graph.shape)
    return connected_components(inside, directed=False)[1]


def blended(groups: np.ndarray, graph: sparse.csr_matrix, passes: int) -> sparse.csr_matrix:
    """Weights (vertices, groups) of the groups at every vertex, rows of which sum to one."""
    degree = np.maximum(np.diff(graph.indptr), 1)
    mean = sparse.diags(BLENDED / degree) @ graph + sparse.diags(np.where(np.diff(graph.indptr) > 0, 1 - BLENDED, 1.0))
    weights = sparse.csr_matrix((np.ones(len(groups)), groups, np.arange(len(groups) + 1)))
    for _ in range(passes):
        weights = (mean @ weights).tocsr()
    weights.sort_indices()
    return weights


class _Pairs:
    """The pairs of groups that meet in pairs of vertices.

    Parameters
    ----------
    comm : of ranks with vertices of their own; None where all have the same
    weights : (vertices, groups) · starts, columns : of the pairs of vertices, row by row

    Attributes
    ----------
    first, second : (pairs,) · turned : (pairs,) of each, the pair the other way round
    """

    def __init__(self, comm, weights: sparse.csr_matrix, starts: np.ndarray, columns: np.ndarray):
        count = weights.shape[1]
        self._starts, self._which, self._weights = weights.indptr.astype(np.int32), weights.indices, weights.data
        rows = sparse.csr_matrix((np.ones(weights.nnz, np.int32), weights.indices, weights.indptr), weights.shape)
        pairs = sparse.csr_matrix((np.ones(len(columns), np.int32), columns, starts), 2 * (weights.shape[0],))
        met = (rows.T @ (pairs @ rows) + rows.T @ rows).tocoo()
        keys = np.unique(np.concatenate([met.row * np.int64(count) + met.col, met.col * np.int64(count) + met.row]))
        if comm is not None:
            keys = np.unique(np.concatenate(comm.allgather(keys)))
        self.first, self.second = np.divmod(keys, count)
        self._place = np.full((count, count), -1, np.int32)
        self._place[self.first, self.second] = np.arange(len(keys))
        self.turned = self._place[self.second, self.first]

    def galerkin(self, starts, columns, diagonal, upper, free, x) -> np.ndarray:
        """Half of the Galerkin product, (pairs, 36), of the motions of groups about the origin."""
        blocks = np.zeros((len(self.first), 36))
        _galerkin(starts, columns, diagonal, upper, free, x, self._starts, self._which, self._weights, self._place, blocks)
        return blocks


class RigidGroups:
    """The Galerkin product of a matrix over vertices on the motions of groups, and its solution on every rank.

    Parameters
    ----------
    weights : (all vertices, groups) in the common order · middles : (groups, 3) that they turn about · size : mm, that a
    turning by one moves a point · block : the matrix over the vertices of this rank · everywhere : their common order
    """

    def __init__(self, weights: sparse.csr_matrix, middles: np.ndarray, size: float, block: VelocityBlock,
                 everywhere: Everywhere):
        self.count, self._block, self._middles, self._size = len(middles), block, middles, size
        self._everywhere, self._of_all, weights = everywhere, weights, weights[everywhere.numbers]
        self._starts, self._which, self._weights = weights.indptr.astype(np.int32), weights.indices, weights.data
        p = block.pattern
        self._pairs = _Pairs(block.shared.comm, weights, p.starts, p.columns)
        self._further: tuple = (None, None)

    def prepare(self, x: np.ndarray) -> None:
        """Make the Galerkin product for vertices at x (vertices, 3) and factorise it. Collective.

        Raises
        ------
        ConvergenceError
            where the matrix is not positive: velocities of the iteration are beyond all measure.
        """
        self._x, block, n, p = x, self._block, 6 * self.count, self._block.pattern
        blocks = self._pairs.galerkin(p.starts, p.columns, block.diagonal, block.upper, block.free, x / self._size)
        matrix = np.zeros((n, n))
        self._add(matrix, self._pairs, total(block.shared.comm, blocks))
        for other in block.others:
            other.add_on_groups(self, matrix)
        self._factorise(matrix)

    def add_galerkin(self, matrix: np.ndarray, vertices: np.ndarray, starts, columns, diagonal, upper) -> None:
        """Add the Galerkin product of a further matrix, which all ranks know, over some ``vertices`` (n,) of the common
        order to ``matrix`` (6 · groups, 6 · groups): given by its upper half as in ``velocity_block``, with pairs of
        vertices that no cell joins. Collective."""
        whole, block = self._everywhere, self._block
        known, pairs = self._further
        if known is not columns:
            pairs = _Pairs(None, self._of_all[vertices], starts, columns)
            self._further = columns, pairs
        free, x = whole.gather(block.free)[vertices], whole.gather(self._x)[vertices]
        self._add(matrix, pairs, pairs.galerkin(starts, columns, diagonal, upper, free, x / self._size))

    def _add(self, matrix: np.ndarray, pairs: _Pairs, half: np.ndarray) -> None:
        """Add half of a Galerkin product, blocks (pairs, 36), and its transpose to ``matrix``."""
        _add_about_middles(pairs.first, pairs.second, pairs.turned, half, self._middles / self._size,
                           matrix.reshape(self.count, 6, self.count, 6))

    def operator(self) -> sparse.csr_matrix:
        """Velocities of all vertices in the common order by the motions, (3 · all vertices, 6 · groups). Collective."""
        w, whole = self._of_all.tocoo(), self._everywhere
        arm = (whole.gather(self._x)[w.row] - self._middles[w.col]) / self._size
        blocks = np.zeros((w.nnz, 3, 6))
        blocks[:, :, :3] = np.eye(3)
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            blocks[:, i, 3 + j], blocks[:, j, 3 + i] = arm[:, k], -arm[:, k]
        blocks *= w.data[:, None, None] * whole.gather(self._block.free)[w.row][:, :, None]
        return sparse.bsr_matrix((blocks, w.col, self._of_all.indptr), (3 * whole.count, 6 * self.count)).tocsr()

    def _factorise(self, matrix: np.ndarray) -> None:
        diagonal = matrix.diagonal()
        if not np.isfinite(matrix).all():
            raise ConvergenceError("a node has no stiffness against the rest")
        self._scale = np.where(diagonal > 0, 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 0.0)
        matrix *= self._scale[:, None] * self._scale
        ridge = RIDGE
        while True:
            matrix[np.diag_indices_from(matrix)] = 1.0 + ridge
            try:
                self._factor = linalg.cho_factor(matrix, lower=True, check_finite=False)
                return
            except linalg.LinAlgError:
                ridge *= 100.0
                if ridge > 1.0:
                    raise ConvergenceError("a node has no stiffness against the rest") from None

    def restricted(self, r: np.ndarray) -> np.ndarray:
        """Forces and moments of the groups, (groups · 6,), of a residual (vertices, 3) of which the owners' part counts.
        Collective."""
        shared, out = self._block.shared, np.zeros((self.count, 6))
        _restrict(shared.owned, self._starts, self._which, self._weights, self._x, self._middles, 1.0 / self._size, r, out)
        return total(shared.comm, out.ravel())

    def prolonged(self, motions: np.ndarray) -> np.ndarray:
        """Velocities (vertices, 3) of the motions (groups · 6,) where they are sought."""
        out = np.empty_like(self._x)
        _prolong(self._starts, self._which, self._weights, self._x, self._middles, 1.0 / self._size,
                 motions.reshape(-1, 6), out)
        return out * self._block.free

    def correction(self, r: np.ndarray) -> np.ndarray:
        """Velocities (vertices, 3), for all copies, of a residual that is zero where velocities are given. Collective."""
        motions = linalg.cho_solve(self._factor, self._scale * self.restricted(r), check_finite=False)
        return self.prolonged(self._scale * motions)


@compiled
def _turned(block, fi, xj, fj, out):
    """F_i A F_j R_j (18,) row by row, for a block A (9,), F diagonal with what is free, R = (1, -x cross)."""
    for i in range(3):
        a0, a1, a2 = fi[i] * block[3 * i] * fj[0], fi[i] * block[3 * i + 1] * fj[1], fi[i] * block[3 * i + 2] * fj[2]
        out[6 * i], out[6 * i + 1], out[6 * i + 2] = a0, a1, a2
        # columns of w x x: e0 x x = (0, -x2, x1), e1 x x = (x2, 0, -x0), e2 x x = (-x1, x0, 0)
        out[6 * i + 3] = a2 * xj[1] - a1 * xj[2]
        out[6 * i + 4] = a0 * xj[2] - a2 * xj[0]
        out[6 * i + 5] = a1 * xj[0] - a0 * xj[1]


@compiled
def _galerkin(starts, columns, diagonal, upper, free, x, first, which, weights, place, blocks):
    """Add half of the Galerkin product to the blocks (pairs of groups, 36), motions about the origin: the other half is
    its transpose. Row by row: first what the motions of all groups near a vertex do to it, then that on its own groups."""
    slot = np.full(len(place), -1)
    near, forces, local = np.empty(len(place), np.int64), np.empty((len(place), 18)), np.empty(36)
    pair = np.empty(18)
    for i in range(len(starts) - 1):
        found = 0
        for k in range(starts[i] - 1, starts[i + 1]):
            same = k < starts[i]
            j = i if same else columns[k]
            block, half = (diagonal[i], 0.5) if same else (upper[k], 1.0)
            _turned(block, free[i], x[j], free[j], pair)
            for b in range(first[j], first[j + 1]):
                B, w = which[b], half * weights[b]
                if slot[B] < 0:
                    slot[B], near[found] = found, B
                    forces[found] = 0.0
                    found += 1
                out = forces[slot[B]]
                for m in range(18):
                    out[m] += w * pair[m]
        x0, x1, x2 = x[i]
        for s in range(found):
            B, c = near[s], forces[s]
            slot[B] = -1
            local[:18] = c
            for n in range(6):
                local[18 + n] = c[12 + n] * x1 - c[6 + n] * x2
                local[24 + n] = c[n] * x2 - c[12 + n] * x0
                local[30 + n] = c[6 + n] * x0 - c[n] * x1
            for a in range(first[i], first[i + 1]):
                w, out = weights[a], blocks[place[which[a], B]]
                for m in range(36):
                    out[m] += w * local[m]


@compiled
def _add_about_middles(first, second, turned, half, middles, matrix):
    """Add half of a product, (pairs, 36), and its transpose to ``matrix`` (groups, 6, groups, 6), turned from motions about
    the origin into those about the middles: u + w x (x - X) is a motion about the origin with u + X x w."""
    block = np.empty((6, 6))
    for p in range(len(first)):
        A, B = first[p], second[p]
        a0, a1, a2 = middles[A]
        b0, b1, b2 = middles[B]
        for i in range(6):
            for j in range(6):
                block[i, j] = half[p, 6 * i + j] + half[turned[p], 6 * j + i]
            c0, c1, c2 = block[i, 0], block[i, 1], block[i, 2]
            block[i, 3] += c1 * b2 - c2 * b1
            block[i, 4] += c2 * b0 - c0 * b2
            block[i, 5] += c0 * b1 - c1 * b0
        out = matrix[A, :, B]
        for j in range(6):
            c0, c1, c2 = block[0, j], block[1, j], block[2, j]
            out[0, j] += c0
            out[1, j] += c1
            out[2, j] += c2
            out[3, j] += block[3, j] + c1 * a2 - c2 * a1
            out[4, j] += block[4, j] + c2 * a0 - c0 * a2
            out[5, j] += block[5, j] + c0 * a1 - c1 * a0


@compiled
def _restrict(owned, starts, which, weights, x, middles, turn, r, out):
    for i in range(owned):
        r0, r1, r2 = r[i, 0], r[i, 1], r[i, 2]
        for k in range(starts[i], starts[i + 1]):
            A, w = which[k], weights[k]
            X = middles[A]
            a0, a1, a2 = turn * (x[i, 0] - X[0]), turn * (x[i, 1] - X[1]), turn * (x[i, 2] - X[2])
            o = out[A]
            o[0] += w * r0
            o[1] += w * r1
            o[2] += w * r2
            o[3] += w * (a1 * r2 - a2 * r1)
            o[4] += w * (a2 * r0 - a0 * r2)
            o[5] += w * (a0 * r1 - a1 * r0)


@compiled
def _prolong(starts, which, weights, x, middles, turn, motions, out):
    for i in range(len(starts) - 1):
        v0 = v1 = v2 = 0.0
        for k in range(starts[i], starts[i + 1]):
            A, w = which[k], weights[k]
            X = middles[A]
            a0, a1, a2 = turn * (x[i, 0] - X[0]), turn * (x[i, 1] - X[1]), turn * (x[i, 2] - X[2])
            m = motions[A]
            v0 += w * (m[0] + m[4] * a2 - m[5] * a1)
            v1 += w * (m[1] + m[5] * a0 - m[3] * a2)
            v2 += w * (m[2] + m[3] * a1 - m[4] * a0)
        out[i, 0], out[i, 1], out[i, 2] = v0, v1, v2
