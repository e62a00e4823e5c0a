"""How thick a body is behind its surface, measured along the inner normals."""

from __future__ import annotations

import numpy as np

OPPOSED = -0.5          # cosine between the normals of two sides that face away from each other
PAIRS = 2_000_000       # of rays and sides at once


def thickness(x: np.ndarray, sides: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Distance from the middle of each boundary side to the opposite boundary along the inner normal.

    Sides that a ray meets at a slant (a neighbour behind a corner) do not bound a section and are not counted.

    Parameters
    ----------
    x : (n, dim) nodes
    sides : (f, dim) vertices of the boundary sides, the body on the left (2-D), normals outwards (3-D)
    reach : only distances below this are of interest, mm

    Returns
    -------
    distance (f,) mm, inf where there is nothing within reach; number of the side that was met (f,), -1 for none.
    """
    corners = x[sides]
    normals = _normals(corners)
    middles = corners.mean(axis=1)
    if x.shape[1] == 3:
        from .rays import first_hits
        distance, hit = first_hits(corners, middles, -normals, reach)
    else:
        distance, hit = _first_hits_plane(corners, middles, -normals, reach)
    facing = (hit >= 0) & (np.einsum("ij,ij->i", normals, normals[hit]) < OPPOSED)
    return np.where(facing, distance, np.inf), np.where(facing, hit, -1)


def ways_around(sides: np.ndarray, lengths: np.ndarray, met: np.ndarray) -> np.ndarray:
    """Shorter way along the boundary of a plane body from the middle of each side to that of the side ``met``, (f,) mm.

    Infinite between two loops of the boundary, 0 for a side that has met none (-1).
    """
    following = dict(zip(sides[:, 0].tolist(), range(len(sides)), strict=True))
    place, loop, whole, left = np.zeros(len(sides)), np.full(len(sides), -1), [], set(range(len(sides)))
    end_of, length = sides[:, 1].tolist(), lengths.tolist()
    while left:
        side, way = min(left), 0.0
        while side in left:
            left.discard(side)
            place[side], loop[side] = way + 0.5 * length[side], len(whole)
            way += length[side]
            side = following.get(end_of[side], -1)
        whole.append(way)
    apart = np.abs(place - place[met])
    around = np.minimum(apart, np.array(whole)[loop] - apart)
    return np.where(met < 0, 0.0, np.where(loop == loop[met], around, np.inf))


def _normals(corners):
    along = corners[:, 1] - corners[:, 0]
    if corners.shape[2] == 2:
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    else:
        normal = np.cross(along, corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return normal / np.where(length > 0, length, 1.0)


def _first_hits_plane(corners, origins, directions, reach):
    """As `rays.first_hits`, by comparing all with all."""
    start, along = corners[:, 0], corners[:, 1] - corners[:, 0]
    distance, hit = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for rows in np.array_split(np.arange(len(origins)), 1 + len(origins) * len(corners) // PAIRS):
        o, d = origins[rows, None], directions[rows, None]
        det = d[..., 1] * along[:, 0] - d[..., 0] * along[:, 1]
        away = start - o
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (away[..., 1] * along[:, 0] - away[..., 0] * along[:, 1]) / det
            s = (d[..., 0] * away[..., 1] - d[..., 1] * away[..., 0]) / det
        t[~((s >= 0) & (s <= 1) & (t > 0) & (t <= reach))] = np.inf
        t[np.arange(len(rows)), rows] = np.inf
        nearest = t.argmin(axis=1)
        distance[rows] = t[np.arange(len(rows)), nearest]
        hit[rows] = np.where(np.isfinite(distance[rows]), nearest, -1)
    return distance, hit
