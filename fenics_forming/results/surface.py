"""The surface of a section as curves with arc length, and the contact pressure along it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .files import ResultsError
from .pictures.drawing import AXES, frame_of, label_of, mirrors_of, new_axes, saved, when
from .pictures.skin import Skin

ON_PLANE = 1e-6    # of the size of the body: sides nearer to a mirror plane lie on it


@dataclass(frozen=True)
class SurfaceCurve:
    """One connected piece of the surface of a section, without its sides on mirror planes and the axis.

    Attributes
    ----------
    points : (n, 2) mm, in order
    arc : (n,) mm, length along the surface from the first point
    values : (n,) of the field
    """

    points: np.ndarray
    arc: np.ndarray
    values: np.ndarray


def contact_pressure(results, frame: int = -1, *, field: str = "contact_pressure") -> list[SurfaceCurve]:
    """The contact pressure, MPa, or another field along the surface of the bodies of a plane or axisymmetric run.

    A curve begins at the axis or mirror plane where it meets one, else at its lowest point. Nodal values are means over
    the sides that meet in a node, so that the pressure falls to zero over one element at the edge of contact.

    Raises
    ------
    ResultsError
        if there is no such frame or field, or the body is one in space.
    """
    _, paths = frame_of(results, frame)
    skin = Skin.read(paths)
    if skin.points.shape[1] == 3:
        raise ResultsError("a body in space has no surface curve; draw contact_pressure with plot_fields")
    _, values = skin.field(field)
    axes = AXES.get(getattr(results.scene, "geometry", None), "xy")
    mirrors = mirrors_of(results.scene, axes, skin.points)
    sides = skin.sides()[1]
    size = np.ptp(skin.points, axis=0).max()
    for axis, at in mirrors:
        on = np.abs(skin.points[:, axis] - at) <= ON_PLANE * size
        sides = sides[~on[sides].all(axis=1)]
    return [_curve(skin.points, values, nodes, mirrors) for nodes in _chains(sides)]


def plot_contact_pressure(results, frame: int | list[int] = -1, *, path: Path | str | None = None, ax=None):
    """Contact pressure over the arc length along the surface, in one frame or several.

    Parameters
    ----------
    results : `Results` of a plane or axisymmetric run with frames
    frame : number of the frame, or a list of them; negative ones count from the end
    path : picture to write
    ax : matplotlib axes to draw in; None: a new figure

    Returns
    -------
    the matplotlib axes
    """
    frames = list(frame) if isinstance(frame, (list, tuple)) else [frame]
    ax = ax or new_axes()
    for number in frames:
        curves = contact_pressure(results, number)
        first = when(results, frame_of(results, number)[0])
        for order, curve in enumerate(curves):
            label = first if len(curves) == 1 else f"{first}, surface {order + 1}"
            (line,) = ax.plot(curve.arc, curve.values, linewidth=1.6, label=label)
            if len(frames) == len(curves) == 1:
                ax.fill_between(curve.arc, curve.values, color=line.get_color(), alpha=0.15, linewidth=0)
    near_zero = 1e-9 * np.ptp(curves[0].points) if curves else 0.0
    start = ", ".join(f"{x if abs(x) > near_zero else 0.0:.3g}" for x in curves[0].points[0]) if curves else ""
    ax.set_xlabel(f"length along the surface from ({start}) (mm)")
    ax.set_ylabel(label_of("contact_pressure_MPa"))
    ax.grid(True, linewidth=0.5, alpha=0.4)
    ax.margins(x=0.02)
    ax.spines[["top", "right"]].set_visible(False)
    if len(ax.get_lines()) > 1:
        ax.legend(frameon=False, fontsize="small")
    else:
        ax.set_title(f"{results.title}\n{first}", fontsize="medium")
    return saved(ax, path)


def _chains(sides):
    """Nodes in order of every connected chain of sides (k, 3); of a closed one the first node is also the last."""
    at = {}
    for number, (start, _, end) in enumerate(sides):
        at.setdefault(int(start), []).append(number)
        at.setdefault(int(end), []).append(number)
    left, chains = set(range(len(sides))), []
    while left:
        ends = [node for node, near in at.items() if len(near) == 1 and near[0] in left]
        node = min(ends) if ends else int(sides[min(left), 0])
        chain = [node]
        while (here := next((n for n in at[node] if n in left), None)) is not None:
            left.remove(here)
            start, middle, end = (int(n) for n in sides[here])
            node = end if node == start else start
            chain += [middle, node]
        chains.append(np.array(chain))
    return chains


def _curve(points, values, nodes, mirrors):
    """The curve through ``nodes``, begun where it meets a mirror plane, or at its lowest point."""
    if nodes[0] == nodes[-1]:
        lowest = int(np.lexsort(points[nodes[:-1]].T)[0])
        nodes = np.concatenate([nodes[lowest:-1], nodes[: lowest + 1]])
    else:
        far = [min((abs(points[end, axis] - at) for axis, at in mirrors[:1]), default=0.0) for end in nodes[[0, -1]]]
        nodes = nodes[::-1] if far[1] < far[0] else nodes
    way = points[nodes]
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    return SurfaceCurve(way, arc, values[nodes])
