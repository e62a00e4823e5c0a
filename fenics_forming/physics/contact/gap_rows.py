r"""The gap operator by carriers and nodes, gathered by numba from the points that count in each carrier.

A point m with the share W in carrier a adds :math:`WR\,N_n(x_m)` to the block of a and each node n that moves the point,
or its foot (with the sign of the master).  R turns the normal of the point into that of the carrier; where no normal needs
turning, one number stands for a block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .bvh import _compile

ALIKE = 1e-14       # between unit normals that need no turning


@dataclass(frozen=True)
class GapRows:
    """What this rank's points give to the gap operator.

    Attributes
    ----------
    starts : (all carriers + 1,) of each in the entries · node : (entries,) · blocks : (entries, d, d), d = 1 where one
        number stands for a block · back : (all carriers, dim, dim) mean of the rotations from carriers to their points
    """

    starts: np.ndarray
    node: np.ndarray
    blocks: np.ndarray
    back: np.ndarray

    @property
    def carrier(self) -> np.ndarray:
        """Of every entry, (entries,)."""
        return np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))


def gap_rows(carrier: np.ndarray, point: np.ndarray, share: np.ndarray, *, places: np.ndarray, shapes: np.ndarray,
             normals: np.ndarray, means: np.ndarray, nodes: int, frames: np.ndarray | None = None) -> GapRows:
    """Entries of the points for each carrier.

    Parameters
    ----------
    carrier, point, share : (m,) points and the carriers in which they count, and how much
    places : (p, n) nodes that move each point or its foot, numbered below ``nodes`` · shapes : (p, n) their shape functions
    normals : (p, dim) at the points · means : (all carriers, dim) of the carriers
    frames : (p, dim, dim) turn motions of the second half of the nodes, those of the foot, into the frame of the point
    """
    alike = frames is None and (len(point) == 0 or bool(np.abs(normals[point] - means[carrier]).max() < ALIKE))
    if frames is None:
        frames = np.empty((0, normals.shape[1], normals.shape[1]))
    return GapRows(*_gathered(carrier, point, share, places, shapes, normals, means, frames, nodes, alike))


@_compile
def lesser_sums(nodal, sides, shape, share, own, across, facet, shapes, total):
    """Sums over carriers of what the points count with, times the lesser of a field at them and at their feet, (total,).

    Parameters
    ----------
    nodal : (nodes,) the field · sides : (f, n) nodes of the slave's sides · shape : (points per side, n) of the points
    share : (points, corners) surface with which they count · own : (f, corners) carriers
    across : (g, n) the field at the nodes of the master's sides · facet, shapes : (points,), (points, n) of the feet
    """
    out, per_side = np.zeros(total), len(shape)
    for f in range(len(sides)):
        for q in range(per_side):
            p = f * per_side + q
            counts = 0.0
            for c in range(own.shape[1]):
                counts += share[p, c]
            if counts > 0.0:
                here = there = 0.0
                for a in range(sides.shape[1]):
                    here += shape[q, a] * nodal[sides[f, a]]
                    there += shapes[p, a] * across[facet[p], a]
                for c in range(own.shape[1]):
                    out[own[f, c]] += share[p, c] * min(here, there)
    return out


@_compile
def _turning(start, end, out):
    """The smallest rotation that turns a unit vector (dim,) into another, (dim, dim)."""
    cosine = 0.0
    for i in range(len(start)):
        cosine += start[i] * end[i]
    scale = 1.0 / max(1.0 + cosine, 1e-12)
    for i in range(len(start)):
        for j in range(len(start)):
            out[i, j] = 2.0 * end[i] * start[j] - (start[i] + end[i]) * (start[j] + end[j]) * scale
        out[i, i] += 1.0


@_compile
def _by_carrier(carrier, count):
    """Where the entries of each carrier begin, (count + 1,), in an order that has them together, (m,)."""
    begin = np.zeros(count + 1, np.int64)
    for a in carrier:
        begin[a + 1] += 1
    for a in range(count):
        begin[a + 1] += begin[a]
    order, next_one = np.empty(len(carrier), np.int64), begin[:-1].copy()
    for k in range(len(carrier)):
        a = carrier[k]
        order[next_one[a]] = k
        next_one[a] += 1
    return begin, order


@_compile
def _pattern(begin, order, point, places, nodes):
    """The nodes of each carrier in rising order: where they begin, (carriers + 1,), and they."""
    count = len(begin) - 1
    last, starts = np.full(nodes, -1, np.int64), np.zeros(count + 1, np.int64)
    for a in range(count):
        for k in order[begin[a]: begin[a + 1]]:
            for n in places[point[k]]:
                if last[n] != a:
                    last[n] = a
                    starts[a + 1] += 1
    node = np.empty(starts.sum(), np.int64)
    last[:] = -1
    for a in range(count):
        starts[a + 1] += starts[a]
        at = starts[a]
        for k in order[begin[a]: begin[a + 1]]:
            for n in places[point[k]]:
                if last[n] != a:
                    last[n] = a
                    node[at] = n
                    at += 1
        node[starts[a]: at].sort()
    return starts, node


@_compile
def _add(block, factor, turn):
    for i in range(len(block)):
        for j in range(len(block)):
            block[i, j] += factor * turn[i, j]


@_compile
def _product(turn, frame, out):
    for i in range(len(out)):
        for j in range(len(out)):
            out[i, j] = 0.0
            for k in range(len(out)):
                out[i, j] += turn[i, k] * frame[k, j]


@_compile
def _gathered(carrier, point, share, places, shapes, normals, means, frames, nodes, flat):
    count, dim = means.shape
    begin, order = _by_carrier(carrier, count)
    starts, node = _pattern(begin, order, point, places, nodes)
    width, framed, own = 1 if flat else dim, len(frames) > 0, places.shape[1] // 2
    blocks, back = np.zeros((len(node), width, width)), np.zeros((count, dim, dim))
    turn, other, slot = np.eye(dim), np.eye(dim), np.empty(nodes, np.int64)
    for a in range(count):
        for s in range(starts[a], starts[a + 1]):
            slot[node[s]] = s
        for k in order[begin[a]: begin[a + 1]]:
            p, w = point[k], share[k]
            if not flat:
                _turning(normals[p], means[a], turn)
            _add(back[a], w, turn.T)
            if framed:
                _product(turn, frames[p], other)
            for b in range(places.shape[1]):
                _add(blocks[slot[places[p, b]]], w * shapes[p, b], other if framed and b >= own else turn)
    return starts, node, blocks, back
