"""Sharp edges of tools that press into a body in space: its surface gets edges there before it is meshed anew.

The material slides off such an edge, and the nodes with it: the facets behind the last ones that have left bridge the edge.
They cut into the tool or leave a gap below it, and each new mesh along them would do so again: the contact would end in
zigzag, with cells that wear out within a step. So vertices near the tool's edge move onto it, other edges of the surface
that go over it are cut there, and a vertex comes to each of its corners. Between these vertices lies a chain of edges on
which the contact ends; a new mesh keeps it as a line.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ...physics.nodes import EDGES
from ...physics.remeshing import BodyArrays
from ...physics.remeshing.body_arrays import keys
from ...physics.remeshing.straight import cell_edges, split_edges, volumes
from .tool_corners import with_edges
from .tool_edges import ON_TOOL, THERE, ToolEdges, edges_of, on_mirrors

AT_END = 0.4          # of an edge of the surface: an end that is nearer to the tool's edge is moved there, else it is cut
AT_CORNER = 0.25      # of the mean edge of the surface: a vertex that is nearer to a corner of the tool belongs there
LEAST = 0.05          # of the volume of a cell: a vertex that leaves less is not moved
ROUNDS = 30           # of cutting; each cuts at least the longest edge that is left


def drawn_to_edges(body: BodyArrays, tools, mirrors: dict[int, float]) -> tuple[BodyArrays, np.ndarray]:
    """The body with a chain of edges of its surface on every protruding sharp edge of a tool that it slides over.

    Where no edge is near, the body is returned as it is. The places (k, 3) are the corners of the tools' edges near it.

    Parameters
    ----------
    tools : ``KnownTool`` at their present places · mirrors : axis → coordinate of the mirror planes
    """
    places = [np.empty((0, 3))]
    for tool in with_edges(tools):
        body, corners = _drawn(body, tool, [other for other in tools if other is not tool], mirrors)
        places.append(corners)
    return body, np.concatenate(places)


def _drawn(body: BodyArrays, tool, others, mirrors) -> tuple[BodyArrays, np.ndarray]:
    pairs = _pairs(body, mirrors)
    size = float(np.linalg.norm(np.diff(body.x[pairs], axis=1)[:, 0], axis=1).mean())
    edges = ToolEdges(tool, body.x.min(axis=0), body.x.max(axis=0), size)
    if not edges:
        return body, np.empty((0, 3))
    made = _Drawing(body, edges, others, size)
    found = edges.crossings(body.x, pairs, tool)
    if len(found.pairs):
        nearer = np.minimum(found.share, 1 - found.share) < AT_END
        ends = found.pairs[np.arange(len(nearer)), (found.share > 0.5).astype(int)]
        chosen = np.unique(ends[nearer])
        made.move(chosen, edges.nearest_within(made.x[chosen], mirrors, THERE * size))
        found = edges.crossings(made.x, _pairs(made, mirrors), tool)
        new, places = made.cut(found.pairs, np.clip(found.share, 0.1, 0.9), found.places)
        made.move(new, edges.nearest_within(np.where(on_mirrors(made.x[new], mirrors, THERE * size), made.x[new], places),
                                            mirrors, THERE * size))
    corners = edges.corners()
    for corner in corners:
        made.draw_to(corner)
    return made.body() if made.is_changed else body, corners


def _pairs(body, mirrors) -> np.ndarray:
    """Edges of the surface, as vertices (e, 2), but for those within mirror planes."""
    sides = body.sides
    size = np.ptp(body.x, axis=0).max()
    for axis, value in mirrors.items():
        sides = sides[~(np.abs(body.x[sides[:, :3], axis] - value) < 1e-8 * size).all(axis=1)]
    return edges_of(sides)


class _Drawing:
    """A body whose vertices move and whose edges are cut; mid-nodes come last."""

    def __init__(self, body: BodyArrays, edges: ToolEdges, others, size: float):
        self.x, self.cells, self._start = body.x.copy(), body.cells[:, :4].copy(), body.x
        self._old, self._edges, self._others, self._size = body, edges, others, size

    @property
    def sides(self) -> np.ndarray:
        """Vertices (f, 3) of the boundary facets as they are now."""
        return _outer_faces(self.cells, len(self.x))

    @property
    def is_changed(self) -> bool:
        return self.x.shape != self._start.shape or bool((self.x != self._start).any())

    def move(self, nodes: np.ndarray, places: np.ndarray) -> None:
        """Move vertices to places; none that would flatten a cell or leaves another tool."""
        free = np.ones(len(nodes), bool)
        for tool in self._others:
            free &= np.abs(tool.gap(self.x[nodes])[0]) > ON_TOOL * self._size
        target, before = self.x.copy(), volumes(self.x, self.cells)
        target[nodes[free]] = places[free]
        while True:
            bad = volumes(target, self.cells) / before < LEAST
            back = np.intersect1d(nodes, self.cells[bad])
            back = back[(target[back] != self.x[back]).any(axis=1)]
            if not len(back):
                break
            target[back] = self.x[back]
        self.x = target

    def cut(self, pairs: np.ndarray, share: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cut edges (k, 2) at shares of their length, and the cells around them; the new vertices and their places."""
        first, wanted = len(self.x), pairs
        cuts = self.x[pairs[:, 0]] + share[:, None] * (self.x[pairs[:, 1]] - self.x[pairs[:, 0]])
        for _ in range(ROUNDS):
            edges, number = cell_edges(self.cells)
            row = _rows(edges, wanted, len(self.x))
            if not (row >= 0).any():
                break
            left = np.flatnonzero(row >= 0)
            left = left[np.argsort(row[left])]
            self.x, self.cells = split_edges(self.x, self.cells, edges, number, row[left], cuts[left])
        new = np.arange(first, len(self.x))
        order = cKDTree(cuts).query(self.x[new])[1] if len(new) else np.empty(0, int)
        return new, places[order]

    def draw_to(self, corner: np.ndarray) -> None:
        """Bring a vertex of the surface to a corner of the tool's edges: one that is near, or one on the chain."""
        pairs = edges_of(self.sides)
        pairs = pairs[np.linalg.norm(self.x[pairs].mean(axis=1) - corner, axis=1) < 2 * self._size]
        if not len(pairs):
            return
        on = self._edges.nearest(self.x[pairs.ravel()])[1].reshape(-1, 2) < THERE * self._size
        beside = pairs[on.any(axis=1)]
        away = np.linalg.norm(self.x[beside] - corner, axis=2)
        if not len(beside) or away.min() < THERE * self._size:
            return
        if away.min() < AT_CORNER * self._size:
            self.move(beside.ravel()[[int(away.argmin())]], corner[None])
            return
        chain = pairs[on.all(axis=1)]
        a, along = self.x[chain[:, 0]], self.x[chain[:, 1]] - self.x[chain[:, 0]]
        share = np.clip(((corner - a) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
        away = np.linalg.norm(a + share[:, None] * along - corner, axis=1)
        near = np.flatnonzero(away < np.linalg.norm(along, axis=1))
        if len(near):
            k = near[[int(away[near].argmin())]]
            self.move(*self.cut(chain[k], np.clip(share[k], 0.1, 0.9), corner[None]))

    def body(self) -> BodyArrays:
        """Of order 2 again: unchanged edges keep their mid-nodes, others are straight, the chain follows the tool."""
        old, edges = self._old, cell_edges(self.cells)[0]
        ends = np.array(EDGES[3])
        old_ends, old_mids = old.cells[:, ends].reshape(-1, 2), old.cells[:, 4:].ravel()
        count = len(self.x)
        key = keys(old_ends, count)
        order = np.argsort(key, kind="stable")
        at = np.minimum(np.searchsorted(key[order], keys(edges, count)), len(key) - 1)
        known = key[order][at] == keys(edges, count)
        moved = np.zeros(count, bool)
        moved[: len(old.x)] = (self.x[: len(old.x)] != old.x).any(axis=1)
        moved[len(old.x):] = True
        kept = known & ~moved[edges].any(axis=1)
        middle = self.x[edges].mean(axis=1)
        middle[kept] = old.x[old_mids[order[at[kept]]]]
        outer = _rows(edges_of(self.sides), edges, count) >= 0
        changed = np.flatnonzero(outer & ~kept)
        if len(changed):
            chain, place = self._edges.follows(self.x[edges[changed]], middle[changed])
            middle[changed[chain]] = place[chain]
        rows = _rows(edges, self.cells[:, ends].reshape(-1, 2), count)
        vertices = np.unique(self.cells)
        number = np.full(count, -1)
        number[vertices] = np.arange(len(vertices))
        return BodyArrays(np.concatenate([self.x[vertices], middle]),
                          np.concatenate([number[self.cells], len(vertices) + rows.reshape(-1, 6)], axis=1))


def _rows(edges: np.ndarray, wanted: np.ndarray, count: int) -> np.ndarray:
    """Row of each wanted edge (k, 2) among ``edges`` (e, 2); -1 where it is none of them."""
    key, want = keys(edges, count), keys(wanted, count)
    order = np.argsort(key, kind="stable")
    at = np.minimum(np.searchsorted(key[order], want), len(key) - 1)
    return np.where(key[order][at] == want, order[at], -1)


def _outer_faces(cells: np.ndarray, count: int) -> np.ndarray:
    faces = cells[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, number = np.unique(keys(faces, count), return_index=True, return_counts=True)
    return faces[first[number == 1]]
