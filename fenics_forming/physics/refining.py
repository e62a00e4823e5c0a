"""The first mesh of a body with finer parts: meshed again and again, each time with the sizes wanted at the last one's
vertices as a background, as one batch. (A callback for each point would call Python some ten thousand times.)
"""

from __future__ import annotations

import numpy as np

from .gmsh_arrays import arrays
from .remeshing.body_arrays import BodyArrays

PASSES = 6
LARGEST = {2: 1.6, 3: 1.8}      # times the wanted size that any cell may have: gmsh leaves up to that
LARGE = {2: 1.4, 3: 1.5}        # times that only
FEW = 0.05                      # of all cells may have
DENSITY = {2: 2.43, 3: 7.35}    # cells that gmsh cuts a square or cube of side 1 into, times (size)^dim
COUNT_ERROR = 0.12              # of the number of cells, against what the sizes come to by that
# The background is larger than the body by this: gmsh aborts where, by rounding, a point of an edge is outside of it.
LARGER = {2: 0.0, 3: 1e-6}
SETTLED = 0.03                  # change of the number of cells after which another pass brings nothing


def refine(gmsh, dim: int, wanted) -> None:
    """Mesh the model of gmsh, which is meshed already, until its edges are as short as wanted; the order becomes 2.

    Parameters
    ----------
    wanted : callable, a `BodyArrays` to the wanted size at its nodes, (n,) mm; only those of vertices are read
    """
    view, scale, before = None, 1.0, 0
    try:
        for _ in range(PASSES):
            gmsh.model.mesh.setOrder(2)
            body = BodyArrays(*arrays(gmsh, dim))
            size = wanted(body)
            wanted_size = size[body.cells[:, : dim + 1]].mean(axis=1)
            ratio = cell_sizes(body) / wanted_size
            count = len(ratio) / (DENSITY[dim] * (cell_volumes(body) / wanted_size**dim).sum())
            fits = view is None or abs(count - 1) < COUNT_ERROR or abs(len(ratio) - before) < SETTLED * before
            before = len(ratio)
            if fits and ratio.max() <= LARGEST[dim] and np.mean(ratio > LARGE[dim]) <= FEW:
                return
            # where sizes change gmsh makes too few cells, by half in space; where nothing is finer they are right
            scale = 1.0 if view is None else scale * np.clip(count, 0.5, 1.5) ** (1 / dim)
            coarse = (size / size[np.isfinite(size)].max()) ** 2
            view = _background(gmsh, body, size * scale ** (1 - np.minimum(coarse, 1.0)), view)
            gmsh.model.mesh.clear()
            gmsh.model.mesh.generate(dim)
        gmsh.model.mesh.setOrder(2)
    finally:
        if view is not None:
            gmsh.view.remove(view)


def cell_sizes(body: BodyArrays) -> np.ndarray:
    """Side of the regular triangle or tetrahedron of the same size as each cell, (m,) mm."""
    volume = cell_volumes(body)
    return np.sqrt(4 / np.sqrt(3) * volume) if body.dim == 2 else np.cbrt(6 * np.sqrt(2) * volume)


def cell_volumes(body: BodyArrays) -> np.ndarray:
    """Of the straight cells, (m,) mm² or mm³."""
    p = body.x[body.cells[:, : body.dim + 1]]
    return np.abs(np.linalg.det(p[:, 1:] - p[:, :1])) / {2: 2, 3: 6}[body.dim]


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
    middle = 0.5 * (body.x.min(axis=0) + body.x.max(axis=0))
    places[:, : body.dim] = np.swapaxes(middle + (1 + LARGER[body.dim]) * (body.x - middle)[cells], 1, 2)
    data = np.concatenate([places.reshape(len(cells), -1), size[cells]], axis=1)
    view = gmsh.view.add("size")
    gmsh.view.addListData(view, {2: "ST", 3: "SS"}[body.dim], len(cells), data.ravel())
    field = fields.add("PostView")
    fields.setNumber(field, "ViewTag", view)
    fields.setAsBackgroundMesh(field)
    return view
