r"""What carries the traction of a contact: hats at the nodes of the slave's surface.

Points see gaps, but tractions :math:`t=\sum_aN_at_a` are unknown at nodes a only, and a node decides by what the points of
its hat see in the mean,

.. math:: g_a=\sum_mW_{am}g_m,\qquad W_{am}=w_mN_a(x_m)\big/\sum_mw_mN_a(x_m)

over the points m that are over the other body.  As there are fewer nodes than displacements of the surface, a hard penalty
locks nothing, and the pressure is smooth.  A node of a sharp edge carries one traction for each of its faces; an edge that
was sharp once stays one, as a corner that comes and goes would let the mean gaps jump.

Where the surface is curved, the normal of a point is turned into that of its node, and the relative motion with it: so a
pressure acts along the normal of the point, and what slides along the surface there slides along it at the node.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..nodes import EDGES
from ..parallel import total

SMOOTH = 0.75       # cosine between normals of neighbouring sides at a common node; below it their edge is sharp


class Carriers:
    """The nodes of the sides of a surface, those of smoothly joined sides taken together.

    A *corner* is a node of one side; all ranks know all corners, side by side, rank after rank.

    Parameters
    ----------
    numbers : (f, k) numbers of the nodes that carry, of this rank's sides, equal on all ranks; the vertices first

    Attributes
    ----------
    groups : (all corners,) the carrier of every corner, numbered in the order of their first corners, rank by rank
    own : (f, k) carriers of this rank's corners · own_sides : (f,) numbers of its sides among those of all ranks
    first, count : carriers that this rank keeps · total : of all ranks · first_corner : (total,) of each
    """

    def __init__(self, comm, numbers: np.ndarray, dim: int):
        self._comm, self._shape = comm, numbers.shape
        before = comm.exscan(numbers.size) if comm.size > 1 else 0
        self._start = before if comm.rank > 0 else 0
        self._edges, self._edge, self._joints = _joints(np.concatenate(comm.allgather(numbers)), dim)
        self._sharp = np.zeros(self._edges.max(initial=-1) + 1, bool)
        self.corners = int(total(comm, float(numbers.size)))
        self.own_sides = self._start // numbers.shape[1] + np.arange(len(numbers))
        self._joined: np.ndarray | None = None

    def group(self, normals: np.ndarray) -> None:
        """Take corners together for unit normals of this rank's sides at them, (f, k, dim). Collective."""
        every = np.concatenate(self._comm.allgather(normals.reshape(-1, normals.shape[-1])))
        one, other = self._joints
        self._sharp[self._edge[np.einsum("ji,ji->j", every[one], every[other]) < SMOOTH]] = True
        joined = ~self._sharp[self._edge]
        if self._joined is not None and np.array_equal(joined, self._joined):
            return
        self._joined = joined
        graph = sparse.coo_matrix((np.ones(joined.sum()), (one[joined], other[joined])), shape=2 * (self.corners,))
        count, labels = connected_components(graph, directed=False)
        first = np.full(count, self.corners)
        np.minimum.at(first, labels, np.arange(self.corners))
        rank = np.empty(count, int)
        rank[np.argsort(first)] = np.arange(count)
        self.groups, self.total, self.first_corner = rank[labels], count, np.sort(first)
        end = self._start + int(np.prod(self._shape))
        self.first, last = np.searchsorted(self.first_corner, [self._start, end])
        self.count = int(last - self.first)
        self.own = self.groups[self._start: end].reshape(self._shape)

    def sharp_edges(self) -> np.ndarray:
        """1 at the vertices of this rank's sides with a sharp edge opposite to them, else 0, (f, corners)."""
        flags = np.zeros(self._shape)
        own = self._edges[self.own_sides]
        flags[:, : own.shape[1]] = self._sharp[own]
        return flags

    def ends(self) -> np.ndarray:
        """Whether the surface ends at, or turns sharply beside, the nodes of this rank's sides, (f, corners)."""
        single = np.bincount(self._edge, minlength=len(self._sharp)) == 0
        at = (self._sharp | single)[self._edges[self.own_sides]]        # of the edge opposite to each vertex
        dim = at.shape[1]
        ends = np.zeros(self._shape, bool)
        for vertex in range(dim):
            ends[:, vertex] = np.delete(at, vertex, axis=1).any(axis=1)
        if self._shape[1] > dim and dim == 3:
            for mid, between in enumerate(EDGES[dim - 1]):
                ends[:, dim + mid] = at[:, 3 - sum(between)]
        return ends

    def sharpen(self, flags: np.ndarray) -> None:
        """Make edges sharp that were so in an earlier run (:meth:`sharp_edges`). Collective."""
        every = np.concatenate(self._comm.allgather(flags[:, : self._edges.shape[1]]))
        self._sharp[self._edges[every > 0.5]] = True

    # ------------------------------------------------------------------ values
    def sums(self, at_corners: np.ndarray) -> np.ndarray:
        """Sums over the corners of each carrier of values (f, k, c) of all ranks, on every rank: (total, c). Collective."""
        flat = at_corners.reshape(-1, at_corners.shape[-1])
        out = np.stack([np.bincount(self.own.ravel(), column, self.total) for column in flat.T], axis=1)
        return total(self._comm, out)

    def mine(self, of_all: np.ndarray) -> np.ndarray:
        """The rows of the carriers of this rank."""
        return of_all[self.first: self.first + self.count]

    def everywhere(self, of_mine: np.ndarray) -> np.ndarray:
        """Values (count, …) of this rank's carriers → (total, …), on every rank. Collective."""
        return np.concatenate(self._comm.allgather(of_mine)) if self._comm.size > 1 else of_mine

    def at_corners(self, of_mine: np.ndarray) -> np.ndarray:
        """Values (count, …) of this rank's carriers at this rank's corners, (f, k, …). Collective."""
        return self.everywhere(of_mine)[self.own]

    def from_corners(self, values: np.ndarray) -> np.ndarray:
        """Mean over the corners of each carrier of values (f, k, …), which all ranks give: (count, …). Collective."""
        every = np.concatenate(self._comm.allgather(values.reshape(-1, *values.shape[2:])))
        return self.mine(means(every, self.groups, self.total))


def means(values: np.ndarray, groups: np.ndarray, count: int) -> np.ndarray:
    """Means of values (n, …) over ``count`` groups (n,) of them, (count, …)."""
    flat = values.reshape(len(values), -1).astype(float)
    found = np.stack([np.bincount(groups, column, count) for column in flat.T], axis=1)
    return (found / np.bincount(groups, minlength=count)[:, None]).reshape(count, *values.shape[1:])


def _joints(numbers: np.ndarray, dim: int) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Of sides with nodes (f, k), the vertices first: the number of the edge (in the plane: end) opposite to each vertex,
    (f, dim); and pairs of corners at one node of two sides with a common edge: that edge, and the two corners."""
    vertices = numbers[:, :dim]
    edges = np.sort(np.stack([np.delete(vertices, j, axis=1) for j in range(dim)], axis=1), axis=2).reshape(-1, dim - 1)
    _, edge = np.unique(edges, axis=0, return_inverse=True)
    order = np.argsort(edge.ravel(), kind="stable")
    together = np.flatnonzero(edge.ravel()[order][1:] == edge.ravel()[order][:-1])
    one, other, shared = order[together] // dim, order[together + 1] // dim, edge.ravel()[order[together]]
    pair, a, b = np.nonzero(numbers[one][:, :, None] == numbers[other][:, None, :])
    k = numbers.shape[1]
    return edge.reshape(-1, dim), shared[pair], (one[pair] * k + a, other[pair] * k + b)
