"""G^T T G over vertices, of which the upper half is stored: gathered from the rows of carriers by numba."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..contact.gap_rows import GapRows
from ..machine_code import compiled


@dataclass(frozen=True)
class BlockRows:
    """Rows of a gap operator over vertices: carrier a has the entries ``starts[a]`` to ``starts[a + 1]``, of the vertices
    ``column`` (entries,) in rising order, with ``blocks`` (entries, 3, 3)."""

    starts: np.ndarray
    column: np.ndarray
    blocks: np.ndarray

    @classmethod
    def of(cls, parts: list[BlockRows]) -> BlockRows:
        """The rows of all parts, one after the other."""
        ends = np.cumsum([0, *(part.starts[-1] for part in parts)])
        starts = [part.starts[:-1] + end for part, end in zip(parts, ends[:-1], strict=True)]
        return cls(np.concatenate([*starts, ends[-1:]]).astype(np.int64), np.concatenate([p.column for p in parts]),
                   np.concatenate([p.blocks for p in parts]))


def on_vertices(rows: GapRows, free: np.ndarray, ends: np.ndarray) -> BlockRows:
    """Rows of a gap operator, all of it on this rank, for velocities that are linear in every cell.

    Parameters
    ----------
    rows : over nodes (n,) · free : (n, 3) 0 where a velocity is given
    ends : (n, 2) numbers of the vertices that each node lies between; a vertex twice itself
    """
    return BlockRows(*_onto_vertices(rows.starts, rows.node, rows.blocks, free, ends))


class UpperHalf:
    """The matrix of some rows: blocks of 3 x 3 over the vertices that they reach on any rank.

    Parameters
    ----------
    rows : of this rank, over vertices numbered alike on all ranks

    Attributes
    ----------
    near : (n,) numbers of the vertices · starts, columns : (n + 1,), (pairs,) of the pairs of each with later ones ·
    diagonal, upper : (n, 9), (pairs, 9) summed over the ranks
    """

    def __init__(self, comm, rows: BlockRows):
        self._comm, self._rows = comm, rows
        self.near = _of_all(comm, rows.column)
        self._column = np.searchsorted(self.near, rows.column)
        self._begin, self._order = _by_vertex(self._column, len(self.near))
        self._carrier = np.repeat(np.arange(len(rows.starts) - 1), np.diff(rows.starts))
        keys = _pairs(rows.starts, self._column, self._begin, self._order, self._carrier)
        keys = _of_all(comm, keys) if comm.size > 1 else np.sort(keys)
        own, columns = np.divmod(keys, max(len(self.near), 1))
        self.columns = columns.astype(np.int32)
        self.starts = np.searchsorted(own, np.arange(len(self.near) + 1)).astype(np.int32)

    def fill(self, tangents: np.ndarray) -> None:
        """Take over symmetric, nowhere negative tangents T (carriers, 3, 3) of this rank. Collective."""
        both = np.zeros((len(self.near) + len(self.columns), 9))
        self.diagonal, self.upper = both[: len(self.near)], both[len(self.near):]
        _gather(self._rows.starts, self._column, self._rows.blocks, tangents, self._begin, self._order, self._carrier,
                self.starts, self.columns, self.diagonal, self.upper)
        if self._comm.size > 1:
            self._comm.Allreduce(both.copy(), both)


def _of_all(comm, numbers: np.ndarray) -> np.ndarray:
    """Numbers that any rank has, in rising order, each once. Collective."""
    mine = np.unique(numbers)
    return np.unique(np.concatenate(comm.allgather(mine))) if comm.size > 1 else mine


@compiled
def _onto_vertices(starts, node, blocks, free, ends):
    count, flat = len(starts) - 1, blocks.shape[1] == 1
    first, column, found = np.zeros(count + 1, np.int64), np.empty(2 * len(node), np.int64), 0
    slot = np.full(ends.max() + 1 if len(ends) else 0, -1, np.int64)
    out = np.zeros((2 * len(node), 3, 3))
    for a in range(count):
        begin = found
        for k in range(starts[a], starts[a + 1]):
            for v in ends[node[k]]:
                if slot[v] < begin:
                    slot[v], column[found] = found, v
                    found += 1
        column[begin:found].sort()
        for place in range(begin, found):
            slot[column[place]] = place
        for k in range(starts[a], starts[a + 1]):
            n = node[k]
            for v in ends[n]:
                to = out[slot[v]]
                for j in range(3):
                    half = 0.5 * free[n, j]
                    if flat:
                        to[j, j] += half * blocks[k, 0, 0]
                    else:
                        for i in range(3):
                            to[i, j] += half * blocks[k, i, j]
        first[a + 1] = found
    return first, column[:found], out[:found]


@compiled
def _by_vertex(column, count):
    """Where the entries of each vertex begin, (count + 1,), in an order that has them together, (entries,)."""
    begin, order = np.zeros(count + 1, np.int64), np.empty(len(column), np.int64)
    for j in column:
        begin[j + 1] += 1
    for j in range(count):
        begin[j + 1] += begin[j]
    free = begin[:-1].copy()
    for e in range(len(column)):
        order[free[column[e]]] = e
        free[column[e]] += 1
    return begin, order


@compiled
def _pairs(starts, column, begin, order, carrier):
    """The pairs i < j of vertices with a common carrier, as i · vertices + j, those of each i together."""
    count, most = len(begin) - 1, 0
    for a in range(len(starts) - 1):
        size = starts[a + 1] - starts[a]
        most += size * (size - 1) // 2
    found, last, keys = 0, np.full(count, -1, np.int64), np.empty(most, np.int64)
    for i in range(count):
        for e in order[begin[i]: begin[i + 1]]:
            for f in range(e + 1, starts[carrier[e] + 1]):
                j = column[f]
                if last[j] != i:
                    last[j], keys[found] = i, i * count + j
                    found += 1
    return keys[:found]


@compiled
def _gather(starts, column, blocks, tangents, begin, order, carrier, first, columns, diagonal, upper):
    """Add B_i^T T B_j for the entries i <= j of every carrier."""
    pressed, presses = np.empty_like(blocks), np.zeros(len(tangents), np.bool_)
    for a in range(len(tangents)):
        T = tangents[a]
        presses[a] = T[0, 0] + T[1, 1] + T[2, 2] > 0.0
        if presses[a]:
            for e in range(starts[a], starts[a + 1]):
                B, out = blocks[e], pressed[e]
                for i in range(3):
                    for j in range(3):
                        out[i, j] = T[i, 0] * B[0, j] + T[i, 1] * B[1, j] + T[i, 2] * B[2, j]
    slot = np.empty(len(first), np.int64)
    for i in range(len(first) - 1):
        for k in range(first[i], first[i + 1]):
            slot[columns[k]] = k
        for e in order[begin[i]: begin[i + 1]]:
            a, B = carrier[e], blocks[e]
            if not presses[a]:
                continue
            for f in range(e, starts[a + 1]):
                out = diagonal[i] if f == e else upper[slot[column[f]]]
                P = pressed[f]
                for m in range(3):
                    for n in range(3):
                        out[3 * m + n] += B[0, m] * P[0, n] + B[1, m] * P[1, n] + B[2, m] * P[2, n]
