"""Bodies that deform elastically, maybe plastically: tools with a material, and the parts of assembled tools."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from ..laws.described import Described, at_key
from ..units import Bedding, Length, Positive, Stress, Vector, kind_of, refused
from .names import Named, named
from .shapes import BodyShape

_SIZE, _SHIFT = kind_of(Positive(Length)), kind_of(Length)


class MeshSize(Described):
    """Element size of a body that deforms.

    Parameters
    ----------
    contact : mm, at the surface that faces workpieces, other parts and loads. far : mm, away from it.
    """

    contact: Positive(Length)
    far: Positive(Length)

    @model_validator(mode="after")
    def _contact_is_finer(self):
        if self.contact > self.far:
            sentence = f"{self.contact:g} mm is larger than far {self.far:g} mm; the contact needs the finer elements"
            raise at_key("contact", sentence, self.contact, f"at most {self.far:g}")
        return self


def _mesh_size(value):
    if value is None or isinstance(value, (dict, MeshSize)):
        return value
    size = _SIZE.parse(value)
    return MeshSize(contact=size, far=size)


_SIZE_SCHEMA = {"anyOf": [{"type": "number"}, {"type": "string"}, {"type": "object"}]}
MeshSizes = Annotated[MeshSize | None, BeforeValidator(_mesh_size), WithJsonSchema(_SIZE_SCHEMA)]
"""One size, or a table with the keys of `MeshSize`."""


def _held(value):
    """Face → axis → displacement, mm, from an axis, a list of axes or a table of displacements on each face."""
    expected = "faces with the axes on which they are held, such as { z_low = 'z' }"
    if not isinstance(value, dict):
        raise refused(value, "is not a table", expected)
    return Named({face: _held_on(face, axes) for face, axes in value.items()})


def _held_on(face, axes):
    axes = (axes,) if isinstance(axes, str) else axes
    if isinstance(axes, (list, tuple)):
        axes = dict.fromkeys(axes, 0.0)
    if not isinstance(axes, dict) or not axes:
        raise at_key(face, "names no axis; expected an axis such as 'z', a list of axes, or { z = '-0.1 mm' }", axes)
    for axis in axes:
        if axis not in ("x", "y", "z", "r"):
            raise at_key(face, f"'{axis}' is no axis; allowed: r, x, y, z", axis, ["r", "x", "y", "z"])
    return Named({axis: _SHIFT.parse(shift) for axis, shift in axes.items()})


Held = Annotated[dict[str, Any], BeforeValidator(_held), WithJsonSchema({"type": "object"})]


class FaceLoad(Described):
    """What pushes on a face; a pressure, a traction, or both.

    Parameters
    ----------
    pressure : MPa, into the body. traction : MPa, one component for each axis.
    """

    pressure: Stress | None = None
    traction: Vector(Stress) | None = None

    @model_validator(mode="after")
    def _loads_something(self):
        if self.pressure is None and self.traction is None:
            raise at_key("", "is empty; expected a 'pressure', a 'traction' or both")
        return self


class FaceSprings(Described):
    """Springs spread over a face, whose other ends stand still.

    Parameters
    ----------
    stiffness : N/mm^3, force per area and displacement. axis : along which they act; across the face if not given.
    """

    stiffness: Positive(Bedding)
    axis: str | None = None


class Solid(Described):
    """What makes a body deformable.

    Parameters
    ----------
    material : name of a material with elastic constants. mesh_size : mm, or { contact, far }; chosen if not given.
    held : faces with the axes on which they are held, such as { z_low = "z" } or { z_high = ["x", "y"] }, or how far they
    are moved on them, { z_low = { z = "0.1 mm" } }. loads, springs : on faces.
    A flat face is named by its axis and end, such as `r_low`; `side_N` is the side of a polygon from its point N on,
    counter-clockwise, `fillet_N` the rounding there, `mantle` that of a cylinder, `surface` all but mirror planes.
    """

    material: str | None = None
    mesh_size: MeshSizes = None
    held: Held = Field(default_factory=Named)
    loads: named(FaceLoad) = Field(default_factory=Named)
    springs: named(FaceSprings) = Field(default_factory=Named)


class Part(Solid):
    """A part of an assembled tool; its keys are those of `Solid`.

    Parameters
    ----------
    shape : a body shape. material : name of a material with elastic constants.
    """

    shape: BodyShape = Field(description="a shape such as { kind = 'rectangle', from = [20, 0], to = [40, 10] }")
    material: str = Field(description="the name of a material")
