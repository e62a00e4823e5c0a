"""An axisymmetric body as it stands in space: its section turned about the axis, with a piece cut out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..files import ResultsError
from . import in_space as plotting3d
from .drawing import AXES, frame_of, label_of, limits_of, mirrors_of, when, wrapped
from .in_plane import levels_of
from .skin import Skin

STEP = 7.5    # degrees between two nodes on the round: a chord lies 0.2 % of the radius inside


def plot_revolved(results, field: str | None = "effective_strain", frame: int = -1, *, angle: float = 270.0,
                  path: Path | str | None = None, mesh: bool = False, limits=None):
    """A field on the body of an axisymmetric run, turned about its axis, in space.

    Parameters
    ----------
    results : `Results` of an axisymmetric run with frames
    field : name of a field, with or without its unit; None: the shape
    frame : number of the frame; negative ones count from the end
    angle : how far the section is turned, degrees; less than 360 lets one look inside
    path : picture to write
    mesh : draw the sides of the elements
    limits : (low, high) of the colours; None: of the field

    Returns
    -------
    the picture (height, width, 3)

    Raises
    ------
    ResultsError
        if the run is not axisymmetric, or has no such frame or field.
    """
    if getattr(results.scene, "geometry", None) != "axisymmetric":
        raise ResultsError("only an axisymmetric body can be turned about its axis; use plot_fields")
    time, paths = frame_of(results, frame)
    skin = Skin.read(paths)
    label, levels = "", None
    if field is not None:
        name, values = skin.field(field)
        label, levels = label_of(name), levels_of(limits or limits_of(skin, values), 10)
    for axis, at in mirrors_of(results.scene, AXES["axisymmetric"], skin.points)[1:]:
        skin = skin.mirrored(axis, at)
    solid, rims = turned(skin, angle)
    values = None if field is None else solid.field(field)[1]
    title = f"{wrapped(results.title)}\n{when(results, time)}"
    return plotting3d.draw(solid, values, label, levels, title, mesh=mesh, lines=rims, path=path)


def turned(skin: Skin, angle: float = 270.0) -> tuple[Skin, list[np.ndarray]]:
    """The skin in space of a section (r, z) turned by an angle (degrees), and the outlines of its cut faces.

    The gap faces (1, 1, 1), from where pictures look.
    """
    first, whole = np.radians(45 + (360 - angle) / 2), angle >= 360
    rim = skin.sides()[1]
    rim = rim[np.abs(skin.points[rim, 0]).max(axis=1) > 1e-9 * np.ptp(skin.points, axis=0).max()]
    count = max(2, round(angle / (2 * STEP)))
    turns = first + np.radians(angle) * np.arange(2 * count + 1) / (2 * count)
    n, used = len(skin.points), np.unique(rim)
    position = np.zeros(n, dtype=int)
    position[used] = np.arange(len(used))
    ends = [] if whole else [turns[0], turns[-1]]
    nodes = [*([np.arange(n)] * len(ends)), *([used] * len(turns))]
    points = np.concatenate([_placed(skin.points[k], t) for k, t in zip(nodes, [*ends, *turns], strict=True)])
    faces = [skin.faces + k * n for k in range(len(ends))] + [_round(position[rim], len(used), count) + len(ends) * n]
    fields = {name: values[np.concatenate(nodes)] for name, values in skin.fields.items()}
    outlines = [_placed(skin.points[side], t) for t in ends for side in rim]
    return replace(skin, points=points, faces=np.concatenate(faces), fields=fields), outlines


def _placed(points, angle):
    r, z = points.T
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def _round(sides, layer, count):
    """Two six-node triangles for every side (start, middle, end) and every double step of the turn."""
    low = 2 * layer * np.arange(count)[:, None]
    a, m, b = ([sides[:, k] + low + level * layer for level in range(3)] for k in range(3))
    one = np.stack([a[0], b[0], b[2], m[0], b[1], m[1]], axis=-1)
    two = np.stack([a[0], b[2], a[2], m[1], m[2], a[1]], axis=-1)
    return np.concatenate([one, two]).reshape(-1, 6)
