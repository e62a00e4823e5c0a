"""Shapes of bodies: what is filled with material at the start. Lengths in mm, no mesh.

Every body shape answers `dimension`, `bounds()`, `volume_or_area()`, `boundary_points(spacing)` and `contains(points)`;
a shape from a file answers only `dimension` (None: the mesh will tell) and whether its file is there.
"""

import math
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from ..laws.described import Described, at_key, one_of
from ..units import Length, Number, Positive
from .outline import Arc, corner_turns, is_inside, nearest, polygonal, rounded_pieces, rounding_area, signed_area
from .shape_fields import (
    Direction,
    Fillet,
    PlanePoint,
    Points,
    SpacePoint,
    check_direction,
    check_extent,
    check_fillet,
    check_format,
    check_outline,
    parsed_points,
    unit,
)


class Shape(Described):
    """Base of all shapes."""

    @property
    def dimension(self):
        """2 or 3, from the points of the shape; None if only its file knows."""
        return 2

    @property
    def file(self):
        """`Path` of the file that the shape is read from, or None."""
        return None

    def bounds(self):
        """Lowest and highest corner, mm, shape (2, dimension); infinite where the shape is."""
        raise NotImplementedError(f"{type(self).__name__} has no bounds before it is meshed")


class ClosedOutline(Shape):
    """Base of the closed plane shapes: `corners` counter-clockwise and the radius of each."""

    @property
    def corners(self):
        """Corners counter-clockwise, mm, shape (n, 2)."""
        raise NotImplementedError

    @property
    def radii(self):
        """Radius of the rounding of each corner, mm, shape (n,); 0 where it is sharp."""
        return np.zeros(len(self.corners))

    @cached_property
    def pieces(self):
        """The outline as `Line`s and `Arc`s, counter-clockwise: the material of the shape on the left."""
        return rounded_pieces(self.corners, self.radii, closed=True)

    def rounding(self, number):
        """The `Arc` that rounds a corner, counted from 1 as the corners are; None where it is sharp."""
        arcs = [piece for piece in self.pieces if isinstance(piece, Arc)]
        order = [*range(1, len(self.corners)), 0]      # the outline starts behind its first corner
        rounded = [k + 1 for k in order if self.radii[k] > 0]
        return arcs[rounded.index(number)] if number in rounded else None

    @cached_property
    def outline(self):
        """The outline as a polygon (arcs cut into 72 sides a turn), first point not repeated, shape (n, 2)."""
        return polygonal(self.pieces)[:-1]

    def bounds(self):
        return np.array([self.outline.min(axis=0), self.outline.max(axis=0)])

    def volume_or_area(self):
        """Area, mm^2."""
        turns = corner_turns(self.corners, closed=True)
        lost = sum(math.copysign(rounding_area(t, r), t) for t, r in zip(turns, self.radii, strict=True))
        return signed_area(self.corners) - lost

    def boundary_points(self, spacing):
        """Points on the boundary not farther apart than `spacing`, mm, shape (n, 2)."""
        return np.vstack([piece.sampled(count_of_points(piece, spacing))[:-1] for piece in self.pieces])

    def contains(self, points):
        """Whether points lie inside, bool, shape (n,)."""
        return is_inside(points, self.outline)

    def depth(self, points):
        """How deep points lie inside, mm, shape (n,); negative outside."""
        distance, _ = nearest(points, self.outline, closed=True)
        return np.where(self.contains(points), distance, -distance)


def count_of_points(piece, spacing):
    """How many parts of a piece of an outline are not longer than `spacing`; 4 to 2000."""
    length = piece.radius * abs(piece.turn) if isinstance(piece, Arc) else math.dist(piece.start, piece.end)
    return min(max(4, math.ceil(length / spacing)), 2000)


