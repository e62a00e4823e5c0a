r"""The compliance of a tool at chosen displacements: what a workpiece, a press or another tool feels of it.

A tool condensed to the nodes that contact can reach is one dense symmetric block :math:`K_s=S^{-1}`, and S comes from one
factorisation and as many right-hand sides (FORMULATION.md 5).
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..linear import DirectSolver
from .body import ToolBody

BLOCK = 64      # right-hand sides at once: 16 take half as long again, more do not gain


def global_dofs(body: ToolBody, nodes: np.ndarray) -> np.ndarray:
    """Numbers of the displacements of local nodes that all ranks share, (n, dim)."""
    dim = body.nodes.dim
    blocks = body.space.dofmap.index_map.local_to_global((body.dofs[nodes, 0] // dim).astype(np.int32))
    return blocks[:, None] * dim + np.arange(dim)


def compliance(body: ToolBody, direct: DirectSolver, dofs: np.ndarray,
               known: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
    """Displacements, mm, at ``dofs`` (k,) (global numbers, the same on all ranks) under unit forces at each of them: (k, k)
    on every rank, mm/N. Rows and columns of held displacements are zero. Collective.

    known : rising dofs (l,) and their compliance (l, l), which is taken over
    """
    first = body.space.dofmap.index_map.local_range[0] * body.nodes.dim
    held = np.zeros(body.owned, dtype=bool)
    held[body.fixed_dofs[body.fixed_dofs < body.owned]] = True
    local = dofs - first
    mine = np.flatnonzero((local >= 0) & (local < body.owned))
    old = np.zeros(len(dofs), bool) if known is None else np.isin(dofs, known[0])
    wanted = np.flatnonzero(~old)
    found = np.zeros((len(dofs), len(wanted)))
    for start in range(0, len(wanted), BLOCK):
        columns = wanted[start:start + BLOCK]
        rows = np.where((local[columns] >= 0) & (local[columns] < body.owned), local[columns], -1)
        rows[held[rows] & (rows >= 0)] = -1
        answers = direct.solve_units(rows)
        found[mine, start:start + len(columns)] = answers[local[mine]]
    if body.nodes.comm.size > 1:
        body.nodes.comm.Allreduce(MPI.IN_PLACE, found, MPI.SUM)
    out = np.zeros((len(dofs), len(dofs)))
    out[:, wanted] = found
    if old.any():
        at = np.searchsorted(known[0], dofs[old])
        out[np.ix_(old, old)] = known[1][np.ix_(at, at)]
        out[np.ix_(wanted, old)] = out[np.ix_(old, wanted)].T
    return 0.5 * (out + out.T)
