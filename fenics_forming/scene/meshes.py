"""Meshes of the workpiece: where they are fine, and when and how they are renewed."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from ..laws.described import Described, at_key, one_of
from ..units import Count, CountFrom, Length, Number, Positive, Within, refused
from .shape_fields import Direction, Point, SpacePoint, check_direction, check_extent


def _below_one(value):
    if value >= 1:
        raise refused(value, "is not below 1", "a quality between 0 and 1, such as 0.3")
    return value


def _above_one(value):
    if value <= 1:
        raise refused(value, "is not above 1", "a ratio such as 4")
    return value


Quality = Annotated[Within(Positive(Number), 0, 1), AfterValidator(_below_one)]
Ratio = Annotated[Positive(Number), AfterValidator(_above_one)]
LEAST_QUALITY = {2: 0.3, 3: 0.2}


class Remesh(Described):
    """When and how the mesh is renewed.

    When: a cell would fall below min_quality (ratio of the radii of its in- and circumscribed circle or ball, 1 is best;
    0.3 in the plane, 0.2 in space); a side lies deeper in a tool than penetration times its length; a cell is more than
    neighbour_ratio times as large as its neighbour; every so many steps; at least least_steps apart.

    How: max_size, min_size : of elements, mm (mesh_size; a twentieth of it). chord : largest distance between a straight
    side and the surface, mm. growth : of the size per unit of distance. strain_rate, temperature : strength with which
    their gradients refine, 1 is a good start; off if not given. engine : "auto", "mmg" or "gmsh".
    """

    min_quality: Quality | None = None
    penetration: Positive(Number) = 0.1
    neighbour_ratio: Ratio = 4.0
    every: CountFrom(1) | None = None
    least_steps: Count = 1
    max_size: Positive(Length) | None = None
    min_size: Positive(Length) | None = None
    chord: Positive(Length) | None = None
    growth: Positive(Number) = 0.2
    strain_rate: Positive(Number) | None = None
    temperature: Positive(Number) | None = None
    engine: Literal["auto", "mmg", "gmsh"] = "auto"

    @model_validator(mode="after")
    def _sizes_are_ordered(self):
        if self.min_size is not None and self.max_size is not None and self.min_size > self.max_size:
            sentence = f"{self.min_size:g} mm is larger than max_size {self.max_size:g} mm"
            raise at_key("min_size", sentence, self.min_size, f"at most {self.max_size:g}")
        return self

    def quality_limit(self, dimension):
        """`min_quality`, or what is usual in 2 or 3 dimensions."""
        return LEAST_QUALITY[dimension] if self.min_quality is None else self.min_quality


def _remesh(value):
    return {True: Remesh(), False: None}[value] if isinstance(value, bool) else value


RemeshField = Annotated[Remesh | None, BeforeValidator(_remesh, json_schema_input_type=bool | Remesh | None)]
"""true, false, or a table with the keys of `Remesh`."""


class Domain(Described):
    """Where elements have `size`, mm; outside they grow from there. Where several say so, the smallest counts."""

    size: Positive(Length)

    @property
    def dimension(self):
        """2 or 3; None if the domain fits any geometry."""
        return None

    @property
    def tool_name(self):
        """Name of the tool that the domain goes with, or None."""
        return None

    def measure_within(self, bounds):
        """Area or volume that it shares with a body in the box `bounds` at most, mm^2 or mm^3."""
        return math.inf


class BoxDomain(Domain):
    """A box with sides along the axes; a rectangle in the plane.

    Parameters
    ----------
    from_ (key `from`), to : lowest and highest corner, mm.
    """

    kind: Literal["box"] = "box"
    from_: Point = Field(alias="from")
    to: Point

    @model_validator(mode="after")
    def _has_extent(self):
        if len(self.from_) != len(self.to):
            raise at_key("to", f"has {len(self.to)} components, 'from' has {len(self.from_)}", self.to)
        check_extent(self.from_, self.to)
        return self

    @property
    def dimension(self):
        return len(self.from_)

    def measure_within(self, bounds):
        low, high = bounds
        return float(np.prod(np.maximum(np.minimum(high, self.to) - np.maximum(low, self.from_), 0.0)))


class SphereDomain(Domain):
    """A ball; a circle in the plane.

    Parameters
    ----------
    centre : mm. radius : mm.
    """

    kind: Literal["sphere"] = "sphere"
    centre: Point
    radius: Positive(Length)

    @property
    def dimension(self):
        return len(self.centre)

    def measure_within(self, bounds):
        return math.pi * self.radius**2 * (1.0 if self.dimension == 2 else 4 / 3 * self.radius)


class CylinderDomain(Domain):
    """A cylinder in space.

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

    def measure_within(self, bounds):
        return math.pi * self.radius**2 * self.height


class NearTool(Domain):
    """Up to a distance from the surface of a tool, wherever it has moved.

    Parameters
    ----------
    tool : name of a tool. distance : mm.
    """

    kind: Literal["near_tool"] = "near_tool"
    tool: str = Field(description="the name of a tool")
    distance: Positive(Length)

    @property
    def tool_name(self):
        return self.tool

    def measure_within(self, bounds):
        return _layer(bounds, self.distance)


class NearSurface(Domain):
    """Up to a distance from the surface of the body itself, mirror planes left out.

    Parameters
    ----------
    distance : mm.
    """

    kind: Literal["near_surface"] = "near_surface"
    distance: Positive(Length)

    def measure_within(self, bounds):
        return _layer(bounds, self.distance)


def _layer(bounds, thickness):
    extent = np.ptp(bounds, axis=0)
    faces = 2 * sum(math.prod(np.delete(extent, axis)) for axis in range(len(extent)))
    return float(faces * thickness)


RefineDomain = one_of("kind", BoxDomain, SphereDomain, CylinderDomain, NearTool, NearSurface)


def _listed(value):
    if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__len__"):
        raise refused(value, "is not a list", "a list such as [{ kind = 'near_surface', distance = 1, size = 0.3 }]")
    return tuple(value)


Refine = Annotated[tuple[RefineDomain, ...], BeforeValidator(_listed)]
"""A list of domains."""
