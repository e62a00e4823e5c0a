"""A new mesh of order 2 for a body whose old one has become poor: the same boundary, the wanted sizes."""

from __future__ import annotations

import numpy as np

from .body_arrays import BodyArrays, Remeshed, boundary_sides
from .landing import Landing

__all__ = ["BodyArrays", "Landing", "Remeshed", "boundary_sides", "remesh"]


def remesh(body: BodyArrays, labels: np.ndarray, sizes, *, chord: float | None = None, corner_angle: float = 40.0,
           engine: str = "auto", least: float | None = None, landing: Landing | None = None,
           corners: np.ndarray | None = None) -> Remeshed:
    """Mesh a body anew, on one rank.

    The new boundary lies on the old one, vertices and mid-nodes alike. Corners, the ends of runs of one label and
    the ends of mirror planes stay where they are; nodes on a mirror plane have exactly its coordinate; no side
    has two labels. The same input gives the same mesh.

    Parameters
    ----------
    labels : (f,) label of each of ``body.sides``, see `Remeshed`
    sizes : callable, points (k, dim) in mm to wanted element sizes (k,) in mm
    chord : largest distance between a straight side and the surface, mm; none: only `sizes` and the curvature count
    corner_angle : a boundary that turns by more than this, in degrees, has a corner (an edge in 3-D)
    least : of a plane body: curvature, chord and short runs ask for no finer sides, mm
    landing : of a plane body: what hovers just above tools lands on them, see `Landing`
    corners : (k, dim) places where the boundary, of a solid its kept lines, has a corner, whatever its shape
    engine : "mmg", "gmsh", or "auto": mmg where it is installed, gmsh otherwise and as its rescue

    Raises
    ------
    MeshError
        in one sentence, when no engine could mesh the body.
    """
    if body.dim == 2:
        from . import plane
        return plane.remesh(body, labels, sizes, chord=chord, corner_angle=corner_angle, engine=engine, least=least,
                            landing=landing, corners=corners)
    from . import solid
    return solid.remesh(body, labels, sizes, chord=chord, corner_angle=corner_angle, engine=engine, corners=corners)
