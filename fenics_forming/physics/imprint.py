"""Corners and edges of tools that lie on the surface of a body at the start become vertices and edges of its first mesh.

A side of an element over such an edge would belong half to the contact: it carries the velocity of the tool beyond the
edge or bends away under it. A punch on a half space comes out by up to a fifth too strong or too weak for that, as the
nodes happen to lie; on an edge of the mesh it is the error of the elements that is left. The elements there are not made
smaller in space, as they are in the plane: small cells at a sharp edge fail early, and a scene can ask for them.
"""

from __future__ import annotations

import numpy as np

ON_SURFACE = 1e-6       # of the element size: so near to the surface of the body an edge lies on it
SHORTEST = 0.5          # of the element size: shorter edges, as of a rounding in facets, would only ask for small elements
SAMPLES = 64            # points on an edge


def edges_on(shape, tools, rims, size: float) -> list[np.ndarray]:
    """Straight edges (2, 3) and circles (centre, axis, radius: (3,), (3,), float) of the tools that touch a body, mm.

    Parameters
    ----------
    shape : of the body, with ``depth``
    tools : known tools · rims : tool name → circles where its flat ends meet its mantle
    size : of the elements, mm
    """
    found = []
    for tool in tools:
        if tool.name in rims:
            found += [circle for circle in rims[tool.name] if _touches(shape, _around(*circle), size)]
            continue
        edges = tool.surface.edges() if tool.surface.radius is None else np.empty((0, 2, 3))
        edges = edges[np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1) > SHORTEST * size]
        along = np.linspace(0, 1, SAMPLES)[:, None]
        found += [edge for edge in edges if _touches(shape, (1 - along) * edge[0] + along * edge[1], size)]
    return found


def circles_of(tool) -> list[tuple]:
    """Centre, axis and radius of the ends of a tool of the scene that is a cylinder with ends; none of any other."""
    if tool.shape is None or tool.shape.kind != "cylinder" or not hasattr(tool.shape, "base"):
        return []
    base, axis = np.array(tool.shape.base), np.array(tool.shape.axis) / np.linalg.norm(tool.shape.axis)
    return [(base + height * axis, axis, tool.shape.radius) for height in (0.0, tool.shape.height)]


def print_edges(gmsh, edges) -> None:
    """Cut the faces of the solid in the model along edges and circles that lie on them."""
    occ = gmsh.model.occ
    curves = []
    for edge in edges:
        if isinstance(edge, tuple):
            centre, axis, radius = edge
            curves.append(occ.addCircle(*centre, radius, zAxis=axis.tolist()))
        else:
            curves.append(occ.addLine(*(occ.addPoint(*end) for end in edge)))
    occ.fragment(gmsh.model.getEntities(3), [(1, curve) for curve in curves])
    occ.synchronize()
    loose = [(1, tag) for _, tag in gmsh.model.getEntities(1) if not len(gmsh.model.getAdjacencies(1, tag)[0])]
    if loose:
        occ.remove(loose, recursive=True)
        occ.synchronize()


def _touches(shape, points: np.ndarray, size: float) -> bool:
    return bool((np.abs(shape.depth(points)) < ON_SURFACE * size).any())


def _around(centre, axis, radius) -> np.ndarray:
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    angle = np.linspace(0, 2 * np.pi, 4 * SAMPLES)[:, None]
    return centre + radius * (np.cos(angle) * first + np.sin(angle) * np.cross(axis, first))


def split_at(pieces, points: np.ndarray, size: float) -> list:
    """The pieces of a plane outline, its lines cut in two at points that lie on them."""
    for point in np.asarray(points):
        pieces = [part for piece in pieces for part in _split(piece, point, ON_SURFACE * size)]
    return list(pieces)


def _split(line, point, slack: float) -> list:
    if hasattr(line, "centre"):
        return [line]
    start, end = np.array(line.start), np.array(line.end)
    along, length = end - start, np.linalg.norm(end - start)
    s = float((point - start) @ along) / length
    off = abs(along[0] * (point - start)[1] - along[1] * (point - start)[0]) / length
    if off > slack or not slack < s < length - slack:
        return [line]
    middle = tuple(point.tolist())
    return [type(line)(line.start, middle), type(line)(middle, line.end)]
