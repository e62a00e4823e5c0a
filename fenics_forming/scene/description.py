"""The scene: everything that the user writes, as one frozen tree; the same from Python and from TOML."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from ..laws import DriveLaw, FlowStressLaw, FrictionLaw, NoFriction
from ..laws.described import Described, at_key
from ..units import (
    Conductivity,
    Count,
    Density,
    Expansion,
    Flag,
    Force,
    ForceOrLineForce,
    Length,
    List,
    NonNegative,
    Number,
    Positive,
    SpecificHeat,
    Stress,
    Temperature,
    Time,
    Vector,
    Within,
    kind_of,
    refused,
)
from .names import Axes, Named, named
from .shapes import BodyShape
from .tool_shapes import ToolShape

AXES = {"plane_strain": ("x", "y"), "axisymmetric": ("r", "z"), "3d": ("x", "y", "z")}
"""Names of the coordinates of every geometry kind."""

SCHEMES = ("explicit", "implicit", "midpoint", "trapezoid", "etd2")
Scheme = Literal["explicit", "implicit", "midpoint", "trapezoid", "etd2"]
Fraction = Within(Number, 0, 1)


def _at_least_one(value):
    if value < 1:
        raise refused(value, "is too small", "a whole number from 1 on")
    return value


class Material(Described):
    """What a body is made of.

    Parameters
    ----------
    flow_stress : a flow-stress law. young, yield_stress, hardening : MPa. expansion : 1/K. density : t/mm^3.
    conductivity : mJ/s/mm/K. specific_heat : mJ/t/K. poisson, plastic_heat_fraction : numbers.
    """

    flow_stress: FlowStressLaw | None = None
    density: Positive(Density) | None = None
    conductivity: Positive(Conductivity) | None = None
    specific_heat: Positive(SpecificHeat) | None = None
    plastic_heat_fraction: Fraction | None = None
    young: Positive(Stress) | None = None
    poisson: Within(Number, 0, 0.4999) | None = None
    yield_stress: Positive(Stress) | None = None
    hardening: NonNegative(Stress) | None = None
    expansion: NonNegative(Expansion) | None = None


class Remesh(Described):
    """When and how a mesh is renewed.

    Parameters
    ----------
    min_quality : least quality of an element, 0 to 1. chord : largest distance between element side and surface, mm.
    """

    min_quality: Fraction | None = None
    chord: Positive(Length) | None = None
    max_size: Positive(Length) | None = None
    min_size: Positive(Length) | None = None


class Workpiece(Described):
    """A body that is formed.

    Parameters
    ----------
    shape : a body shape. material : name of a material. symmetry : axes; the body's low face on each is a mirror plane,
    a round body is cut in half through its centre.
    mesh_size : mm, chosen from the shape if not given. temperature : degC, constant, for the flow-stress law.
    """

    shape: BodyShape = Field(description="a shape such as { kind = 'rectangle', from = [0, 0], to = [10, 15] }")
    material: str = Field(description="the name of a material")
    symmetry: Axes = ()
    mesh_size: Positive(Length) | None = None
    temperature: Temperature | None = None
    remesh: Remesh | None = None


class Tool(Described):
    """A rigid tool.

    Parameters
    ----------
    shape : a tool shape. drive : how it moves; at rest without. friction : on its surface, none if not given.
    symmetry : axes; the low face of a closed shape on each is a mirror plane.
    """

    shape: ToolShape = Field(description="a shape such as { kind = 'plane', point = [0, 15], normal = [0, -1] }")
    drive: DriveLaw | None = None
    friction: FrictionLaw = NoFriction()
    symmetry: Axes = ()


class TrackedPoint(Described):
    """A material point whose place and state go into the history.

    Parameters
    ----------
    body : name of a workpiece. at : its place at the start, mm.
    """

    body: str = Field(description="the name of a workpiece")
    at: Vector(Length)


class Process(Described):
    """Choices that concern the whole process.

    Parameters
    ----------
    shifting : how the material is moved, one of `SCHEMES`; the same choice as `steps.scheme`.
    """

    shifting: Scheme | None = None


class Adaptive(Described):
    """Steps chosen by the run.

    Parameters
    ----------
    max_strain_increment : largest increment of effective strain in a step. tolerance : relative error of a step.
    min_fraction : shortest step, as a fraction of the given one.
    """

    max_strain_increment: Positive(Number) = 0.05
    tolerance: Positive(Number) = 1e-3
    min_fraction: Within(Positive(Number), 0, 1) = 1e-3


def _adaptive(value):
    return {True: Adaptive(), False: None}[value] if isinstance(value, bool) else value


class Steps(Described):
    """How the process is cut into steps.

    Parameters
    ----------
    stroke : of the tool in a step, mm; or time : of a step, s; exactly one of them. tool : name of the tool whose
    stroke counts, the first driven one if not given. adaptive : true, or a table with the keys of `Adaptive`.
    scheme : how the material is moved in a step, one of `SCHEMES`; "implicit" is the midpoint scheme, solved again.
    """

    stroke: Positive(Length) | None = None
    time: Positive(Time) | None = None
    scheme: Scheme = "implicit"
    adaptive: Annotated[Adaptive | None, BeforeValidator(_adaptive)] = None
    tool: str | None = None

    @model_validator(mode="after")
    def _one_size(self):
        if self.stroke is None and self.time is None:
            raise at_key("stroke", "is missing; expected 'stroke' or 'time' as the size of a step")
        if self.stroke is not None and self.time is not None:
            raise at_key("time", "is given together with 'stroke'; the size of a step is one of them", self.time)
        return self


class Stop(Described):
    """When the run ends: at the first condition that is met; at least one.

    Parameters
    ----------
    stroke : of the tool that counts in the steps, mm. time : s. force : of that tool, N (N/mm in plane strain).
    height : extent of the modelled part of the workpiece along the direction of the drive, mm.
    """

    stroke: Positive(Length) | None = None
    time: Positive(Time) | None = None
    force: Positive(ForceOrLineForce) | None = None
    height: Positive(Length) | None = None

    @model_validator(mode="after")
    def _any(self):
        if all(value is None for value in (self.stroke, self.time, self.force, self.height)):
            raise at_key("", "is empty; expected at least one of stroke, time, force, height")
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
    augmented : augmented-Lagrange update of the contact pressure.

    References
    ----------
    Defaults and the errors that they cost: FORMULATION.md 1 and 3.
    """

    regularisation: Positive(Number) = 1.5e-3
    slip_regularisation: Positive(Number) = 1e-3
    velocity_tolerance: Positive(Number) = 1e-2
    force_tolerance: Positive(Number) = 2e-3
    max_iterations: Annotated[Count, AfterValidator(_at_least_one)] = 40
    penalty_factor: Positive(Number) = 10.0
    augmented: Flag = True


