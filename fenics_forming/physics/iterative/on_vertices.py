"""Contact between bodies on the vertices alone, where every rank knows all of it."""

from __future__ import annotations

from time import process_time

import numpy as np
from scipy import sparse

from ..contact.interfaces import Interfaces
from ..parallel import total
from .everywhere import Everywhere
from .sharing import Shared


class OnVertices:
    """The sum over all ranks of what ``between.BetweenBodies`` gives on the vertices, as far as it is not zero.

    Parameters
    ----------
    between : gives the blocks · interfaces : book the time · shared, everywhere : of the vertices
    """

    def __init__(self, between, interfaces: Interfaces, shared: Shared, everywhere: Everywhere):
        self._between, self._interfaces, self._shared, self._everywhere = between, interfaces, shared, everywhere

    def prepare(self) -> None:
        """Take over the present tangents. Collective."""
        given, whole = self._between.vertex_blocks(), self._everywhere
        start = process_time()
        keys, blocks = whole.sum_of(*given)
        rows, columns = np.divmod(keys, whole.count)
        self._near = np.unique(np.concatenate([rows, columns]))     # in the common order
        size = len(self._near)
        rows, columns = np.searchsorted(self._near, rows), np.searchsorted(self._near, columns)
        starts = np.searchsorted(rows, np.arange(size + 1))
        self._matrix = sparse.bsr_matrix((blocks.reshape(-1, 3, 3), columns, starts), 2 * (3 * size,))
        self._diagonal = np.zeros((size, 9))
        self._diagonal[rows[rows == columns]] = blocks[rows == columns]
        own = whole.numbers[: self._shared.owned]
        at = np.minimum(np.searchsorted(self._near, own), max(size - 1, 0))
        self._mine = np.flatnonzero(self._near[at] == own) if size else np.empty(0, np.int64)
        self._place = at[self._mine]
        self._interfaces.book(process_time() - start)

    def add_product(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with velocities x (vertices, 3) to the owners' rows of y. Collective."""
        start = process_time()
        near = np.zeros((len(self._near), 3))
        near[self._place] = x[self._mine]
        forces = self._matrix @ total(self._shared.comm, near).ravel()
        y[self._mine] += forces.reshape(-1, 3)[self._place]
        self._interfaces.book(process_time() - start)

    def add_diagonal(self, blocks: np.ndarray) -> None:
        """Add the blocks on the diagonal to the owners' of ``blocks`` (vertices, 9)."""
        blocks[self._mine] += self._diagonal[self._place]

    def on_groups(self, operator: sparse.csr_matrix) -> np.ndarray:
        """The Galerkin product (m, m) with an ``operator`` (3 · all vertices, m) in the common order."""
        rows = operator[(3 * self._near[:, None] + np.arange(3)).ravel()]
        return (rows.T @ (self._matrix @ rows)).toarray()
