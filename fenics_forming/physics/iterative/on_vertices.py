"""Contact between bodies on the vertices alone, where every rank knows all of it."""

from __future__ import annotations

from time import process_time

import numpy as np

from ..contact.interfaces import Interfaces
from ..parallel import total
from .everywhere import Everywhere
from .products import add_product_of_some, product
from .sharing import Shared
from .upper_half import BlockRows, UpperHalf


class OnVertices:
    """What ``between.BetweenBodies`` gives on the vertices, over those that contact reaches.

    Parameters
    ----------
    between : gives the rows · interfaces : book the time · shared, everywhere : of the vertices
    """

    def __init__(self, between, interfaces: Interfaces, shared: Shared, everywhere: Everywhere):
        self._between, self._interfaces, self._shared, self._everywhere = between, interfaces, shared, everywhere
        self._made_of: list[BlockRows] = []

    def prepare(self) -> None:
        """Take over the present tangents. Collective."""
        start = process_time()
        parts = self._between.vertex_rows()
        if len(parts) != len(self._made_of) or any(a is not b for a, b in zip(parts, self._made_of, strict=True)):
            self._made_of = parts
            self._matrix = UpperHalf(self._shared.comm, BlockRows.of(parts))
            self._find_own()
        self._matrix.fill(np.concatenate([contact.weighted_tangent() for contact in self._interfaces.contacts]))
        self._interfaces.book(process_time() - start)

    def _find_own(self) -> None:
        """Which vertices of this rank are near, ``_mine``, and where among those."""
        near, own = self._matrix.near, self._everywhere.numbers[: self._shared.owned]
        at = np.minimum(np.searchsorted(near, own), max(len(near) - 1, 0))
        self._mine = np.flatnonzero(near[at] == own) if len(near) else np.empty(0, np.int64)
        self._place = at[self._mine]
        if self._shared.comm.size == 1:
            local = np.empty(len(near), np.uint32)
            local[self._place] = self._mine
            self._near, self._columns = local, local[self._matrix.columns]

    def add_product(self, x: np.ndarray, y: np.ndarray) -> None:
        """Add the product with velocities x (vertices, 3) to the owners' rows of y. Collective."""
        start, matrix = process_time(), self._matrix
        if self._shared.comm.size > 1:
            near = np.zeros((len(matrix.near), 3))
            near[self._place] = x[self._mine]
            near = total(self._shared.comm, near)
            product(matrix.starts, matrix.columns, matrix.diagonal, matrix.upper, near, forces := np.empty_like(near))
            y[self._mine] += forces[self._place]
        else:
            add_product_of_some(self._near, matrix.starts, self._columns, matrix.diagonal, matrix.upper, x, y)
        self._interfaces.book(process_time() - start)

    def add_diagonal(self, blocks: np.ndarray) -> None:
        """Add the blocks on the diagonal to the owners' of ``blocks`` (vertices, 9)."""
        blocks[self._mine] += self._matrix.diagonal[self._place]

    def add_on_groups(self, groups, matrix: np.ndarray) -> None:
        """Add the Galerkin product on the motions of ``aggregates.RigidGroups`` to their ``matrix`` (m, m). Collective."""
        start, K = process_time(), self._matrix
        groups.add_galerkin(matrix, K.near, K.starts, K.columns, K.diagonal, K.upper)
        self._interfaces.book(process_time() - start)
