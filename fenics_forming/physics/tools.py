"""From the tools of a scene to their contact surfaces."""

from __future__ import annotations

import numpy as np

from ..errors import SceneError
from ..scene import Scene, Tool
from .contact.rigid import KnownTool
from .contact.surfaces import Circle, Cylinder, Plane, Sphere


def known_tools(scene: Scene) -> list[KnownTool]:
    """The rigid tools of a scene, ready for contact.

    Raises
    ------
    SceneError
        where a surface cannot be built, with the dotted key.
    """
    tools = []
    for name, tool in scene.tools.items():
        try:
            surface = surface_of(tool, scene)
        except SceneError as error:
            sentence = str(error).removeprefix(f"{error.key}: ")
            raise SceneError(sentence, key=f"tools.{name}.shape.{error.key}", got=error.got) from error
        friction = tool.friction if tool.friction.law != "none" else None
        tools.append(KnownTool(name, surface, friction))
    return tools


def surface_of(tool: Tool, scene: Scene):
    """The contact surface of a tool, in its own frame."""
    shape = tool.shape
    match shape.kind:
        case "plane":
            return Plane(shape.point, shape.normal)
        case "circle":
            return Circle(shape.centre, shape.radius, hollow=shape.hollow)
        case "sphere":
            return Sphere(shape.centre, shape.radius, hollow=shape.hollow)
        case "box":
            from .contact.blocks import box_surface
            low, high = np.array(shape.bounds())
            for axis in (scene.axes.index(a) for a in tool.symmetry):
                low[axis] -= high[axis] - low[axis]          # the mirror plane is no surface of the tool
            return box_surface(low, high)
        case "cylinder" if hasattr(shape, "base"):
            from .contact.blocks import cylinder_surface
            base, height = np.array(shape.base), shape.height
            along = np.array(shape.axis) / np.linalg.norm(shape.axis)
            for axis in (scene.axes.index(a) for a in tool.symmetry if abs(along[scene.axes.index(a)]) > 0.5):
                base, height = base - (along[axis] > 0) * height * along, 2 * height
            return cylinder_surface(base, along, shape.radius, height)
        case "cylinder":
            return Cylinder(shape.centre, shape.axis, shape.radius, hollow=shape.hollow)
        case "polyline":
            from .contact.polyline import Polyline
            points, fillet = np.asarray(shape.points, float), np.broadcast_to(shape.fillet, len(shape.points))
            if shape.side == "right":
                points, fillet = points[::-1], fillet[::-1]
            return Polyline(points, fillet=fillet.copy())
        case "rectangle" | "polygon":
            from .contact.polyline import solid_polygon
            points, fillet = _past_the_mirrors(shape.corners, shape.radii, tool, scene)
            return solid_polygon(points, fillet=fillet)
        case "file" if tool.material is None and scene.dimension == 3 and not shape.path.endswith(".msh"):
            from mpi4py import MPI

            from .cad_surface import cad_triangles
            from .contact.triangulated import Triangulated
            vertices, triangles = cad_triangles(shape.path, shape.scale, MPI.COMM_WORLD)
            return Triangulated(vertices, _without_mirrors(vertices, triangles, tool, scene))
        case "file":
            from .file_surfaces import file_sides, outline_of, triangles_of
            sides = file_sides(scene, next(name for name, known in scene.tools.items() if known is tool))
            if scene.dimension == 3:
                from .contact.triangulated import Triangulated
                return Triangulated(*triangles_of(sides))
            from .contact.polyline import solid_polygon
            corners = outline_of(sides)
            return solid_polygon(_past_the_mirrors(corners, np.zeros(len(corners)), tool, scene)[0])
        case "stl":
            from .contact.triangulated import Triangulated, read_stl
            surface = read_stl(shape.path, scale=shape.scale)
            if any(shape.offset):
                surface = Triangulated(surface.vertices + np.asarray(shape.offset), surface.triangles)
            return surface
    raise SceneError(f"'{shape.kind}' is no tool shape", key="kind", got=shape.kind)


def _without_mirrors(vertices, triangles, tool: Tool, scene: Scene):
    """Triangles (t, 3) of a body but those on its mirror planes, its low faces on the axes named in ``symmetry``."""
    corners = vertices[triangles]
    low, size = vertices[triangles].min(axis=(0, 1)), np.ptp(vertices, axis=0).max()
    for axis in (scene.axes.index(a) for a in tool.symmetry):
        on = (corners[:, :, axis] < low[axis] + 1e-7 * size).all(axis=1)
        triangles, corners = triangles[~on], corners[~on]
    return triangles


def _past_the_mirrors(corners, radii, tool: Tool, scene: Scene):
    """A closed outline carried on beyond its mirror planes, where its side is no surface of the tool.

    The mirror planes are the low faces named in ``symmetry`` and, in axisymmetry, the axis r = 0.
    """
    points, radii = np.asarray(corners, float), np.asarray(radii, float)
    mirrors = [(scene.axes.index(a), points[:, scene.axes.index(a)].min()) for a in tool.symmetry]
    if scene.geometry == "axisymmetric" and points[:, 0].min() <= 1e-9 * np.ptp(points, axis=0).max():
        mirrors.append((0, points[:, 0].min()))
    for axis, value in dict(mirrors).items():
        reach = np.ptp(points, axis=0).max()
        on = np.isclose(points[:, axis], value, atol=1e-9 * reach)
        out, rounds = [], []
        n = len(points)
        for i in range(n):
            before, behind = on[i - 1], on[(i + 1) % n]
            beyond = points[i].copy()
            beyond[axis] -= reach
            here, there = (points[i], radii[i]), (beyond, 0.0)
            first, last = on[i] and behind, on[i] and before     # of a side on the mirror; both in its middle
            add = [there] if first and last else [here, there] if first else [there, here] if last else [here]
            out += [p for p, _ in add]
            rounds += [r for _, r in add]
        points, radii = np.array(out), np.array(rounds)
    return points, radii
