"""The velocity field of one instant, frozen with its mesh, at any place: for sub-steps within a step."""

from __future__ import annotations

import numpy as np

from ..physics.gather import gather_cells, gather_nodal
from ..physics.locating import Located, Locator, slopes
from ..physics.nodes import Nodes, quadratic_shapes


class FrozenField:
    """Nodal values on the mesh as it lies now, interpolated by its quadratic shapes.

    Every rank holds the whole field, in an order that does not depend on the ranks: a point may leave the part of the
    mesh that its rank owns. Making one is collective, evaluating it is not.

    Parameters
    ----------
    nodes : the mesh; it may move afterwards
    values : (count, k)
    """

    def __init__(self, nodes: Nodes, values: np.ndarray):
        whole = gather_nodal(nodes, nodes.x), gather_cells(nodes), gather_nodal(nodes, values)
        x, cells, self._values = nodes.comm.bcast(whole, 0) if nodes.comm.size > 1 else whole
        self._locator = Locator(x.copy(), cells)

    def find(self, points: np.ndarray) -> Located:
        """Where points (p, dim), mm, lie in the mesh, with their distances from it."""
        return self._locator.find_curved(points)

    def at(self, points: np.ndarray, found: Located | None = None) -> np.ndarray:
        """Values (p, k) at points (p, dim), mm; ``found``: what :meth:`find` gave, if it is known.

        Outside, where a side of the body has moved to, they go on linearly from the nearest place of the mesh.
        """
        found = self.find(points) if found is None else found
        rows = self._locator.cells[found.cells]
        x, values = self._locator.x[rows], self._values[rows]
        inside = np.einsum("pa,pak->pk", quadratic_shapes(found.barycentric, x.shape[2]), values)
        outside = found.distance > 0.0
        away = points[outside] - self._locator.place(found)[outside]
        slope = np.swapaxes(slopes(found.barycentric[outside], x.shape[2]), 1, 2)
        by_coordinate = [np.matmul(slope, nodal[outside]) for nodal in (x, values)]
        by_local = [d[:, 1:] - d[:, :1] for d in by_coordinate]
        inside[outside] += np.einsum("pd,pdk->pk", away, np.linalg.solve(*by_local))
        return inside
