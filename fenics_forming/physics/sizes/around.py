"""The way along the surface of a body in space from one side to another, compiled by numba."""

from __future__ import annotations

import heapq

import numpy as np

from ..contact.bvh import _compile
from .field import edges_of


def is_around_the_end(x: np.ndarray, sides: np.ndarray, plane: np.ndarray, met: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Whether the shortest way from each side to the one that it has met is not longer than wanted, (f,).

    It leads over edges of the surface, not over mirror planes; to a mirror plane, its edge is near enough.

    Parameters
    ----------
    x : (n, 3) nodes
    sides : (f, 3) vertices of the boundary sides
    plane : (f,) axis of the mirror plane of each side, -1 for none
    met : (f,) number of the other side, -1 for none: those are not looked at
    most : (f,) mm
    """
    free = sides[plane < 0]
    ends = np.unique(np.sort(edges_of(free), axis=1), axis=0) if len(free) else np.empty((0, 2), np.int64)
    ends = np.concatenate([ends, ends[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    first = np.searchsorted(ends[:, 0], np.arange(len(x) + 1))
    length = np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    on_plane = np.zeros((len(x), 3), bool)
    for axis in range(3):
        on_plane[sides[plane == axis], axis] = True
    return _reached(np.ascontiguousarray(x), np.ascontiguousarray(sides, np.int64), plane, met, most, first,
                    np.ascontiguousarray(ends[:, 1]), length, on_plane)


@_compile
def _reached(x, sides, plane, met, most, first, other, length, on_plane):
    reached = np.zeros(len(sides), np.bool_)
    best = np.full(len(x), np.inf)
    away = np.full(len(x), -1.0)        # from the middle of the side that is met, at its vertices
    for side in range(len(sides)):
        if met[side] < 0:
            continue
        axis = plane[met[side]]
        middle, goal = _middle(x, sides[side]), _middle(x, sides[met[side]])
        for node in sides[met[side]]:
            away[node] = np.sqrt(((x[node] - goal) ** 2).sum())
        heap = [(0.0, -1)]
        heap.pop()
        seen = [-1]
        for node in sides[side]:
            best[node] = np.sqrt(((x[node] - middle) ** 2).sum())
            heapq.heappush(heap, (best[node], node))
            seen.append(node)
        while len(heap) > 0:
            way, node = heapq.heappop(heap)
            if way > most[side]:
                break
            if way > best[node]:
                continue
            if (axis >= 0 and on_plane[node, axis]) or (axis < 0 and 0.0 <= away[node] <= most[side] - way):
                reached[side] = True
                break
            for k in range(first[node], first[node + 1]):
                further = way + length[k]
                if further < best[other[k]]:
                    best[other[k]] = further
                    heapq.heappush(heap, (further, other[k]))
                    seen.append(other[k])
        for node in seen:
            if node >= 0:
                best[node] = np.inf
        for node in sides[met[side]]:
            away[node] = -1.0
    return reached


@_compile
def _middle(x, nodes):
    return (x[nodes[0]] + x[nodes[1]] + x[nodes[2]]) / 3
