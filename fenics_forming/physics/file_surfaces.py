"""Contact surfaces of tools whose body comes from a file: the outer sides of its mesh, the same on every rank."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from ..errors import SceneError
from .facets import exterior_facets
from .nodes import Nodes, quadratic_shapes
from .parallel import everywhere
from .solid_mesh import facing_points, solid_mesh
from .surface import facet_sides

PARTS = 6               # straight pieces of a curved side in the plane
STRAIGHT = 1e-7         # of the size of the body: points so near to the line between their neighbours are no corners
_QUARTERS = [(0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)]      # of a side in space: mid-nodes lie opposite to the vertices


def file_sides(scene, name: str, comm=MPI.COMM_WORLD) -> np.ndarray:
    """Nodes of the outer sides of a tool from a file, outwards, none on its mirror planes in space: (f, 3 | 6, dim) mm.
    Collective.

    Raises
    ------
    MeshError
        if the file holds no such body.
    """
    tool, dim = scene.tools[name], scene.dimension
    size, near = tool.mesh_size, facing_points(scene, name, {name: tool})[name]
    contact, far = (None, None) if size is None else (size.contact, size.far)
    mesh = solid_mesh(tool.shape, dim, contact=contact, far=far, near=near, comm=comm)
    nodes = Nodes(mesh)
    x = everywhere(comm, nodes.x[facet_sides(nodes, exterior_facets(mesh))])
    if dim == 2:
        return x
    low, high = x.min(axis=(0, 1)), x.max(axis=(0, 1))
    for axis in (scene.axes.index(a) for a in tool.symmetry):
        x = x[(x[..., axis] > low[axis] + STRAIGHT * (high - low).max()).any(axis=1)]
    return x


def triangles_of(sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) and triangles (t, 3), four flat ones for each side (f, 6, 3)."""
    return sides.reshape(-1, 3), quarters(np.arange(sides.shape[0] * 6).reshape(-1, 6))


def quarters(sides: np.ndarray) -> np.ndarray:
    """Four flat triangles (4 f, 3) for each quadratic side (f, 6)."""
    return np.concatenate([sides[:, quarter] for quarter in _QUARTERS])


def outline_of(sides: np.ndarray) -> np.ndarray:
    """The closed outline, (n, 2), that sides (f, 3, 2) make up, body on the left; corners only where it is straight.

    Raises
    ------
    SceneError
        if they make up more than one.
    """
    size = float(np.ptp(sides.reshape(-1, 2), axis=0).max())
    keys = np.round(sides[:, :2] / (1e-9 * size)).astype(np.int64)
    _, ends = np.unique(keys.reshape(-1, 2), axis=0, return_inverse=True)
    starts, stops = ends.reshape(-1, 2).T
    side_from = {start: side for side, start in enumerate(starts.tolist())}
    order, at = [0], int(stops[0])
    while at != int(starts[0]):
        order.append(side_from[at])
        at = int(stops[order[-1]])
    if len(order) < len(sides):
        raise SceneError("has several outlines, as with a hole; expected a body without holes", key="path")
    t = np.linspace(0, 1, PARTS, endpoint=False)
    pieces = quadratic_shapes(np.stack([1 - t, t], axis=1), 1)
    points = np.einsum("pa,fai->fpi", pieces, sides[order]).reshape(-1, 2)
    return _corners(points, STRAIGHT * size)


def _corners(points: np.ndarray, slack: float) -> np.ndarray:
    """The points of a closed outline that do not lie on the line between those that are kept before and behind them."""
    kept = []
    for k, point in enumerate(points):
        before, behind = points[k - 1] if not kept else kept[-1], points[(k + 1) % len(points)]
        along = behind - before
        away = along[0] * (point[1] - before[1]) - along[1] * (point[0] - before[0])
        if abs(away) > slack * np.linalg.norm(along):
            kept.append(point)
    return np.array(kept)
