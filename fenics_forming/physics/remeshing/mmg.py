"""mmg, where mmgpy is installed: the only place that imports it."""

from __future__ import annotations

from contextlib import suppress
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from .gradation import GROWTH
from .rounding import on_a_grid, to_seven_digits

if TYPE_CHECKING:       # only solids need what is compiled there
    from .straight import Straight

FIRST_TABLES = 60       # MB, in space, where they grow
# in the plane, where they do not: MB at least, and for each triangle, three times what mmg has been seen to need
LEAST_TABLES, EACH = 1, 6e-4
OWN_TABLES = 10         # MB; from here on they cost as much as those that mmg makes unasked


def installed() -> bool:
    return find_spec("mmgpy") is not None


def plane(points: np.ndarray, sides: np.ndarray, size: np.ndarray,
          triangles: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fill a boundary with triangles, or remesh the triangles that fill it.

    Parameters
    ----------
    points : (n, 2) vertices of the boundary first
    sides : (f, 2) vertices of the sides, all of which stay
    size : (n,) wanted length of the edges at the points, mm
    triangles : (m, 3) that fill the boundary; none: only the boundary is there

    Returns
    -------
    x, triangles, sides : the f sides in the old order, with exactly the old positions

    Raises
    ------
    RuntimeError
        when mmg fails.
    """
    import mmgpy

    mesh, enough = mmgpy.MmgMesh2D(), _enough(points[sides], size)
    if enough < OWN_TABLES:
        mesh = _small_tables(mesh, enough)
    mesh.set_mesh_size(vertices=len(points), edges=len(sides), triangles=0 if triangles is None else len(triangles))
    mesh.set_vertices(np.ascontiguousarray(points))
    if triangles is not None:
        mesh.set_triangles(triangles.astype(np.int32))
    # a side is known again by its reference
    mesh.set_edges(sides.astype(np.int32), np.arange(1, len(sides) + 1))
    mesh.set_required_edges(np.arange(len(sides), dtype=np.int32))
    mesh.set_field("metric", np.ascontiguousarray(size[:, None]))
    mesh.remesh(verbose=-1)
    edges, reference = (np.asarray(a) for a in mesh.get_edges_with_refs())
    edges, reference = edges[reference > 0], reference[reference > 0]
    if not np.array_equal(np.sort(reference), np.arange(1, len(sides) + 1)):
        raise RuntimeError("mmg lost sides of the boundary")
    x = np.array(mesh.get_vertices())
    new = _directed(x, edges[np.argsort(reference)].astype(np.int64), points[sides])
    x[new] = points[sides]           # mmg scales the body: rounding
    cells, part = (np.asarray(a) for a in mesh.get_triangles_with_refs())
    cells = cells.astype(np.int64)
    return (x, cells, new) if triangles is not None else _inside(x, cells, part, new)


def _small_tables(empty, memory: int):
    """An empty mesh whose tables begin with so many MB.

    mmg makes tables for millions of cells at once, 0.3 s (in the plane for 50 000 points, a fifth of the time of a small
    mesh), unless it knows of a limit of memory before it hears of the mesh. What takes that limit is the call that
    remeshes; on an empty mesh it does nothing but complain.
    """
    with suppress(RuntimeError):
        empty.remesh(verbose=-1, mem=memory)
    return empty


def _enough(ends: np.ndarray, size: np.ndarray) -> int:
    """MB for more triangles than fit into the box of the sides (f, 2, 2), were all as small as the smallest."""
    width, height = np.ptp(ends.reshape(-1, 2), axis=0)
    least = min(size.min(), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min())
    return int(LEAST_TABLES + EACH * 4 / 3**0.5 * width * height / least**2)


def _directed(x: np.ndarray, sides: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """The sides (f, 2), each from the first to the second of its ends, (f, 2, 2)."""
    there, back = (np.abs(x[s] - ends).max(axis=(1, 2)) for s in (sides, sides[:, ::-1]))
    return np.where((there <= back)[:, None], sides, sides[:, ::-1])


def _inside(x: np.ndarray, triangles: np.ndarray, part: np.ndarray,
            sides: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Without the parts that lie on the right of the sides, the holes, and the vertices in them."""
    following = np.full(len(x), -1)
    following[sides[:, 0]] = sides[:, 1]
    behind = (following[triangles] == triangles[:, [1, 2, 0]]).any(axis=1)
    inside = np.zeros(part.max() + 1, dtype=bool)
    inside[part[behind]] = True
    triangles = triangles[inside[part]]
    used = np.zeros(len(x), dtype=bool)
    used[triangles] = used[sides] = True
    number = np.cumsum(used) - 1
    return x[used], number[triangles], number[sides]


def solid(mesh: Straight, size: np.ndarray, chord: float) -> Straight:
    """A new straight tetrahedral mesh of the same body.

    Every patch and every line of the old one goes in under a number of its own, so that lines stay lines and
    corners corners; no other edge is looked for. Cells have one side on the boundary at most, nearly always.

    Parameters
    ----------
    size : (n,) wanted length of the edges at the nodes, mm
    chord : largest distance between old and new surface, mm

    Raises
    ------
    RuntimeError
        when mmg fails, for instance on inverted cells.
    """
    import mmgpy

    from .straight import Straight, nearest_nodes, volumes

    m = _small_tables(mmgpy.MmgMesh3D(), FIRST_TABLES)
    m.set_mesh_size(vertices=len(mesh.x), tetrahedra=len(mesh.cells), triangles=len(mesh.facets), edges=len(mesh.lines))
    m.set_vertices(on_a_grid(mesh.x))
    m.set_tetrahedra(mesh.cells.astype(np.int32), np.ones(len(mesh.cells), np.int64))
    m.set_triangles(mesh.facets.astype(np.int32), mesh.patch.astype(np.int64) + 1)
    if len(mesh.lines):
        m.set_edges(mesh.lines.astype(np.int32), mesh.line.astype(np.int64) + 1)
        m.set_ridge_edges(np.arange(len(mesh.lines), dtype=np.int32))
    if len(mesh.corners):
        m.set_corners(mesh.corners.astype(np.int32))
        m.set_required_vertices(mesh.corners.astype(np.int32))
    m.set_field("metric", to_seven_digits(size).reshape(-1, 1))
    m.remesh(verbose=-1, hausd=float(chord), hgrad=1 + GROWTH, angle=0)
    facets, patch = (np.array(a, np.int64) for a in m.get_triangles_with_refs())
    lines, line = (np.array(a, np.int64) for a in m.get_edges_with_refs())
    x, cells = np.array(m.get_vertices()), np.array(m.get_tetrahedra(), np.int64)
    if len(cells) == 0 or volumes(x, cells).min() <= 0:
        raise RuntimeError("mmg left cells without volume")
    return Straight(x, cells, facets, patch - 1, lines[line > 0], line[line > 0] - 1,
                    nearest_nodes(x, np.unique(lines[line > 0]), mesh.x[mesh.corners]))
