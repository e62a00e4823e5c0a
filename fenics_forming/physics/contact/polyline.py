"""Tool profiles in the plane: straight sides with sharp or rounded corners, the fillets being true arcs."""

from dataclasses import KW_ONLY, dataclass, field

import numpy as np

from fenics_forming.errors import SceneError
from fenics_forming.physics.contact.drawing import arc_steps, clip
from fenics_forming.physics.contact.pieces import Pieces, turns_of

SEARCHED_BY_TREE = 64       # more pieces than this are searched by a compiled tree, fewer by numpy
SHARP = np.deg2rad(20.0)    # a vertex that turns more is a corner


@dataclass(frozen=True, eq=False, repr=False)
class Polyline:
    """Profile of a tool: walking along the points, the workpiece lies on the left.

    ``gap = ±|x - c|``, exact on the fillets too: they are circular arcs. At a sharp vertex the sign comes
    from the mean of the two adjacent normals, which is right for a wedge of any angle. Beyond the end of an
    open polyline the closest point is the end point, and the tool falls back from there at 45 degrees: what slides
    out of a land is free. A closed polyline is a cavity when it runs
    counter-clockwise, a solid tool when it runs clockwise; `solid_polygon` takes either sense.

    Parameters
    ----------
    points : array (n, 2)
        Vertices in mm.
    fillet : float or array (n,)
        Radius in mm that rounds every vertex where the line turns, or one for each vertex; 0 leaves it sharp.
    closed : bool
        Join the last point with the first, which need not be repeated.

    Raises
    ------
    SceneError
        Too few points, points that coincide, a line that folds back on itself, a fillet too large for a side.

    References
    ----------
    Baerentzen and Aanaes, Signed distance computation using the angle weighted pseudonormal,
    IEEE Trans. Vis. Comput. Graph. 11 (2005) 243-253.
    """

    points: np.ndarray
    _: KW_ONLY
    fillet: float = 0.0
    closed: bool = False
    _pieces: Pieces = field(init=False)
    _tree: tuple | None = field(init=False)
    dimension = 2
    radius = None

    def __post_init__(self):
        points, fillet = _checked_points(self.points, self.closed), _checked_fillet(self.fillet)
        pieces = Pieces.of(points, fillet, self.closed)
        tree = _grow(pieces) if len(pieces.radius) > SEARCHED_BY_TREE else None
        for name, value in dict(points=points, fillet=fillet, _pieces=pieces, _tree=tree).items():
            object.__setattr__(self, name, value)

    def __repr__(self):
        radius = np.max(self.fillet)
        corner = f"fillet {radius:g} mm" if radius else "sharp"
        return (f"Polyline({len(self.points)} points, {'closed' if self.closed else 'open'}, {corner}, "
                f"length {self._pieces.length().sum():.6g} mm, workpiece on the left)")

    def closest(self, points):
        """Signed gap (n,) in mm and unit normal (n, 2); see `surfaces.Surface.closest`."""
        points = np.ascontiguousarray(points, float)
        if self._tree is None:
            nearest = self._pieces.nearest(points)
        else:
            from fenics_forming.physics.contact.bvh import nearest_pieces
            nearest = nearest_pieces(*self._tree, points)
        return self._pieces.take(nearest).gap(points)

    def bounds(self):
        """Low and high corner (2,) in mm of the box around it."""
        low, high = self._pieces.boxes()
        return low.min(0), high.max(0)

    def outline(self, low, high):
        """Vertices and segments of the part inside a box; see `surfaces.Surface.outline`."""
        ends, p = [], self._pieces
        for a, centre, radius, angle in zip(p.start, p.centre, p.radius, p.angle, strict=True):
            n = arc_steps(radius, angle, low, high) if radius else 1
            turn = angle * np.arange(n)[:, None] / n
            arm = a - centre
            ends.append(centre + np.cos(turn) * arm + np.sin(turn) * [-arm[1], arm[0]])
        vertices = np.concatenate([*ends, p.end[-1:]])
        first = np.arange(len(vertices) - 1)
        return clip(vertices, np.stack([first, first + 1], axis=1), low, high)

    def corners(self):
        """Vertices (k, 2) in mm that turn by more than 20 degrees and have no fillet."""
        sharp = (np.abs(turns_of(self.points, self.closed)) > SHARP) & (np.asarray(self.fillet) == 0)
        return self.points[sharp]

    def roundings(self, spacing):
        """Points on the fillets, their radius and angle; see `surfaces.Surface.roundings`."""
        p, arcs = self._pieces, np.flatnonzero(self._pieces.radius)
        count = np.maximum(np.ceil(p.length()[arcs] / spacing), 2).astype(int)
        arc = np.repeat(arcs, count + 1)
        turn = np.concatenate([np.linspace(0, p.angle[a], n + 1) for a, n in zip(arcs, count, strict=True)] or [[]])
        arm = p.start[arc] - p.centre[arc]
        across = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        points = p.centre[arc] + np.cos(turn)[:, None] * arm + np.sin(turn)[:, None] * across
        return points, p.radius[arc], np.abs(p.angle[arc])


