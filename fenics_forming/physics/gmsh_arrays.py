"""Meshes of order 2 as arrays (positions and cells in basix order), read from a gmsh model and made sound."""

from __future__ import annotations

from contextlib import contextmanager

import basix
import numpy as np
from dolfinx import mesh as dmesh
from dolfinx.io.gmshio import cell_perm_array

from ..errors import MeshError
from .nodes import EDGES, QUADRATURE_DEGREE, quadratic_shapes, single

NODES = {2: 6, 3: 10}
_GMSH_TYPE = {2: 9, 3: 11}


@contextmanager
def gmsh_model():
    """A fresh, silent gmsh model (rank 0 only)."""
    import gmsh

    fresh = not gmsh.isInitialized()
    if fresh:
        gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("fenics_forming")
    try:
        yield gmsh
    finally:
        gmsh.model.remove()
        if fresh:
            gmsh.finalize()


def arrays(gmsh, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, dim) and quadratic cells (m, 6 or 10), in basix order, of the model."""
    tags, x, _ = gmsh.model.mesh.getNodes()
    _, rows = gmsh.model.mesh.getElementsByType(_GMSH_TYPE[dim])
    if len(rows) == 0:
        raise MeshError(f"it has no {'triangles' if dim == 2 else 'tetrahedra'}")
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    cells = number[rows.astype(np.int64)].reshape(-1, NODES[dim])
    kind = dmesh.CellType.triangle if dim == 2 else dmesh.CellType.tetrahedron
    cells = cells[:, cell_perm_array(kind, NODES[dim])]
    used, cells = np.unique(cells, return_inverse=True)
    return x.reshape(-1, 3)[used, :dim], cells.reshape(-1, NODES[dim])


def sound_arrays(gmsh, dim: int, split) -> tuple[np.ndarray, np.ndarray]:
    """The mesh of the model raised to order 2, cells with several sides on the boundary split (see `split_corner_cells`).

    A cell with a side on a surface that is curved more than the cell is large may be turned inside out by it. Then gmsh is
    asked to move the nodes inside.

    Raises
    ------
    MeshError
        if that does not help.
    """
    gmsh.model.mesh.setOrder(2)
    x, cells = split(*arrays(gmsh, dim), dim)
    if inverted_cells(x, cells).any():
        gmsh.model.mesh.optimize("HighOrder")
        x, cells = split(*arrays(gmsh, dim), dim)
        inverted = int(inverted_cells(x, cells).sum())
        if inverted:
            raise MeshError(f"{inverted} of {len(cells)} cells are turned inside out by the curved surface beside them; a "
                            "smaller mesh_size follows it")
    return x, cells


def inverted_cells(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Whether the map of each cell of order 2 loses its orientation at an integration point of the flow, (cells,).

    At a vertex it may be singular: two sides of a cell on one smooth curve meet there at 180 degrees.
    """
    dim = x.shape[1]
    kind = basix.CellType.triangle if dim == 2 else basix.CellType.tetrahedron
    points, _ = basix.make_quadrature(kind, QUADRATURE_DEGREE[dim])
    element = basix.create_element(basix.ElementFamily.P, kind, 2, basix.LagrangeVariant.gll_warped)
    gradients = element.tabulate(1, points)[1:, :, :, 0]
    det = np.linalg.det(np.einsum("kpa,cad->cpkd", gradients, x[cells]))
    corners = x[cells[:, : dim + 1]]
    return (det * np.linalg.det(corners[:, 1:] - corners[:, :1])[:, None] <= 0).any(axis=1)


def split_corner_cells(x: np.ndarray, cells: np.ndarray, dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Cut every cell that has more than one side on the boundary into one cell per side, at its centre.

    Where a side of the body folds down onto a tool, such a cell would be pressed flat.
    """
    corners = cells[:, : dim + 1]
    sides = np.sort(np.stack([np.delete(corners, i, axis=1) for i in range(dim + 1)], axis=1), axis=2).reshape(-1, dim)
    keys = sides @ len(x) ** np.arange(dim, dtype=np.int64)       # one number a side: rows are sorted ten times as slowly
    exterior = single(keys).reshape(-1, dim + 1)
    cut = exterior.sum(axis=1) > 1
    if not cut.any():
        return x, cells
    old = cells[cut]
    # the new nodes lie where the quadratic map of the old cell takes them, so that its Jacobian is theirs:
    # straight spokes would invert the cells behind a curved side
    middle_of = np.full((1, dim + 1), 1 / (dim + 1))
    placed = np.einsum("pa,kad->kpd", quadratic_shapes(np.concatenate(
        [middle_of, 0.5 * (np.eye(dim + 1) + middle_of)]), dim), x[old])
    centre, spokes = placed[:, 0], placed[:, 1:]
    first = len(x)
    k = len(old)
    centre_number = first + np.arange(k)
    spoke_number = first + k + np.arange(k * (dim + 1)).reshape(k, dim + 1)
    x = np.concatenate([x, centre, spokes.reshape(-1, dim)])
    edges = EDGES[dim]
    middle = {frozenset(e): old[:, dim + 1 + i] for i, e in enumerate(edges)}
    new = []
    for side in range(dim + 1):      # the vertex opposite to the side is replaced by the centre
        def number(edge, side=side):
            if side in edge:
                other = edge[0] if edge[1] == side else edge[1]
                return spoke_number[:, other]
            return middle[frozenset(edge)]
        columns = [centre_number if v == side else old[:, v] for v in range(dim + 1)] + [number(e) for e in edges]
        new.append(np.stack(columns, axis=1))
    return x, np.concatenate([cells[~cut], *new])
