"""Sides that cross each other: an engine that is given such a boundary may crash or never return."""

from __future__ import annotations

import numpy as np

from .boundary_kernels import meetings

TOUCH = 1e-9          # of the length of a side
PIECES = 4            # of a parabola: a sixteenth of its height is missed


def crossing(points: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """The sides, (f, 2) vertices, that cross or touch another one with which they share no vertex: (f,) bool."""
    i, j = meetings(points[sides[:, 0]], points[sides[:, 1]], TOUCH).T
    meet = (sides[i][:, :, None] != sides[j][:, None, :]).all(axis=(1, 2))
    found = np.zeros(len(sides), dtype=bool)
    found[i[meet]] = found[j[meet]] = True
    return found


def curved_crossing(points: np.ndarray, sides: np.ndarray, middles: np.ndarray) -> np.ndarray:
    """As `crossing` for the parabolas over the sides with the given ``middles`` (f, 2), each as PIECES straight pieces."""
    ends, count = points[sides], len(points)
    s = np.arange(1, PIECES)[:, None, None] / PIECES
    inner = (1 - s) * (1 - 2 * s) * ends[:, 0] + 4 * s * (1 - s) * middles + s * (2 * s - 1) * ends[:, 1]
    numbers = count + np.arange(len(sides) * (PIECES - 1)).reshape(PIECES - 1, -1)
    ways = np.concatenate([sides[None, :, 0], numbers, sides[None, :, 1]])
    pieces = np.stack([ways[:-1], ways[1:]], axis=2)                 # pieces, sides, 2
    found = crossing(np.concatenate([points, inner.reshape(-1, 2)]), pieces.reshape(-1, 2))
    return found.reshape(PIECES, -1).any(axis=0)


def crossings(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs i < j of the segments from a to b, (f, 2) each, of one closed way that cross or touch and do not follow."""
    i, j = meetings(a, b, TOUCH).T
    meet = (j - i > 1) & ((i > 0) | (j < len(a) - 1))
    return i[meet], j[meet]
