"""The first mesh of a body with finer parts: meshed again and again, each time with the sizes wanted at the last one's
vertices as a background, as one batch. (A callback for each point would call Python some ten thousand times.)
"""

from __future__ import annotations

import numpy as np

from .meshing import arrays
from .remeshing.body_arrays import BodyArrays

PASSES = 6
LARGEST = {2: 1.6, 3: 1.8}      # times the wanted size that any cell may have: gmsh leaves up to that
LARGE = {2: 1.4, 3: 1.5}        # times that only
FEW = 0.05                      # of all cells may have


def refine(gmsh, dim: int, wanted) -> None:
    """Mesh the model of gmsh, which is meshed already, until its edges are as short as wanted; the order becomes 2.

    Parameters
    ----------
    wanted : callable, a `BodyArrays` to the wanted size at its nodes, (n,) mm; only those of vertices are read
    """
    view = None
    try:
        for _ in range(PASSES):
            gmsh.model.mesh.setOrder(2)
            body = BodyArrays(*arrays(gmsh, dim))
            size = wanted(body)
            ratio = cell_sizes(body) / size[body.cells[:, : dim + 1]].mean(axis=1)
            if ratio.max() <= LARGEST[dim] and np.mean(ratio > LARGE[dim]) <= FEW:
                return
            view = _background(gmsh, body, size, view)
            gmsh.model.mesh.clear()
            gmsh.model.mesh.generate(dim)
        gmsh.model.mesh.setOrder(2)
    finally:
        if view is not None:
            gmsh.view.remove(view)


def cell_sizes(body: BodyArrays) -> np.ndarray:
    """Side of the regular triangle or tetrahedron of the same size as each cell, (m,) mm."""
    p = body.x[body.cells[:, : body.dim + 1]]
    double = np.abs(np.linalg.det(p[:, 1:] - p[:, :1]))
    return np.sqrt(2 / np.sqrt(3) * double) if body.dim == 2 else np.cbrt(np.sqrt(2) * double)


def _background(gmsh, body, size, old: int | None) -> int:
    """Sizes at the vertices of a mesh become the background of the next one; the number of their view."""
    fields = gmsh.model.mesh.field
    for field in fields.list():
        fields.remove(field)
    if old is not None:
        gmsh.view.remove(old)
    else:
        gmsh.model.mesh.removeSizeCallback()
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    cells = body.cells[:, : body.dim + 1]
    places = np.zeros((len(cells), 3, body.dim + 1))
    places[:, : body.dim] = np.swapaxes(body.x[cells], 1, 2)
    data = np.concatenate([places.reshape(len(cells), -1), size[cells]], axis=1)
    view = gmsh.view.add("size")
    gmsh.view.addListData(view, {2: "ST", 3: "SS"}[body.dim], len(cells), data.ravel())
    field = fields.add("PostView")
    fields.setNumber(field, "ViewTag", view)
    fields.setAsBackgroundMesh(field)
    return view
