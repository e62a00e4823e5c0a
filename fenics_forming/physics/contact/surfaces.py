"""Analytic tool surfaces: plane, circle, sphere, cylinder, and what every tool surface offers."""

from dataclasses import KW_ONLY, dataclass
from typing import Protocol

import numpy as np

from fenics_forming.errors import SceneError
from fenics_forming.physics.contact.drawing import arc_steps, clip


class Surface(Protocol):
    """What every tool surface offers; lengths in mm, coordinates in the tool's own frame.

    Surfaces are fixed and frozen: for a moving tool the caller transforms the points.
    """

    dimension: int
    radius: float | None
    """Of a surface that is round everywhere, mm; None for any other."""

    def closest(self, points):
        """Signed gap and outward normal, ``gap = ±|x - c|`` with c the closest point of the surface.

        Parameters
        ----------
        points : array (n, d)
            Coordinates in mm.

        Returns
        -------
        gap : array (n,)
            Distance in mm, positive outside the tool (open), negative inside.
        normal : array (n, d)
            Unit normal out of the tool; ``c = points - gap * normal`` is the closest point. Where c is an
            edge or a corner, ``normal = (x - c)/gap``; on the edge itself it is the pseudonormal.
        """

    def bounds(self):
        """Low and high corner, two arrays (d,) in mm, of the box around the surface; infinite where it is."""

    def outline(self, low, high):
        """Surface inside a box, to draw: vertices (v, d) and segments (m, 2) or triangles (m, 3)."""

    def corners(self):
        """Sharp corner points (k, d) in mm, to grade a mesh by; none for a smooth surface."""

    def edges(self):
        """Ends (e, 2, 3) in mm of sharp edges in space around which there is less tool than space; of a surface that has no
        `radius`."""

    def roundings(self, spacing):
        """Points on roundings of a surface that has no `radius`, to grade a mesh by.

        Parameters
        ----------
        spacing : float
            Largest distance between neighbours in mm.

        Returns
        -------
        points : array (k, d)
        radius : array (k,)
            In mm, of the rounding that the point lies on.
        angle : array (k,)
            That the rounding turns by, in radian, without sign.
        """


@dataclass(frozen=True)
class Plane:
    """Half-space tool (half-plane in 2D), ``gap = (x - point)·normal``.

    Parameters
    ----------
    point : d numbers
        A point of the plane in mm.
    normal : d numbers
        Direction out of the tool, towards the workpiece; any length but zero.

    Raises
    ------
    SceneError
        Normal of zero length, or of another dimension than the point.
    """

    point: tuple[float, ...]
    normal: tuple[float, ...]
    radius = None

    def __post_init__(self):
        point = _vector("point", self.point)
        normal = _direction("normal", self.normal, len(point))
        _freeze(self, point=point, normal=normal, _arrays=(np.array(point), np.array(normal)))

    @property
    def dimension(self):
        """Dimension d of space."""
        return len(self.point)

    def closest(self, points):
        """Signed gap (n,) in mm and unit normal (n, d); see `Surface.closest`."""
        points = np.asarray(points, float)
        point, normal = self._arrays
        normals = np.empty(points.shape)
        normals[:] = normal
        return (points - point) @ normal, normals

    def bounds(self):
        """Low and high corner in mm: flat for a plane normal to an axis, else infinite."""
        flat = np.abs(self.normal) == 1.0
        return np.where(flat, self.point, -np.inf), np.where(flat, self.point, np.inf)

    def outline(self, low, high):
        """Vertices and cells of the plane inside a box; see `Surface.outline`."""
        low, high = np.asarray(low, float), np.asarray(high, float)
        reach = np.linalg.norm(high - low)
        middle = (low + high) / 2
        gap, normal = self.closest(middle[None])
        along = _tangents(self.normal) * reach
        if self.dimension == 2:
            square, cells = np.array([-along[0], along[0]]), [[0, 1]]
        else:
            square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ along
            cells = [[0, 1, 2], [0, 2, 3]]
        return clip(middle - gap * normal + square, np.array(cells), low, high)

    def corners(self):
        """No corners: array (0, d)."""
        return np.empty((0, self.dimension))

    def edges(self):
        """No edges: array (0, 2, d)."""
        return np.empty((0, 2, self.dimension))

    def roundings(self, spacing):
        """None: arrays (0, d), (0,), (0,)."""
        return np.empty((0, self.dimension)), np.empty(0), np.empty(0)


