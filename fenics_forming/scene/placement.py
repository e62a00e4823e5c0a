"""Where the bodies, tools and points of a scene are: overlaps, mirror planes. Samples, no mesh."""

import numpy as np

from ..errors import SceneError

TOLERANCE = 1e-6
"""Of lengths, relative to the size of the body."""

def placement_problems(scene):
    """SceneErrors of what lies where it cannot."""
    for name, body in scene.workpieces.items():
        key = f"workpieces.{name}"
        if body.shape.file is not None:
            continue
        size = float(np.ptp(body.shape.bounds(), axis=0).max())
        ball = body.shape.kind == "circle" and body.shape.centre[0] == 0
        if scene.geometry == "axisymmetric" and body.shape.bounds()[0, 0] < -TOLERANCE * size and not ball:
            low = body.shape.bounds()[0, 0]
            yield SceneError(
                f"reaches r = {low:g} mm; the radius r is not negative", key=f"{key}.shape", got=float(low)
            )
            continue
        yield from _mirror_problems(scene, key, body, size)
        yield from _overlap_problems(scene, name, body, size)
        yield from _stop_problems(scene, body, size)
        yield from _point_problems(scene, name, body, size)
        yield from _line_problems(scene, name, body, size)


def placement_warnings(scene):
    """Sentences about what lies where it is probably not meant to."""
    shapes = [body.shape for body in scene.workpieces.values()]
    if all(shape.file is None for shape in shapes):
        extent = np.ptp(_bounds_together(shapes), axis=0).max()
        samples = np.concatenate([shape.boundary_points(extent / 400) for shape in shapes])
        for tool_name in scene.driven_tools:
            shape = scene.tools[tool_name].shape
            if shape.file is None and (gap := float(-shape.depth(samples).max())) > extent:
                yield f"tools.{tool_name}.shape: starts {gap:.3g} mm away from the body, more than the body is large"
    if len(scene.tools) == 1:
        yield from _unopposed(scene)