def solid_polygon(points, *, fillet=0.0):
    """Closed solid tool with straight sides, ``gap > 0`` outside, whatever the sense of its points.

    Parameters
    ----------
    points : array (n, 2)
        Vertices in mm.
    fillet : float or array (n,)
        Radius in mm of all corners, convex and concave, or one for each; 0 leaves it sharp.

    Returns
    -------
    Polyline

    Raises
    ------
    SceneError
        As `Polyline`.
    """
    points = _checked_points(points, True)
    x, y = (points - points[0]).T
    area = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2
    if area > 0:
        points, fillet = points[::-1], fillet[::-1] if np.ndim(fillet) else fillet
    return Polyline(points, fillet=fillet, closed=True)


def _grow(pieces):
    """Pieces sorted as a search tree over them, and the tree: the arguments of `bvh.nearest_pieces`."""
    from fenics_forming.physics.contact.bvh import build
    order, boxes = build(*pieces.boxes())
    p = pieces.take(order)
    return p.start, p.end, p.centre, p.radius, p.middle, p.cos_half, order, boxes


def _checked_points(points, closed):
    points = np.array(points, float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise SceneError(f"form an array of shape {points.shape}; rows of two finite numbers are expected",
                         key="points", got=points.shape, allowed="rows of two finite numbers in mm")
    if closed and len(points) > 1 and (points[0] == points[-1]).all():
        points = points[:-1]
    least = 3 if closed else 2
    if len(points) < least:
        raise SceneError(f"are {len(points)}; at least {least} are expected", key="points", got=len(points),
                         allowed=f"at least {least}")
    side = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)[: None if closed else -1]
    if (side <= 1e-12 * np.ptp(points, axis=0).max()).any():
        twice = points[np.argmin(side)].tolist()
        raise SceneError(f"hold {twice} twice in a row; leave one out", key="points", got=twice,
                         allowed="consecutive points that differ")
    back = np.abs(turns_of(points, closed)) > np.pi - 1e-6
    if back.any():
        tip = points[back][0].tolist()
        raise SceneError(f"fold back on themselves at {tip}; give the tool, or the slit in it, some width",
                         key="points", got=tip, allowed="turns of less than 180 degrees")
    points.flags.writeable = False
    return points


def _checked_fillet(fillet):
    if not (np.isfinite(fillet).all() and np.all(np.asarray(fillet) >= 0)):
        raise SceneError(f"is {fillet} mm; a radius, or 0 for sharp corners, is expected", key="fillet",
                         got=fillet, allowed="a radius, or 0 for sharp corners")
    return np.asarray(fillet, float) if np.ndim(fillet) else float(fillet)
