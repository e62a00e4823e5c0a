"""Tool surfaces made of triangles, usually from an STL file."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fenics_forming.errors import SceneError
from fenics_forming.physics.contact.drawing import clip

COINCIDENT = 1e-9       # vertices nearer than this share of the size are one; flatter triangles are none
FACETED = np.deg2rad([0.5, 30.0])   # an edge that turns less is flat, one that turns more is sharp, between: a rounding


@dataclass(frozen=True, eq=False, repr=False)
class Triangulated:
    """Tool surface of flat triangles, wound counter-clockwise seen from outside the tool.

    ``gap = ±|x - c|`` with the exact closest point c. The sign comes from the normal of the face, or from the
    pseudonormal of the edge (sum of the two face normals) or vertex (sum weighted by the angles) that c lies
    on, which is right past edges of any sharpness. A closed surface of negative volume is turned inside out.
    An open surface is allowed; its sign is right as far as the closest point is not on its rim. A sphere of
    radius R in facets of edge h is off by up to h²/(6R): give round tools analytically where they matter.

    Parameters
    ----------
    vertices : array (v, 3)
        Coordinates in mm; vertices that coincide are merged.
    triangles : int array (m, 3)
        Rows of vertex numbers; triangles without area are dropped.

    Raises
    ------
    SceneError
        No triangle left, or neighbours wound in opposite senses.

    References
    ----------
    Baerentzen and Aanaes, Signed distance computation using the angle weighted pseudonormal,
    IEEE Trans. Vis. Comput. Graph. 11 (2005) 243-253.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    open_edges: int = field(init=False)
    _feature_normals: np.ndarray = field(init=False)    # (m, 7, 3): corners a b c, edges ab bc ca, face
    _tree: tuple = field(init=False)
    dimension = 3
    radius = None

    def __post_init__(self):
        from fenics_forming.physics.contact.bvh import build
        vertices, triangles = _cleaned(np.asarray(self.vertices, float), np.asarray(self.triangles, np.int64))
        open_edges = _open_edges(triangles)
        if open_edges == 0 and _volume(vertices[triangles]) < 0:
            triangles = triangles[:, ::-1].copy()
        corners = vertices[triangles]
        order, boxes = build(corners.min(1), corners.max(1))
        tree = corners[order], order, boxes
        normals = _pseudonormals(corners, triangles, len(vertices))
        vertices.flags.writeable = triangles.flags.writeable = False
        for name, value in dict(vertices=vertices, triangles=triangles, open_edges=open_edges,
                                _feature_normals=normals, _tree=tree).items():
            object.__setattr__(self, name, value)

    def __repr__(self):
        low, high = self.bounds()
        extent = " x ".join(f"{length:.6g}" for length in high - low)
        state = f"open: {self.open_edges} free edges" if self.open_edges else "closed"
        return (f"Triangulated({len(self.triangles)} triangles, {len(self.vertices)} vertices, {extent} mm, "
                f"{state})")

    def closest(self, points):
        """Signed gap (n,) in mm and unit normal (n, 3); see `surfaces.Surface.closest`."""
        from fenics_forming.physics.contact.bvh import nearest_triangles
        points = np.ascontiguousarray(points, float)
        triangle, feature, closest = nearest_triangles(*self._tree, points)
        normal = self._feature_normals[triangle, feature]
        away = points - closest
        height = np.einsum("nk,nk->n", away, normal)
        # on a face the face's own normal is free of the round-off in x - c
        edge = feature != 6
        distance = np.linalg.norm(away[edge], axis=1) * np.where(height[edge] >= 0, 1.0, -1.0)
        clear = np.abs(distance) > COINCIDENT * np.ptp(self.vertices, axis=0).max()
        gap, rows = height, np.flatnonzero(edge)
        gap[rows] = distance
        normal[rows[clear]] = away[rows[clear]] / distance[clear, None]
        return gap, normal

    def bounds(self):
        """Low and high corner (3,) in mm of the box around it."""
        return self.vertices.min(0), self.vertices.max(0)

    def outline(self, low, high):
        """Vertices and triangles of the part inside a box; see `surfaces.Surface.outline`."""
        return clip(self.vertices, self.triangles, low, high)

    def corners(self):
        """No corners, array (0, 3): see `edges`."""
        return np.empty((0, 3))

    def edges(self):
        """Ends (e, 2, 3) in mm of the sharp edges that protrude; see `surfaces.Surface.edges`."""
        return self.sharp_edges[0]

    @cached_property
    def sharp_edges(self):
        """Ends (e, 2, 3) in mm of the sharp edges that protrude, and the unit normals (e, 2, 3) on either side."""
        start, end, turn, _, protrudes, normals = _inner_edges(self.vertices[self.triangles], self.triangles)
        sharp = protrudes & (turn >= FACETED[1])
        return np.stack([start[sharp], end[sharp]], axis=1), normals[sharp]

    def roundings(self, spacing):
        """Points on edges between facets of a rounding, its radius and, as it is not known, a quarter of a turn.

        Facets of height h that follow a radius R turn by h / R from one to the next. See `surfaces.Surface.roundings`.
        """
        start, end, turn, height, *_ = _inner_edges(self.vertices[self.triangles], self.triangles)
        rounded = (turn > FACETED[0]) & (turn < FACETED[1])
        start, end, radius = start[rounded], end[rounded], (height / np.where(turn > 0, turn, 1.0))[rounded]
        count = np.maximum(np.ceil(np.linalg.norm(end - start, axis=1) / spacing), 2).astype(int)
        edge, first = np.repeat(np.arange(len(count)), count + 1), np.repeat(np.cumsum(count + 1) - count - 1, count + 1)
        share = ((np.arange(len(edge)) - first) / count[edge])[:, None]
        points = (1 - share) * start[edge] + share * end[edge]
        return points, radius[edge], np.full(len(edge), np.pi / 2)


