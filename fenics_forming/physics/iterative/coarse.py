"""The velocity block on the vertices alone: one V-cycle of GAMG with the rigid-body motions as its near null space."""

from __future__ import annotations

from itertools import count

import numpy as np
from petsc4py import PETSc

from .pattern import Pattern
from .sharing import Shared

_NUMBER = count()
# Notes of the measurements: benchmarks/solver3d.py. A prefix of its own for every solver, and never deleted: GAMG reads the
# options of its levels anew at each set-up.
OPTIONS = {"pc_type": "gamg", "pc_gamg_threshold": "0.0", "mg_levels_ksp_type": "chebyshev", "mg_levels_ksp_max_it": "2",
           "mg_levels_pc_type": "bjacobi"}


class CoarseSolver:
    """The linearised flow with velocities that are linear in each cell.

    Parameters
    ----------
    pattern, shared : of the vertices; free (vertices, 3) 1 where the velocity is sought
    """

    def __init__(self, pattern: Pattern, shared: Shared, free: np.ndarray):
        self.pattern, self._shared = pattern, shared
        self.diagonal = np.zeros((shared.count, 9))
        self.upper = np.zeros((len(pattern.columns), 9))
        self._free = free
        self._create()

    def _create(self):
        shared, rows, columns = self._shared, self.pattern.rows, self.pattern.columns
        every = np.arange(shared.count, dtype=np.int32)
        i, j = np.concatenate([every, rows, columns]), np.concatenate([every, columns, rows])
        self._order = np.lexsort((j, i))
        self._columns = j[self._order].astype(PETSc.IntType)
        self._starts = np.searchsorted(i[self._order], np.arange(shared.count + 1)).astype(PETSc.IntType)
        kept = self._free[i][:, :, None] * self._free[j][:, None, :]
        kept[: shared.count] = np.maximum(kept[: shared.count], np.eye(3))
        self._kept = kept.reshape(-1, 9)[self._order]
        size = ((3 * shared.owned, None), (3 * shared.owned, None))
        self.matrix = A = PETSc.Mat().create(comm=shared.comm)
        A.setSizes(size, 3)
        A.setType("aij")
        numbers = shared.map.local_to_global(every).astype(PETSc.IntType)
        A.setLGMap(PETSc.LGMap().create(numbers, bsize=3, comm=shared.comm))
        A.setUp()
        self._ksp = PETSc.KSP().create(shared.comm)
        prefix = f"forming_coarse_{next(_NUMBER)}_"
        options = PETSc.Options(prefix)
        for name, value in OPTIONS.items():
            options[name] = value
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setType("preonly")
        self._ksp.setFromOptions()
        self._b, self._x = A.createVecs()

    def clear(self) -> None:
        self.diagonal[:] = 0.0
        self.upper[:] = 0.0

    def place(self, x: np.ndarray) -> None:
        """Take over the positions (vertices, 3) of the vertices: the rigid-body motions belong to them. Collective."""
        mine = x[: self._shared.owned] * 1.0
        comm = self._shared.comm
        middle = comm.allreduce(mine.sum(axis=0)) / comm.allreduce(len(mine))
        a = mine - middle
        a = a / max(float(np.sqrt(comm.allreduce(float((a**2).sum())))), 1e-300)
        modes = np.zeros((6, len(mine), 3))
        for k in range(3):
            modes[k, :, k] = 1.0
            i, j = (k + 1) % 3, (k + 2) % 3
            modes[3 + k, :, i], modes[3 + k, :, j] = -a[:, j], a[:, i]
        basis = []
        for mode in modes.reshape(6, -1):
            v = self.matrix.createVecLeft()
            v.array[:] = mode
            for other in basis:
                v.axpy(-v.dot(other), other)
            v.normalize()
            basis.append(v)
        self.matrix.setNearNullSpace(PETSc.NullSpace().create(vectors=basis, comm=comm))

    def prepare(self) -> None:
        """Take over the present values and set the V-cycle up. Collective."""
        turned = self.upper.reshape(-1, 3, 3).swapaxes(1, 2).reshape(-1, 9)
        values = np.concatenate([self.diagonal, self.upper, turned])[self._order] * self._kept
        self.matrix.zeroEntries()
        self.matrix.setValuesBlockedLocalCSR(self._starts, self._columns, values.ravel(), PETSc.InsertMode.ADD_VALUES)
        self.matrix.assemble()
        self._ksp.setOperators(self.matrix)
        self._ksp.setUp()

    def solve(self, r: np.ndarray) -> np.ndarray:
        """Velocities (vertices, 3), for all copies, of a residual of which the owners' part counts."""
        self._b.array[:] = r[: self._shared.owned].ravel()
        self._ksp.solve(self._b, self._x)
        x = np.empty_like(r)
        x[: self._shared.owned] = self._x.array.reshape(-1, 3)
        return self._shared.hand_on(x)
