"""Material points: found once in the mesh, then carried by the shape functions of their cells."""

from __future__ import annotations

import numpy as np

from .locating import Locator
from .nodes import Nodes, quadratic_shapes
from .parallel import lowest, total


class MaterialPoints:
    """Named points, or rows of points, of the material, each at local coordinates of one cell, which it never leaves.

    Making them is collective.

    Parameters
    ----------
    nodes : the mesh as it lies now
    at : name → (k, dim) positions now, mm; a point slightly outside (on a curved side) takes the nearest place of the body
    cells : name → owned cells, by number, that the points may lie in, where a mesh holds several bodies; all if not given

    Attributes
    ----------
    distance : name → (k,) mm between what was asked for and the place in the body
    """

    def __init__(self, nodes: Nodes, at: dict[str, np.ndarray], *, cells: dict[str, np.ndarray] | None = None):
        self._nodes, self._names = nodes, list(at)
        rows = [np.asarray(places, float).reshape(-1, nodes.dim) for places in at.values()]
        self._ends = np.cumsum([len(row) for row in rows])[:-1]
        asked = np.concatenate(rows)
        if cells is None:
            distance, hosts, shapes = _located(nodes, asked, np.arange(len(nodes.cells)))
        else:
            found = [_located(nodes, row, cells[name]) for name, row in zip(at, rows, strict=True)]
            distance, hosts, shapes = (np.concatenate(column) for column in zip(*found, strict=True))
        distance, mine = _one_owner(nodes.comm, distance)
        self.distance, self._mine, self._count = self._by_name(distance), np.flatnonzero(mine), len(asked)
        self._rows, self._shapes = hosts[self._mine], shapes[self._mine]

    def values(self, nodal: np.ndarray) -> dict[str, np.ndarray]:
        """Values of a nodal field (nodes[, c]) at the points, name → (k[, c]), on every rank. Collective."""
        out = np.zeros((self._count,) + nodal.shape[1:])
        out[self._mine] = np.einsum("pa,pa...->p...", self._shapes, nodal[self._rows])
        return self._by_name(total(self._nodes.comm, out))

    @property
    def places(self) -> dict[str, np.ndarray]:
        """Where the points are now, name → (k, dim) mm, on every rank. Collective."""
        return self.values(self._nodes.x)

    def relocated(self, nodes: Nodes, cells: dict[str, np.ndarray] | None = None) -> MaterialPoints:
        """The same points at their present places in a new mesh of the body, or ``cells`` of it. Collective."""
        return MaterialPoints(nodes, self.places, cells=cells)

    def _by_name(self, rows):
        return dict(zip(self._names, np.split(rows, self._ends), strict=True))


def _located(nodes: Nodes, points: np.ndarray, cells: np.ndarray):
    """Distance (k,) of points from the nearest of this rank's ``cells``, infinite where it has none, the nodes of that
    cell (k, 6 | 10) and the shape functions there."""
    width = nodes.cells.shape[1]
    if not len(cells):
        return np.full(len(points), np.inf), np.zeros((len(points), width), int), np.zeros((len(points), width))
    found = Locator(nodes.x, nodes.cells[cells]).find_curved(points)
    return found.distance, nodes.cells[cells[found.cells]], quadratic_shapes(found.barycentric, nodes.dim)


def _one_owner(comm, distance):
    """Least distance over the ranks, (p,), and whether this rank is the first that has it, (p,)."""
    least = lowest(comm, distance)
    first = lowest(comm, np.where(distance <= least, float(comm.rank), np.inf))
    return least, first == comm.rank
