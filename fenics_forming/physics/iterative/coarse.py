"""The velocity block on the vertices alone: one V-cycle, with rigid motions of groups of vertices below."""

from __future__ import annotations

import numpy as np

from .aggregates import RigidGroups, blended, groups_of
from .everywhere import Everywhere
from .pattern import Pattern
from .sharing import Shared
from .velocity_block import VelocityBlock

ORDER = 6           # of the smoother, before and after; a product costs a sixteenth of one with quadratic velocities
IN_A_GROUP = 40     # vertices, at most ...
MOST_GROUPS = 352   # ... but no more boxes than that: every rank factorises a full matrix of six motions of each
PASSES = 2          # that blend the groups


class CoarseSolver:
    """The linearised flow with velocities that are linear in each cell.

    Parameters
    ----------
    pattern, shared : of the vertices; free (vertices, 3) 1 where the velocity is sought; x (vertices, 3) where they are;
    body (vertices,) which they belong to; start (vertices, 3) anything, to find the largest eigenvalue from
    """

    def __init__(self, pattern: Pattern, shared: Shared, free: np.ndarray, x: np.ndarray, body: np.ndarray,
                 start: np.ndarray):
        self.block = VelocityBlock(pattern, shared, start)
        self.block.free[:] = free
        whole = self.everywhere = Everywhere(shared, x, body)
        graph = whole.graph(pattern)
        most = max(IN_A_GROUP, -(-whole.count // MOST_GROUPS))
        groups = groups_of(whole.places, graph, most)
        weights = blended(groups, graph, PASSES)
        places = whole.gather(x)
        middles = np.stack([np.bincount(groups, places[:, k]) for k in range(3)], axis=1) / np.bincount(groups)[:, None]
        size = float(np.ptp(places, axis=0).max()) / max(len(middles), 1) ** (1 / 3)
        self.groups = RigidGroups(weights, middles, size, self.block, whole)

    def place(self, x: np.ndarray) -> None:
        """Take over the positions (vertices, 3) of the vertices: rigid motions belong to them."""
        self._x = x.copy()

    def prepare(self, *, again: bool = False) -> None:
        """Make smoother and lowest level ready for the present values; ``again`` where only contact has changed, of which
        the smoother has to know. Collective."""
        if not again:
            for other in self.block.others:
                other.prepare()
        self.block.prepare_smoother()
        if not again:
            self.groups.prepare(self._x)

    def solve(self, r: np.ndarray) -> np.ndarray:
        """Velocities (vertices, 3), for all copies, of a residual of which the owners' part counts. Collective."""
        block = self.block
        r = block.shared.hand_on(r) * block.free
        x, y = np.zeros_like(r), np.empty_like(r)
        block.smooth(x, r, ORDER, last=False)
        e = self.groups.correction(r)
        x += e
        r -= block.free_times(e, y)
        block.smooth(x, r, ORDER, last=True)
        return x
