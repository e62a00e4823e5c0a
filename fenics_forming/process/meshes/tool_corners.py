"""Sharp corners of tools that press into a plane body: the boundary gets a vertex there before it is meshed anew.

The material slides off such a corner, and so do the nodes: the side behind the last one that has left bridges the
corner. It then cuts into the tool or leaves a gap below it, and each new mesh along it would bridge it as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...physics.nodes import EDGES
from ...physics.remeshing import BodyArrays

SPARED = 0.5          # of the wanted size: within it a corner has no other vertex
NEAR = 0.5            # of the length of a side: so near to a corner it is drawn to it
AT_END = 0.4          # of a side: a vertex that is nearer to the corner is moved there, else the side is cut
ON_TOOL = 0.02        # of the length of a side: a vertex that hovers less than this above a tool is on it
AROUND = 16           # directions in which it is asked what is tool
NEWTON_STEPS = 8


@dataclass(frozen=True)
class Redrawn(BodyArrays):
    """A body whose boundary is not quite that of its cells.

    outline : (f, 3) vertices and mid-nodes of its boundary sides
    """

    outline: np.ndarray

    @property
    def sides(self) -> np.ndarray:
        return self.outline


def drawn_to_corners(body: BodyArrays, sizes, tools, mirrors: dict[int, float]) -> BodyArrays:
    """The body with a vertex of its boundary at every protruding sharp corner of a tool that it slides over.

    Such a corner lies beside a side of the body, one neighbour of which is on that tool. The nearest vertex moves to it
    or, where that is far, its side and the cell behind are cut in two. Other vertices within half of the wanted size are
    left out: what the nodes that have just left the corner show there is no shape worth keeping. In space, and where no
    corner is near, the body is returned as it is.

    Parameters
    ----------
    sizes : callable, wanted sizes at points (k, 2), mm
    """
    for tool in tools if body.dim == 2 else ():
        corners = protruding_corners(tool)
        for corner, size in zip(corners, sizes(corners) if len(corners) else (), strict=True):
            body = _drawn(body, tool, corner, SPARED * size, mirrors)
    return body


def with_edges(tools) -> list:
    """The tools in space that have sharp edges which protrude."""
    return [tool for tool in tools if tool.surface.dimension == 3 and tool.surface.radius is None
            and len(tool.surface.edges())]


def protruding_corners(tool) -> np.ndarray:
    """Sharp corners of a tool at its present place, (k, 2) mm, around which there is less tool than space."""
    corners, hollow = sharp_corners(tool)
    return corners[~hollow]


def sharp_corners(tool) -> tuple[np.ndarray, np.ndarray]:
    """Sharp corners of a tool at its present place, (k, 2) mm, and whether there is more tool around them than space."""
    corners = tool.motion.to_space(np.asarray(tool.surface.corners(), float).reshape(-1, len(tool.motion.displacement)))
    if len(corners) == 0:
        return corners, np.zeros(0, bool)
    angle = 2 * np.pi * (np.arange(AROUND) + 0.5) / AROUND
    low, high = tool.surface.bounds()
    extent = np.where(np.isfinite(high - low), high - low, 0.0).max()
    ring = corners[:, None] + 1e-6 * extent * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    gap = tool.gap(ring.reshape(-1, 2))[0].reshape(len(corners), AROUND)
    return corners, (gap > 0).sum(axis=1) <= AROUND // 2


def bridged(x: np.ndarray, sides: np.ndarray, tool, corner: np.ndarray) -> tuple[int, float] | None:
    """The side (its row) over which a tool's corner lies, and where on it, 0 to 1; None where the body does not pass it.

    Parameters
    ----------
    sides : (f, 3) vertices and mid-node of the sides of the body
    """
    if len(sides) == 0:
        return None
    s, distance = feet(x[sides], corner)
    length = np.linalg.norm(x[sides[:, 1]] - x[sides[:, 0]], axis=1)
    k = int(np.argmin(distance))
    if distance[k] > NEAR * length[k]:
        return None
    ends = sides[k, :2]
    beside = np.isin(sides[:, :2], ends).any(axis=1)
    around = np.unique(sides[beside, :2])
    gap = tool.gap(x[around])[0]
    away = np.linalg.norm(x[around] - corner, axis=1)
    touches = (np.abs(gap) < ON_TOOL * length[k]) & (away > ON_TOOL * length[k])
    return (k, float(s[k])) if touches.any() else None


def left_corner(sides: np.ndarray, x: np.ndarray, tools) -> dict[str, float]:
    """Tool name → how far the nearest vertex of this rank's sides (f, 3) is from a corner that the body slides over, of
    the length of the side there; 0 where a vertex lies on every such corner."""
    found = {}
    for tool in tools if x.shape[1] == 2 else ():
        found[tool.name] = 0.0
        for corner in protruding_corners(tool):
            passed = bridged(x, sides, tool, corner)
            if passed is not None:
                ends = x[sides[passed[0], :2]]
                away = np.linalg.norm(ends - corner, axis=1).min() / np.linalg.norm(ends[1] - ends[0])
                found[tool.name] = max(found[tool.name], float(away))
    return found


def feet(p: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where on the parabolas with nodes p (f, 3, 2) the nearest point to ``point`` lies, 0 to 1, and its distance, mm."""
    a, b, m = p[:, 0], p[:, 1], p[:, 2]
    along, w = b - a, m - 0.5 * (a + b)
    s = np.clip(((point - a) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    for _ in range(NEWTON_STEPS):
        tangent = along + 4 * (1 - 2 * s)[:, None] * w
        to = a + s[:, None] * along + 4 * (s * (1 - s))[:, None] * w - point
        slope = (tangent**2).sum(axis=1)
        curvature = slope - 8 * (to * w).sum(axis=1)
        s = np.clip(s - (to * tangent).sum(axis=1) / np.where(curvature > 0.1 * slope, curvature, slope), 0.0, 1.0)
    at = a + s[:, None] * along + 4 * (s * (1 - s))[:, None] * w
    return s, np.linalg.norm(at - point, axis=1)


def _drawn(body: BodyArrays, tool, corner: np.ndarray, radius: float, mirrors: dict[int, float]) -> BodyArrays:
    """The body with a vertex at one corner, and no other within the radius, where it passes it."""
    found = bridged(body.x, body.sides, tool, corner)
    if found is None:
        return body
    k, s = found
    a, b, _ = body.sides[k]
    fixed = np.zeros(len(body.x), bool)
    for axis, value in mirrors.items():
        fixed |= np.abs(body.x[:, axis] - value) < 1e-8 * np.ptp(body.x[:, axis])
    end = a if s < 0.5 else b
    if min(s, 1 - s) < AT_END and not fixed[end]:
        x, cells, sides, vertex = body.x.copy(), body.cells, body.sides, end
    else:
        x, cells, sides, vertex = _cut(body, k, s)
        fixed = np.append(fixed, np.zeros(len(x) - len(fixed), bool))
    x[vertex] = corner
    sides = _thinned(x, sides, vertex, radius, fixed)
    return Redrawn(x, cells, sides)


def _thinned(x: np.ndarray, sides: np.ndarray, vertex: int, radius: float, fixed: np.ndarray) -> np.ndarray:
    """The sides without the vertices near a given one, the two that meet there straight (in place)."""
    near = (np.linalg.norm(x - x[vertex], axis=1) < radius) & ~fixed
    for forward in (True, False):
        start, end = (0, 1) if forward else (1, 0)
        row = int(np.flatnonzero(sides[:, start] == vertex)[0])
        while near[sides[row, end]] and len(sides) > 4:
            following = int(np.flatnonzero(sides[:, start] == sides[row, end])[0])
            sides = sides.copy()
            sides[row, end] = sides[following, end]
            sides = np.delete(sides, following, axis=0)
            row -= following < row
        x[sides[row, 2]] = 0.5 * (x[vertex] + x[sides[row, end]])
    return sides


def _cut(body: BodyArrays, k: int, s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Positions, cells, sides and the new vertex after the k-th side has been cut at s, and the cell behind it."""
    a, b, m = body.sides[k]
    row = int(np.flatnonzero((body.cells[:, 3:] == m).any(axis=1))[0])
    cell = body.cells[row]
    far = cell[:3][~np.isin(cell[:3], [a, b])][0]
    mid = {frozenset((cell[i], cell[j])): cell[3 + e] for e, (i, j) in enumerate(EDGES[2])}
    w = body.x[m] - 0.5 * (body.x[a] + body.x[b])
    at = lambda t: body.x[a] + t * (body.x[b] - body.x[a]) + 4 * t * (1 - t) * w  # noqa: E731
    n = len(body.x)
    vertex, first, second, inner = n, m, n + 1, n + 2
    x = np.vstack([body.x, at(s), at(0.5 * (1 + s)), 0.5 * (at(s) + body.x[far])])
    x[first] = at(0.5 * s)
    pieces = [_cell(far, a, vertex, {frozenset((far, a)): mid[frozenset((far, a))], frozenset((a, vertex)): first,
                                     frozenset((far, vertex)): inner}),
              _cell(far, vertex, b, {frozenset((far, b)): mid[frozenset((far, b))], frozenset((vertex, b)): second,
                                     frozenset((far, vertex)): inner})]
    sides = np.vstack([np.delete(body.sides, k, axis=0), [[a, vertex, first], [vertex, b, second]]])
    return x, np.vstack([np.delete(body.cells, row, axis=0), pieces]), sides, vertex


def _cell(p, q, r, mid) -> np.ndarray:
    vertices = (p, q, r)
    return np.array([*vertices, *(mid[frozenset((vertices[i], vertices[j]))] for i, j in EDGES[2])])


# ---------------------------------------------------------------------- between two remeshings
def hold_corners(body, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Draw the vertex that has just left a corner back to it, in place; the history that it finds there. Collective.

    It does not follow the material then: the history (nodes,), by name, is interpolated along the side over the corner.
    The mid-nodes around follow by half of the way, inner ones lie half-way between the ends of their edges: their
    history is the mean of these anyway.

    Parameters
    ----------
    body : ``FlowingBody`` in the plane, its tools at their present places
    """
    for tool in body.tools if body.nodes.dim == 2 else ():
        for corner in protruding_corners(tool):
            for free, _ in body.skins():
                history = drawn_back(body, free, tool, corner, history)
    return history


def drawn_back(body, free, tool, corner: np.ndarray, history: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The same for one tool, one of its corners, and one body with the surface ``free`` (`FreeSurface`)."""
    nodes, sides, x = body.nodes, free.surface.sides, body.x
    passed, mine = bridged(x, sides, tool, corner), None
    if passed is not None:
        k, s = passed
        a, b, _ = sides[k]
        mine = (float(np.linalg.norm(x[[a, b]] - corner, axis=1).min()), x[a if s < 0.5 else b].copy(),
                {name: (1 - s) * values[a] + s * values[b] for name, values in history.items()})
    found = [one for one in nodes.comm.allgather(mine) if one is not None]
    if not found:
        return history
    distance, place, values = min(found, key=lambda one: one[0])
    if distance == 0.0 or any(abs(place[axis] - value) < 1e-8 * body.size
                               for axis, value in free.mirrors.items()):
        return history
    vertex = np.flatnonzero((np.abs(x - place) < 1e-12 * body.size).all(axis=1) & nodes.is_vertex & free.nodes)
    x[vertex] = corner
    _follow(body, tool, vertex, corner - place)
    history = {name: array.copy() for name, array in history.items()}
    for name, value in values.items():
        history[name][vertex] = value
    return {name: nodes.with_mids(array) for name, array in history.items()}


def _follow(body, tool, vertex: np.ndarray, moved: np.ndarray) -> None:
    """Move the mid-nodes of the edges at a vertex that has moved: inner ones, and those between two vertices on the tool,
    to the middle of their edge, others of the boundary by half of the way."""
    x = body.x
    mids, ends = body.nodes.edges_at(vertex)
    middle = 0.5 * x[ends].sum(axis=1)
    outer = np.isin(mids, body.boundary)
    low = np.abs(tool.gap(x[ends].reshape(-1, 2))[0]).reshape(-1, 2).max(axis=1)
    on_tool = low < ON_TOOL * np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    straight = ~outer | on_tool
    x[mids[straight]] = middle[straight]
    x[mids[~straight]] += 0.5 * moved
