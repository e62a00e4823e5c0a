"""A new mesh of order 2 for a plane body (plane strain, axisymmetric)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import MeshError
from ..gmsh_arrays import split_corner_cells
from . import mmg
from .body_arrays import BodyArrays, Remeshed, boundary_sides, keys
from .corner_cells import turned
from .crossing import crossing, curved_crossing
from .curve import Curve
from .filling import fill
from .gradation import edges_of, over_mesh
from .landing import Landing
from .outline import loops
from .quality import scaled_jacobian
from .resampling import Boundary, Outline

ATTEMPTS = 4         # with finer and finer sides where the one before failed
CURVED = 2           # of them look at the curves of the sides; what still crosses then is less than such fine sides resolve
FLATTEST = 0.25      # scaled Jacobian of a cell behind a curved side; below, the side is halved


def remesh(body: BodyArrays, labels: np.ndarray, sizes, *, chord: float | None, corner_angle: float, engine: str,
           least: float | None, landing: Landing | None, corners: np.ndarray | None = None) -> Remeshed:
    """See `fenics_forming.physics.remeshing.remesh`.

    Coarse sides may cross each other and a cell may have no room for the curve of its side: such sides get finer
    in the next attempt; where an engine fails, all sides do. A side that folds its cell over in every attempt is straight.
    """
    detail = None if least is None else lambda points: np.minimum(least, sizes(points))
    chains, changes = loops(body, labels, corner_angle, landing, detail, corners)
    curves = [[Curve(chain, detail) for chain in loop] for loop in chains]
    boundary = Boundary(curves, sizes, _around(body, sizes), chord, least)
    best, room, folded, reasons = None, 0.0, None, {}
    for attempt in range(1, ATTEMPTS + 1):
        outline = boundary.resample()
        crossed = crossing(outline.points, outline.sides)
        if attempt <= CURVED:
            crossed |= curved_crossing(outline.points, outline.sides, outline.middles)
        if crossed.any():
            place = ", ".join(f"{c:.6g}" for c in outline.points[outline.sides[np.argmax(crossed), 0]])
            reasons["boundary"] = f"its boundary crosses itself at ({place}) mm"
            boundary.refine(outline.spans[crossed])
            continue
        found = _filled(outline, sizes, engine, reasons)
        if found is None:
            boundary.refine()
            continue
        new, spans, least = found
        if least > room:
            best, room = new, least
        elif best is None:
            folded = new
        if least >= FLATTEST:
            break
        boundary.refine(spans)
    best = best or _straightened(folded)
    if best is None:
        raise MeshError(f"the body could not be meshed anew: {'; '.join(reasons.values())}")
    made = replace(best, healed=tuple(changes))
    made.__dict__["sides"] = best.sides       # which a copy would look for again
    return made


def _around(body: BodyArrays, sizes) -> np.ndarray:
    """Wanted sizes at the vertices of the old mesh, small also near by where they are small; (n,), infinite elsewhere.

    A coarse side next to small cells would be the base of flat ones.
    """
    triangles = body.cells[:, :3]
    size, vertices = np.full(len(body.x), np.inf), np.zeros(len(body.x), dtype=bool)
    vertices[triangles] = True
    size[vertices] = sizes(body.x[vertices])
    return over_mesh(size, *edges_of(body.x, triangles))


def _filled(outline: Outline, sizes, engine: str, reasons: dict[str, str]) -> tuple[Remeshed, np.ndarray, float] | None:
    """The first mesh that an engine gives, the spans of the sides at cells without room, the least scaled Jacobian."""
    for name in _engines(engine):
        try:
            x, triangles, sides = fill(outline, sizes, name)
        except RuntimeError as error:
            reasons[name] = f"{name}: {error}"
            continue
        new = _order_two(x, turned(x, triangles, sides), sides, outline, name)
        room = scaled_jacobian(new.x, new.cells)
        if room.min() <= 0.0:
            reasons[name] = f"{name}: a curved side folds its cell over"
        flat = np.zeros(len(new.x), dtype=bool)
        flat[new.cells[room < FLATTEST]] = True
        return new, outline.spans[flat[sides].any(axis=1)], float(room.min())
    return None


def _straightened(made: Remeshed | None) -> Remeshed | None:
    """The mesh with straight sides where their curves fold cells over; None where that does not help."""
    if made is None:
        return None
    flat = np.zeros(len(made.x), dtype=bool)
    flat[made.cells[scaled_jacobian(made.x, made.cells) <= 0.0, 3:]] = True
    sides, x = made.sides[flat[made.sides[:, 2]]], made.x.copy()
    x[sides[:, 2]] = x[sides[:, :2]].mean(axis=1)
    straight = replace(made, x=x)
    straight.__dict__["sides"] = made.sides
    return straight if scaled_jacobian(x, made.cells).min() > 0.0 else None


def _engines(engine: str) -> list[str]:
    if engine == "mmg" and not mmg.installed():
        raise MeshError("mmg is to mesh the body anew, but mmgpy is not installed; 'auto' and 'gmsh' do without it")
    return (["mmg"] if mmg.installed() else []) + ["gmsh"] if engine == "auto" else [engine]


def _order_two(x: np.ndarray, triangles: np.ndarray, sides: np.ndarray, outline: Outline, engine: str) -> Remeshed:
    """Triangles raised to order 2: mid-nodes half-way inside, those of the outline on its sides."""
    count = len(x)
    key, mid = np.unique(keys(triangles[:, [[1, 2], [0, 2], [0, 1]]].reshape(-1, 2), count), return_inverse=True)
    first, second = np.divmod(key, count)
    middle = 0.5 * (x[first] + x[second])
    on_side = np.searchsorted(key, keys(sides, count))
    middle[on_side] = outline.middles
    cells = np.concatenate([triangles, count + mid.reshape(-1, 3)], axis=1)
    x = np.concatenate([x, middle])
    outside = np.zeros(len(x), dtype=bool)
    outside[count + on_side] = True
    if (outside[cells[:, 3:]].sum(axis=1) > 1).any():
        x, cells = split_corner_cells(x, cells, 2)
    new = boundary_sides(cells, 2, x)
    # the mid-node tells the side, also after cells have been cut
    label = np.zeros(len(x), dtype=np.int64)
    label[count + on_side] = outline.labels
    made = Remeshed(x=x, cells=cells, labels=label[new[:, 2]], engine=engine)
    made.__dict__["sides"] = new       # the property of that name, known already
    return made

