"""Material points: found once in the mesh, then carried by the shape functions of their cell."""

from __future__ import annotations

import basix
import numpy as np
from mpi4py import MPI

from .nodes import Nodes


class MaterialPoint:
    """A point of the material at local coordinates of one cell, which it never leaves.

    Parameters
    ----------
    nodes : the mesh as it lies now
    at : (dim,) position now, mm; a point slightly outside (on a curved side) takes the nearest place of the body
    """

    def __init__(self, nodes: Nodes, at):
        self._nodes = nodes
        at = np.asarray(at, float)
        cell, local, distance = _locate(nodes, at)
        best = nodes.comm.allreduce((distance, nodes.comm.rank), MPI.MINLOC)
        self.distance, self._owner = best
        self._mine = nodes.comm.rank == self._owner
        if self._mine:
            element = _element(nodes)
            self._row = nodes.cells[cell]
            self._shape = element.tabulate(0, local[None])[0, 0, :, 0]

    def value(self, nodal: np.ndarray):
        """Value of a nodal field (nodes[, k]) at the point, on every rank."""
        found = self._shape @ nodal[self._row] if self._mine else None
        return self._nodes.comm.bcast(found, self._owner) if self._nodes.comm.size > 1 else found


def _element(nodes):
    return basix.create_element(basix.ElementFamily.P, nodes.mesh.basix_cell(), 2, basix.LagrangeVariant.gll_warped)


def _locate(nodes: Nodes, at: np.ndarray):
    """Owned cell, local coordinates and distance of the place of the body that is nearest to ``at``."""
    if len(nodes.cells) == 0:
        return -1, np.zeros(nodes.dim), np.inf
    p = nodes.x[nodes.vertices]
    edges = np.swapaxes(p[:, 1:] - p[:, :1], 1, 2)
    local = np.linalg.solve(edges, (at - p[:, 0])[:, :, None])[:, :, 0]
    inside = np.minimum(local.min(axis=1), 1.0 - local.sum(axis=1))
    element = _element(nodes)
    best = (-1, np.zeros(nodes.dim), np.inf)
    for cell in np.argsort(inside)[-4:]:          # a curved cell may reach over its straight neighbour
        place = _clipped(local[cell])
        x = nodes.x[nodes.cells[cell]]
        for _ in range(8):
            table = element.tabulate(1, place[None])[:, 0, :, 0]
            step = np.linalg.lstsq((table[1:] @ x).T, at - table[0] @ x, rcond=None)[0]
            place = _clipped(place + step)
        distance = float(np.linalg.norm(element.tabulate(0, place[None])[0, 0, :, 0] @ x - at))
        if distance < best[2] - 1e-12:
            best = (int(cell), place, distance)
    return best


def _clipped(local):
    """The nearest admissible local coordinates, by clipping barycentric coordinates."""
    bary = np.clip(np.append(1.0 - local.sum(), local), 0.0, None)
    return bary[1:] / bary.sum()
