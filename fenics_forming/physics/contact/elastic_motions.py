r"""A deformable tool inside the velocity solve: its stiffness condensed to the nodes that contact reaches.

The displacements :math:`u` of these nodes in the frame that moves with the tool are unknown motions
(``free_motions``) whose shapes are those of the sides, and

.. math:: K_s\,(u-u^*)+f^* = -\int N^T t\,d\Gamma ,\qquad K_s=S^{-1} ,

with the compliance S of ``tool_body.compliance``, one dense symmetric block that never changes while the tool stays elastic
(:math:`u^*=f^*=0`).  Of a tool that yields or has parts it is the tangent at the forces f* under which it was last solved.
All other nodes are free of traction; the field inside follows from one back-substitution where somebody asks.

The force at the end of a step, which a solve before does not know, is extrapolated as a whole, in the pattern of the
earlier one :math:`Q_p`: what single points do from one solve to the next would be carried into the next one.  With
:math:`u_p=SQ_p` and :math:`\hat q=Q_p/\sqrt{u_p\cdot Q_p}`, where :math:`Q_e=Q+r\,Q_p\,u_p\cdot(Q-Q_p)/(u_p\cdot Q_p)`,

.. math:: B K_s\,\tau a = B\,(f-f^*-K_s(u_0-u^*)+r Q_p)-Q ,\qquad
          B K_s = K_s-\tfrac{r}{1+r}\,\hat q\hat q^T ,

symmetric and positive definite, since :math:`B^{-1}=1+r\,Q_p u_p^T/(u_p\cdot Q_p)`.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..parallel import highest
from .deformed import DeformedSurface
from .free_motions import SMOOTH, FreeMotions
from .tool_surface import ToolSurface

ALL = 700       # displacements up to which all that faces the workpiece are unknown from the first touch on
# By dimension of the tool; in space a side more all around soon doubles the unknowns, and their block is dense.
MARGIN = {2: 2, 3: 1}   # sides around those that contact touches whose nodes are unknown too: it lands on nodes that follow
RINGS = {2: 4, 3: 1}    # further ones that are taken along: new ones are rarely due
REACH = 0.5     # of the length of a side: gaps up to which a point counts as near


class ElasticMotions(FreeMotions):
    """The displacements of the surface of a tool as unknowns of the solve.

    Parameters
    ----------
    surface : `ToolSurface` · comm : of the tool
    compliance : f(dofs (k,)) → (k, k) mm/N, of the modelled part. Collective
    at_rest : (n, dim) mm, displacements without contact, None where there are none
    frame : direction (dim,) and stiffness, N/mm, of a press frame in series, or None
    rolls : whether it turns, so that it leaves nodes behind that contact will not reach again for a while

    Attributes
    ----------
    unknown : (count,) rows of the displacements of the surface, (n · dim,)
    deformed : `DeformedSurface`, the displacements now
    """

    def __init__(self, surface: ToolSurface, comm, compliance, *, frame: tuple[np.ndarray, float] | None = None,
                 at_rest: np.ndarray | None = None, rolls: bool = False):
        self._rolls = rolls
        self.surface, self._comm, self._compliance, self._frame = surface, comm, compliance, frame
        self.deformed, self._dim = DeformedSurface(surface), surface.dim
        self.unknown = np.empty(0, dtype=np.int64)
        self.solved_at = np.zeros((2, surface.count * surface.dim))      # u* and f*
        if at_rest is not None:
            self.solved_at[0] = at_rest.ravel()
        super().__init__(0)

    deforms = True

    # ------------------------------------------------------------------ which nodes are unknown
    def _reach_for(self, nodes: np.ndarray) -> None:
        """Make nodes (n,) bool unknowns, and those around them. Collective."""
        nodes = highest(self._comm, nodes.astype(float)) > 0
        free, dim = self.surface.free.ravel(), self._dim
        near = self.surface.around(nodes, MARGIN[dim])
        if np.isin(np.flatnonzero(np.repeat(near, dim) & free), self.unknown).all():
            return
        near = self.surface.around(near, RINGS[dim])
        if self.surface.facing.sum() * dim <= ALL:
            near |= self.surface.facing
        wanted = free & np.repeat(near, dim)
        if not self._rolls or wanted.sum() + len(self.unknown) <= ALL:
            wanted[self.unknown] = True
        self._take(np.flatnonzero(wanted))

    def _take(self, unknown: np.ndarray) -> None:
        """Other unknowns; nodes that are new, and those that are left behind, are where they are without traction.
        Collective."""
        both = np.union1d(unknown, self.unknown)
        S = self._compliance(self.surface.dofs.ravel()[both])
        if self._frame is not None:
            along = np.asarray(self._frame[0], float)[both % self._dim]
            S = S + np.outer(along, along) / self._frame[1]
        now_at = np.searchsorted(both, unknown)
        from_old, S, K = S[np.ix_(now_at, np.searchsorted(both, self.unknown))], S[np.ix_(now_at, now_at)], self.stiffness
        _, old, kept = np.intersect1d(unknown, self.unknown, assume_unique=True, return_indices=True)

        def carried(values: np.ndarray) -> np.ndarray:
            return from_old @ (K @ values)

        now, then = self.solved_at[0, self.unknown], self.solved_at[0, unknown]
        self.displacement = then + carried(self.displacement - now)
        self.earlier = then + carried(self.earlier - now)
        self.rate, self.velocity, self.pace = carried(self.rate), carried(self.velocity), carried(self.pace)
        for name in ("force", "mass", "reaction"):
            values = getattr(self, name)
            if values is not None:
                setattr(self, name, np.zeros(len(unknown)))
                getattr(self, name)[old] = values[kept]
        if self._start is not None:
            time, values, speed = self._start
            self._start = time, np.zeros(len(unknown)), speed
            self._start[1][old] = values[kept]
        self.unknown, self.count = unknown, len(unknown)
        self.stiffness = np.linalg.inv(S)
        self.stiffness = 0.5 * (self.stiffness + self.stiffness.T)

    def _start_with(self, unknown: np.ndarray) -> None:
        """These unknowns, at rest. Collective."""
        self.unknown, self.count = np.empty(0, dtype=np.int64), 0
        self.forget()
        for name in ("displacement", "earlier", "rate", "velocity", "pace", "force", "mass"):
            setattr(self, name, np.zeros(0))
        self.stiffness = np.zeros((0, 0))
        self._take(unknown)

    def refresh(self, displacement: np.ndarray, force: np.ndarray) -> None:
        """The tool has been solved: displacements and forces (n, dim) of its surface, and a new compliance. Collective."""
        settled = self.displacement, self.rate, self.velocity, self.earlier, self.pace
        self.solved_at = np.stack([displacement.ravel(), force.ravel()])
        self._take(self.unknown)
        self.displacement, self.rate, self.velocity, self.earlier, self.pace = settled

    # ------------------------------------------------------------------ in a solve
    def moved(self, motion, time: float):
        """The motion of the drive as it is; the surface is displaced as it is at a time."""
        self.goes(motion, time)
        self.deformed.u.ravel()[:] = self.solved_at[0]
        self.deformed.u.ravel()[self.unknown] = self.at(time)
        return motion

    def search(self, points: np.ndarray, motion, gap: np.ndarray, normal: np.ndarray) -> None:
        """The motions opposite to points in space, (points, dim), which have these gaps and normals. Collective."""
        near = gap <= REACH * self.surface.size
        whole = self.deformed.interpolation(motion, points, gap, normal, near)
        self._reach_for(np.bincount(whole.indices // self._dim, minlength=self.surface.count) > 0)
        self._whole, self.basis = whole, whole[:, self.unknown]

    def reached(self) -> sp.csr_matrix:
        """See `FreeMotions.reached`: the nodes of the sides that points are over and of those beside them."""
        return self.surface.beside(self._whole)[:, self.unknown]

    def prepare(self, horizon: float) -> None:
        """See `FreeMotions.prepare`, with the forces under which the tool was last solved."""
        self.horizon = horizon
        at, force = self.solved_at[:, self.unknown]
        self.resistance = horizon * self.stiffness
        self.load = self.force - force - self.stiffness @ (self.displacement - at)
        earlier, yields, more = self._pattern()
        if earlier is not None:
            part, work = more / (1.0 + more), float(yields @ earlier)
            self.resistance = self.resistance - (horizon * part / work) * np.outer(earlier, earlier)
            self.load = self.load + part * earlier * (1.0 - float(yields @ self.load) / work)

    def _pattern(self) -> tuple[np.ndarray | None, np.ndarray | None, float]:
        """Q_p, S Q_p and r, None where nothing is extrapolated."""
        earlier, more = self._before_now()
        if earlier is None or not earlier.any():
            return None, None, 0.0
        return earlier, np.linalg.solve(self.stiffness, earlier), more

    def at_end(self, reaction: np.ndarray) -> np.ndarray:
        """The reaction (n,) of a solve as it will be at the end of its step, (n,) N."""
        earlier, yields, more = self._pattern()
        if earlier is None:
            return reaction
        return reaction + more * earlier * float(yields @ (reaction - earlier)) / float(yields @ earlier)

    def found(self, reaction: np.ndarray) -> bool:
        """See `FreeMotions.found`."""
        if self.now > self.since:
            return False
        size, before = (0.0 if r is None else float(np.linalg.norm(r)) for r in
                        (reaction, None if self._start is None else self._start[1]))
        self._keep(reaction, smooth=before > 0 and abs(size - before) <= SMOOTH * size)
        return False

    def unopposed(self) -> np.ndarray:
        """Rates that take the tool to its state without traction over the prepared horizon, (n,)."""
        at, force = self.solved_at[:, self.unknown]
        rest = at + np.linalg.solve(self.stiffness, self.force - force) if self.force.any() or force.any() else at
        return (rest - self.displacement) / self.horizon

    def under(self, reaction: np.ndarray) -> np.ndarray:
        """See `FreeMotions.under`."""
        at, force = self.solved_at[:, self.unknown]
        return at + np.linalg.solve(self.stiffness, self.force - reaction - force)

    def memory(self) -> dict[str, np.ndarray | float]:
        """See `FreeMotions.memory`."""
        return super().memory() | {"unknown": self.unknown.copy(), "solved_at": self.solved_at.copy()}

    def remember(self, memory) -> None:
        """See `FreeMotions.remember`; nodes that are unknown by now stay so."""
        unknown = np.array(memory["unknown"], dtype=np.int64)
        later = np.union1d(unknown, self.unknown) if self.count else unknown
        solved_at = np.array(memory["solved_at"], float)
        if not np.array_equal(unknown, self.unknown) or not np.array_equal(solved_at, self.solved_at):
            self.solved_at = solved_at
            self._start_with(unknown)
        super().remember(memory)
        if len(later) > len(unknown):
            self._take(later)

    def frame_yields(self, forces: np.ndarray) -> np.ndarray:
        """Displacement of the whole tool by the press frame under forces (n, dim) on its surface, (dim,), mm."""
        if self._frame is None:
            return np.zeros(self._dim)
        direction, stiffness = self._frame
        return np.asarray(direction) * float(forces.sum(axis=0) @ direction) / stiffness

    def spread(self, values: np.ndarray) -> np.ndarray:
        """See `FreeMotions.spread`: zero at what is not unknown."""
        return self.on_surface(values).ravel()

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """See `FreeMotions.gathered`."""
        return values[self.unknown] if len(values) else np.zeros(self.count)

    def on_surface(self, on_unknowns: np.ndarray) -> np.ndarray:
        """Values (count,) of the unknowns, zero elsewhere, (n, dim)."""
        out = np.zeros(self.surface.count * self._dim)
        out[self.unknown] = on_unknowns
        return out.reshape(-1, self._dim)
