"""Whether tools that are given as bodies make sense: materials, shapes, faces, contacts of parts, names."""

import numpy as np

from ..errors import SceneError
from ..laws.described import unknown_word
from .mesh_checks import too_fine

MESHED = ("rectangle", "polygon", "circle", "box", "cylinder", "file")
"""Kinds of shapes that can be meshed; of a circle the full one, of a cylinder the one with ends."""


def solids_of(scene):
    """(tool, part or None, dotted key, solid) of every tool that is given as a body, part by part."""
    for name, tool in scene.tools.items():
        if tool.parts:
            for part, solid in tool.parts.items():
                yield name, part, f"tools.{name}.parts.{part}", solid
        elif tool.material is not None:
            yield name, None, f"tools.{name}", tool


def body_names(scene):
    """Names that points and contacts may use: workpieces, parts, and tools in one piece with a material."""
    return [*scene.workpieces, *(part or name for name, part, _, _ in solids_of(scene))]


def solid_problems(scene):
    """SceneErrors of names, dimensions and files of tools that are given as bodies."""
    seen = set(scene.workpieces)
    for name, part, key, solid in solids_of(scene):
        if solid.material not in scene.materials:
            yield unknown_word(f"'{solid.material}' is not the name of a material", solid.material, scene.materials,
                               f"{key}.material")
        if (part or name) in seen or part in scene.tools:
            sentence = "is the name of another body of the scene, so that points and contacts could mean either"
            yield SceneError(sentence, key=key, got=part or name, allowed="a name of its own")
        seen.add(part or name)
        if part is not None and solid.shape.dimension not in (None, scene.dimension):
            sentence = f"is {solid.shape.dimension}-dimensional; '{scene.geometry}' has the axes {', '.join(scene.axes)}"
            yield SceneError(sentence, key=f"{key}.shape", got=solid.shape.dimension, allowed=scene.dimension)
        file = solid.shape.file if part is not None else None
        if file is not None and not file.is_file():
            sentence = f"the file '{file}' does not exist (paths are relative to the scene file)"
            yield SceneError(sentence, key=f"{key}.shape.path", got=str(file), allowed="a file that exists")
    for name, tool in scene.tools.items():
        yield from _tool_problems(scene, name, tool)


def _tool_problems(scene, name, tool):
    key = f"tools.{name}"
    if tool.parts and tool.material is not None:
        sentence = "belongs to the parts of an assembled tool; leave it out here"
        yield SceneError(sentence, key=f"{key}.material", got=tool.material, allowed="a material of each part")
    if tool.stress_state == "plane_stress" and scene.geometry != "plane_strain":
        sentence = f"'plane_stress' belongs to tools in the plane, not to '{scene.geometry}'"
        yield SceneError(sentence, key=f"{key}.stress_state", got="plane_stress", allowed="geometry = 'plane_strain'")
    if not tool.has_body:
        for given in ("mesh_size", "held", "loads", "springs"):
            if getattr(tool, given):
                sentence = "belongs to a tool that deforms; give it a 'material' with 'young' and 'poisson', or 'parts'"
                yield SceneError(sentence, key=f"{key}.{given}", allowed="a tool with a material")
    if scene.is_tools_alone:
        return
    if tool.shape is None:
        yield SceneError("is missing; workpieces meet an assembled tool as one shape, and its parts have no common "
                         "outline: they leave gaps, overlap, or are bodies in space", key=f"{key}.shape",
                         allowed="a tool shape")


def deforming_problems(scene, names):
    """SceneErrors of the tools ``names`` that are to deform: elastic constants, shapes, faces, sizes."""
    for name, part, key, solid in solids_of(scene):
        if name not in names:
            continue
        yield from _material_problems(scene, part or name, solid)
        shape = solid.shape
        round_surface = getattr(shape, "hollow", False) or shape.kind == "cylinder" and not hasattr(shape, "base")
        if shape.kind not in MESHED or round_surface:
            what = "is a surface without a body behind it" if shape.kind not in ("circle", "cylinder") else \
                "has no outer end; a bore is part of the shape of the body around it"
            yield SceneError(f"'{shape.kind}' {what}, and the tool is to deform; allowed: {', '.join(MESHED)}",
                             key=f"{key}.shape", got=shape.kind, allowed=list(MESHED))
            continue
        yield from _size_problems(scene, key, solid)
        if part is not None:
            yield from _face_problems(scene, key, solid, [shape])
    for name in names:
        shapes = [solid.shape for _, _, _, solid in (s for s in solids_of(scene) if s[0] == name)]
        yield from _face_problems(scene, f"tools.{name}", scene.tools[name], shapes)


def tool_point_problems(scene):
    """SceneErrors of tracked points that lie outside the tool or part they belong to."""
    shapes = {part or name: solid.shape for name, part, _, solid in solids_of(scene)}
    for name, point in scene.points.items():
        shape = shapes.get(point.body)
        if shape is None or shape.file is not None or shape.kind not in MESHED:
            continue
        size = float(np.ptp(shape.bounds(), axis=0).max())
        if shape.depth([point.at])[0] < -2e-3 * size:
            at = ", ".join(f"{x:g}" for x in point.at)
            yield SceneError(f"({at}) lies outside '{point.body}'", key=f"points.{name}.at", got=point.at,
                             allowed="a point of the body")


