"""What a new mesh of a solid must keep of the old surface: patches, the lines between them, corners.

An edge of the boundary is kept as a line where the labels of its two facets differ or the surface turns there by
more than the corner angle. Patches are the smooth pieces between lines; a line is a run of such edges between two
corners (or a closed one); a corner is where lines meet, end, or turn sharply themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ...errors import MeshError

# nodes of the edges of a facet: ends, middle; the mid-nodes of a facet follow its vertices and face them
FACET_EDGES = ((1, 2, 3), (2, 0, 4), (0, 1, 5))


SAME = 1e-9             # of the size of the body: a node as near to a place is there


@dataclass(frozen=True)
class Features:
    """The kept features of a surface of order 2.

    Attributes
    ----------
    patch : (f,) number of the patch of every facet, from 0
    patch_labels : (patches,) the label of each
    edges : (e, 3) nodes of the kept edges: ends, middle
    line : (e,) number of the line of every kept edge, from 0
    smooth : (e,) whether the surface is smooth across the edge, which is kept for its labels only
    corners : nodes of the corners
    """

    patch: np.ndarray
    patch_labels: np.ndarray
    edges: np.ndarray
    line: np.ndarray
    smooth: np.ndarray
    corners: np.ndarray


def find_features(x: np.ndarray, sides: np.ndarray, labels: np.ndarray, corner_angle: float,
                  places: np.ndarray | None = None) -> Features:
    """The features of the boundary facets ``sides`` (f, 6) of order 2 with their labels (f,).

    Parameters
    ----------
    corner_angle : degrees by which a smooth surface, or a smooth line, may turn from facet to facet
    places : (k, 3) mm; nodes of kept edges there are corners

    Raises
    ------
    MeshError
        where more than two facets meet at an edge: the body is pinched.
    """
    edges, first, second, normals = _edges(x, sides)
    turn = np.einsum("ek,ek->e", normals[0], normals[1])
    limit = np.cos(np.radians(corner_angle))
    sharp = turn < limit
    differs = labels[first] != labels[second]
    sharp &= differs | ~_lonely(edges, sharp | differs)
    kept = sharp | differs
    joined = coo_matrix((np.ones(np.sum(~kept)), (first[~kept], second[~kept])), shape=(len(sides), len(sides)))
    count, patch = connected_components(joined, directed=False)
    patch_labels = np.zeros(count, labels.dtype)
    patch_labels[patch] = labels
    edges, sharp = edges[kept], sharp[kept]
    between = np.sort(np.stack([patch[first[kept]], patch[second[kept]]], axis=1), axis=1)
    corners = _corners(x, edges, sharp, between, limit)
    if places is not None and len(places) and len(edges):
        ends = np.unique(edges[:, :2])
        away, row = cKDTree(x[ends]).query(places)
        corners = np.union1d(corners, ends[row[away < SAME * np.ptp(x, axis=0).max()]])
    return Features(patch, patch_labels, edges, _runs(edges, corners), ~sharp, corners)


def _edges(x, sides):
    """Edges (e, 3) of the closed surface, their two facets, and the unit normals of both in the middle of the edge."""
    edges = sides[:, FACET_EDGES].reshape(-1, 3)
    order = np.argsort(edges[:, 2], kind="stable")
    middle = edges[order, 2]
    if len(middle) % 2 or (middle[::2] != middle[1::2]).any() or (middle[2::2] == middle[1:-1:2]).any():
        raise MeshError("more or fewer than two boundary facets meet at an edge: the body is pinched or torn there, and "
                        "no mesh of it can be made; smaller steps or a finer mesh may keep it whole")
    normals = _middle_normals(x[sides]).reshape(-1, 3)[order]
    facet = order // 3
    return edges[order[::2]], facet[::2], facet[1::2], (normals[::2], normals[1::2])


def _middle_normals(nodes):
    """Unit normals (f, 3, 3) of quadratic facets (f, 6, 3) at their mid-nodes."""
    a, b, c, bc, ac, ab = np.moveaxis(nodes, 1, 0)
    along = np.stack([c - b, a - c, b - a], axis=1)
    # derivative of the facet from the mid-node of a side towards the opposite vertex
    inwards = np.stack([2 * (ab + ac - bc) - a - (b + c) / 2, 2 * (ab + bc - ac) - b - (a + c) / 2,
                        2 * (ac + bc - ab) - c - (a + b) / 2], axis=1)
    normal = np.cross(along, inwards)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    return normal / np.where(length > 0, length, 1.0)


def _lonely(edges, kept):
    """Kept edges of which neither end touches another one: a kink of the mesh, not an edge of the body."""
    touching = np.bincount(edges[kept, :2].ravel(), minlength=edges.max() + 1)
    return kept & (touching[edges[:, 0]] == 1) & (touching[edges[:, 1]] == 1)


def _corners(x, edges, sharp, between, limit):
    """Nodes where other than two kept edges meet, where they part other patches, or where a sharp line turns."""
    if not len(edges):
        return np.empty(0, np.int64)
    size = edges.max() + 1
    ends = edges[:, :2]
    degree = np.bincount(ends.ravel(), minlength=size)
    nodes = ends.ravel()
    order = np.argsort(nodes, kind="stable")
    order = order[degree[nodes[order]] == 2]
    one, other = order[::2], order[1::2]
    tangent = (4 * x[edges[:, 2]] - 3 * x[ends[:, 0]] - x[ends[:, 1]],
               4 * x[edges[:, 2]] - 3 * x[ends[:, 1]] - x[ends[:, 0]])
    out = np.stack(tangent, axis=1).reshape(-1, 3)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    turned = np.einsum("nk,nk->n", out[one], -out[other]) < limit
    # labels end along facets of the old mesh, in zigzag where the surface is smooth: no corner of the body
    turned &= sharp[one // 2] & sharp[other // 2]
    turned |= (between[one // 2] != between[other // 2]).any(axis=1)
    return np.union1d(np.flatnonzero((degree != 2) & (degree > 0)), nodes[one[turned]])


def _runs(edges, corners):
    """Number of the line of every kept edge: edges that share a node which is no corner are of one line."""
    e = len(edges)
    if e == 0:
        return np.empty(0, np.int64)
    size = edges.max() + 1
    is_corner = np.zeros(size, bool)
    is_corner[corners] = True
    edge, node = np.repeat(np.arange(e), 2), edges[:, :2].ravel()
    free = ~is_corner[node]
    graph = coo_matrix((np.ones(free.sum()), (edge[free], e + node[free])), shape=(e + size, e + size))
    _, component = connected_components(graph, directed=False)
    return np.unique(component[:e], return_inverse=True)[1].reshape(-1)
