"""Triangles of the wanted sizes inside a given boundary, by mmg or gmsh."""

from __future__ import annotations

import numpy as np

from ..gmsh_arrays import gmsh_model
from ..nodes import determinants
from . import mmg
from .gradation import edges_of, over_mesh
from .resampling import Outline
from .rounding import on_a_grid, to_seven_digits

PASSES = 4
MISFIT = (0.6, 1.7)       # of the length of an edge over the wanted one
FEW = 0.02                # of the edges may be outside of that


def fill(outline: Outline, sizes, engine: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles inside the outline: x (n, 2), triangles (m, 3), sides (f, 2) as those of the outline.

    The first mesh follows the lengths of the boundary; as long as edges inside are much longer or shorter than
    `sizes` says, the next one follows what `sizes` is at the vertices of the last.

    Raises
    ------
    RuntimeError
        when the engine fails or gives something else than the inside.
    """
    make = {"mmg": mmg.plane, "gmsh": gmsh_plane}[engine]

    def one_pass(points, ends, size, cells=None):
        x, made, new = make(on_a_grid(points), ends, to_seven_digits(size), cells)
        x[new] = outline.points[outline.sides]
        return _checked(outline, (x, made, new))

    x, triangles, sides = one_pass(outline.points, outline.sides, outline.size)
    for _ in range(PASSES - 1):
        edges, length = edges_of(x, triangles)
        wanted, inner = np.empty(len(x)), np.ones(len(x), dtype=bool)
        inner[sides] = False
        wanted[inner] = sizes(x[inner])
        wanted[sides[:, 0]] = outline.size[outline.sides[:, 0]]
        wanted = over_mesh(wanted, edges, length)
        ratio = length / wanted[edges].mean(axis=1)
        if np.mean((ratio < MISFIT[0]) | (ratio > MISFIT[1])) <= FEW:
            break
        x, triangles, sides = one_pass(x, sides, wanted, triangles)
    return x, triangles, sides


def _checked(outline: Outline, found):
    """What an engine gave, if it is the inside of the outline."""
    x, triangles, sides = found
    p = x[triangles]
    area = 0.5 * determinants(p[:, 1:] - p[:, :1])
    if not (area > 0).all() or abs(area.sum() / outline.area - 1) > 1e-9:
        raise RuntimeError("the triangles do not fill the boundary")
    return x, triangles, sides


def gmsh_plane(points: np.ndarray, sides: np.ndarray, size: np.ndarray,
               triangles: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `mmg.plane`; gmsh starts from the boundary again and takes the sizes at the points as a background.

    Raises
    ------
    RuntimeError
        when gmsh fails.
    """
    starts = np.flatnonzero(np.append(True, sides[1:, 0] != sides[:-1, 1]))
    boundary = points[sides[:, 0]]
    number = np.arange(1, len(sides) + 1)
    with gmsh_model() as gmsh:
        loops = [_discrete_loop(gmsh, 1 + k, nodes, boundary[nodes - 1])
                 for k, nodes in enumerate(np.split(number, starts[1:]))]
        gmsh.model.geo.addPlaneSurface(loops)
        gmsh.model.geo.synchronize()
        view = _set_sizes(gmsh, points, triangles, size)
        try:
            gmsh.model.mesh.generate(2)
        except Exception as error:   # gmsh raises bare Exceptions
            raise RuntimeError(str(error)) from error
        finally:
            if view is not None:
                gmsh.view.remove(view)
        tags, x, _ = gmsh.model.mesh.getNodes()
        cells = gmsh.model.mesh.getElementsByType(2)[1].astype(np.int64).reshape(-1, 3)
    order = np.argsort(tags)
    cells = np.searchsorted(tags[order], cells)
    x = x.reshape(-1, 3)[order, :2]
    return x, cells, np.stack([number - 1, _following(number - 1, starts)], axis=1)


def _following(number: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """The next number in a loop; loops begin at `starts`."""
    following = number + 1
    following[np.append(starts[1:], len(number)) - 1] = starts
    return following


def _discrete_loop(gmsh, tag: int, nodes: np.ndarray, x: np.ndarray) -> int:
    """A closed curve that is meshed already: its nodes and the lines between them."""
    gmsh.model.addDiscreteEntity(0, tag)
    gmsh.model.addDiscreteEntity(1, tag, [tag, tag])
    flat = np.column_stack([x, np.zeros(len(x))])
    gmsh.model.mesh.addNodes(0, tag, nodes[:1], flat[0])
    gmsh.model.mesh.addNodes(1, tag, nodes[1:], flat[1:].ravel())
    gmsh.model.mesh.addElementsByType(tag, 1, nodes, np.stack([nodes, np.roll(nodes, -1)], axis=1).ravel())
    return gmsh.model.geo.addCurveLoop([tag])


def _set_sizes(gmsh, points: np.ndarray, triangles: np.ndarray | None, size: np.ndarray) -> int | None:
    """Sizes from the boundary, or from a view of the sizes at the points of triangles; the number of that view."""
    option = gmsh.option
    option.setNumber("Mesh.Algorithm", 6)
    option.setNumber("Mesh.ElementOrder", 1)
    option.setNumber("Mesh.Renumber", 0)       # the numbers of the boundary stay
    option.setNumber("Mesh.MeshSizeExtendFromBoundary", int(triangles is None))
    option.setNumber("Mesh.MeshSizeFromPoints", 0)
    if triangles is None:
        return None
    p = points[triangles]
    data = np.concatenate([p[:, :, 0], p[:, :, 1], np.zeros((len(p), 3)), size[triangles]], axis=1)
    view = gmsh.view.add("size")
    gmsh.view.addListData(view, "ST", len(p), data.ravel())
    field = gmsh.model.mesh.field.add("PostView")
    gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    return view
