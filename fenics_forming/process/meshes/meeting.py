r"""Surfaces that pressed on one another meet again in the mean, as contact between them sees it.

Nodes of a new mesh that are put onto the other body leave overlaps and gaps between them, above all where a side passes a
corner of the other.  Contact would push these out within one step: an overlap of a thousandth of a millimetre under the
pressure of riveting does 4 % of the power.  So the new surface is moved by the least that makes the mean gaps of what
pressed zero, :math:`\min|d|` with :math:`n_a\cdot(Gd)_a=-g_a`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import lsqr

from ...physics.contact.bodies import BodyContact
from ...physics.contact.interfaces import FADE, REACH
from ...physics.kinematics import Kinematics
from ...physics.remeshing import BodyArrays

PASSES = 4          # gaps are linear in the way but for the curvature
DAMPING = 1e-2      # of one: a carrier that hardly feels the moving nodes asks for no great way
OPEN = 0.01         # of the size of a side: wider mean gaps are those of edges of the contact, which stay open
NEARLY = 1e-6       # of the size of a side: a gap that nothing feels


@dataclass(frozen=True)
class Meeting:
    """How two bodies look at one another: ``holds`` whether the points are on the renewed one."""

    kinematics: Kinematics
    element: str
    interference: float
    holds: bool


class _Sides(BodyContact):
    """Contact of sides given as arrays on one rank; ``nodes`` has only what is asked of it."""

    def _sides(self, facets: np.ndarray) -> np.ndarray:
        return facets

    def _number(self, local: np.ndarray) -> np.ndarray:
        return local


@dataclass(frozen=True)
class _Places:
    """Positions (n, dim) of two bodies, of one after those of the other."""

    x: np.ndarray

    @property
    def dim(self) -> int:
        return self.x.shape[1]

    comm = MPI.COMM_SELF


def close_mean_gaps(meeting: Meeting, x: np.ndarray, sides: np.ndarray, free: np.ndarray, other: BodyArrays, pressed,
                    farthest: float) -> None:
    """Move the nodes at ``x`` (n, dim), in place, so that what pressed meets in the mean.

    sides : (f, 3 | 6) of the renewed surface · free : (n, dim) which components may move · other : the body beside it
    pressed : f(nodes (k, dim)) → whether the body that holds the points was pressed there (k,)
    farthest : mm; carriers that overlap by more do not meet
    """
    count, dim = x.shape
    places, theirs = _Places(np.concatenate([x, other.x])), other.sides + count
    ours = np.concatenate([free, np.zeros(other.x.shape, bool)])
    dofs = np.arange(places.x.size).reshape(-1, dim)
    contact = _Sides(places, meeting.kinematics, sides if meeting.holds else theirs, theirs if meeting.holds else sides,
                     dofs=dofs, owned=places.x.size, element=meeting.element, interference=meeting.interference)
    corners = contact.points.sides[:, :dim]
    size = float(np.linalg.norm(places.x[corners[:, 0]] - places.x[corners[:, 1]], axis=1).mean())
    for _ in range(PASSES):
        contact.search(places.x, 1.0, REACH * size, FADE * size, FADE * size)
        state, rows = contact.state, contact.rows
        node = contact.points.corners.ravel()[contact.carriers.first_corner]
        meets = (contact.weights > 0) & (state.gap > -farthest) & (state.gap < OPEN * size)
        meets[meets] = pressed(places.x[node[meets]])
        if not meets.any() or np.abs(state.gap[meets]).max() < NEARLY * size:
            return
        blocks = rows.blocks if rows.blocks.shape[1] == dim else rows.blocks * np.eye(dim)
        columns = contact.unknowns[rows.node]
        across = np.einsum("ki,kij->kj", state.normal[rows.carrier], blocks) * ours.ravel()[columns]
        operator = sparse.csr_matrix((across.ravel(), (np.repeat(rows.carrier, dim), columns.ravel())),
                                     (len(meets), places.x.size))[meets]
        way = lsqr(operator, -state.gap[meets], damp=DAMPING, atol=1e-10, btol=1e-10)[0].reshape(-1, dim)
        places.x[:count] += way[:count]
        x += way[:count]