@dataclass(frozen=True)
class Sphere:
    """Ball, or ball-shaped cavity: ``gap = |x - centre| - radius``, of opposite sign when hollow.

    Parameters
    ----------
    centre : 2 or 3 numbers
        Centre in mm; with two numbers this is a circle.
    radius : float
        Radius in mm.
    hollow : bool
        The tool is what lies outside; the workpiece is inside.

    Raises
    ------
    SceneError
        Radius not positive.
    """

    centre: tuple[float, ...]
    radius: float
    _: KW_ONLY
    hollow: bool = False

    def __post_init__(self):
        _freeze(self, centre=_vector("centre", self.centre), radius=_length("radius", self.radius))

    @property
    def dimension(self):
        """Dimension d of space."""
        return len(self.centre)

    def closest(self, points):
        """Signed gap (n,) in mm and unit normal (n, d); see `Surface.closest`."""
        offset = np.asarray(points, float) - self.centre
        return _round_gap(offset, self.radius, self.hollow, np.eye(self.dimension)[0])

    def bounds(self):
        """Low and high corner (d,) in mm of the box around it."""
        return np.subtract(self.centre, self.radius), np.add(self.centre, self.radius)

    def outline(self, low, high):
        """Vertices and cells of the part inside a box; see `Surface.outline`."""
        if self.dimension == 2:
            n = arc_steps(self.radius, 2 * np.pi, low, high)
            turn = 2 * np.pi * np.arange(n) / n
            rim = np.stack([np.cos(turn), np.sin(turn)], axis=1)
            cells = np.stack([np.arange(n), np.roll(np.arange(n), -1)], axis=1)
        else:
            n = arc_steps(self.radius, 2 * np.pi, low, high, most=256)
            turn, tilt = 2 * np.pi * np.arange(n + 1) / n, np.pi * np.arange(n // 2 + 1) / (n // 2)
            ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
            rim = np.sin(tilt)[:, None, None] * ring + np.cos(tilt)[:, None, None] * [0.0, 0.0, 1.0]
            rim, cells = rim.reshape(-1, 3), _grid_triangles(n // 2, n)
        return clip(self.centre + self.radius * rim, cells[:, ::-1] if self.hollow else cells, low, high)

    def corners(self):
        """No corners: array (0, d)."""
        return np.empty((0, self.dimension))


@dataclass(frozen=True)
class Circle(Sphere):
    """Disc, or round hole, in the plane: ``gap = |x - centre| - radius``, of opposite sign when hollow.

    Parameters
    ----------
    centre : 2 numbers
        Centre in mm.
    radius : float
        Radius in mm.
    hollow : bool
        The tool is what lies outside; the workpiece is inside.

    Raises
    ------
    SceneError
        Radius not positive; centre not of two numbers.
    """

    def __post_init__(self):
        _freeze(self, centre=_vector("centre", self.centre, 2), radius=_length("radius", self.radius))


@dataclass(frozen=True)
class Cylinder:
    """Endless round roll or bore: ``gap = |d - (d·axis) axis| - radius``, d = x - centre.

    Parameters
    ----------
    centre : 3 numbers
        A point of the axis in mm.
    axis : 3 numbers
        Direction of the axis; any length but zero.
    radius : float
        Radius in mm.
    hollow : bool
        The tool is what lies outside; the workpiece is inside the bore.

    Raises
    ------
    SceneError
        Radius not positive; axis of zero length.
    """

    centre: tuple[float, ...]
    axis: tuple[float, ...]
    radius: float
    _: KW_ONLY
    hollow: bool = False
    dimension = 3

    def __post_init__(self):
        _freeze(self, centre=_vector("centre", self.centre, 3), axis=_direction("axis", self.axis, 3),
                radius=_length("radius", self.radius))

    def closest(self, points):
        """Signed gap (n,) in mm and unit normal (n, 3); see `Surface.closest`."""
        offset = np.asarray(points, float) - self.centre
        offset -= (offset @ np.asarray(self.axis))[:, None] * self.axis
        return _round_gap(offset, self.radius, self.hollow, _tangents(self.axis)[0])

    def bounds(self):
        """Low and high corner (3,) in mm; infinite along every direction that the axis has a share in."""
        axis = np.asarray(self.axis)
        half = np.where(axis == 0, self.radius, np.inf)
        return self.centre - half, self.centre + half

    def outline(self, low, high):
        """Vertices and triangles of the part inside a box; see `Surface.outline`."""
        middle, reach = np.add(low, high) / 2, np.linalg.norm(np.subtract(high, low))
        along = (middle - self.centre) @ np.asarray(self.axis) + np.array([-reach, reach])
        n = arc_steps(self.radius, 2 * np.pi, low, high, most=4000)
        turn = 2 * np.pi * np.arange(n + 1) / n
        ring = self.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1) @ _tangents(self.axis)
        vertices = self.centre + np.multiply.outer(along[::-1], self.axis)[:, None] + ring
        cells = _grid_triangles(1, n)
        return clip(vertices.reshape(-1, 3), cells[:, ::-1] if self.hollow else cells, low, high)

    def corners(self):
        """No corners: array (0, 3)."""
        return np.empty((0, 3))


def _round_gap(offset, radius, hollow, fallback):
    """Gap and normal from the offset (n, d) to the centre or axis; `fallback` is the normal right on it."""
    distance = np.linalg.norm(offset, axis=1)
    middle = distance == 0
    normal = np.where(middle[:, None], fallback, offset / np.where(middle, 1.0, distance)[:, None])
    return (radius - distance, -normal) if hollow else (distance - radius, normal)


def _tangents(normal):
    """Unit vectors (d - 1, d) normal to a unit vector, right-handed with it; (n_y, -n_x) in the plane."""
    normal = np.asarray(normal)
    if len(normal) == 2:
        return np.array([[normal[1], -normal[0]]])
    first = np.cross(np.eye(3)[np.argmin(np.abs(normal))], normal)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first)])


