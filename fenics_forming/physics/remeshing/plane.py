"""A new mesh of order 2 for a plane body (plane strain, axisymmetric)."""

from __future__ import annotations

import numpy as np

from ...errors import MeshError
from ..meshing import split_corner_cells
from . import mmg
from .body_arrays import BodyArrays, Remeshed, boundary_sides, keys
from .curve import Curve
from .filling import fill
from .outline import loops
from .resampling import Outline, resample

FINER = (1.0, 1.5, 2.5)      # sides of the boundary where the engines fail: a coarser one may cut itself


def remesh(body: BodyArrays, labels: np.ndarray, sizes, *, chord: float | None, corner_angle: float,
           engine: str) -> Remeshed:
    """See `fenics_forming.physics.remeshing.remesh`."""
    curves = [[Curve(chain) for chain in loop] for loop in loops(body, labels, corner_angle)]
    reasons = []
    for finer in FINER:
        outline = resample(curves, sizes, chord, finer)
        for name in _engines(engine):
            try:
                x, triangles, sides = fill(outline, sizes, name)
            except RuntimeError as error:
                reasons.append(f"{name}: {error}")
                continue
            return _order_two(x, triangles, sides, outline, name)
    raise MeshError(f"the body could not be meshed anew ({'; '.join(dict.fromkeys(reasons))}); "
                    "its boundary may cross itself")


def _engines(engine: str) -> list[str]:
    return (["mmg"] if mmg.installed() else []) + ["gmsh"] if engine == "auto" else [engine]


def _order_two(x: np.ndarray, triangles: np.ndarray, sides: np.ndarray, outline: Outline, engine: str) -> Remeshed:
    """Triangles raised to order 2: mid-nodes half-way inside, those of the outline on its sides."""
    count = len(x)
    edges = np.sort(triangles[:, [[1, 2], [0, 2], [0, 1]]].reshape(-1, 2), axis=1)
    key, first, mid = np.unique(keys(edges, count), return_index=True, return_inverse=True)
    middle = 0.5 * x[edges[first]].sum(axis=1)
    on_side = np.searchsorted(key, keys(sides, count))
    middle[on_side] = outline.middles
    cells = np.concatenate([triangles, count + mid.reshape(-1, 3)], axis=1)
    x, cells = split_corner_cells(np.concatenate([x, middle]), cells, 2)
    new = boundary_sides(cells, 2, x)
    # the mid-node tells the side, also after cells have been cut
    label = np.zeros(len(x), dtype=np.int64)
    label[count + on_side] = outline.labels
    return Remeshed(x=x, cells=cells, labels=label[new[:, 2]], engine=engine)

