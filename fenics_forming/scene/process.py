"""How a process is run: the way the material is moved, the steps, the end."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, WithJsonSchema, model_validator

from ..laws.described import Described, at_key
from ..units import CountFrom, Flag, ForceOrLineForce, Length, Number, Positive, Time, Within, kind_of, refused
from .cooling import Coolings

SCHEMES = ("explicit", "implicit", "midpoint", "trapezoid", "etd2", "substeps", "rotation")
Scheme = Literal["explicit", "implicit", "midpoint", "trapezoid", "etd2", "substeps", "rotation"]




TOOL_MODES = ("stress_only", "separate", "coupled", "iterated")
ToolMode = Literal["stress_only", "separate", "coupled", "iterated", "rigid"]


class Shifting(Described):
    """How the material is moved in a step.

    Parameters
    ----------
    scheme : one of `SCHEMES`; "implicit" is the midpoint scheme, solved again; "rotation" moves explicitly, the rigid
    part of the motion exactly. substeps : parts of a step in the frozen velocity field, 3 if not given.
    rule : of a sub-step, "plain" (by the velocity at its start) or "midpoint" (second order). Both belong to the scheme
    "substeps". rotation : the rigid part of the motion exactly, with any scheme.
    """

    scheme: Scheme
    substeps: CountFrom(1) = 3
    rule: Literal["plain", "midpoint"] = "plain"
    rotation: Flag = False

    @model_validator(mode="after")
    def _fits_the_scheme(self):
        for key in ("substeps", "rule"):
            if key in self.model_fields_set and self.scheme != "substeps":
                sentence = f"belongs to the scheme 'substeps', not to '{self.scheme}'; leave it out, or change the scheme"
                raise at_key(key, sentence, getattr(self, key), "the scheme 'substeps'")
        return self

    @property
    def turns_exactly(self):
        """Whether the rigid part of the motion is exact."""
        return self.rotation or self.scheme == "rotation"


def _shifting(value):
    return {"scheme": value} if isinstance(value, str) else value


def _volume_constancy(value):
    if not isinstance(value, bool) and value != "each_step":
        raise refused(value, "is not known", "true (with remeshing), 'each_step' or false")
    return value


_VOLUME_SCHEMA = WithJsonSchema({"enum": [True, False, "each_step"]})


class Process(Described):
    """Choices that concern the whole process.

    Parameters
    ----------
    shifting : how the material is moved, one of `SCHEMES` or a table with the keys of `Shifting`; the scheme is the same
    choice as `steps.scheme`. substeps : short for shifting = { scheme = "substeps", substeps = … }.
    volume_constancy : lost volume is given back to the free surface: true, where the body has `remesh`, at every
    remeshing and, so that little is due then, after every step; "each_step", also without; false, never.
    inertia : whether acceleration takes force. weight : whether gravity acts, along the negative z (in plane strain y).
    Both need the density of the material.
    tool_deformation : how tools whose material has elastic constants deform: "iterated" within every solve (the default),
    "coupled" with the velocity of the last tool step, "separate" after every tool step, "stress_only" without an effect
    on the workpiece, or "rigid", not at all. tool_guard : "coupled" falls back to "iterated" where it is not stable.
    flow : false where nothing is formed: heat alone, until a time. heat : whether temperatures are computed; if not given,
    where something asks for it (air, heat_exchange, plastic_heat_fraction, flow = false). cooling : operations between
    blows, a list of tables with the keys of `Cooling`.
    """

    shifting: Annotated[
        Shifting | None, BeforeValidator(_shifting, json_schema_input_type=Scheme | Shifting | None)
    ] = None
    substeps: CountFrom(1) | None = None
    volume_constancy: Annotated[bool | Literal["each_step"], BeforeValidator(_volume_constancy), _VOLUME_SCHEMA] = True
    tool_deformation: ToolMode = "iterated"
    tool_guard: Flag = True
    inertia: Flag = False
    weight: Flag = False
    flow: Flag = True
    heat: Flag | None = None
    cooling: Coolings = ()

    @model_validator(mode="after")
    def _one_number_of_substeps(self):
        if self.substeps is None or self.shifting is None:
            return self
        if self.shifting.scheme != "substeps":
            sentence = f"belongs to shifting 'substeps', not to '{self.shifting.scheme}'; leave one of them out"
            raise at_key("substeps", sentence, self.substeps, "shifting = 'substeps'")
        if "substeps" in self.shifting.model_fields_set and self.shifting.substeps != self.substeps:
            sentence = f"{self.substeps} contradicts {self.shifting.substeps} of shifting.substeps; give one of them"
            raise at_key("substeps", sentence, self.substeps, self.shifting.substeps)
        return self

    @property
    def moved(self):
        """The `Shifting` that the keys here ask for, or None if they leave it open."""
        if self.substeps is None:
            return self.shifting
        if self.shifting is None:
            return Shifting(scheme="substeps", substeps=self.substeps)
        return self.shifting.replaced(substeps=self.substeps)


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


_FACTOR = kind_of(Number)


def _load_steps(value):
    expected = "a number of steps such as 10, or a list of load factors such as [0.5, 1, 0]"
    if value is None:
        return None
    if isinstance(value, int) and not isinstance(value, bool):
        if value < 1:
            raise refused(value, "is too small", expected)
        return value
    if not isinstance(value, (list, tuple)) or not value:
        raise refused(value, "is no number of steps", expected)
    return tuple(_FACTOR.parse(factor) for factor in value)


_LOADS_SCHEMA = WithJsonSchema({"anyOf": [{"type": "integer"}, {"type": "array"}]})
LoadSteps = Annotated[Any, BeforeValidator(_load_steps), _LOADS_SCHEMA]


class ToolStep(Described):
    """When tools that deform are solved again: as soon as one of these has passed since they were.

    Parameters
    ----------
    time : s. deflection : mm, of the largest displacement on the surface, estimated from the force.
    """

    time: Positive(Time) | None = None
    deflection: Positive(Length) | None = None

    @model_validator(mode="after")
    def _any(self):
        if self.time is None and self.deflection is None:
            raise at_key("", "is empty; expected 'time', 'deflection' or both")
        return self


class Steps(Described):
    """How the process is cut into steps.

    Parameters
    ----------
    stroke : of the tool in a step, mm; or time : of a step, s; or loads : of tools alone, the number of equal steps to
    their full loads, or the list of load factors to go through; exactly one of them. tool : name of the tool whose
    stroke counts, the first driven one if not given. adaptive : true, or a table with the keys of `Adaptive`.
    scheme : how the material is moved in a step, one of `SCHEMES`; "implicit" is the midpoint scheme, solved again.
    tool_every : steps between two solutions of the tools that deform, in the modes "coupled" and "separate"; or tool_step,
    a table with the keys of `ToolStep`.
    """

    stroke: Positive(Length) | None = None
    time: Positive(Time) | None = None
    loads: LoadSteps = None
    scheme: Scheme = "implicit"
    adaptive: Annotated[
        Adaptive | None, BeforeValidator(_adaptive, json_schema_input_type=bool | Adaptive | None)
    ] = None
    tool: str | None = None
    tool_every: CountFrom(1) = 1
    tool_step: ToolStep | None = None

    @model_validator(mode="after")
    def _one_size(self):
        given = [key for key in ("stroke", "time", "loads") if getattr(self, key) is not None]
        if not given:
            raise at_key("stroke", "is missing; expected 'stroke' or 'time' as the size of a step")
        if len(given) > 1:
            sentence = f"is given together with '{given[0]}'; the size of a step is one of them"
            raise at_key(given[1], sentence, getattr(self, given[1]))
        if self.tool_step is not None and "tool_every" in self.model_fields_set:
            raise at_key("tool_step", "is given together with 'tool_every'; give one of them", self.tool_step)
        return self


class Stop(Described):
    """When the run ends: at the first condition that is met; at least one.

    Parameters
    ----------
    stroke : of the tool that counts in the steps, mm. time : s. force : of that tool, N (N/mm in plane strain).
    height : extent of the modelled part of the workpiece along the direction of the drive, mm. dead_centre : true, at the
    bottom dead centre of a crank press. energy_spent : true, where the last blow of a hammer or screw press has ended.
    """

    stroke: Positive(Length) | None = None
    time: Positive(Time) | None = None
    force: Positive(ForceOrLineForce) | None = None
    height: Positive(Length) | None = None
    dead_centre: Flag = False
    energy_spent: Flag = False

    @model_validator(mode="after")
    def _any(self):
        if not any((self.stroke, self.time, self.force, self.height, self.dead_centre, self.energy_spent)):
            known = "stroke, time, force, height, dead_centre, energy_spent"
            raise at_key("", f"is empty; expected at least one of {known}")
        return self
