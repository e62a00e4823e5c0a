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
from .machine_code import compiled
from .parallel import total
from .resolving import Unknowns
from .trace import trace_operator


class Border:
    """The rows and columns of all unknown motions of the tools of a workpiece.

    For few unknowns: the matrix of the workpiece is factorised as ever, and the motions are found from its Schur
    complement, one more right-hand side for each.
    """

    def __init__(self, workpiece):
        self.workpiece, self.contact = workpiece, workpiece.contact
        self.tools: list[KnownTool] = [t for t in self.contact.tools if t.is_sought]
        self.trace = trace_operator(workpiece)
        free = np.ones(self.trace.shape[1])
        free[workpiece.fixed_dofs] = 0.0
        self._onto_free = (self.trace @ sp.diags(free)).T.tocsr()
        self._increment = np.zeros(0)
        self._diagonal: sp.csr_matrix | None = None

    # ------------------------------------------------------------------ what the motions contribute
    def blocks(self) -> tuple[list[np.ndarray | sp.csr_matrix], list[np.ndarray]]:
        """B of every tool, as far as this rank knows it, (local dofs, n), and C, (n, n) on all ranks. Collective."""
        comm, columns, corners = self.workpiece.nodes.comm, [], []
        for tool in self.tools:
            pressed = self._tangent(tool) @ tool.free.basis
            columns.append(-(self._onto_free @ pressed))
            corner = tool.free.basis.T @ pressed
            corner = corner.toarray() if sp.issparse(corner) else corner
            corners.append(total(comm, corner) + tool.free.resistance)
        return columns, corners

    def _tangent(self, tool: KnownTool) -> sp.csr_matrix:
        """D, block diagonal, (points · dim)²."""
        count, dim = self.contact.facets.count, self.contact.facets.dim
        if self._diagonal is None:
            columns = np.repeat(np.arange(count * dim).reshape(count, 1, dim), dim, axis=1)
            starts = np.arange(0, columns.size + 1, dim)
            self._diagonal = sp.csr_matrix((np.zeros(columns.size), columns.ravel(), starts), shape=(count * dim,) * 2)
        self._diagonal.data = (self.contact.weights[:, None, None] * tool.tangent).ravel()
        return self._diagonal

    def reactions(self, tool: KnownTool) -> np.ndarray:
        """Forces of the tool on the body along its motions, ∫ Φᵀt, (n,), N. Collective."""
        return self.contact.along_motions(tool)

    def residuals(self) -> list[np.ndarray]:
        """f - R a - ∫ Φᵀt of every tool, (n,), N. Collective."""
        return [t.free.load - t.free.resistance @ t.free.rate - self.reactions(t) for t in self.tools]

    def power(self) -> float:
        """Power of what does not balance on the present rates, motion by motion, mW. Collective."""
        return float(sum(t.free.power(r) for r, t in zip(self.residuals(), self.tools, strict=True)))

    # ------------------------------------------------------------------ solving
    def solve(self, system, b: PETSc.Vec) -> None:
        """Factorise, and solve for the increment of the workpiece; those of the rates are kept for :meth:`advance`.
        Collective."""
        body = self.workpiece
        system.solve(b)
        x = body.increment.x.petsc_vec
        local, corners = self.blocks()
        columns, answers = [c for values in local for c in self._columns(values)], []
        for column in columns:
            answers.append(x.duplicate())
            system.solve_also(column, answers[-1])
        schur = _block_diagonal(corners)
        schur -= np.array([[c.dot(z) for z in answers] for c in columns])
        right = np.concatenate(self.residuals()) - np.array([c.dot(x) for c in columns])
        self._increment = _solved(0.5 * (schur + schur.T), right)
        for z, da in zip(answers, self._increment, strict=True):
            x.axpy(-da, z)
        body.increment.x.scatter_forward()

    def _columns(self, local: np.ndarray) -> list[PETSc.Vec]:
        """Columns (local dofs, n) summed over the ranks that share a dof."""
        found = []
        for values in np.asarray(local).T:
            column = self.workpiece.increment.x.petsc_vec.duplicate()
            with column.localForm() as ghosted:
                ghosted.array[:] = values
            column.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
            found.append(column)
        return found

    # ------------------------------------------------------------------ the rates
    def keep(self) -> None:
        """Remember the rates, for a solve that has to start again."""
        self._kept = [t.free.rate.copy() for t in self.tools]

    def start_again(self) -> None:
        """The rates as they were kept."""
        for tool, rate in zip(self.tools, self._kept, strict=True):
            tool.free.rate = rate.copy()

    def found(self) -> bool:
        """A solve has converged: the motions hear of the reactions; whether one resists otherwise than it was taken to, so
        that the solve has to be done again. Collective."""
        return any([tool.free.found(self.reactions(tool)) for tool in self.tools])

    def solved(self, solve, rise):
        """What ``solve()`` finds, done again where a motion resists otherwise than it was taken to. Collective.

        rise : f() → relative rise of the force of forming with the way, 1/mm
        """
        found = self._once(solve, rise)
        for _ in range(3):
            if not self.found():
                break
            for tool in self.tools:
                tool.free.prepare(tool.free.horizon)
            again = self._once(solve, rise)
            found = replace(again, iterations=found.iterations + again.iterations)
        return found

    def _once(self, solve, rise):
        """One solve; where a force has to be met later, with what the body will resist then."""
        later = [tool.free for tool in self.tools if tool.free.time_left > 0.0]
        if not later or self.workpiece.is_cold:
            return solve()
        for motions in later:
            motions.expect(rise())
        return solve(step=None)         # what ties rates to those before would hold the tool back

    def coming(self) -> dict[str, np.ndarray]:
        """Tool → velocity at its contact points (points, dim) with the whole increment of its rates, mm/s."""
        parts = np.split(self._increment, np.cumsum([t.free.count for t in self.tools])[:-1])
        return {t.name: t.given_velocity + t.free.velocities(t.free.rate + da)
                for t, da in zip(self.tools, parts, strict=True)}

    def advance(self, share: float = 1.0) -> None:
        """Add a share of the increments to the rates."""
        first = 0
        for tool in self.tools:
            n = tool.free.count
            tool.free.rate = tool.free.rate + share * self._increment[first:first + n]
            first += n


