"""A new surface laid onto the old one: nodes on the old quadratic facets and lines, corners in their places."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .features import FACET_EDGES, Features
from .gradation import GROWTH
from .quadratic import Curves, Facets
from .straight import Straight

FLAT = 1e-12            # of the size of the body: a coordinate that varies less over a patch is the same
STANDOFF = 0.07         # of the size: how far a straight edge may stand off the surface, if the scene gives no chord
FINEST = 0.4            # of the size: what curvature alone may ask for
ZIGZAG = 0.2            # of the length of an edge: a line that is further away from its middle runs in zigzag


class OldSurface:
    """The old boundary as a place to put nodes: patches, lines, corners, planes of constant coordinate.

    Parameters
    ----------
    x, sides : nodes (n, 3) and facets (f, 6) of the old body, mm
    features : what must be kept of it
    """

    def __init__(self, x: np.ndarray, sides: np.ndarray, features: Features):
        self.x, self.sides, self.features = x, sides, features
        self.corners = x[features.corners]
        self._patches: dict[tuple, Facets] = {}
        self._lines: dict[int, Curves] = {}
        nodes = sides[np.argsort(features.patch, kind="stable")]
        starts = np.searchsorted(np.sort(features.patch), np.arange(len(features.patch_labels)))
        low = np.minimum.reduceat(x[nodes].min(axis=1), starts)
        high = np.maximum.reduceat(x[nodes].max(axis=1), starts)
        self._flat = high - low <= FLAT * np.ptp(x[sides.ravel()], axis=0).max()
        self._level = x[nodes[starts, 0]]

    def on_patches(self, patch: tuple[int, ...], points: np.ndarray) -> np.ndarray:
        """Closest points (n, 3) of one patch or several."""
        if patch not in self._patches:
            self._patches[patch] = Facets(self.x[self.sides[np.isin(self.features.patch, patch)]])
        return self._patches[patch].closest(points)

    def on_line(self, line: int, points: np.ndarray) -> np.ndarray:
        """Closest points (n, 3) of a kept line."""
        if line not in self._lines:
            self._lines[line] = Curves(self.x[self.features.edges[self.features.line == line]])
        return self._lines[line].closest(points)

    def level(self, x: np.ndarray, patch: int, nodes: np.ndarray) -> None:
        """Write the coordinates that are the same all over a patch (mirror plane, flat contact) into x."""
        for axis in np.flatnonzero(self._flat[patch]):
            x[nodes, axis] = self._level[patch, axis]


def place_vertices(mesh: Straight, surface: OldSurface) -> np.ndarray:
    """Positions (n, 3) with the boundary nodes on the old surface, those of lines on their lines, corners on corners."""
    x = mesh.x.copy()
    held = np.zeros(len(x), bool)
    if len(mesh.corners):
        x[mesh.corners] = surface.corners
        held[mesh.corners] = True
    for line in np.unique(mesh.line):
        nodes = np.unique(mesh.lines[mesh.line == line])
        nodes = nodes[~held[nodes]]
        x[nodes] = surface.on_line(int(line), x[nodes])
        held[nodes] = True
    for patch in np.unique(mesh.patch):
        nodes = np.unique(mesh.facets[mesh.patch == patch])
        nodes = nodes[~held[nodes]]
        x[nodes] = surface.on_patches((int(patch),), x[nodes])
    level(x, mesh.facets, mesh.patch, surface)
    return x


def place_mids(x: np.ndarray, sides: np.ndarray, patch: np.ndarray, lines: np.ndarray, line: np.ndarray,
               surface: OldSurface) -> np.ndarray:
    """Positions of all nodes with the mid-nodes of the boundary on the old surface.

    Parameters
    ----------
    x : (n, 3) mid-nodes half-way
    sides, patch : (f, 6), (f,) the new facets
    lines, line : (e, 3), (e,) the new kept edges (ends, middle)
    """
    x = x.copy()
    held = np.zeros(len(x), bool)
    for k in np.unique(line):
        edges = lines[line == k]
        middle = edges[:, 2]
        target = surface.on_line(int(k), x[middle])
        length = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
        kinked = np.linalg.norm(target - x[middle], axis=1) > ZIGZAG * length
        if kinked.any():
            beside = np.unique(patch[np.isin(sides[:, 3:], middle).any(axis=1)])
            target[kinked] = surface.on_patches(tuple(int(p) for p in beside), x[middle[kinked]])
        x[middle] = target
        held[middle] = True
    for k in np.unique(patch):
        nodes = np.unique(sides[patch == k, 3:])
        nodes = nodes[~held[nodes]]
        x[nodes] = surface.on_patches((int(k),), x[nodes])
    level(x, sides, patch, surface)
    return x


def level(x, sides, patch, surface) -> None:
    """Write the constant coordinates of flat patches into x."""
    for k in np.unique(patch):
        surface.level(x, int(k), np.unique(sides[patch == k]))


def within_chord(sizes, x: np.ndarray, sides: np.ndarray, chord: float | None):
    """The sizes, near a curved surface at most those of straight edges that leave it by no more than the chord distance.

    An edge of length l whose mid-node stands off by s may have the length l √(chord/s). From the nearest vertex of the
    surface inwards that limit grows as sizes may. Without a chord distance STANDOFF of the size counts, and the limit is
    not below FINEST of the size: what has rolled up tightly (a rim that folds onto a tool) keeps its shape nearly.
    """
    edges = sides[:, np.array(FACET_EDGES)].reshape(-1, 3)
    a, b, middle = (x[edges[:, k]] for k in range(3))
    along, off = b - a, middle - (a + b) / 2
    length2 = np.einsum("ek,ek->e", along, along)
    off = np.linalg.norm(off - along * (np.einsum("ek,ek->e", off, along) / length2)[:, None], axis=1)
    size = sizes(middle)
    with np.errstate(divide="ignore"):
        allowed = np.sqrt(length2 * (STANDOFF * size if chord is None else chord) / off)
    if chord is None:
        allowed = np.maximum(allowed, FINEST * size)
    vertices, row = np.unique(edges[:, :2], return_inverse=True)
    limit = np.full(len(vertices), np.inf)
    np.minimum.at(limit, row.reshape(-1, 2), allowed[:, None])
    tree = cKDTree(x[vertices])

    def limited(points):
        distance, nearest = tree.query(points)
        return np.minimum(sizes(points), limit[nearest] + GROWTH * distance)

    return limited