def _bounds_together(shapes):
    """Lowest and highest coordinates of several shapes, (2, dim)."""
    bounds = np.array([shape.bounds() for shape in shapes])
    return np.array([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def _mirror_problems(scene, key, body, size):
    low = body.shape.bounds()[0]
    planes = [(scene.axes.index(axis), axis) for axis in body.symmetry]
    for number, axis in planes:
        if not _has_flat_low_face(body.shape, number, low[number], size):
            sentence = f"'{axis}': the body has no flat low face on this axis, which would be the mirror plane"
            yield SceneError(sentence, key=f"{key}.symmetry", got=axis, allowed="axes with a flat low face")
    if scene.geometry == "axisymmetric" and low[0] <= TOLERANCE * size:
        planes = [(0, "r"), *planes]
    if not hasattr(body.shape, "corners"):
        return
    for corner, radius in zip(body.shape.corners, body.shape.radii, strict=True):
        for number, axis in planes:
            if radius > 0 and corner[number] <= low[number] + TOLERANCE * size:
                where = "axis of rotation" if axis == "r" else f"mirror plane of '{axis}'"
                at = ", ".join(f"{x:g}" for x in corner)
                sentence = f"would round the corner ({at}) on the {where}; give one radius for each corner, 0 there"
                yield SceneError(sentence, key=f"{key}.shape.fillet", got=body.shape.fillet, allowed="0 there")
                return


def _has_flat_low_face(shape, number, low, size):
    if hasattr(shape, "corners"):
        on_plane = np.abs(shape.corners[:, number] - low) <= TOLERANCE * size
        return bool(np.any(on_plane & np.roll(on_plane, -1)))
    if shape.kind == "circle":
        return True          # mirrored through its centre: the half above it is meshed
    if shape.kind == "cylinder":
        along = np.abs(np.array(shape.axis)[number]) / np.linalg.norm(shape.axis)
        return bool(along > 1 - 1e-12 or along < 1e-12)
    return shape.kind == "box"


def _overlap_problems(scene, name, body, size):
    samples = body.shape.boundary_points(size / 400)
    for tool_name, tool in scene.tools.items():
        if tool.shape.file is not None:
            continue
        # arcs are compared as polygons of 72 sides a turn, whose sides lie 0.1 % of the radius inside
        slack = TOLERANCE * size + 1e-3 * max(_largest_radius(tool.shape), _largest_radius(body.shape))
        depth = tool.shape.depth(samples)
        worst, point = depth.max(), samples[depth.argmax()]
        if hasattr(tool.shape, "boundary_points") and hasattr(body.shape, "depth"):
            corners = tool.shape.boundary_points(size / 400)
            inside = body.shape.depth(corners)
            if inside.max() > worst:
                worst, point = inside.max(), corners[inside.argmax()]
        if worst > slack:
            at = ", ".join(f"{x:.4g}" for x in point)
            rounded = worst < 0.5 * _largest_radius(tool.shape)      # a right corner loses 0.41 of the radius
            advice = (
                "move it, or do not round a hollow corner that the body fills: fillet may be one radius for each point"
                if rounded
                else "move it, or turn its normal or side towards the workpiece"
            )
            sentence = f"overlaps the workpiece '{name}' at the start, {worst:.3g} mm deep at ({at}); {advice}"
            yield SceneError(sentence, key=f"tools.{tool_name}.shape", got=float(worst), allowed="no overlap")


def _largest_radius(shape):
    return float(np.max(shape.fillet)) if hasattr(shape, "fillet") else 0.0


def _stop_problems(scene, body, size):
    name = scene.counting_tool
    drive = scene.tools[name].drive if name is not None else None
    if drive is None or drive.direction is None:
        return
    shapes = [b.shape for b in scene.workpieces.values() if b.shape.file is None]
    height = float(np.ptp(np.concatenate([s.boundary_points(size / 100) for s in shapes]) @ drive.direction))
    if scene.stop.height is not None and scene.stop.height >= height * (1 - 1e-9):
        sentence = f"{scene.stop.height:g} mm is not below the height at the start, {height:g} mm"
        yield SceneError(sentence, key="stop.height", got=scene.stop.height, allowed=f"below {height:g}")
    number = int(np.argmax(np.abs(drive.direction)))
    along_axis = drive.direction[number] < -1 + 1e-12 and scene.axes[number] in body.symmetry
    shape = scene.tools[name].shape
    if scene.stop.stroke is not None and along_axis and shape.kind == "plane":
        reach = shape.point[number] - body.shape.bounds()[0, number]
        flat = shape.unit_normal[number] < -1 + 1e-12
        if flat and scene.stop.stroke >= reach:
            sentence = f"{scene.stop.stroke:g} mm takes the tool '{name}' to the mirror plane, {reach:g} mm away"
            yield SceneError(sentence, key="stop.stroke", got=scene.stop.stroke, allowed=f"below {reach:g}")


def _point_problems(scene, name, body, size):
    for point_name, point in scene.points.items():
        if point.body == name:
            yield from _outside(name, body, size, point.at, f"points.{point_name}.at")


def _line_problems(scene, name, body, size):
    for line_name, line in scene.flow_lines.items():
        if line.body == name:
            yield from _outside(name, body, size, line.from_, f"flow_lines.{line_name}.from")
            yield from _outside(name, body, size, line.to, f"flow_lines.{line_name}.to")


def _outside(name, body, size, point, key):
    samples = body.shape.boundary_points(size / 400)
    on_boundary = _distance_to_body(body.shape, point, samples) <= 2e-3 * size
    if not body.shape.contains([point])[0] and not on_boundary:
        centre = body.shape.bounds().mean(axis=0)
        sentence = f"({_listed(point)}) lies outside the workpiece '{name}', which is centred at ({_listed(centre)})"
        yield SceneError(sentence, key=key, got=point, allowed="a point of the body")


def _distance_to_body(shape, point, samples):
    if hasattr(shape, "depth"):
        return max(0.0, -float(shape.depth([point])[0]))
    return float(np.linalg.norm(samples - np.array(point), axis=1).min())


def _listed(vector):
    return ", ".join(f"{x:g}" for x in vector)


def _unopposed(scene):
    name, tool = next(iter(scene.tools.items()))
    direction = tool.drive.direction if tool.drive is not None else None
    if direction is None:
        return
    number = int(np.argmax(np.abs(direction)))
    hollow = getattr(tool.shape, "hollow", False) or hasattr(tool.shape, "points")
    mirrored = {axis for body in scene.workpieces.values() for axis in body.symmetry}
    if scene.axes[number] not in mirrored and not hollow:
        yield f"workpieces.{scene.workpiece_name}: nothing opposes the tool '{name}'; add a tool or a mirror plane"
