"""The surface of a body with a new mesh, put back onto the bodies that it pressed on before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ...physics.contact.capture import CapturingSurface
from ...physics.remeshing import BodyArrays, Remeshed
from .meeting import Meeting, close_mean_gaps

ROUNDS = 2          # bodies share the nodes beside a seam
FARTHEST = 0.3      # of the size of the sides around: a node that has come farther off is left where it is


@dataclass(frozen=True)
class Neighbour:
    """A body beside another that gets a new mesh.

    body : as it is now · felt : (n,) nodes of the old mesh of the renewed body that felt it
    before, feels : the other as it was, and (n,) its nodes that felt the renewed body · meeting : how they look
    """

    body: BodyArrays
    felt: np.ndarray
    before: BodyArrays
    feels: np.ndarray
    meeting: Meeting


class Neighbours:
    """What a body touches.

    Parameters
    ----------
    old : the body with its old mesh
    others : the bodies that may touch it
    mirrors : axis → coordinate of the mirror planes of the body
    """

    def __init__(self, old: BodyArrays, others: list[Neighbour], mirrors: dict[int, float]):
        self._mirrors, self._old = mirrors, old
        self._others = [other for other in others if other.felt.any()]

    def meet(self, made: Remeshed, x: np.ndarray) -> np.ndarray:
        """Put nodes that lie where the body was pressed onto the other body, in place; which they are, (n,).

        ``x`` (n, dim) positions of the nodes of ``made``, mm.
        """
        met, rows = np.zeros(len(x), bool), np.unique(made.sides[made.labels >= 0])
        size = _sizes(made, x)[rows]
        for other in self._others:
            found = CapturingSurface(other.body.x[other.body.sides], other.body.sides).capture(x[rows])
            gap = found.gap - other.meeting.interference
            near = _marks(self._old, other.felt)(x[rows]) & found.over & (np.abs(gap) < FARTHEST * size)
            x[rows[near]] -= gap[near, None] * found.normal[near]
            met[rows[near]] = True
        free = np.zeros(x.shape, bool)
        free[made.sides[made.labels == 0]] = True
        free[made.sides[made.labels > 0]] = False
        for axis in self._mirrors:
            free[made.sides[made.labels == -1 - axis], axis] = False
        for other in ROUNDS * self._others:
            pressed = _marks(self._old, other.felt) if other.meeting.holds else _marks(other.before, other.feels)
            close_mean_gaps(other.meeting, x, made.sides[made.labels >= 0], free, other.body, pressed,
                            FARTHEST * float(size.min()))
        for axis, value in self._mirrors.items():
            x[np.unique(made.sides[made.labels == -1 - axis]), axis] = value
        return met


def _marks(body: BodyArrays, marks: np.ndarray):
    """f(points (k, dim)) → the marks (n,) of the nodes of the surface of a body that are nearest."""
    rows = np.unique(body.sides)
    tree = cKDTree(body.x[rows])
    return lambda points: marks[rows][tree.query(points)[1]]


def _sizes(made: BodyArrays, x: np.ndarray) -> np.ndarray:
    """Length of the shortest edge of the sides around each node of the boundary, (n,), mm."""
    vertices = made.sides[:, : made.dim]
    edges = np.linalg.norm(x[vertices] - x[np.roll(vertices, 1, axis=1)], axis=2).min(axis=1)
    out = np.full(len(x), np.inf)
    np.minimum.at(out, made.sides.ravel(), np.repeat(edges, made.sides.shape[1]))
    return out