def _grid_triangles(rows, columns):
    """Triangles of a grid of rows x columns quadrilaterals with (rows + 1)(columns + 1) vertices."""
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    below = first + columns + 1
    return np.r_[np.c_[first, below, below + 1], np.c_[first, below + 1, first + 1]]


def _freeze(description, **values):
    for name, value in values.items():
        object.__setattr__(description, name, value)


def _vector(key, value, dimension=None):
    numbers = tuple(float(v) for v in value)
    if len(numbers) not in ((2, 3) if dimension is None else (dimension,)) or not np.isfinite(numbers).all():
        allowed = f"{dimension or '2 or 3'} finite numbers"
        raise SceneError(f"is {value}; {allowed} are expected", key=key, got=value, allowed=allowed)
    return numbers


def _direction(key, value, dimension):
    numbers = np.array(_vector(key, value, dimension))
    length = np.linalg.norm(numbers)
    if length == 0:
        raise SceneError(f"is {value}; a direction needs a component that is not zero", key=key, got=value,
                         allowed="a direction of any length but zero")
    return tuple((numbers / length).tolist())


def _length(key, value):
    if not (np.isfinite(value) and value > 0):
        raise SceneError(f"is {value} mm; a positive length is expected", key=key, got=value,
                         allowed="a positive length")
    return float(value)
