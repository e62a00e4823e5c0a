"""From a straight mesh to order 2 on the old quadratic surface, without turning a cell inside out."""

from __future__ import annotations

import numpy as np

from .features import FACET_EDGES
from .quality import scaled_jacobian
from .straight import Straight, cell_edges, volumes
from .surface import OldSurface, level, place_mids, place_vertices

LEAST = 0.1             # of the volume before: less is not let be
ROOM = 0.3              # of the Jacobian of the vertices: the cell is to last for some steps
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

    The mid-nodes of the boundary lie on the old surface; where the Jacobian of a cell would fall below ROOM times
    that of its vertices, they go back towards the middle of their edge in fractions.
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
        bad[touched] = scaled_jacobian(x, cells[touched]) < ROOM
        if not bad.any():
            break
        share[cells[bad, 4:]] = fraction
        x = straight + share[:, None] * (placed - straight)
        level(x, sides, mesh.patch, surface)
    return x, cells, mids, mesh.patch
