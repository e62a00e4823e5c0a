"""Sharp edges of tools in space that the surface of a body goes around, and where its edges cross them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

NEAR = 0.5            # of the length of an edge of the surface: so near to a tool's edge it goes over that
ON_TOOL = 0.02        # of the same: a vertex that hovers less than this above a tool is on it
THERE = 1e-6          # of the same: a vertex so near to a tool's edge is on it
ALONG = 0.15          # of the same: so far may the middle of a chord be from the arc of a tool's edge, a sixth of a turn
SAMPLES = np.linspace(0.0, 1.0, 17)
TURNS = 30            # between an edge and a mirror plane that cuts it
SPACING = 0.2         # of the mean edge of the surface, between the points by which the nearest tool edge is found
CANDIDATES = 6        # of those, the nearest ones are looked at exactly: where three pieces meet, each with two
CORNER = np.cos(np.radians(30.0))    # an edge that turns more has a corner


@dataclass(frozen=True)
class Crossings:
    """Edges of the surface of a body that go over edges of a tool.

    pairs : (k, 2) vertices
    share : (k,) where on the way from the first to the second they come nearest to the tool's edge
    places : (k, 3) the nearest points on that, mm
    """

    pairs: np.ndarray
    share: np.ndarray
    places: np.ndarray


class ToolEdges:
    """The protruding sharp edges of a tool near a body, at its present place, as straight pieces.

    Parameters
    ----------
    tool : `KnownTool` in space
    low, high : box around the body, mm · size : mean length of the edges of its surface, mm
    """

    def __init__(self, tool, low: np.ndarray, high: np.ndarray, size: float):
        self.size = size
        ends, normals = tool.surface.sharp_edges
        ends = tool.motion.to_space(ends.reshape(-1, 3)).reshape(-1, 2, 3)
        near = ((ends.max(axis=1) > low - size) & (ends.min(axis=1) < high + size)).all(axis=1)
        self.ends, normals = ends[near], tool.motion.turn(normals[near].reshape(-1, 3)).reshape(-1, 2, 3)
        across = normals[:, 0] - normals[:, 1]
        self.across = across / np.linalg.norm(across, axis=1, keepdims=True)
        length = np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1)
        count = np.maximum(np.ceil(length / (SPACING * size)), 1).astype(int) + 1
        self._piece = np.repeat(np.arange(len(count)), count)
        share = (np.arange(len(self._piece)) - np.repeat(np.cumsum(count) - count, count)) / (count[self._piece] - 1)
        points = self.ends[self._piece, 0] + share[:, None] * (self.ends[:, 1] - self.ends[:, 0])[self._piece]
        self._tree = cKDTree(points) if len(points) else None

    def __bool__(self) -> bool:
        return len(self.ends) > 0

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The places (n, 3) on the edges that are nearest to points (n, 3), and the distances (n,), mm."""
        _, places, distance = self._near(points)
        row, best = np.arange(len(points)), distance.argmin(axis=1)
        return places[row, best], distance[row, best]

    def nearest_within(self, points: np.ndarray, mirrors: dict[int, float], slack: float) -> np.ndarray:
        """The places (n, 3) that are nearest to points, of those within ``slack`` of mirror planes on these planes.

        Mirror planes cut the edges: going to the edge and back to the plane in turns leads to where.
        """
        held = on_mirrors(points, mirrors, slack)
        places = self.nearest(points)[0]
        for _ in range(TURNS if held.any() else 0):
            before, places = places, self.nearest(np.where(held, points, places))[0]
            if np.abs(places - before).max() < 1e-9 * self.size:
                break
        return np.where(held, points, places)

    def follows(self, ends: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether edges of a surface, with ends (k, 2, 3), run along the tool's; the places nearest to their middles."""
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        off = self.nearest(ends.reshape(-1, 3))[1].reshape(-1, 2)
        place, away = self.nearest(middle)
        return (off < THERE * length[:, None]).all(axis=1) & (away < ALONG * length), place

    def _near(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Some pieces (n, k) near points, the nearest places (n, k, 3) on them, and the distances (n, k), mm."""
        _, sample = self._tree.query(points, k=min(CANDIDATES, self._tree.n))
        pieces = self._piece[sample.reshape(len(points), min(CANDIDATES, self._tree.n))]
        start, along = self.ends[pieces, 0], self.ends[pieces, 1] - self.ends[pieces, 0]
        share = np.einsum("nkd,nkd->nk", points[:, None] - start, along) / np.einsum("nkd,nkd->nk", along, along)
        places = start + np.clip(share, 0.0, 1.0)[..., None] * along
        return pieces, places, np.linalg.norm(points[:, None] - places, axis=2)

    def corners(self) -> np.ndarray:
        """Points (k, 3) where more than two edges meet, or an edge turns sharply."""
        points, node = np.unique(self.ends.reshape(-1, 3), axis=0, return_inverse=True)
        node = node.reshape(-1, 2)
        way = self.ends[:, 1] - self.ends[:, 0]
        way = way / np.linalg.norm(way, axis=1, keepdims=True)
        out = np.zeros((len(points), 3))
        np.add.at(out, node.ravel(), np.stack([way, -way], axis=1).reshape(-1, 3))
        degree = np.bincount(node.ravel(), minlength=len(points))
        # of two unit vectors away from a point the sum has the length sqrt(2 + 2 cos), 0 where they go straight on
        turned = (out**2).sum(axis=1) > 2 - 2 * CORNER
        return points[(degree > 2) | ((degree == 2) & turned)]

    def crossings(self, x: np.ndarray, pairs: np.ndarray, tool) -> Crossings:
        """Where edges of a surface (e, 2), between vertices at x (n, 3), go over edges of the tool.

        They come nearer than half of their length, have their ends on either side of the plane that halves the angle of the
        tool there, and one of the ends is on the tool. Ends that lie on the tool's edge cross nothing.
        """
        ends = x[pairs]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        rows = np.flatnonzero(self.nearest(ends.mean(axis=1))[1] < (0.5 + NEAR) * length)
        if not len(rows):
            return Crossings(np.empty((0, 2), np.int64), np.empty(0), np.empty((0, 3)))
        ends, length = ends[rows], length[rows]
        points = ends[:, :1] + SAMPLES[:, None] * (ends[:, 1] - ends[:, 0])[:, None]
        distance = self.nearest(points.reshape(-1, 3))[1].reshape(len(rows), -1)
        best = distance.argmin(axis=1)
        closest = points[np.arange(len(rows)), best]
        gap = np.abs(tool.gap(ends.reshape(-1, 3))[0]).reshape(-1, 2)
        crosses = (distance.min(axis=1) < NEAR * length) & self._between(ends, closest, length)
        crosses &= (gap < ON_TOOL * length[:, None]).any(axis=1)
        crosses &= (distance[:, [0, -1]] > THERE * length[:, None]).all(axis=1)
        return Crossings(pairs[rows[crosses]], SAMPLES[best[crosses]], self.nearest(closest[crosses])[0])

    def _between(self, ends: np.ndarray, points: np.ndarray, length: np.ndarray) -> np.ndarray:
        """Whether the ends (r, 2, 3) lie on either side of the plane that halves the angle of the tool, where that is
        nearest to points (r, 3); where several pieces meet there, of any of these planes."""
        piece, place, distance = self._near(points)
        height = np.einsum("riqd,rqd->riq", ends[:, :, None] - place[:, None], self.across[piece])
        meets = distance <= distance.min(axis=1, keepdims=True) + THERE * length[:, None]
        return (meets & (height.prod(axis=1) < 0)).any(axis=1)


def on_mirrors(points: np.ndarray, mirrors: dict[int, float], slack: float) -> np.ndarray:
    """Which coordinates of points (n, 3) are those of a mirror plane, (n, 3)."""
    held = np.zeros(points.shape, bool)
    for axis, value in mirrors.items():
        held[:, axis] = np.abs(points[:, axis] - value) < slack
    return held


def edges_of(sides: np.ndarray) -> np.ndarray:
    """Vertices (e, 2) of the edges of the facets (f, 3 or 6) of a surface, each once."""
    ends = np.sort(np.concatenate([sides[:, [0, 1]], sides[:, [1, 2]], sides[:, [2, 0]]]), axis=1).astype(np.int64)
    return np.unique(ends, axis=0)
