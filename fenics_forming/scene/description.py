"""The scene: everything that the user writes, as one frozen tree; the same from Python and from TOML."""

from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from ..laws import Follower, RatioDrive
from ..laws.described import Described, at_key
from ..units import Force, kind_of
from .contacts import Contacts
from .heat import asks_for_heat
from .material import Material
from .names import Named, named
from .process import Process, Shifting, Steps, Stop
from .settings import Output, Solver
from .tool import Tool
from .tracked import FlowLine, TrackedPoint
from .workpiece import Workpiece

AXES = {"plane_strain": ("x", "y"), "axisymmetric": ("r", "z"), "3d": ("x", "y", "z")}
"""Names of the coordinates of every geometry kind."""


class Scene(Described):
    """A forming process as the user describes it; see `read_scene` for scene files and `check` for its sense.

    Parameters
    ----------
    title : any text. geometry : "plane_strain" (x, y; forces per mm), "axisymmetric" (r, z; forces of the full
    turn) or "3d". materials, workpieces, tools, points, flow_lines : tables by name. contacts : list of contacts between
    bodies. process, steps, stop, output, solver. A scene of deformable tools alone has no workpieces and needs neither
    steps nor stop.
    """

    title: str = ""
    geometry: Literal["plane_strain", "axisymmetric", "3d"] = Field(description="one of plane_strain, axisymmetric, 3d")
    materials: named(Material) = Field(description="one table [materials.NAME] for each material")
    workpieces: named(Workpiece) = Field(
        default_factory=Named, description="one table [workpieces.NAME] for each body that is formed"
    )
    tools: named(Tool) = Field(default_factory=Named, description="one table [tools.NAME] for each tool")
    points: named(TrackedPoint) = Field(default_factory=Named)
    flow_lines: named(FlowLine) = Field(default_factory=Named)
    contacts: Contacts = ()
    process: Process = Process()
    steps: Steps | None = Field(None, description="a table with 'stroke' or 'time', the size of a step")
    stop: Stop | None = Field(
        None, description="a table with one of stroke, time, force, height, dead_centre, energy_spent"
    )
    output: Output = Output()
    solver: Solver = Solver()

    @classmethod
    def _requires(cls, name, values):
        if name in ("workpieces", "steps", "stop"):
            return bool(values.get("workpieces")) or not _has_bodies(values.get("tools"))
        if name == "tools":
            return not (_says(values.get("process"), "flow", False) or _says(values.get("process"), "inertia", True))
        return super()._requires(name, values)

    @model_validator(mode="before")
    @classmethod
    def _force_has_the_unit_of_the_geometry(cls, values):
        stop = values.get("stop") if isinstance(values, dict) else None
        force = stop.get("force") if isinstance(stop, dict) else None
        if isinstance(force, str) and values.get("geometry") in ("axisymmetric", "3d"):
            try:
                kind_of(Force).parse(force)
            except PydanticCustomError as error:
                raise at_key("stop.force", error.message(), force) from None
        return values

    @model_validator(mode="after")
    def _assembled_tools_have_outlines(self):
        """What workpieces meet of an assembled tool without a shape: the outline around its parts."""
        if self.workpieces and any(tool.parts and tool.shape is None for tool in self.tools.values()):
            from .joined import joined

            tools = dict(self.tools)
            for name, tool in tools.items():
                around = joined([part.shape for part in tool.parts.values()]) if tool.shape is None else None
                tools[name] = tool if around is None else tool.replaced(shape=around)
            self.__dict__["tools"] = Named(tools)
        return self

    @model_validator(mode="after")
    def _schemes_agree(self):
        if self.steps is None:
            return self
        moved = self.process.moved
        first, second = moved.scheme if moved else None, self.steps.scheme if self.steps.says("scheme") else None
        same = {first, second} <= {"implicit", "midpoint"}
        if first and second and first != second and not same:
            raise at_key("steps.scheme", f"'{second}' contradicts process.shifting '{first}'; give one of them", second)
        return self

    @property
    def axes(self):
        """Names of the coordinates: ("x", "y"), ("r", "z") or ("x", "y", "z")."""
        return AXES[self.geometry]

    @property
    def dimension(self):
        """2 or 3."""
        return len(self.axes)

    @property
    def scheme(self):
        """Name of the scheme that moves the material, one of `SCHEMES`; "midpoint" also for "implicit"."""
        return self.shifting.scheme

    @property
    def shifting(self):
        """How the material is moved, as a `Shifting` whose scheme is "midpoint" also for "implicit"."""
        moved = self.process.moved or Shifting(scheme=self.steps.scheme)
        return moved.replaced(scheme="midpoint") if moved.scheme == "implicit" else moved

    @property
    def restores_volume(self):
        """Whether lost volume is given back in every step: where that is asked for, or the mesh is renewed anyway."""
        constancy = self.process.volume_constancy
        renewed = any(body.remesh is not None for body in self.workpieces.values())
        return constancy == "each_step" or bool(constancy) and renewed

    @property
    def workpiece(self):
        """The one workpiece, or the first of several."""
        return next(iter(self.workpieces.values()))

    @property
    def workpiece_name(self):
        """Its name."""
        return next(iter(self.workpieces))

    @property
    def deforming_tools(self):
        """Names of the tools that deform while something is formed: all their materials have elastic constants."""
        if self.is_tools_alone or not self.process.flow or self.process.tool_deformation == "rigid":
            return []
        return [name for name, tool in self.tools.items() if tool.has_body and all(
            getattr(self.materials[solid.material], key) is not None
            for solid in tool.solids(name).values() for key in ("young", "poisson"))]

    @property
    def yielding_tools(self):
        """Names of the tools that deform or are on a press frame that does."""
        if not self.process.flow or self.process.tool_deformation == "rigid":
            return []
        return [name for name, tool in self.tools.items() if name in self.deforming_tools
                or tool.drive is not None and tool.drive.frame_stiffness is not None]

    @property
    def is_tools_alone(self):
        """Whether nothing is formed: deformable tools under loads of their own."""
        return not self.workpieces

    @property
    def computes_heat(self):
        """Whether the temperatures of the workpiece change."""
        return asks_for_heat(self) is not None

    @property
    def is_assembled(self):
        """Whether there are several workpieces."""
        return len(self.workpieces) > 1

    def alone(self, name):
        """The scene with one of its workpieces only, to do with that what is done with a single one."""
        return self.model_copy(update={"workpieces": Named({name: self.workpieces[name]}), "contacts": ()})

    def drive(self, name, among=None):
        """What moves a tool: its drive, of a tool that follows another one tied to that of the other.

        among : tool → what stands for its drive, as in a run
        """
        given = (among or {}).get(name, self.tools[name].drive)
        return Follower(self.drive(given.of, among), given) if isinstance(given, RatioDrive) else given

    @property
    def driven_tools(self):
        """Names of the tools that move, in order."""
        return [name for name, tool in self.tools.items() if tool.drive is not None and tool.drive.moves]

    @property
    def counting_tool(self):
        """Name of the tool whose stroke and force count in steps and stop; None if no tool moves."""
        if self.steps is not None and self.steps.tool is not None:
            return self.steps.tool
        leading = [name for name in self.driven_tools if not isinstance(self.tools[name].drive, RatioDrive)]
        travelling = [name for name in leading if self.tools[name].drive.direction is not None]
        return next(iter([*travelling, *leading]), None)

    def to_toml(self):
        """The scene as TOML text; numbers in internal units, keys with their default left out."""
        from .toml_text import toml_text

        return toml_text(self.as_table())

    @classmethod
    def json_schema(cls):
        """JSON schema of scene files, as a dict."""
        return cls.model_json_schema(by_alias=True)

    def __repr__(self):
        from .printing import tree

        return tree(self)

    __str__ = __repr__


def _says(process, key, value):
    """Whether the table of the process, as the user gives it, has this value of a key: without a flow, and of bodies that
    fly, tools may be left out."""
    given = getattr(process, key) if isinstance(process, Process) else \
        process.get(key) if isinstance(process, dict) else None
    return given is value


def _has_bodies(tools):
    """Whether a table of tools, as the user gives it, has one with a material or with parts."""
    if not isinstance(tools, dict):
        return False
    return any(tool.has_body if isinstance(tool, Tool) else isinstance(tool, dict) and not tool.keys().isdisjoint(_BODY)
               for tool in tools.values())


_BODY = ("material", "parts")
