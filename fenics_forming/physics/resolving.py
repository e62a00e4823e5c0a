r"""A factorised system solved again after a few contact points have closed or opened.

The tangents D of m directions at contact points change, :math:`A'=A+P^T\,\Delta D\,P`, P (m, unknowns) the velocities
there, of the body less that of the tool. With the factors of A (Sherman, Morrison and Woodbury),

.. math:: A'^{-1}b = y - Z\,(I+\Delta D\,PZ)^{-1}\Delta D\,Py ,\qquad y=A^{-1}b ,\; Z=A^{-1}P^T ,

a back-substitution for each direction where another factorisation takes ten times as long.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.linalg import block_diag

from .contact import point_law as law
from .settling import Settling
from .trace import trace_operator

NONE = np.zeros(0)      # no unknowns behind those of the workpiece


class Unknowns:
    """Values of all unknowns: those of the workpiece, owned by this rank, and those behind them, known on all ranks."""

    def __init__(self, body: PETSc.Vec, behind: np.ndarray):
        self.body, self.behind = body, behind

    def dot(self, other: Unknowns) -> float:
        """Collective."""
        return self.body.dot(other.body) + float(self.behind @ other.behind)


class FewChanges:
    """The system with changed tangents at a few points.

    Parameters
    ----------
    solve : f(`Unknowns`) → `Unknowns` by the factors of before
    columns : the rows of P · change : (m, m) ΔD
    """

    def __init__(self, solve, columns: list[Unknowns], change: np.ndarray):
        self._solve, self._columns, self._change = solve, columns, change
        self._answers = [solve(column) for column in columns]
        met = np.array([[column.dot(answer) for answer in self._answers] for column in columns])
        self._inner = np.eye(len(columns)) + change @ met

    def solve(self, right: Unknowns) -> Unknowns:
        """With the changed tangents. Collective."""
        found = self._solve(right)
        felt = np.array([column.dot(found) for column in self._columns])
        for share, answer in zip(np.linalg.solve(self._inner, self._change @ felt), self._answers, strict=True):
            found.body.axpy(-share, answer.body)
            found.behind = found.behind - share * answer.behind
        return found


class FewPoints(Settling):
    """Settling by :class:`FewChanges`: traction and tangent change at the points that close or open, nowhere else.

    A point that opens loses all of its friction, which may close it again: one that wants to be as it was stays so, and is
    left to its grip (``point_law.follow_contact``).
    """

    def settle(self, system, b: PETSc.Vec, solve, border) -> None:
        """See `Settling.settle`. Collective."""
        tools = self._contact.tools
        self._before = {tool.name: (tool.state.active, tool.tangent) for tool in tools}
        self._turned = {tool.name: np.zeros(len(tool.state.active), bool) for tool in tools}
        super().settle(system, b, solve, border)

    def _allowed(self, tool, closed: np.ndarray) -> np.ndarray:
        as_before, turned = self._before[tool.name][0], self._turned[tool.name]
        back = (tool.state.active != as_before) & (closed == as_before)
        turned |= back
        return np.where(turned, as_before, closed)

    def _take_over(self, tool, now: np.ndarray, velocity: np.ndarray) -> None:
        state, contact = tool.state, self._contact
        old, resisted = self._response(tool)
        state.grip = np.where(now == state.active, state.grip, now)
        state.active = now
        state.pressure = np.where(now, law.trial_pressure(state, velocity, contact.coefficient, contact.dt), 0.0)
        new, resists = self._response(tool)
        tool.traction, tool.tangent = tool.traction + (new - old), tool.tangent + (resists - resisted)

    def _response(self, tool) -> tuple[np.ndarray, np.ndarray]:
        """Traction and tangent of a tool as far as they depend on which points are closed."""
        contact, state = self._contact, tool.state
        traction, tangent = law.normal_response(state, contact.coefficient)
        if tool.has_friction:
            rubbing, resistance = law.friction_response(state, contact.limit(tool), contact.slip0_now)
            traction, tangent = traction + rubbing, tangent + resistance
        return traction, tangent

    def changed(self, solve, like: PETSc.Vec, tools=()) -> FewChanges:
        """The system of the present points by means of ``solve``, that of before, with the motions of ``tools`` behind the
        unknowns. Collective."""
        contact, dim, trace = self._contact, self._contact.facets.dim, self._trace()
        rows, behind, change = [], [], []
        for tool in contact.tools:
            as_before, tangent = self._before[tool.name]
            points = np.flatnonzero(tool.state.active != as_before)
            at = (points[:, None] * dim + np.arange(dim)).ravel()
            rows.append(trace[at])
            behind.append(np.hstack([np.zeros((len(at), 0)), *(self._moved(tool, other, at) for other in tools)]))
            change.append(contact.weights[points, None, None] * (tool.tangent - tangent)[points])
        comm = contact.facets.comm
        blocks = np.concatenate(comm.allgather(np.concatenate(change)))
        return FewChanges(solve, _columns(sp.vstack(rows, format="csr"), like, np.concatenate(behind), comm),
                          block_diag(*blocks) if len(blocks) else np.zeros((0, 0)))

    @staticmethod
    def _moved(tool, other, at: np.ndarray) -> np.ndarray:
        """Less the velocities of a tool at directions ``at`` of its points by the motions of this or another, (k, n)."""
        return -_dense(tool.free.basis[at]) if other is tool else np.zeros((len(at), other.free.count))

    def _trace(self) -> sp.csr_matrix:
        """Velocities at the contact points from the free unknowns of this rank, (points · dim, local dofs)."""
        if self._traced is None:
            trace = trace_operator(self._body)
            free = np.ones(trace.shape[1])
            free[self._body.fixed_dofs] = 0.0
            self._traced = (trace @ sp.diags(free)).tocsr()
        return self._traced

    _traced: sp.csr_matrix | None = None


def _columns(rows: sp.csr_matrix, like: PETSc.Vec, behind: np.ndarray, comm) -> list[Unknowns]:
    """Rows (own, local dofs) of all ranks, one rank's after the other's, as columns of the system; ``behind`` (own, n) what
    they have at the unknowns behind those of the workpiece. Collective."""
    counts, found = comm.allgather(rows.shape[0]), []
    behind = np.concatenate(comm.allgather(behind))
    for rank, count in enumerate(counts):
        for k in range(count):
            column = like.duplicate()
            with column.localForm() as local:
                local.set(0.0)
                if rank == comm.rank:
                    row = rows[k]
                    local.array[row.indices] += row.data
            column.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            found.append(Unknowns(column, behind[len(found)]))
    return found


def _dense(matrix) -> np.ndarray:
    return matrix.toarray() if sp.issparse(matrix) else np.asarray(matrix)