class Rectangle(ClosedOutline):
    """A rectangle between two corners, `fillet` rounds its corners.

    Parameters
    ----------
    from_ (key `from`), to : lower left and upper right corner, mm. fillet : radius, mm, or four radii, from the
    lower left corner counter-clockwise.
    """

    kind: Literal["rectangle"] = "rectangle"
    from_: PlanePoint = Field(alias="from")
    to: PlanePoint
    fillet: Fillet = 0.0

    @model_validator(mode="after")
    def _has_extent(self):
        check_extent(self.from_, self.to)
        check_fillet(self.fillet, self.corners, closed=True)
        return self

    @property
    def corners(self):
        (a, b), (c, d) = self.from_, self.to
        return np.array([(a, b), (c, b), (c, d), (a, d)])

    @property
    def radii(self):
        return np.broadcast_to(np.array(self.fillet, dtype=float), 4)


class Polygon(ClosedOutline):
    """A polygon, `fillet` rounds its corners.

    The points may be given either way round and are kept counter-clockwise.

    Parameters
    ----------
    points : at least three, mm. fillet : radius, mm, or one radius for each point.
    """

    kind: Literal["polygon"] = "polygon"
    points: Points
    fillet: Fillet = 0.0

    @model_validator(mode="before")
    @classmethod
    def _counter_clockwise(cls, values):
        if not isinstance(values, dict) or "points" not in values:
            return values
        try:
            points = parsed_points(values["points"])
        except ValueError:
            return values  # the field itself will say what is wrong with it
        fillet = values.get("fillet", 0.0)
        if len(points) >= 3 and signed_area(points) < 0:
            values = values | {"points": points[::-1]}
            if isinstance(fillet, (list, tuple)):
                values["fillet"] = tuple(fillet)[::-1]
        return values

    @model_validator(mode="after")
    def _is_simple(self):
        if len(self.points) < 3:
            raise at_key("points", f"has {len(self.points)} points; a polygon needs at least three", self.points)
        check_outline(self.points, closed=True)
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        if signed_area(self.points) <= 1e-12 * math.dist(low, high) ** 2:
            raise at_key("points", "enclose no area", self.points)
        check_fillet(self.fillet, self.corners, closed=True)
        return self

    @property
    def corners(self):
        return np.array(self.points)

    @property
    def radii(self):
        return np.broadcast_to(np.array(self.fillet, dtype=float), len(self.points))


class Circle(Shape):
    """A full circle in the plane; in axisymmetry a ring of round section.

    Parameters
    ----------
    centre : mm. radius : mm.
    """

    kind: Literal["circle"] = "circle"
    centre: PlanePoint
    radius: Positive(Length)

    def bounds(self):
        return np.array(self.centre) + self.radius * np.array([[-1, -1], [1, 1]])

    def volume_or_area(self):
        """Area, mm^2."""
        return math.pi * self.radius**2

    def depth(self, points):
        """How deep points lie inside, mm, shape (n,); negative outside."""
        return self.radius - np.linalg.norm(np.atleast_2d(points) - self.centre, axis=1)

    def boundary_points(self, spacing):
        """Points on the boundary not farther apart than `spacing`, mm, shape (n, 2)."""
        count = min(max(32, math.ceil(math.tau * self.radius / spacing)), 2000)
        angles = np.linspace(0, math.tau, count, endpoint=False)
        return np.array(self.centre) + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])

    def contains(self, points):
        """Whether points lie inside, bool, shape (n,)."""
        return np.linalg.norm(np.atleast_2d(points) - self.centre, axis=1) <= self.radius


