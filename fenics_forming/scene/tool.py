"""A tool, as the scene describes it: rigid, or a body that may deform."""

from typing import Literal

from pydantic import Field

from ..laws import DriveLaw, FrictionLaw, NoFriction
from ..laws.described import Described
from ..laws.heat_exchange import HeatExchangeLaw, NoExchange
from .names import Axes, Named, named
from .solids import Part, Solid
from .tool_shapes import ToolShape


class RigidTool(Described):
    """What a tool has, be it rigid or not."""

    shape: ToolShape | None = Field(
        None, description="a shape such as { kind = 'plane', point = [0, 15], normal = [0, -1] }"
    )
    drive: DriveLaw | None = None
    friction: FrictionLaw = NoFriction()
    symmetry: Axes = ()
    heat_exchange: HeatExchangeLaw = NoExchange()


class Tool(Solid, RigidTool):
    """A tool: rigid, or deformable where its material has elastic constants and its deformation is asked for.

    Parameters
    ----------
    shape : a tool shape; may be left out of an assembled tool whose parts lie side by side in the plane.
    drive : how it moves; at rest without.
    friction : on its surface, none if not given. symmetry : axes; the low face of a closed shape on each is a mirror plane.
    heat_exchange : with the workpiece, none if not given.
    parts : tables by name with the keys of `Part`, for an assembled tool. stress_state : "plane_stress" instead of plane
    strain, of tools in the plane. The other keys are those of `Solid`.
    """

    parts: named(Part) = Field(default_factory=Named)
    stress_state: Literal["plane_strain", "plane_stress"] = "plane_strain"

    @classmethod
    def _requires(cls, name, values):
        return name == "shape" and not values.get("parts") or super()._requires(name, values)

    @property
    def has_body(self):
        """Whether it is given as a body, by a material or by parts, that could deform."""
        return self.material is not None or bool(self.parts)

    @property
    def rolls(self):
        """Whether it is round and turns, so that all of its mantle comes to the workpiece in time."""
        return self.drive is not None and self.drive.rotation_centre is not None and not self.parts and \
            self.shape.kind in ("circle", "cylinder")

    def solids(self, name):
        """Its bodies by name, each with the keys of `Solid` and a shape: its parts, or itself as ``name``."""
        return dict(self.parts) if self.parts else {name: self}
