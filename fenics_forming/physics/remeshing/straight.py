"""Straight tetrahedral meshes with a labelled surface: cells with several boundary sides split, shapes improved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..contact.bvh import _compile
from ..nodes import EDGES
from .body_arrays import FACETS, keys

ROUNDS = 20             # of splitting; each round splits at least the longest edge that is left
POWER = 4               # of 1/shape in the sum that is made small: the worst cells count most


@dataclass(frozen=True)
class Straight:
    """A straight-sided tetrahedral body and the features of its surface.

    Attributes
    ----------
    x : (n, 3) mm
    cells : (m, 4) of positive volume
    facets : (f, 3) boundary, normals outwards; patch : (f,) the patch of each
    lines : (e, 2) kept edges; line : (e,) the line of each
    corners : nodes that are corners
    """

    x: np.ndarray
    cells: np.ndarray
    facets: np.ndarray
    patch: np.ndarray
    lines: np.ndarray
    line: np.ndarray
    corners: np.ndarray

    def moved(self, x: np.ndarray) -> Straight:
        """The same mesh with its nodes at other places."""
        return replace(self, x=x)


def volumes(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed volumes (m,), mm³."""
    p = x[cells[:, :4]]
    return np.einsum("mk,mk->m", p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0])) / 6


def nearest_nodes(x: np.ndarray, among: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The node nearest to each point (k, 3), among some nodes: (k,)."""
    return among[cKDTree(x[among]).query(points)[1]] if len(points) else np.empty(0, np.int64)


def cell_edges(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges of the cells, (e, 2) with the lower node first, and the number of each edge of each cell (m, 6)."""
    count = int(cells.max()) + 1
    key, number = np.unique(keys(cells[:, np.array(EDGES[3])].reshape(-1, 2), count), return_inverse=True)
    return np.stack(np.divmod(key, count), axis=1), number.reshape(-1, 6)


def on_boundary(cells: np.ndarray) -> np.ndarray:
    """Whether the face opposite to each vertex of each cell is on the boundary, (m, 4)."""
    key = keys(cells[:, np.array(FACETS[3])].reshape(-1, 3), int(cells.max()) + 1)
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    return (count[inverse.ravel()] == 1).reshape(-1, 4)


def oriented(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The cells (m, 4) renumbered so that neighbours turn alike and the body has a positive volume.

    A cell that is inside out among its neighbours keeps its negative volume. (The numbering of dolfinx has no
    orientation, so that the sign of a cell alone tells nothing.)
    """
    m = len(cells)
    faces = cells[:, np.array(FACETS[3])].reshape(-1, 3)
    key = keys(faces, int(cells.max()) + 1)
    order = np.argsort(key, kind="stable")
    shared = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    one, other = order[shared], order[shared + 1]
    # neighbours turn alike when they see their common face the opposite way round
    after = np.take_along_axis(faces, (faces.argmin(axis=1)[:, None] + 1) % 3, axis=1)[:, 0]
    alike = after[one] != after[other]
    one, other = one // 4, other // 4
    # every cell twice, as it is and turned over: what hangs together is one of the two orientations of the body
    rows = np.concatenate([one, one + m])
    columns = np.concatenate([np.where(alike, other, other + m), np.where(alike, other + m, other)])
    _, part = connected_components(coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * m, 2 * m)), directed=False)
    volume = volumes(x, cells)
    total = np.bincount(part, np.concatenate([volume, -volume]))
    turned = total[part[:m]] < total[part[m:]]
    cells = cells.copy()
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return cells


def one_side_each(mesh: Straight) -> Straight:
    """Split the cells that have more than one side on the boundary, by the inner edge opposite to the two sides.

    The velocity of a cell whose vertices but one side are all on a tool has nothing left to give: such a cell would be
    pressed flat. The halves have better shapes than the quarters around a centre, which are left for the cells
    with three sides and for those whose opposite edge is itself on the boundary.
    """
    x, cells = mesh.x, mesh.cells
    for _ in range(ROUNDS):
        exterior = on_boundary(cells)
        edges, number = cell_edges(cells)
        outer = np.zeros(len(edges), bool)
        outer[number[_edges_of_faces(exterior)]] = True
        several = exterior.sum(axis=1) == 2
        ends = np.array(EDGES[3])
        opposite = exterior[:, ends[:, 0]] & exterior[:, ends[:, 1]] & several[:, None] & ~outer[number]
        wanted = np.unique(number[opposite])
        if not len(wanted):
            break
        x, cells = split_edges(x, cells, edges, number, wanted)
    return _with_centres(mesh, x, cells)


def _edges_of_faces(exterior):
    """Whether each edge (m, 6) of each cell lies on an exterior face of this cell."""
    ends = np.array(EDGES[3])
    touched = np.zeros((len(exterior), 6), bool)
    for face in range(4):
        touched[:, (ends != face).all(axis=1)] |= exterior[:, [face]]
    return touched


def split_edges(x, cells, edges, number, wanted, places=None):
    """Cut the wanted edges that are the longest wanted one in all their cells, and those cells.

    places : (len(wanted), 3) where each is cut, mm; in the middle unless given
    """
    places = x[edges[wanted]].mean(axis=1) if places is None else places
    length = np.linalg.norm(x[edges[wanted, 1]] - x[edges[wanted, 0]], axis=1)
    rank, order = np.full(len(edges), len(wanted)), np.argsort(-length, kind="stable")
    rank[wanted[order]] = np.arange(len(wanted))
    ranks = rank[number]
    best = ranks.min(axis=1)
    beaten = np.zeros(len(wanted) + 1, bool)
    beaten[ranks[ranks > best[:, None]]] = True
    cut = (best < len(wanted)) & ~beaten[best]
    chosen, which = np.unique(best[cut], return_inverse=True)
    middle = len(x) + which.ravel()
    x = np.concatenate([x, places[order[chosen]]])
    local = ranks[cut].argmin(axis=1)
    ends, old, row = np.array(EDGES[3])[local], cells[cut], np.arange(cut.sum())
    one, other = old.copy(), old.copy()
    one[row, ends[:, 0]] = middle
    other[row, ends[:, 1]] = middle
    return x, np.concatenate([cells[~cut], one, other])


def _with_centres(mesh, x, cells):
    """Cut what still has more than one boundary side into four at its centre."""
    cut = on_boundary(cells).sum(axis=1) > 1
    old, centre = cells[cut], len(x) + np.arange(cut.sum())
    quarters = np.repeat(old[:, None], 4, axis=1)
    quarters[:, np.arange(4), np.arange(4)] = centre[:, None]
    return replace(mesh, x=np.concatenate([x, x[old].mean(axis=1)]),
                   cells=np.concatenate([cells[~cut], quarters.reshape(-1, 4)]))


def improve(mesh: Straight, *, inside: float = 0.6, surface: float = 0.4, sweeps: int = 8) -> Straight:
    """Move nodes of badly shaped cells to better places: inside freely, on patches and lines along them.

    ``shape = 6 sqrt(2) V/l³`` with the root mean square l of the edges: 1 for the regular cell, 0 for a flat one. A
    node moves down the gradient of the sum of shape**-4 over its cells, and only as far as that sum falls. On curved
    patches and lines it follows the tangent: they have to be met again afterwards.

    Parameters
    ----------
    inside, surface : worst shape around a node, inside and on the surface, below which it moves
    """
    order = np.argsort(mesh.cells.ravel(), kind="stable")
    start = np.searchsorted(mesh.cells.ravel()[order], np.arange(len(mesh.x) + 1))
    x, below = mesh.x.copy(), np.full(len(mesh.x), inside)
    below[mesh.facets] = surface
    _smooth(x, np.ascontiguousarray(mesh.cells), order // 4, start, _ways(mesh), below, sweeps)
    return mesh.moved(x)


def _ways(mesh):
    """Projections (n, 3, 3) onto the directions in which each node may move."""
    n = len(mesh.x)
    ways = np.tile(np.eye(3), (n, 1, 1))
    p = mesh.x[mesh.facets]
    normal = _summed(mesh.facets, np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), n)
    on = np.unique(mesh.facets)
    ways[on] -= normal[on, :, None] * normal[on, None, :]
    along = mesh.x[mesh.lines[:, 1]] - mesh.x[mesh.lines[:, 0]]
    # lines have no sense of direction: the ends of both edges at a node give it, whichever way they run
    first = np.full(n, -1)
    first[mesh.lines.ravel()] = np.repeat(np.arange(len(along)), 2)
    sense = np.sign(np.einsum("eik,ek->ei", along[first[mesh.lines]], along))
    sense = np.where(sense == 0, 1.0, sense)
    tangent = _summed(mesh.lines, sense[:, :, None] * along[:, None], n)
    on = np.unique(mesh.lines)
    ways[on] = tangent[on, :, None] * tangent[on, None, :]
    ways[mesh.corners] = 0
    return ways


def _summed(nodes, vectors, count):
    """Unit sums (count, 3) of vectors (k, 3) or (k, nodes, 3) at the nodes (k, nodes)."""
    vectors = np.broadcast_to(vectors if vectors.ndim == 3 else vectors[:, None], (*nodes.shape, 3)).reshape(-1, 3)
    total = np.stack([np.bincount(nodes.ravel(), vectors[:, k], count) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0, length, 1.0)


@_compile
def _badness(x, cells, around, node, gradient):
    """Sum of shape**-POWER of the cells around a node, its gradient there, and the worst shape."""
    total, worst = 0.0, 1.0
    gradient[:] = 0.0
    d = np.empty((3, 3))
    area, pull = np.empty(3), np.empty(3)
    for c in around:
        k = 0
        odd = 1.0
        squares = 0.0
        for i in range(4):
            if cells[c, i] == node:
                odd = 1.0 if i % 2 == 0 else -1.0
                continue
            for j in range(3):
                d[k, j] = x[cells[c, i], j] - x[node, j]
                squares += d[k, j] * d[k, j]
            k += 1
        for j in range(3):
            pull[j] = d[0, j] + d[1, j] + d[2, j]
            squares += (d[1, j] - d[0, j]) ** 2 + (d[2, j] - d[0, j]) ** 2 + (d[2, j] - d[1, j]) ** 2
        # gradient of 6 V by the node: minus the area vector of the opposite face, twice
        for j in range(3):
            p, q = (j + 1) % 3, (j + 2) % 3
            area[j] = -odd * ((d[1, p] - d[0, p]) * (d[2, q] - d[0, q]) - (d[1, q] - d[0, q]) * (d[2, p] - d[0, p]))
        six = -(d[0, 0] * area[0] + d[0, 1] * area[1] + d[0, 2] * area[2])
        if six <= 0.0:
            return np.inf, -1.0
        shape = np.sqrt(2.0) * six * (squares / 6.0) ** -1.5
        worst = min(worst, shape)
        bad = shape**-POWER
        total += bad
        for j in range(3):
            gradient[j] -= POWER * bad * (area[j] / six + 3.0 * pull[j] / squares)
    return total, worst


@_compile
def _smooth(x, cells, around, start, ways, below, sweeps):
    full, g, unused, old = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for _ in range(sweeps):
        moved = 0
        for node in range(len(x)):
            if start[node] == start[node + 1]:
                continue
            star = around[start[node]:start[node + 1]]
            value, worst = _badness(x, cells, star, node, full)
            if worst > below[node] or worst <= 0.0:
                continue
            for i in range(3):
                g[i] = ways[node, i, 0] * full[0] + ways[node, i, 1] * full[1] + ways[node, i, 2] * full[2]
            slope = np.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
            if slope == 0.0:
                continue
            reach = 0.0
            for i in range(4):
                if cells[star[0], i] != node:
                    far = 0.0
                    for j in range(3):
                        far += (x[cells[star[0], i], j] - x[node, j]) ** 2
                    reach = max(reach, np.sqrt(far))
            old[:] = x[node]
            step = 0.3 * reach / slope
            for _ in range(8):
                x[node] = old - step * g
                new, _ = _badness(x, cells, star, node, unused)
                if new < value:
                    moved += 1
                    break
                x[node] = old
                step *= 0.5
        if moved == 0:
            break
