"""The scene: everything that the user writes, as one frozen tree; the same from Python and from TOML."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from ..laws import DriveLaw, FlowStressLaw, Follower, FrictionLaw, NoFriction, RatioDrive
from ..laws.damage import DamageLaw
from ..laws.described import Described, at_key
from ..laws.elasticity import Elasticity, Hardening
from ..laws.heat_exchange import Air, HeatExchangeLaw, NoExchange
from ..units import (
    Conductivity,
    Count,
    Density,
    Expansion,
    Flag,
    Force,
    Length,
    List,
    NonNegative,
    Number,
    Positive,
    SpecificHeat,
    Stress,
    Temperature,
    Vector,
    Within,
    kind_of,
    refused,
)
from .contacts import Contacts
from .heat import asks_for_heat
from .initial_velocity import InitialVelocity
from .library import FromLibrary
from .meshes import Refine, RemeshField
from .names import Axes, Named, named
from .process import CountFromOne, Process, Shifting, Steps, Stop
from .shapes import BodyShape
from .solids import Part, Solid
from .tool_shapes import ToolShape

AXES = {"plane_strain": ("x", "y"), "axisymmetric": ("r", "z"), "3d": ("x", "y", "z")}
"""Names of the coordinates of every geometry kind."""

Fraction = Within(Number, 0, 1)


def _at_least_two(value):
    if value < 2:
        raise refused(value, "is too small", "a whole number from 2 on")
    return value


class Material(FromLibrary):
    """What a body is made of.

    Parameters
    ----------
    from_ (key `from`) : name of a material of the library (`forming materials`); its keys hold where no other is given.
    flow_stress : a flow-stress law. damage : a damage law, followed only if given. young, yield_stress : MPa.
    hardening : slope of the yield stress over the plastic strain, MPa, or pairs (plastic strain, stress in MPa).
    expansion : 1/K. density : t/mm^3.
    conductivity : mJ/s/mm/K. specific_heat : mJ/t/K. poisson, plastic_heat_fraction : numbers.
    """

    flow_stress: FlowStressLaw | None = None
    damage: DamageLaw | None = None
    density: Positive(Density) | None = None
    conductivity: Positive(Conductivity) | None = None
    specific_heat: Positive(SpecificHeat) | None = None
    plastic_heat_fraction: Fraction | None = None
    young: Positive(Stress) | None = None
    poisson: Within(Number, 0, 0.4999) | None = None
    yield_stress: Positive(Stress) | None = None
    hardening: Hardening | None = None
    expansion: NonNegative(Expansion) | None = None

    @property
    def elasticity(self):
        """The law of a body that deforms elastically; None without elastic constants."""
        if self.young is None or self.poisson is None:
            return None
        keys = ("young", "poisson", "yield_stress", "hardening", "expansion")
        return Elasticity(**{key: value for key in keys if (value := getattr(self, key)) is not None})


class Workpiece(Described):
    """A body that is formed.

    Parameters
    ----------
    shape : a body shape. material : name of a material. symmetry : axes; the body's low face on each is a mirror plane,
    a round body is cut in half through its centre.
    mesh_size : mm, chosen from the shape if not given. remesh : true or a table with the keys of `Remesh`; the mesh is
    never renewed if not given. refine : list of domains with finer elements, for the first mesh and every later one.
    temperature : degC, at the start; it stays where nothing asks for temperatures to be computed. air : what the free
    surface gives heat to. initial_velocity : mm/s, its components, or a table with the
    `kind` "uniform", "homogeneous" or "rotation"; at rest if not given.
    """

    shape: BodyShape = Field(description="a shape such as { kind = 'rectangle', from = [0, 0], to = [10, 15] }")
    material: str = Field(description="the name of a material")
    symmetry: Axes = ()
    mesh_size: Positive(Length) | None = None
    temperature: Temperature | None = None
    air: Air | None = None
    remesh: RemeshField = None
    refine: Refine = ()
    initial_velocity: InitialVelocity | None = None


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


class TrackedPoint(Described):
    """A material point whose place and state go into the history.

    Parameters
    ----------
    body : name of a workpiece; of tools that deform, name of the tool or part. at : its place at the start, mm.
    """

    body: str = Field(description="the name of a workpiece")
    at: Vector(Length)


class FlowLine(Described):
    """A straight line of material points at the start, followed through the run.

    Parameters
    ----------
    body : name of a workpiece. from_ (key `from`), to : its ends, mm. points : their number, ends included.
    """

    body: str = Field(description="the name of a workpiece")
    from_: Vector(Length) = Field(alias="from")
    to: Vector(Length)
    points: Annotated[Count, AfterValidator(_at_least_two)] = 100

    @model_validator(mode="after")
    def _has_a_length(self):
        if len(self.from_) != len(self.to):
            raise at_key("to", f"has {len(self.to)} components, 'from' has {len(self.from_)}", self.to)
        if self.from_ == self.to:
            raise at_key("to", "is the same point as 'from'; the line has no length", self.to)
        return self


class Output(Described):
    """What is written, and when.

    Parameters
    ----------
    fields_every : steps between two frames; 0 for the start and the end only. strokes : mm, strokes that are hit
    exactly and written. checkpoint_every : steps between two checkpoints; 0 for none.
    """

    fields_every: Count = 10
    strokes: List(Positive(Length), at_least=0) = ()
    checkpoint_every: Count = 10


class Solver(Described):
    """Numerical parameters; none of them is a property of the material.

    Parameters
    ----------
    regularisation : of the strain rate, relative to tool speed / body size. slip_regularisation : of the slip velocity,
    relative to the tool speed. velocity_tolerance, force_tolerance : relative changes at which Newton stops.
    max_iterations : of Newton in a solve. penalty_factor : contact penalty relative to the stiffness of the surface.
    augmented : augmented-Lagrange update of the contact pressure. linear : how the equations of an iteration are solved,
    "direct", "iterative" (in space), or "auto".

    References
    ----------
    Defaults and the errors that they cost: FORMULATION.md 1 and 3.
    """

    regularisation: Positive(Number) = 1.5e-3
    slip_regularisation: Positive(Number) = 1e-3
    velocity_tolerance: Positive(Number) = 1e-2
    force_tolerance: Positive(Number) = 2e-3
    max_iterations: CountFromOne = 40
    penalty_factor: Positive(Number) = 10.0
    augmented: Flag = True
    linear: Literal["auto", "direct", "iterative"] = "auto"


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
