"""Where the tools of a scene are at a time of its run, as lines for a picture."""

from __future__ import annotations

import numpy as np


def tool_outlines(results, time: float, points: np.ndarray, mirrors=()) -> list[np.ndarray]:
    """Outlines of the tools of the scene at a time (s), near the body.

    Parameters
    ----------
    results : `Results` with a scene
    points : (n, d) mm, the body
    mirrors : (axis, position) of the planes at which the picture is mirrored; outlines end there

    Returns
    -------
    segments (k, 2, 2), in space triangles (k, 3, 3), for each tool; none without a scene
    """
    if not getattr(results.scene, "tools", None) or results.scene.is_tools_alone:
        return []
    from ...physics.contact.drawing import clip
    from ...physics.tools import known_tools

    low, high = points.min(axis=0), points.max(axis=0)
    size = np.linalg.norm(high - low)
    low, high = low - 0.2 * size, high + 0.2 * size
    for axis, at in mirrors:
        low[axis] = at
    outlines = []
    for tool in known_tools(results.scene):
        place = _motion(results, tool.name, time)
        far = 2 * size + np.linalg.norm(place(np.zeros((1, points.shape[1]))))
        vertices, segments = tool.surface.outline(low - far, high + far)
        vertices, segments = clip(place(np.asarray(vertices)), np.asarray(segments), low, high)
        outlines.append(vertices[segments])
    return outlines


def as_segments(outline) -> np.ndarray:
    """A line through points (k, 2) as segments (k - 1, 2, 2)."""
    outline = np.asarray(outline, float)
    return np.stack([outline[:-1], outline[1:]], axis=1)


def flipped(outline: np.ndarray, axis: int, at: float) -> np.ndarray:
    """The mirror image of segments."""
    image = outline.copy()
    image[..., axis] = 2 * at - image[..., axis]
    return image


def _motion(results, tool, time):
    """f(points (n, 2)) → where they are at a time: turned about the centre of rotation, then moved along."""
    drive = results.scene.tools[tool].drive
    if drive is None:
        return lambda points: points
    shift = _displacement(results, tool, drive, time)
    if drive.rotation_centre is None:
        return lambda points: points + shift
    centre, turn = np.asarray(drive.rotation_centre), _turn(drive.angle(time), drive.rotation_axis, len(shift))
    return lambda points: (points - centre) @ turn.T + centre + shift


def _turn(angle, axis, dimension):
    """Matrix of a turn by an angle, in space about an axis (Rodrigues)."""
    cos, sin = np.cos(angle), np.sin(angle)
    if dimension == 2:
        return np.array([[cos, -sin], [sin, cos]])
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + sin * cross + (1 - cos) * cross @ cross


def _displacement(results, tool, drive, time):
    """Displacement by the drive; where only the run knew it, as of a hammer, by the stroke in the history."""
    stroke = f"stroke_{tool}_mm"
    if drive.direction is None or stroke not in results.history.columns:
        return np.asarray(drive.displacement(time))
    travel = np.interp(time, results.history.column("time_s"), results.history.column(stroke))
    if np.isclose(travel, drive.travel(time), rtol=1e-3, atol=1e-6):
        return np.asarray(drive.displacement(time))
    return travel * np.asarray(drive.direction)