def _material_problems(scene, body, solid):
    material = scene.materials[solid.material]
    for key in ("young", "poisson"):
        if getattr(material, key) is None:
            sentence = f"is missing; '{body}' is made of '{solid.material}' and deforms elastically"
            yield SceneError(sentence, key=f"materials.{solid.material}.{key}", allowed="an elastic constant")
            return
    try:
        _ = material.elasticity
    except SceneError as error:
        sentence = str(error).removeprefix(f"{error.key}: ")
        yield SceneError(sentence, key=f"materials.{solid.material}.{error.key}", got=error.got, allowed=error.allowed)


def _size_problems(scene, key, solid):
    shape, size = solid.shape, solid.mesh_size
    if shape.file is not None:
        if size is not None and str(shape.file).endswith(".msh"):
            yield SceneError("the file holds a mesh already; leave it out", key=f"{key}.mesh_size", got=size.far)
        return
    bounds = np.asarray(shape.bounds())
    if scene.geometry == "axisymmetric" and shape.kind != "circle" and bounds[0, 0] < -1e-6 * np.ptp(bounds, axis=0).max():
        sentence = f"reaches r = {bounds[0, 0]:g} mm; the radius r is not negative"
        yield SceneError(sentence, key=f"{key}.shape", got=float(bounds[0, 0]))
    if size is None:
        return
    extent = float(np.ptp(bounds, axis=0).max())
    if size.contact > extent:
        sentence = f"{size.contact:g} mm is larger than the body, {extent:g} mm"
        yield SceneError(sentence, key=f"{key}.mesh_size", got=size.contact, allowed=f"below {extent:g}")
    elif hasattr(shape, "volume_or_area"):
        yield from too_fine(scene.dimension, shape.volume_or_area(), size.far, f"{key}.mesh_size")


def _face_problems(scene, key, solid, shapes):
    """Faces that no shape has, axes that the scene has not, components of tractions."""
    known = None if any(shape.file is not None for shape in shapes) else _faces(scene, shapes)
    for table in ("held", "loads", "springs"):
        for face in getattr(solid, table):
            if known is not None and face not in known:
                yield unknown_word(f"'{face}' is not a face of the body", face, known, f"{key}.{table}.{face}")
    axes = [(f"held.{face}", axis) for face, shifts in solid.held.items() for axis in shifts]
    axes += [(f"springs.{face}.axis", bed.axis) for face, bed in solid.springs.items() if bed.axis is not None]
    for where, axis in axes:
        if axis not in scene.axes:
            yield unknown_word(f"'{axis}' is not an axis of '{scene.geometry}'", axis, scene.axes, f"{key}.{where}")
    for face, load in solid.loads.items():
        if load.traction is not None and len(load.traction) != scene.dimension:
            sentence = f"has {len(load.traction)} components; '{scene.geometry}' has the axes {', '.join(scene.axes)}"
            yield SceneError(sentence, key=f"{key}.loads.{face}.traction", got=load.traction, allowed=scene.dimension)


def _faces(scene, shapes):
    """Names of the faces that at least one of the shapes has, those of the flat ends first."""
    bounds = np.array([shape.bounds() for shape in shapes])
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    slack, found = 1e-6 * np.ptp([low, high], axis=0).max(), []
    for number, axis in enumerate(scene.axes):
        for end, value in (("low", low[number]), ("high", high[number])):
            if axis == "r" and end == "low" and value <= slack:
                continue                       # the axis of rotation is no face
            if any(_is_flat(shape, number, value, slack) for shape in shapes):
                found.append(f"{axis}_{end}")
    found.append("surface")
    if any(shape.kind == "cylinder" for shape in shapes):
        found.append("mantle")
    if any(getattr(shape, "neck", None) for shape in shapes):
        found.append("neck")
    sides = max((len(shape.corners) for shape in shapes if hasattr(shape, "corners")), default=0)
    rounded = {k + 1 for shape in shapes if hasattr(shape, "corners") for k, r in enumerate(shape.radii) if r > 0}
    return found + [f"side_{k}" for k in range(1, sides + 1)] + [f"fillet_{k}" for k in sorted(rounded)]


def _is_flat(shape, axis, value, slack):
    """Whether a shape has a flat face across an axis at a coordinate; a round one cut in half has its cut."""
    if hasattr(shape, "corners"):
        on = np.abs(shape.corners[:, axis] - value) <= slack
        return bool((on & np.roll(on, -1)).any())
    if shape.kind == "cylinder":
        along = abs(shape.axis[axis]) / np.linalg.norm(shape.axis)
        return bool(along > 1 - 1e-12 and np.abs(shape.bounds()[:, axis] - value).min() <= slack)
    return shape.kind == "box" and bool(np.abs(shape.bounds()[:, axis] - value).min() <= slack)
