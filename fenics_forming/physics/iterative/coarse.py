"""The velocity block on the vertices alone: one V-cycle of GAMG with the rigid-body motions as its near null space."""

from __future__ import annotations

from itertools import count

import numpy as np
from petsc4py import PETSc

from .everywhere import Everywhere
from .pattern import Pattern
from .sharing import Shared

_NUMBER = count()
# A prefix of its own for every solver, and never deleted: GAMG reads the options of its levels anew at each set-up.
# One step with ILU(0) needs no eigenvalues: a quarter less to set up than two of Chebyshev with it, for as many iterations.
OPTIONS = {"pc_type": "gamg", "pc_gamg_threshold": "0.0", "mg_levels_ksp_type": "richardson", "mg_levels_ksp_max_it": "1",
           "mg_levels_pc_type": "ilu"}


class CoarseSolver:
    """The linearised flow with velocities that are linear in each cell.

    Parameters
    ----------
    pattern, shared : of the vertices; free (vertices, 3) 1 where the velocity is sought; x (vertices, 3) where they are;
    body (vertices,) which they belong to
    """

    def __init__(self, pattern: Pattern, shared: Shared, free: np.ndarray, x: np.ndarray, body: np.ndarray):
        self.pattern, self._shared = pattern, shared
        self._blocks = np.zeros((shared.count + len(pattern.columns), 9))
        self.diagonal, self.upper = self._blocks[: shared.count], self._blocks[shared.count:]
        self.everywhere = Everywhere(pattern, shared, x, body)
        self.between = None         # contact between bodies, where there is
        self._kept = self.everywhere.gather(free).ravel() > 0
        self._ksp: PETSc.KSP | None = None

    def clear(self) -> None:
        self._blocks[:] = 0.0

    def _create(self):
        whole, three = self.everywhere, np.arange(3)
        width = np.diff(whole.starts)
        starts = np.append(0, np.cumsum(np.repeat(3 * width, 3))).astype(PETSc.IntType)
        columns = (3 * whole.columns[:, None] + three).astype(PETSc.IntType)
        rows = [np.tile(part.ravel(), 3) for part in np.split(columns, whole.starts[1:-1])]
        self._values = np.zeros(9 * len(whole.columns))
        size = 3 * whole.count
        self.matrix = PETSc.Mat().createAIJWithArrays(
            (size, size), (starts, np.concatenate(rows), self._values), comm=PETSc.COMM_SELF)
        self.matrix.setBlockSize(3)
        self._ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        prefix = f"forming_coarse_{next(_NUMBER)}_"
        options = PETSc.Options(prefix)
        for name, value in OPTIONS.items():
            options[name] = value
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setType("preonly")
        self._ksp.setFromOptions()
        self._b, self._x = self.matrix.createVecs()

    def place(self, x: np.ndarray) -> None:
        """Take over the positions (vertices, 3) of the vertices: the rigid-body motions belong to them. Collective."""
        self._places, self._motions_known = self.everywhere.gather(x), False

    def _rigid_motions(self) -> PETSc.NullSpace:
        a = self._places - self._places.mean(axis=0)
        modes = np.zeros((6, len(a), 3))
        for k in range(3):
            modes[k, :, k] = 1.0
            i, j = (k + 1) % 3, (k + 2) % 3
            modes[3 + k, :, i], modes[3 + k, :, j] = -a[:, j], a[:, i]
        basis = np.linalg.qr(modes.reshape(6, -1).T)[0].T
        vectors = [PETSc.Vec().createWithArray(v.copy(), comm=PETSc.COMM_SELF) for v in basis]
        return PETSc.NullSpace().create(vectors=vectors, comm=PETSc.COMM_SELF)

    def prepare(self) -> None:
        """Take over the present values and set the V-cycle up. Collective."""
        others = None
        if self.between is not None:
            others = self.everywhere.sum_of(*self.between.vertex_blocks())
            if not self.everywhere.holds(others[0]):
                self.everywhere.hold(others[0])
                self._ksp = None
        if self._ksp is None:
            self._create()
            self._motions_known = False
        self.everywhere.gather_blocks(self._blocks, self._kept, self._values, others)
        self.matrix.stateIncrease()
        if not self._motions_known:
            self.matrix.setNearNullSpace(self._rigid_motions())
            self._motions_known = True
        self._ksp.setOperators(self.matrix)
        self._ksp.setUp()

    def solve(self, r: np.ndarray) -> np.ndarray:
        """Velocities (vertices, 3), for all copies, of a residual of which the owners' part counts. Collective."""
        self._b.array[:] = self.everywhere.gather(r).ravel()
        self._ksp.solve(self._b, self._x)
        return self._x.array.reshape(-1, 3)[self.everywhere.numbers]