class Box(Shape):
    """A box with sides along the axes.

    Parameters
    ----------
    from_ (key `from`), to : lowest and highest corner, mm.
    """

    kind: Literal["box"] = "box"
    from_: SpacePoint = Field(alias="from")
    to: SpacePoint

    @model_validator(mode="after")
    def _has_extent(self):
        check_extent(self.from_, self.to)
        return self

    @property
    def dimension(self):
        return 3

    def bounds(self):
        return np.array([self.from_, self.to])

    def volume_or_area(self):
        """Volume, mm^3."""
        return float(np.prod(np.subtract(self.to, self.from_)))

    def boundary_points(self, spacing):
        """Points on the boundary not farther apart than `spacing` (40 an edge at most), mm, shape (n, 3)."""
        low, high = self.bounds()
        counts = np.clip(np.ceil((high - low) / spacing), 4, 40).astype(int)
        grid = np.stack(np.meshgrid(*(np.linspace(0, 1, n + 1) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3)
        return low + grid[np.any((grid == 0) | (grid == 1), axis=1)] * (high - low)

    def contains(self, points):
        """Whether points lie inside, bool, shape (n,)."""
        return np.all((np.atleast_2d(points) >= self.from_) & (np.atleast_2d(points) <= self.to), axis=1)

    def depth(self, points):
        """How deep points lie inside, mm, shape (n,); negative outside."""
        beyond = np.maximum(np.subtract(self.from_, np.atleast_2d(points)), np.subtract(np.atleast_2d(points), self.to))
        return -np.linalg.norm(np.maximum(beyond, 0.0), axis=1) - np.minimum(beyond.max(axis=1), 0.0)


class Cylinder(Shape):
    """A solid cylinder in space.

    Parameters
    ----------
    base : centre of one end face, mm. axis : direction from there to the other, any length. radius, height : mm.
    """

    kind: Literal["cylinder"] = "cylinder"
    base: SpacePoint
    axis: Direction = (0.0, 0.0, 1.0)
    radius: Positive(Length)
    height: Positive(Length)

    @model_validator(mode="after")
    def _has_an_axis(self):
        check_direction("axis", self.axis)
        return self

    @property
    def dimension(self):
        return 3

    def bounds(self):
        axis = unit(self.axis)
        ends = np.array([self.base, np.array(self.base) + self.height * axis])
        reach = self.radius * np.sqrt(np.maximum(1 - axis**2, 0))
        return np.array([ends.min(axis=0) - reach, ends.max(axis=0) + reach])

    def volume_or_area(self):
        """Volume, mm^3."""
        return math.pi * self.radius**2 * self.height

    def boundary_points(self, spacing):
        """Points on the boundary, shape (n, 3): rings on the mantle and on the end faces."""
        axis = unit(self.axis)
        first = unit(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
        angles = np.linspace(0, math.tau, 72, endpoint=False)[:, None]
        ring = np.cos(angles) * first + np.sin(angles) * np.cross(axis, first)
        heights = np.linspace(0, self.height, int(np.clip(np.ceil(self.height / spacing), 4, 40)) + 1)
        mantle = [self.radius * ring + h * axis for h in heights]
        faces = [s * self.radius * ring + h * axis for h in (0, self.height) for s in (0, 0.25, 0.5, 0.75)]
        return np.array(self.base) + np.vstack(mantle + faces)

    def contains(self, points):
        """Whether points lie inside, bool, shape (n,)."""
        offset, axis = np.atleast_2d(points) - self.base, unit(self.axis)
        along = offset @ axis
        across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
        return (along >= 0) & (along <= self.height) & (across <= self.radius * (1 + 1e-12))

    def depth(self, points):
        """How deep points lie inside, mm, shape (n,); negative outside."""
        offset, axis = np.atleast_2d(points) - self.base, unit(self.axis)
        along = offset @ axis
        across = np.linalg.norm(offset - along[:, None] * axis, axis=1)
        beyond = np.column_stack([np.maximum(-along, along - self.height), across - self.radius])
        return -np.linalg.norm(np.maximum(beyond, 0.0), axis=1) - np.minimum(beyond.max(axis=1), 0.0)


class BodyFile(Shape):
    """A body from a mesh or CAD file: msh, step, stp or brep.

    Parameters
    ----------
    path : the file, relative to the scene file. scale : factor on its coordinates, so that they become mm.
    """

    kind: Literal["file"] = "file"
    path: str
    scale: Positive(Number) = 1.0

    @model_validator(mode="after")
    def _is_a_known_format(self):
        check_format(self.path, (".msh", ".step", ".stp", ".brep"))
        return self

    @property
    def dimension(self):
        return None

    @property
    def file(self):
        return Path(self.path)


BodyShape = one_of("kind", Rectangle, Polygon, Circle, Box, Cylinder, BodyFile)
