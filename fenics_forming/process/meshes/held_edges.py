"""Vertices that have just left a sharp edge of a tool in space are drawn back to it, between two new meshes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ...physics.parallel import everywhere, highest, lowest, total
from ...physics.remeshing.quality import scaled_jacobian
from ...physics.remeshing.straight import volumes
from .drawn_edges import AT_CORNER, AT_END, LEAST
from .tool_corners import with_edges
from .tool_edges import ON_TOOL, THERE, ToolEdges, edges_of

LEAST_JACOBIAN = 0.1  # of the scaled Jacobian of a curved cell: below it no vertex is moved
SAME = 1e-10          # of the size of the body: two places so near are one


def hold_edges(body, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Draw the vertices that have just left an edge back to it, in place; the history that they find there. Collective.

    They do not follow the material then: the history (nodes,), by name, is interpolated along the edge of the surface that
    goes over the tool's. Mid-nodes follow: those between two vertices on the tool's edge to the nearest place on it, inner
    ones to the middle of their edge, others of the boundary by half of the way.

    Parameters
    ----------
    body : ``FlowingBody`` in space, its tools at their present places
    """
    for tool in with_edges(body.tools):
        for free, _ in body.skins():
            history = _held(body, free, tool, history)
    return history


def _held(body, free, tool, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    comm, x = body.nodes.comm, body.x
    pairs = edges_of(free.surface.sides[free.sides])
    length = np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
    count, sum_ = total(comm, np.array([len(pairs), length.sum()]))
    low = lowest(comm, x[pairs].min(axis=(0, 1), initial=np.inf))
    edges = ToolEdges(tool, low, highest(comm, x[pairs].max(axis=(0, 1), initial=-np.inf)), sum_ / count)
    if not edges:
        return history
    left = [_leaving(x, pairs, tool, edges, free.mirrors), _at_corners(comm, x, pairs, edges, sum_ / count)]
    node, other, place, at_corner = (np.concatenate(parts) for parts in zip(*left, strict=True))
    rows = everywhere(comm, _rows(body, tool, history, node, other, place, at_corner))
    if not len(rows):
        return history
    rows = rows[np.lexsort(np.roll(rows, -7, axis=1).T)]  # of the ways to a vertex the nearest first: column 6
    _, first = np.unique(np.round(rows[:, :3] / (SAME * body.size)), axis=0, return_index=True)
    rows = rows[first]
    vertex = _found(body, rows[:, :3])
    blocked = np.zeros(len(rows), bool)
    while True:
        placed = _placed(body, free, tool, edges, vertex, rows[:, 3:6], ~blocked)
        worst = highest(comm, (_spoilt(body, placed, vertex) & ~blocked).astype(float)) > 0
        if not worst.any():
            break
        blocked |= worst
    x[:] = placed
    history = {name: values.copy() for name, values in history.items()}
    for number, values in enumerate(history.values()):
        here = (vertex >= 0) & ~blocked
        values[vertex[here]] = rows[here, 7 + number]
    return {name: body.nodes.with_mids(values) for name, values in history.items()}


def _leaving(x, pairs, tool, edges: ToolEdges, mirrors):
    """Vertices of this rank's surface that an edge of the tool is to take back: their numbers, those on its other side, the
    places there, and that these are no corners."""
    found = edges.crossings(x, pairs, tool)
    near = np.minimum(found.share, 1 - found.share) < AT_END
    second = (found.share[near] > 0.5).astype(int)
    row = np.arange(len(second))
    node, other = found.pairs[near][row, second], found.pairs[near][row, 1 - second]
    place = edges.nearest_within(x[node], mirrors, THERE * edges.size)
    return node, other, place, np.zeros(len(node), bool)


def _at_corners(comm, x, pairs, edges: ToolEdges, size: float):
    """The same for the vertex that has left a corner of the edges, others beside it being near them. Collective."""
    corners, vertices = edges.corners(), np.unique(pairs)
    away = np.full(len(corners), np.inf)
    if len(vertices) and len(corners):
        away, row = cKDTree(x[vertices]).query(corners)
    mine = (away == lowest(comm, away)) & (away > THERE * size) & (away < AT_CORNER * size)
    node, other, place = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty((0, 3))]
    for k in np.flatnonzero(mine):
        vertex = vertices[row[k]]
        beside = pairs[(pairs == vertex).any(axis=1)].sum(axis=1) - vertex
        beside = beside[edges.nearest(x[beside])[1] < AT_CORNER * size]      # these have left it as well
        node.append(np.full(len(beside), vertex))
        other.append(beside)
        place.append(np.tile(corners[k], (len(beside), 1)))
    node = np.concatenate(node)
    return node, np.concatenate(other), np.concatenate(place), np.ones(len(node), bool)


