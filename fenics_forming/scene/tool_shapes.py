"""Shapes of tools: where their surface is and on which side the workpiece lies. Lengths in mm, no mesh.

Every tool shape answers `dimension`, `bounds()` and `depth(points)`: how deep points lie inside the tool, mm, negative
outside, as far as it is known before a mesh is made.
"""

import math
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from ..laws.described import at_key, one_of
from ..units import Flag, Length, Number, Positive, Vector
from .outline import nearest, polygonal, rounded_pieces
from .shape_fields import (
    Direction,
    Fillet,
    PlanePoint,
    Point,
    Points,
    SpacePoint,
    check_direction,
    check_fillet,
    check_format,
    check_outline,
    unit,
)
from .shapes import BodyFile, Box, Circle, Cylinder, Polygon, Rectangle, Shape, count_of_points


class Plane(Shape):
    """An unbounded plane (a line in two dimensions).

    Parameters
    ----------
    point : any point on it, mm. normal : any length, out of the tool, towards the workpiece.
    """

    kind: Literal["plane"] = "plane"
    point: Point
    normal: Vector(Number)

    @model_validator(mode="after")
    def _has_a_normal(self):
        check_direction("normal", self.normal)
        if len(self.normal) != len(self.point):
            raise at_key("normal", f"has {len(self.normal)} components, the point has {len(self.point)}", self.normal)
        return self

    @property
    def dimension(self):
        return len(self.point)

    @property
    def unit_normal(self):
        """The normal with length 1, shape (dimension,)."""
        return unit(self.normal)

    def bounds(self):
        infinite = np.full(self.dimension, np.inf)
        return np.array([-infinite, infinite])

    def depth(self, points):
        return -(np.atleast_2d(points) - self.point) @ self.unit_normal


class _Round(Shape):
    """Base of circle, cylinder and sphere; `hollow` puts the workpiece inside."""

    radius: Positive(Length)
    hollow: Flag = Field(False, description="true when the workpiece lies inside")

    def _distance(self, points):
        return np.linalg.norm(np.atleast_2d(points) - self.centre, axis=1)

    def bounds(self):
        reach = self.radius * np.ones(self.dimension)
        return np.array(self.centre) + np.array([-reach, reach])

    def depth(self, points):
        outside = self._distance(points) - self.radius
        return outside if self.hollow else -outside


class CircleTool(_Round):
    """A circle in the plane: a roll, or a bore when `hollow`.

    Parameters
    ----------
    centre, radius : mm. hollow : the workpiece lies inside. neck : radius, mm, of the neck of a roll that deforms; the
    roll is meshed outside of it, and `held = { neck = ["x", "y"] }` is where its drive takes hold.
    """

    kind: Literal["circle"] = "circle"
    centre: PlanePoint
    neck: Positive(Length) | None = None

    @model_validator(mode="after")
    def _neck_is_inside(self):
        if self.neck is not None and (self.hollow or self.neck >= self.radius):
            sentence = "belongs to a roll; the workpiece lies inside of a hollow circle" if self.hollow else \
                f"{self.neck:g} mm is not smaller than the radius, {self.radius:g} mm"
            raise at_key("neck", sentence, self.neck, None if self.hollow else f"below {self.radius:g}")
        return self

    def volume_or_area(self):
        """Area, mm^2, outside of the neck."""
        return math.pi * (self.radius**2 - (self.neck or 0.0) ** 2)

    def boundary_points(self, spacing):
        """Points on the circle, mm, shape (n, 2)."""
        return Circle(centre=self.centre, radius=self.radius).boundary_points(spacing)


class SphereTool(_Round):
    """A ball, or a hollow ball.

    Parameters
    ----------
    centre, radius : mm. hollow : the workpiece lies inside.
    """

    kind: Literal["sphere"] = "sphere"
    centre: SpacePoint

    @property
    def dimension(self):
        return 3


