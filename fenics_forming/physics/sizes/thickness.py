"""How thick a body is behind its surface, measured along the inner normals."""

from __future__ import annotations

import numpy as np

from ..machine_code import compiled

OPPOSED = -0.5          # cosine between the normals of two sides that face away from each other


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


@compiled
def _first_hits_plane(corners, origins, directions, reach):
    """As `rays.first_hits`, by comparing all with all."""
    distance, hit = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for ray in range(len(origins)):
        u, v = directions[ray, 0], directions[ray, 1]
        for side in range(len(corners)):
            along = (corners[side, 1, 0] - corners[side, 0, 0], corners[side, 1, 1] - corners[side, 0, 1])
            away = (corners[side, 0, 0] - origins[ray, 0], corners[side, 0, 1] - origins[ray, 1])
            det = v * along[0] - u * along[1]
            if det == 0.0 or side == ray:
                continue
            t, s = (away[1] * along[0] - away[0] * along[1]) / det, (u * away[1] - v * away[0]) / det
            if 0.0 <= s <= 1.0 and 0.0 < t <= reach and t < distance[ray]:
                distance[ray], hit[ray] = t, side
    return distance, hit