def _rows(body, tool, history, node, other, place, at_corner) -> np.ndarray:
    """In rows: where the vertices are (3), where they come to (3), how far the edge to the other vertex passes by that, mm,
    less than 0 at corners, and the history found there. Those on another tool are left out."""
    x = body.x
    way = x[other] - x[node]
    length = np.linalg.norm(way, axis=1)
    share = np.clip(np.einsum("kd,kd->k", place - x[node], way) / length**2, 0.0, 1.0)
    apart = np.linalg.norm(x[node] + share[:, None] * way - place, axis=1) - body.size * at_corner
    values = [(1 - share) * h[node] + share * h[other] for h in history.values()]
    free = np.ones(len(node), bool)
    for one in body.tools:
        if one is not tool:
            free &= np.abs(one.gap(x[node])[0]) > ON_TOOL * length
    return np.column_stack([x[node], place, apart, *values])[free]


def _found(body, places: np.ndarray) -> np.ndarray:
    """Vertex of this rank, ghosts included, at each place (k, 3); -1 where it has none."""
    vertices = np.flatnonzero(body.nodes.is_vertex)
    distance, row = cKDTree(body.x[vertices]).query(places)
    return np.where(distance < SAME * body.size, vertices[row], -1)


def _spoilt(body, placed: np.ndarray, vertex: np.ndarray) -> np.ndarray:
    """Whether each of the vertices (k,) belongs to a cell of this rank that hardly anything is left of."""
    nodes = body.nodes
    cells = nodes.cells[(placed != body.x).any(axis=1)[nodes.cells].any(axis=1)]
    if not len(cells):
        return np.zeros(len(vertex), bool)
    flat = volumes(placed, cells) / volumes(body.x, cells) < LEAST
    bent = scaled_jacobian(placed, cells) < np.minimum(LEAST_JACOBIAN, 0.5 * scaled_jacobian(body.x, cells))
    return np.isin(vertex, cells[flat | bent, :4]) & (vertex >= 0)


def _placed(body, free, tool, edges: ToolEdges, vertex: np.ndarray, places: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Positions with the chosen vertices at their places and the mid-nodes after them, see `hold_edges`."""
    x, here = body.x.copy(), chosen & (vertex >= 0)
    x[vertex[here]] = places[here]
    moved = x - body.x
    mids, ends = body.nodes.edges_at(vertex[here])
    if not len(mids):
        return x
    middle, length = x[ends].mean(axis=1), np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    outer = np.isin(mids, body.boundary)
    on_tool = np.abs(tool.gap(x[ends].reshape(-1, 3))[0]).reshape(-1, 2).max(axis=1) < ON_TOOL * length
    straight = ~outer | on_tool
    x[mids[straight]] = middle[straight]
    x[mids[~straight]] += 0.5 * moved[ends[~straight]].sum(axis=1)
    chain, place = edges.follows(x[ends], middle)
    x[mids[outer & chain]] = place[outer & chain]
    for axis, on in free.on_plane.items():
        x[on, axis] = body.x[on, axis]
    return x
