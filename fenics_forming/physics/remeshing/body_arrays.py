"""A whole body of order 2 as plain arrays on one rank: what a remeshing takes and gives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..locating import Locator
from ..nodes import keys, single
from ..surface import FACETS, sides_of


@dataclass(frozen=True)
class BodyArrays:
    """A body of order 2.

    Attributes
    ----------
    x : (n, dim) positions of the nodes, mm
    cells : (m, 6 | 10) nodes of the cells in basix order: vertices first, then mid-nodes as in ``nodes.EDGES``
    """

    x: np.ndarray
    cells: np.ndarray

    @property
    def dim(self) -> int:
        return self.x.shape[1]

    @cached_property
    def sides(self) -> np.ndarray:
        """Nodes of the boundary facets, see `boundary_sides`."""
        return boundary_sides(self.cells, self.dim, self.x)

    @cached_property
    def locator(self) -> Locator:
        """Finds points in the body."""
        return Locator(self.x, self.cells)


@dataclass(frozen=True)
class Remeshed(BodyArrays):
    """A body with a new mesh.

    Attributes
    ----------
    labels : (f,) label of each of ``sides``: 0 free surface, k >= 1 pressed by the k-th tool, -1 - axis on the
        mirror plane of that axis (the axis of rotation is the mirror plane r = 0)
    engine : what made the mesh: "mmg", "gmsh" or "gmsh, then mmg"
    healed : what of the old boundary could not be kept, in words
    """

    labels: np.ndarray
    engine: str
    healed: tuple[str, ...] = ()


def following(values: np.ndarray) -> np.ndarray:
    """What comes next to each of the values (k, …) around a loop; `numpy.roll` takes five times as long for a few."""
    return np.concatenate([values[1:], values[:1]])


def preceding(values: np.ndarray) -> np.ndarray:
    """What comes before each of the values (k, …) around a loop."""
    return np.concatenate([values[-1:], values[:-1]])


def boundary_sides(cells: np.ndarray, dim: int, x: np.ndarray) -> np.ndarray:
    """The facets that belong to one cell only, in the order of the cells: (f, 3 | 6) nodes.

    Vertices first: in 2-D the body lies on the left of the way from the first to the second, in 3-D they turn
    around the outward normal. Then the mid-nodes, in 3-D in the order of a quadratic triangle (opposite to the
    first, second, third vertex).
    """
    if dim == 2:        # a side has a node of its own
        once = np.bincount(cells[:, 3:].ravel(), minlength=len(x))[cells[:, 3:].ravel()] == 1
    else:
        once = single(keys(cells[:, np.array(FACETS[dim])].reshape(-1, dim), len(x)))
    cell, facet = np.divmod(np.flatnonzero(once), dim + 1)
    return sides_of(cells[cell], facet, x)