class AppendedBorder(Border):
    """The same for many unknowns, as those of deformable tools: appended to the matrix of the workpiece, behind the
    unknowns of the last rank, and factorised with it; or eliminated, where the workpiece is solved by iterations."""

    def __init__(self, workpiece):
        super().__init__(workpiece)
        self._matrix: AppendedMatrix | None = None

    def solve(self, system, b: PETSc.Vec) -> None:
        if system.changes is not None:
            self._solve_again(system, b)
            return
        local, corners = self.blocks()
        columns = self._owned(local[0] if len(local) == 1 else sp.hstack(local, format="csr"))
        self._increment = system.solve_bordered(b, columns, _block_diagonal(corners), np.concatenate(self.residuals()),
                                                self._factorised)

    def _factorised(self, system, b: PETSc.Vec, columns: sp.csr_matrix, corner: np.ndarray,
                    right: np.ndarray) -> np.ndarray:
        """Factorise the appended matrix, and solve; the motions (n,). Collective."""
        bulk, comm = system.matrix, self.workpiece.nodes.comm
        fits = self._matrix is not None and self._matrix.fits(bulk, columns)
        if total(comm, float(not fits)) > 0:
            pattern = sp.hstack([self._pattern(tool) for tool in self.tools], format="csr")
            self._matrix = AppendedMatrix(bulk, self._owned(pattern), comm, system.solver_of)
            self._matrix.fits(bulk, columns)
        self._matrix.fill(columns, corner)
        x = self.workpiece.increment.x
        found = self._matrix.solve(b, right, x.petsc_vec)
        x.scatter_forward()
        return found

    def _solve_again(self, system, b: PETSc.Vec) -> None:
        """With the factors of before and the contact as it is now, which few points have changed. Collective."""
        x = self.workpiece.increment.x
        few = system.changes.changed(self._solve_as_factorised, x.petsc_vec, self.tools)
        found = few.solve(Unknowns(b, np.concatenate(self.residuals())))
        found.body.copy(x.petsc_vec)
        self._increment = found.behind
        x.scatter_forward()

    def _solve_as_factorised(self, right: Unknowns) -> Unknowns:
        found = right.body.duplicate()
        return Unknowns(found, self._matrix.resolve(right.body, right.behind, found))

    def _owned(self, local: sp.csr_matrix) -> sp.csr_matrix:
        """Rows (local dofs, n) summed over the ranks that share a dof, (owned dofs, n). Collective."""
        body, comm = self.workpiece, self.workpiece.nodes.comm
        if comm.size == 1:
            local.sum_duplicates()
            return local
        index_map = body.space.dofmap.index_map
        ghosts = local[body.owned:].tocoo()
        rows = index_map.ghosts[ghosts.row] if ghosts.nnz else np.empty(0, np.int64)
        rows, across, values = (np.concatenate(parts) for parts in
                                zip(*comm.allgather((rows, ghosts.col, ghosts.data)), strict=True))
        first, end = index_map.local_range
        mine = (rows >= first) & (rows < end)
        found = sp.csr_matrix((values[mine], (rows[mine] - first, across[mine])), shape=(body.owned, local.shape[1]))
        found = (local[:body.owned] + found).tocsr()
        found.sum_duplicates()
        return found

    def _pattern(self, tool: KnownTool) -> sp.csr_matrix:
        """Which unknowns of the workpiece a motion may meet: those of the points over its sides and the ones beside, so
        that sliding changes the pattern rarely."""
        onto = self._onto_free.astype(bool).astype(float)
        dim = self.workpiece.nodes.dim
        points = sp.kron(sp.identity(onto.shape[1] // dim), np.ones((dim, dim)), format="csr")
        return sp.csr_matrix(onto @ (points @ tool.free.reached()))


class AppendedMatrix:
    """A matrix with dense rows and columns behind those of its last rank, on a pattern that stays, and its factorisation.

    Parameters
    ----------
    bulk : the matrix (``petsc``) of the workpiece, whose values it keeps in ``rows`` (None: somewhere else)
    pattern : (owned rows, n) entries that the columns may have
    solver_of : f(matrix, its rows, pattern) → its factorisation
    """

    def __init__(self, bulk, pattern: sp.csr_matrix, comm, solver_of):
        self._bulk, self._rows, self._comm, self.count = bulk.petsc, bulk.rows, comm, pattern.shape[1]
        self._is_last = comm.rank == comm.size - 1
        first, size, n = self._bulk.getOwnershipRange()[0], self._bulk.getSize()[0], self.count
        starts, across, _ = self._bulk.getValuesCSR()
        self._keys = _keys(pattern)
        behind = size + self._keys % n
        widths = np.diff(starts) + np.diff(pattern.indptr)
        self._bulk_at = (np.arange(len(across)) + np.repeat(pattern.indptr[:-1], np.diff(starts))).astype(PETSc.IntType)
        self._border_at = np.arange(len(behind)) + np.repeat(starts[1:], np.diff(pattern.indptr))
        columns = np.empty(len(across) + len(behind), dtype=PETSc.IntType)
        columns[self._bulk_at], columns[self._border_at] = across, behind
        keys = comm.gather(self._keys + first * n, root=comm.size - 1)
        if self._is_last:
            rows, motions = np.divmod(np.concatenate(keys), n)
            self._turned = np.lexsort((rows, motions))
            per_motion = np.bincount(motions, minlength=n)
            below = np.cumsum(per_motion)
            self._turned_at = len(columns) + np.arange(len(rows)) + n * motions[self._turned]
            self._corner_at = (len(columns) + below[:, None] + n * np.arange(n)[:, None] + np.arange(n)).ravel()
            columns = np.concatenate([columns, np.empty(len(rows) + n * n, dtype=PETSc.IntType)])
            columns[self._turned_at] = rows[self._turned]
            columns[self._corner_at] = np.tile(size + np.arange(n), n)
            widths = np.concatenate([widths, per_motion + n])
        own = len(widths)
        self._pattern = np.append(0, np.cumsum(widths)).astype(PETSc.IntType), columns
        self._values = np.ones(len(columns))
        create = PETSc.Mat().createAIJWithArrays if comm.size == 1 else PETSc.Mat().createAIJ
        csr = (*self._pattern, self._values)
        self.petsc = create((own, own), csr, comm=comm) if comm.size == 1 else \
            create(((own, None), (own, None)), csr=csr, comm=comm)
        self._right, self._found = self.petsc.createVecs()
        self._solver = solver_of(self.petsc, csr, pattern)

    def fits(self, bulk, columns: sp.csr_matrix) -> bool:
        """Whether these blocks, which are to be filled in, have places in the pattern, as far as this rank knows."""
        if self._bulk is not bulk.petsc or self.count != columns.shape[1]:
            return False
        keys = _keys(columns)
        self._places = np.searchsorted(self._keys, keys)
        return not len(keys) or self._places[-1] < len(self._keys) and bool((self._keys[self._places] == keys).all())

    def fill(self, columns: sp.csr_matrix, corner: np.ndarray) -> None:
        """Values of the blocks, which fit, that of the workpiece as it is now. Collective."""
        border = np.zeros(len(self._keys))
        border[self._places] = columns.data
        _put((self._rows or self._bulk.getValuesCSR())[2], self._bulk_at, self._values)
        self._values[self._border_at] = border
        parts = self._comm.gather(border, root=self._comm.size - 1)
        if self._is_last:
            self._values[self._turned_at] = np.concatenate(parts)[self._turned]
            self._values[self._corner_at] = corner.ravel()
        if self._comm.size == 1:
            self.petsc.stateIncrease()
        else:
            self.petsc.setValuesCSR(*self._pattern, self._values)
            self.petsc.assemble()

    def solve(self, b: PETSc.Vec, right: np.ndarray, x: PETSc.Vec) -> np.ndarray:
        """Factorise, and solve for the unknowns of the workpiece into ``x``; those behind them on all ranks. Collective."""
        self._solver.factorise()
        return self.resolve(b, right, x)

    def resolve(self, b: PETSc.Vec, right: np.ndarray, x: PETSc.Vec) -> np.ndarray:
        """The same with the factors of the last :meth:`solve`. Collective."""
        n = b.getLocalSize()
        self._right.array[:n] = b.array_r[:n]
        if self._is_last:
            self._right.array[n:] = right
        self._solver.solve(self._right, self._found)
        x.array[:n] = self._found.array_r[:n]
        return total(self._comm, self._found.array_r[n:].copy() if self._is_last else np.zeros(len(right)))


def _block_diagonal(blocks: list[np.ndarray]) -> np.ndarray:
    """One square matrix with the square blocks on its diagonal."""
    ends = np.cumsum([0] + [len(block) for block in blocks])
    whole = np.zeros((ends[-1], ends[-1]))
    for first, last, block in zip(ends, ends[1:], blocks, strict=False):
        whole[first:last, first:last] = block
    return whole


@compiled
def _put(values, places, into):
    """Values to their places in a longer array: by numpy it takes twice the time."""
    for k in range(len(places)):
        into[places[k]] = values[k]


def _keys(columns: sp.csr_matrix) -> np.ndarray:
    """Rows and columns of the entries as rising numbers."""
    rows = np.repeat(np.arange(columns.shape[0]), np.diff(columns.indptr))
    return rows * np.int64(columns.shape[1]) + columns.indices


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution of a small symmetric system in which a motion that nothing resists stays as it is."""
    scale = 1.0 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return scale * np.linalg.lstsq(scale[:, None] * matrix * scale, scale * right, rcond=1e-12)[0]
