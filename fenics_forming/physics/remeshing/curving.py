"""From a straight mesh to order 2 on the old quadratic surface, without turning a cell inside out."""

from __future__ import annotations

import basix
import numpy as np

from ..locating import slopes
from ..nodes import QUADRATURE_DEGREE
from .features import FACET_EDGES
from .straight import Straight, cell_edges, volumes
from .surface import OldSurface, level, place_mids, place_vertices

LEAST = 0.1             # of the largest Jacobian of a cell: the smallest one that is let be
FRACTIONS = (0.75, 0.5, 0.25, 0.0)


def vertices_placed(mesh: Straight, surface: OldSurface) -> Straight:
    """Boundary vertices on the old surface; where that flattens a cell, back to where they were in fractions."""
    placed, share = place_vertices(mesh, surface), np.ones(len(mesh.x))
    before = volumes(mesh.x, mesh.cells)
    x = placed
    for fraction in FRACTIONS:
        flat = volumes(x, mesh.cells) < LEAST * before
        if not flat.any():
            break
        share[mesh.cells[flat]] = fraction
        x = mesh.x + share[:, None] * (placed - mesh.x)
        level(x, mesh.facets, mesh.patch, surface)
    return mesh.moved(x)


def raised(mesh: Straight, surface: OldSurface) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Order 2: nodes (n, 3), cells (m, 10), the mid-nodes of the facets (f, 3) and the patch of each facet (f,).

    The mid-nodes of the boundary lie on the old surface; where the Jacobian of a cell would fall below a tenth of
    its largest, they go back towards the middle of their edge in fractions.
    """
    n = len(mesh.x)
    edges, number = cell_edges(mesh.cells)
    key = edges[:, 0] * n + edges[:, 1]

    def middle(ends):
        low, high = np.sort(ends, axis=1).T
        return n + np.searchsorted(key, low * n + high)

    cells = np.concatenate([mesh.cells, n + number], axis=1)
    mids = np.stack([middle(mesh.facets[:, list(e[:2])]) for e in FACET_EDGES], axis=1)
    lines = np.concatenate([mesh.lines, middle(mesh.lines)[:, None]], axis=1)
    straight = np.concatenate([mesh.x, mesh.x[edges].mean(axis=1)])
    sides = np.concatenate([mesh.facets, mids], axis=1)
    x = place_mids(straight, sides, mesh.patch, lines, mesh.line, surface)
    curved = np.flatnonzero((x != straight).any(axis=1))
    touched = np.isin(cells, curved).any(axis=1)
    placed, share = x, np.ones(len(x))
    for fraction in FRACTIONS:
        bad = np.zeros(len(cells), bool)
        bad[touched] = _least_jacobian(x, cells[touched]) < LEAST
        if not bad.any():
            break
        share[cells[bad, 4:]] = fraction
        x = straight + share[:, None] * (placed - straight)
        level(x, sides, mesh.patch, surface)
    return x, cells, mids, mesh.patch


def _least_jacobian(x, cells):
    """Smallest Jacobian of each cell at its vertices and at the points where the flow is integrated, over its largest."""
    points, _ = basix.make_quadrature(basix.CellType.tetrahedron, QUADRATURE_DEGREE[3])
    inner = np.concatenate([np.eye(4), np.column_stack([1 - points.sum(axis=1), points])])
    by_coordinate = slopes(inner, 3)                                       # (p, 10, 4)
    local = by_coordinate[:, :, 1:] - by_coordinate[:, :, :1]
    j = np.einsum("pal,mak->mplk", local, x[cells])
    det = np.einsum("mpk,mpk->mp", j[:, :, 0], np.cross(j[:, :, 1], j[:, :, 2]))
    return det.min(axis=1) / np.abs(det).max(axis=1)
