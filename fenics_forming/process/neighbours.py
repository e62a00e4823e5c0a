"""The surface of a body with a new mesh, put back onto the bodies that it pressed on before."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..physics.contact.capture import CapturingSurface
from ..physics.remeshing import BodyArrays, Remeshed

FARTHEST = 0.3      # of the size of the sides around: a node that has come farther off is left where it is


class Neighbours:
    """What a body touches.

    Parameters
    ----------
    old : the body with its old mesh
    others : (mark (n,) which nodes of ``old`` feel it, `BodyArrays`) of every body that may touch it
    mirrors : axis → coordinate of the mirror planes of the body
    """

    def __init__(self, old: BodyArrays, others: list[tuple[np.ndarray, BodyArrays]], mirrors: dict[int, float]):
        self._mirrors, rows = mirrors, np.unique(old.sides)
        self._nearest = cKDTree(old.x[rows])
        self._others = [(felt[rows], other) for felt, other in others if felt[rows].any()]

    def meet(self, made: Remeshed, x: np.ndarray) -> np.ndarray:
        """Put nodes that lie where the body was pressed onto the other body, in place; which they are, (n,).

        ``x`` (n, dim) positions of the nodes of ``made``, mm.
        """
        met, rows = np.zeros(len(x), bool), np.unique(made.sides[made.labels >= 0])
        size = _sizes(made, x)[rows]
        _, nearest = self._nearest.query(x[rows])
        for felt, other in self._others:
            surface = CapturingSurface(other.x[other.sides], other.sides)
            found = surface.capture(x[rows])
            near = felt[nearest] & found.over & (np.abs(found.gap) < FARTHEST * size)
            x[rows[near]] -= found.gap[near, None] * found.normal[near]
            met[rows[near]] = True
        for axis, value in self._mirrors.items():
            x[np.unique(made.sides[made.labels == -1 - axis]), axis] = value
        return met


def _sizes(made: BodyArrays, x: np.ndarray) -> np.ndarray:
    """Length of the shortest edge of the sides around each node of the boundary, (n,), mm."""
    vertices = made.sides[:, : made.dim]
    edges = np.linalg.norm(x[vertices] - x[np.roll(vertices, 1, axis=1)], axis=2).min(axis=1)
    out = np.full(len(x), np.inf)
    np.minimum.at(out, made.sides.ravel(), np.repeat(edges, made.sides.shape[1]))
    return out
