"""Nested dissection of a plane mesh: in which order its unknowns are eliminated, and on which fronts.

The cells are halved again and again across the side with more of them in a row. An unknown belongs to the smallest part
of this tree that holds all cells around it: what lies within a half is eliminated before what both halves share (A.
George, SIAM J. Numer. Anal. 10, 1973, 345). The front of a part is the dense matrix of its own unknowns and of those of
greater parts that its cells touch, its boundary (I. S. Duff, J. K. Reid, ACM Trans. Math. Softw. 9, 1983, 302). Unknowns
that are appended to those of the mesh, as motions of a die that deforms, meet each other all: they belong to the whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

CELLS = 8       # of the smallest parts, about


@dataclass(frozen=True)
class Fronts:
    """Fronts in the order of elimination, of unknowns numbered in it.

    Attributes
    ----------
    order (unknowns,) : the unknown that comes k-th
    first (fronts + 1,) : of the own unknowns of a front · velocities (fronts,) : how many of these are velocities, which
        come before the pressures
    starts (fronts + 1,) : of the boundary of a front in ``boundary`` (all,), rising
    parents (fronts,) : -1 of the last · slots (fronts,) : 2 · depth + side, where the tree is walked depth first
    """

    order: np.ndarray
    first: np.ndarray
    velocities: np.ndarray
    starts: np.ndarray
    boundary: np.ndarray
    parents: np.ndarray
    slots: np.ndarray


def fronts_of(corners: np.ndarray, dofs: np.ndarray, velocities: int, appended: sp.csr_matrix | None = None) -> Fronts:
    """Fronts of a mesh.

    Parameters
    ----------
    corners (cells, 3, 2) : of the cells · dofs (cells, k) : their unknowns, first two velocities of each corner,
        then of each side, ``velocities`` in all, then pressures
    appended (unknowns, n) : which of these an unknown behind them meets; those count as velocities
    """
    depth = max(0, int(np.ceil(np.log2(len(corners) / CELLS))))
    leaf = _leaves(corners, _neighbours(dofs[:, velocities - 6: velocities: 2]), depth)
    count = int(dofs.max()) + 1
    lowest, highest = np.full(count, 2**depth), np.zeros(count, int)
    np.minimum.at(lowest, dofs, leaf[:, None])
    np.maximum.at(highest, dofs, leaf[:, None])
    part = (2**depth + lowest) >> np.frexp(lowest ^ highest)[1]       # numbered as a heap: 1, its halves 2 and 3, …
    at, which = np.repeat(leaf + 2**depth, dofs.shape[1]), dofs.ravel()
    if appended is not None:
        met, motions = appended.nonzero()
        at, which = np.concatenate([at, part[met]]), np.concatenate([which, count + motions])
        part = np.concatenate([part, np.ones(appended.shape[1], int)])
        count = len(part)
    walk = _depth_first(depth)
    is_pressure = np.zeros(count, bool)
    is_pressure[dofs[:, velocities:]] = True
    order = np.lexsort((is_pressure, walk[part]))
    rank = np.empty(count, int)
    rank[order] = np.arange(count)
    parts = 2 ** (depth + 1) - 1
    own = np.bincount(walk[part], minlength=parts)
    pressures = np.bincount(walk[part[is_pressure]], minlength=parts)
    keys = _boundary(at, which, part, walk, rank)
    starts = np.searchsorted(keys, np.arange(parts + 1) * count)
    heap = np.argsort(walk[1:]) + 1
    parents = np.where(heap > 1, walk[heap >> 1], -1)
    levels = np.frexp(heap)[1] - 1
    return Fronts(order, np.concatenate([[0], np.cumsum(own)]), own - pressures, starts, keys % count, parents,
                  2 * levels + heap % 2)


def _neighbours(sides: np.ndarray) -> np.ndarray:
    """The cells across the sides (cells, 3), numbered alike in both cells; -1 where there is none."""
    order = np.argsort(sides, axis=None, kind="stable")
    shared = np.flatnonzero(np.diff(sides.ravel()[order]) == 0)
    one, other = order[shared], order[shared + 1]
    found = np.full(sides.size, -1)
    found[one], found[other] = other // 3, one // 3
    return found.reshape(-1, 3)


def _leaves(corners: np.ndarray, neighbours: np.ndarray, depth: int) -> np.ndarray:
    """The smallest part of every cell, (cells,).

    A cell with more neighbours in the other half goes over to it, of one half after the other: a line along cells as they
    lie, which turns from side to side, has half as many unknowns again as a straight one.
    """
    centres, widths = corners.mean(axis=1), np.ptp(corners, axis=1)
    group = np.zeros(len(centres), int)
    for level in range(depth):
        by_group = np.argsort(group, kind="stable")
        starts = np.searchsorted(group[by_group], np.arange(2**level))
        extent = np.maximum.reduceat(centres[by_group], starts) - np.minimum.reduceat(centres[by_group], starts)
        size = np.diff(np.append(starts, len(group)))
        in_a_row = extent * size[:, None] / np.add.reduceat(widths[by_group], starts)
        along = np.take_along_axis(centres, in_a_row.argmax(axis=1)[group][:, None], axis=1)[:, 0]
        ordered = np.lexsort((along, group))
        place = np.empty(len(group), int)
        place[ordered] = np.arange(len(group))
        group = 2 * group + (2 * (place - starts[group]) >= size[group])
        for half in (0, 1):
            beyond = np.where(neighbours < 0, -1, group[neighbours])
            leans = (beyond == group[:, None] ^ 1).sum(axis=1) > (beyond == group[:, None]).sum(axis=1)
            goes = leans & (group % 2 == half)
            goes &= np.bincount(group[~goes], minlength=2 ** (level + 1))[group] > 0      # no part without cells
            group = np.where(goes, group ^ 1, group)
    return group


def _depth_first(depth: int) -> np.ndarray:
    """Place of every part (numbered as a heap; 0 is none) in a walk that ends with the whole, halves before their part."""
    walk = np.zeros(2 ** (depth + 1), int)
    walk[1] = 2 ** (depth + 1) - 2
    for level in range(1, depth + 1):
        heap = np.arange(2**level, 2 ** (level + 1))
        size = 2 ** (depth + 1 - level) - 1
        walk[heap] = walk[heap >> 1] - 1 - np.where(heap % 2, 0, size)
    return walk


def _boundary(at: np.ndarray, which: np.ndarray, part: np.ndarray, walk: np.ndarray, rank: np.ndarray):
    """Place of a front times the number of unknowns, plus the rank of an unknown of its boundary: rising, (all,); of
    parts ``at`` in which something meets the unknowns ``which``."""
    found = []
    while True:
        beyond = at != part[which]
        at, which = at[beyond], which[beyond]
        if not len(at):
            return np.unique(np.concatenate(found)) if found else np.zeros(0, int)
        keys = np.unique(walk[at] * len(part) + rank[which])
        found.append(keys)
        at = at >> 1