def read_stl(path, *, scale=1.0):
    """Tool surface from an STL file, binary or ASCII.

    Parameters
    ----------
    path : path
        The file.
    scale : float
        Length in mm of the file's unit of length (STL names none): 25.4 for inches, 1000 for metres.

    Returns
    -------
    Triangulated

    Raises
    ------
    SceneError
        The file is not an STL file, or holds no surface.
    """
    with open(path, "rb") as file:
        content = file.read()
    count = int.from_bytes(content[80:84], "little")
    if len(content) >= 84 and len(content) == 84 + 50 * count:     # binary, whatever its first word
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(content, record, offset=84)["corners"].astype(float)
    else:
        corners = _ascii_corners(path, content)
    return Triangulated(scale * corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def _ascii_corners(path, content):
    words = content.split()
    starts = [i + 1 for i, word in enumerate(words) if word.lower() == b"vertex"]
    try:
        numbers = np.array([words[i:i + 3] for i in starts], dtype="S").astype(float)
    except ValueError:
        numbers = np.empty((0, 3))
    if len(numbers) == 0 or len(numbers) % 3:
        raise SceneError(f"{path} is not an STL file: neither binary (84 + 50 n bytes) nor ASCII (three "
                         "'vertex x y z' per facet); was it cut off on the way?", key="file", got=str(path),
                         allowed="an STL file, binary or ASCII")
    return numbers.reshape(-1, 3, 3)


def _cleaned(vertices, triangles):
    """Vertices merged where they coincide, unused ones and triangles without area left out."""
    used, inverse = np.unique(triangles, return_inverse=True)
    vertices, triangles = vertices[used], inverse.reshape(triangles.shape)
    tolerance = COINCIDENT * np.ptp(vertices, axis=0).max() if len(vertices) else 0.0
    labels = np.stack([_clusters(vertices[:, k], tolerance) for k in range(3)], axis=1)
    _, first, inverse = np.unique(labels, axis=0, return_index=True, return_inverse=True)
    vertices, triangles = vertices[first], inverse.reshape(-1)[triangles]
    corners = vertices[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(1)
    keep = np.linalg.norm(_area_vectors(corners), axis=1) > tolerance * longest
    if not keep.any():
        raise SceneError("have no area; is the surface empty, or its unit of length wrong?", key="triangles",
                         got=len(triangles), allowed="triangles with an area")
    used, inverse = np.unique(triangles[keep], return_inverse=True)
    return vertices[used], inverse.reshape(-1, 3)


def _clusters(values, tolerance):
    """Equal labels for values that follow each other within the tolerance when sorted."""
    order = np.argsort(values)
    labels = np.empty(len(values), int)
    labels[order] = np.cumsum(np.diff(values[order], prepend=values[order[:1]]) > tolerance)
    return labels


def _edges(triangles):
    """Edges ab, bc, ca: their number (m, 3) with both senses alike, and whether they run upwards (m, 3)."""
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    key = ends.min(2) * (triangles.max() + 1) + ends.max(2)
    return np.unique(key, return_inverse=True)[1].reshape(triangles.shape), ends[:, :, 0] < ends[:, :, 1]


def _inner_edges(corners, triangles):
    """Edges between two triangles: their ends (e, 3), the angle between the normals (e,), the mean height (e,), whether
    there is less tool than space around them (e,), the unit normals of both (e, 2, 3)."""
    edge, _ = _edges(triangles)
    order = np.argsort(edge, axis=None, kind="stable")
    twin = np.flatnonzero(edge.ravel()[order][1:] == edge.ravel()[order][:-1])
    one, other = order[twin], order[twin + 1]
    face, area = _unit(_area_vectors(corners)), np.linalg.norm(_area_vectors(corners), axis=1)
    start, end = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
    a, b = one // 3, other // 3
    across = np.cross(face[a], face[b])
    turn = np.arctan2(np.linalg.norm(across, axis=1), np.einsum("ij,ij->i", face[a], face[b]))
    height = 0.5 * (area[a] + area[b]) / np.linalg.norm(end[one] - start[one], axis=1)
    protrudes = np.einsum("ij,ij->i", across, end[one] - start[one]) > 0
    return start[one], end[one], turn, height, protrudes, np.stack([face[a], face[b]], axis=1)


def _open_edges(triangles):
    """Number of edges with one triangle only."""
    edge, upwards = _edges(triangles)
    count = np.bincount(edge.ravel())
    balance = np.bincount(edge.ravel(), np.where(upwards, 1, -1).ravel())
    clash = np.sum((count == 2) & (balance != 0))
    if clash:
        raise SceneError(f"are wound in opposite senses on the two sides of {clash} edges; let the program "
                         "that wrote them unify the normals", key="triangles", got=int(clash),
                         allowed="counter-clockwise seen from outside the tool, all of them")
    return int(np.sum(count == 1))


def _area_vectors(corners):
    """Normals (m, 3) with twice the area as length."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _volume(corners):
    corners = corners - corners[0, 0]
    return np.einsum("mk,mk->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6


def _unit(vectors):
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def _pseudonormals(corners, triangles, vertex_count):
    """Normals (m, 7, 3) that decide the sign at corners a b c, edges ab bc ca, and on the face."""
    face = _unit(_area_vectors(corners))
    out, back = _unit(np.roll(corners, -1, axis=1) - corners), _unit(np.roll(corners, 1, axis=1) - corners)
    angle = np.arctan2(np.linalg.norm(np.cross(out, back), axis=2), np.einsum("mik,mik->mi", out, back))
    edge, _ = _edges(triangles)
    normals = np.empty((len(triangles), 7, 3))
    normals[:, 6] = face
    for k in range(3):
        at_vertex = np.bincount(triangles.ravel(), (angle * face[:, k, None]).ravel(), vertex_count)
        at_edge = np.bincount(edge.ravel(), np.repeat(face[:, k], 3))
        normals[:, :3, k], normals[:, 3:6, k] = at_vertex[triangles], at_edge[edge]
    normals[:, :6] = _unit(normals[:, :6])
    return normals