class CylinderTool(_Round):
    """An unbounded cylinder in space: a roll, or a bore when `hollow`.

    Parameters
    ----------
    centre : any point on its axis, mm. axis : its direction, any length. radius : mm.
    hollow : the workpiece lies inside.
    """

    kind: Literal["cylinder"] = "cylinder"
    centre: SpacePoint
    axis: Direction

    @model_validator(mode="after")
    def _has_an_axis(self):
        check_direction("axis", self.axis)
        return self

    @property
    def dimension(self):
        return 3

    @property
    def unit_axis(self):
        """The axis with length 1, shape (3,)."""
        return unit(self.axis)

    def bounds(self):
        crosswise = np.abs(self.unit_axis) <= 1e-12
        reach = np.where(crosswise & (crosswise.sum() == 2), self.radius, np.inf)
        return np.array(self.centre) + np.array([-reach, reach])

    def _distance(self, points):
        offset = np.atleast_2d(points) - self.centre
        return np.linalg.norm(offset - (offset @ self.unit_axis)[:, None] * self.unit_axis, axis=1)


class Polyline(Shape):
    """An open outline in the plane; `fillet` rounds its inner corners.

    Parameters
    ----------
    points : at least two, mm. side : where the workpiece lies when walking along the points, "left" or "right".
    fillet : radius, mm, or one radius for each point (those of the two ends have no meaning).
    """

    kind: Literal["polyline"] = "polyline"
    points: Points
    fillet: Fillet = 0.0
    side: Literal["left", "right"] = "left"

    @model_validator(mode="after")
    def _is_simple(self):
        if len(self.points) < 2:
            raise at_key("points", f"has {len(self.points)} points; a polyline needs at least two", self.points)
        check_outline(self.points, closed=False)
        check_fillet(self.fillet, np.array(self.points), closed=False)
        return self

    @cached_property
    def pieces(self):
        """The outline as `Line`s and `Arc`s in an order that has the workpiece on the left."""
        points, radii = np.array(self.points), np.broadcast_to(np.array(self.fillet, dtype=float), len(self.points))
        if self.side == "right":
            points, radii = points[::-1], radii[::-1]
        return rounded_pieces(points, radii, closed=False)

    @cached_property
    def outline(self):
        """The pieces as points (arcs cut into 72 sides a turn), the workpiece on the left, shape (n, 2)."""
        return polygonal(self.pieces)

    def boundary_points(self, spacing):
        """Points on the outline not farther apart than `spacing`, mm, shape (n, 2)."""
        return np.vstack([piece.sampled(count_of_points(piece, spacing)) for piece in self.pieces])

    def bounds(self):
        return np.array([self.outline.min(axis=0), self.outline.max(axis=0)])

    def depth(self, points):
        """Distance to the outline, positive on its far side; points beyond its ends count as outside."""
        points = np.atleast_2d(points)
        distance, left = nearest(points, self.outline, closed=False)
        beyond = np.zeros(len(points), dtype=bool)
        for end, before in ((self.outline[0], self.outline[1]), (self.outline[-1], self.outline[-2])):
            outwards = (points - end) @ (end - before) > 0
            beyond |= outwards & (np.linalg.norm(points - end, axis=1) <= distance * (1 + 1e-9))
        return np.where(left | beyond, -distance, distance)


class Stl(Shape):
    """A surface of triangles from an STL file, its normals towards the workpiece.

    Parameters
    ----------
    path : the file, relative to the scene file. scale : factor on its coordinates, so that they become mm.
    offset : shift after scaling, mm.
    """

    kind: Literal["stl"] = "stl"
    path: str
    scale: Positive(Number) = 1.0
    offset: SpacePoint = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _is_a_known_format(self):
        check_format(self.path, (".stl",))
        return self

    @property
    def dimension(self):
        return 3

    @property
    def file(self):
        return Path(self.path)


ToolShape = one_of("kind", Plane, CircleTool, CylinderTool, SphereTool, Polyline, Rectangle, Polygon, Stl, Box, Cylinder,
                   BodyFile)
"""`Cylinder` is the one with ends; `Box`, it and `BodyFile` are bodies, for tools that deform."""