class Scene(Described):
    """A forming process as the user describes it; see `read_scene` for scene files and `check` for its sense.

    Parameters
    ----------
    title : any text. geometry : "plane_strain" (x, y; forces per mm), "axisymmetric" (r, z; forces of the full
    turn) or "3d". materials, workpieces, tools, points : tables by name. process, steps, stop, output, solver.
    """

    title: str = ""
    geometry: Literal["plane_strain", "axisymmetric", "3d"] = Field(description="one of plane_strain, axisymmetric, 3d")
    materials: named(Material) = Field(description="one table [materials.NAME] for each material")
    workpieces: named(Workpiece) = Field(description="one table [workpieces.NAME]")
    tools: named(Tool) = Field(description="one table [tools.NAME] for each tool")
    points: named(TrackedPoint) = Field(default_factory=Named)
    process: Process = Process()
    steps: Steps = Field(description="a table with 'stroke' or 'time', the size of a step")
    stop: Stop = Field(description="a table with one of stroke, time, force, height")
    output: Output = Output()
    solver: Solver = Solver()

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
    def _schemes_agree(self):
        first, second = self.process.shifting, self.steps.scheme if "scheme" in self.steps.model_fields_set else None
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
        """How the material is moved: "explicit", "midpoint" (also for "implicit"), "trapezoid" or "etd2"."""
        chosen = self.process.shifting if self.process.shifting else self.steps.scheme
        return "midpoint" if chosen == "implicit" else chosen

    @property
    def workpiece(self):
        """The one workpiece."""
        return next(iter(self.workpieces.values()))

    @property
    def workpiece_name(self):
        """Its name."""
        return next(iter(self.workpieces))

    @property
    def driven_tools(self):
        """Names of the tools that move, in order."""
        return [name for name, tool in self.tools.items() if tool.drive is not None and tool.drive.moves]

    @property
    def counting_tool(self):
        """Name of the tool whose stroke and force count in steps and stop; None if no tool moves."""
        if self.steps.tool is not None:
            return self.steps.tool
        travelling = [name for name in self.driven_tools if self.tools[name].drive.direction is not None]
        return next(iter([*travelling, *self.driven_tools]), None)

    def to_toml(self):
        """The scene as TOML text; numbers in internal units, keys with their default left out."""
        from .scene_file import scene_as_toml

        return scene_as_toml(self)

    @classmethod
    def json_schema(cls):
        """JSON schema of scene files, as a dict."""
        return cls.model_json_schema(by_alias=True)

    def __repr__(self):
        from .printing import tree

        return tree(self)

    __str__ = __repr__
