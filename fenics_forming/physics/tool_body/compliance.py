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


def compliance(body: ToolBody, direct: DirectSolver, dofs: np.ndarray) -> np.ndarray:
    """Displacements, mm, at ``dofs`` (k,) (global numbers, the same on all ranks) under unit forces at each of them: (k, k)
    on every rank, mm/N. Rows and columns of held displacements are zero. Collective.
    """
    first = body.space.dofmap.index_map.local_range[0] * body.nodes.dim
    held = np.zeros(body.owned, dtype=bool)
    held[body.fixed_dofs[body.fixed_dofs < body.owned]] = True
    local = dofs - first
    mine = np.flatnonzero((local >= 0) & (local < body.owned))
    out = np.zeros((len(dofs), len(dofs)))
    for start in range(0, len(dofs), BLOCK):
        columns = np.arange(start, min(start + BLOCK, len(dofs)))
        unit = np.zeros((body.owned, len(columns)), order="F")
        here = mine[(mine >= start) & (mine <= columns[-1])]
        unit[local[here], here - start] = ~held[local[here]]
        found = direct.solve_columns(unit)
        out[np.ix_(mine, columns)] = found[local[mine]]
    if body.nodes.comm.size > 1:
        body.nodes.comm.Allreduce(MPI.IN_PLACE, out, MPI.SUM)
    return 0.5 * (out + out.T)
