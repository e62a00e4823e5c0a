r"""Unknown tool motions in the linear systems of a workpiece's Newton.

With the trace G of the velocities at the contact points, the motions :math:`\Phi` there and the contact tangent
:math:`D=w\,(-\partial t/\partial s)` in the slip :math:`s=Gv-V_q-\Phi a`,

.. math:: \begin{pmatrix} A & B \\ B^T & C \end{pmatrix}\begin{pmatrix} dv \\ da \end{pmatrix} =
          \begin{pmatrix} b \\ r \end{pmatrix},\quad
          B=-G^TD\Phi,\quad C=R+\Phi^TD\Phi,\quad r=f-Ra-\Phi^T w\,t .
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc

from .contact.rigid import KnownTool
from .parallel import total


class Border:
    """The rows and columns of all unknown motions of the tools of a workpiece.

    Few unknowns: the matrix of the workpiece is factorised as ever, and the motions are found from its Schur complement,
    one more right-hand side for each.
    """

    def __init__(self, workpiece):
        self.workpiece, self.contact = workpiece, workpiece.contact
        self.tools: list[KnownTool] = [t for t in self.contact.tools if t.free is not None]
        self._trace = trace_operator(workpiece)
        self._increment = np.zeros(sum(t.free.count for t in self.tools))

    # ------------------------------------------------------------------ what the motions contribute
    def _tangent(self, tool: KnownTool) -> sp.bsr_matrix:
        """D, block diagonal, (points · dim)²."""
        blocks = self.contact.weights[:, None, None] * tool.tangent
        count, dim = blocks.shape[:2]
        return sp.bsr_matrix((blocks, np.arange(count), np.arange(count + 1)), shape=(count * dim, count * dim))

    def reactions(self, tool: KnownTool) -> np.ndarray:
        """Forces of the tool on the body along its motions, ∫ Φᵀt, (n,), N. Collective."""
        local = (self.contact.weights[:, None] * tool.traction).ravel() @ tool.free.basis
        return total(self.workpiece.nodes.comm, np.asarray(local))

    def residuals(self) -> list[np.ndarray]:
        """f - R a - ∫ Φᵀt of every tool, (n,), N. Collective."""
        return [t.free.load - t.free.resistance @ t.free.rate - self.reactions(t) for t in self.tools]

    def power(self) -> float:
        """Power of what does not balance on the present rates, mW. Collective."""
        return -float(sum(r @ t.free.rate for r, t in zip(self.residuals(), self.tools, strict=True)))

    # ------------------------------------------------------------------ solving
    def keep(self) -> None:
        """Remember the rates, for a solve that has to start again."""
        self._kept = [t.free.rate.copy() for t in self.tools]

    def start_again(self) -> None:
        """The rates as they were kept."""
        for tool, rate in zip(self.tools, self._kept, strict=True):
            tool.free.rate = rate.copy()

    def solve(self, system) -> None:
        """Mend the increment that ``system`` has just solved for with given motions of the tools; the increments of the
        rates are kept for :meth:`advance`. Collective."""
        comm, x = self.workpiece.nodes.comm, self.workpiece.increment.x.petsc_vec
        columns, corners = [], []
        for tool in self.tools:
            D = self._tangent(tool)
            columns += self._columns(-(self._trace.T @ (D @ tool.free.basis)))
            corners.append(total(comm, tool.free.basis.T @ (D @ tool.free.basis)) + tool.free.resistance)
        answers = []
        for column in columns:
            answers.append(x.duplicate())
            system.solve_also(column, answers[-1])
        n = len(columns)
        schur = np.zeros((n, n))
        at = np.cumsum([0] + [len(c) for c in corners])
        for first, last, corner in zip(at, at[1:], corners, strict=False):
            schur[first:last, first:last] = corner
        schur -= np.array([[c.dot(z) for z in answers] for c in columns])
        right = np.concatenate(self.residuals()) - np.array([c.dot(x) for c in columns])
        self._increment = _solved(0.5 * (schur + schur.T), right)
        for z, da in zip(answers, self._increment, strict=True):
            x.axpy(-da, z)
        self.workpiece.increment.x.scatter_forward()

    def _columns(self, local: np.ndarray) -> list[PETSc.Vec]:
        """Columns (local dofs, n) summed over the ranks that share a dof, zero where the velocity is given."""
        body, found = self.workpiece, []
        for values in np.asarray(local).T:
            column = body.increment.x.petsc_vec.duplicate()
            with column.localForm() as ghosted:
                ghosted.array[:] = values
            column.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            column.array[body.fixed_dofs[body.fixed_dofs < body.owned]] = 0.0
            found.append(column)
        return found

    def found(self) -> bool:
        """A solve has converged: the motions hear of the reactions; whether one resists otherwise than it was taken to, so
        that the solve has to be done again. Collective."""
        return any([tool.free.found(self.reactions(tool)) for tool in self.tools])

    def solved(self, solve):
        """What ``solve()`` finds, done again where a motion resists otherwise than it was taken to. Collective."""
        found = solve()
        for _ in range(3):
            if not self.found():
                break
            for tool in self.tools:
                tool.free.prepare(tool.free.horizon)
            again = solve()
            found = replace(again, iterations=found.iterations + again.iterations)
        return found

    def advance(self, share: float = 1.0) -> None:
        """Add a share of the increments to the rates."""
        first = 0
        for tool in self.tools:
            n = tool.free.count
            tool.free.rate = tool.free.rate + share * self._increment[first:first + n]
            first += n


def trace_operator(workpiece) -> sp.csr_matrix:
    """Velocities at the contact points from the unknowns of this rank, (points · dim, local dofs)."""
    facets, dim = workpiece.contact.facets, workpiece.nodes.dim
    per = facets.points_per_facet
    nodes = np.repeat(facets.facet_nodes, per, axis=0)                       # (points, nodes of a facet)
    shapes = np.tile(facets.shape, (len(facets.facet_nodes), 1))
    columns = workpiece.velocity_dofs[nodes].swapaxes(1, 2)                  # (points, dim, nodes)
    values = np.broadcast_to(shapes[:, None, :], columns.shape)
    starts = np.arange(0, columns.size + 1, columns.shape[2])
    size = len(workpiece.solution.x.array)
    return sp.csr_matrix((values.ravel(), columns.ravel(), starts), shape=(facets.count * dim, size))


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution of a small symmetric system in which a motion that nothing resists stays as it is."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return scale * np.linalg.lstsq(scale[:, None] * matrix * scale, scale * right, rcond=1e-12)[0]
