"""Units at the border: strings such as "30 kN" come in, plain numbers in mm, s, t, N, MPa, mJ, degC go on.

A bare number is taken in the internal unit. `pint` is imported only when a string is met. Every type here is an
annotated `float` (or tuple of floats) for pydantic; `Positive(Length)` and `NonNegative(Length)` narrow it.
"""

import math
import re
from dataclasses import dataclass, replace
from functools import cache
from numbers import Integral, Real
from typing import Annotated, get_args

from pydantic import AfterValidator, BeforeValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*\Z", re.S)
_UNIT = re.compile(r"(?!.*(\d\d|(\*\*|\^)\s*\(|\d\s*(\*\*|\^)))[A-Za-zµμ°%²³·/*^() 0-9+-]{1,40}\Z", re.S)
_SMALLEST, _LARGEST = 1e-30, 1e30  # so that squares and products of quantities neither vanish nor overflow
_SIGNS = {None: "", "positive": "positive ", "non-negative": "non-negative "}


@dataclass(frozen=True)
class Kind:
    """One kind of quantity: its name, internal unit (as pint and as the user reads it), an example, its sign."""

    name: str
    unit: str
    example: str
    sign: str | None = None
    angular: bool = False
    also: tuple[str, ...] = ()
    low: float = -math.inf
    high: float = math.inf

    @property
    def expected(self):
        """The phrase for messages: "a positive length such as '1 mm'"."""
        sign = _SIGNS[self.sign]
        phrase = f"{sign}{self.name}"
        article = "an" if phrase[0] in "aeiou" else "a"
        bounds = f" from {self.low:g} to {self.high:g}" if math.isfinite(self.high) else ""
        return f"{article} {phrase}{bounds} such as {self.example}"

    def parse(self, value):
        """The value in internal units; a bad one raises PydanticCustomError (a `ValueError`) that says why."""
        number = self._from_text(value) if isinstance(value, str) else self._from_number(value)
        if not math.isfinite(number):
            raise self.refused(value, "is not finite")
        if abs(number) > _LARGEST or self.sign == "positive" and 0 < number < _SMALLEST:
            raise self.refused(value, "is beyond every sensible size")
        if self.sign == "positive" and number <= 0:
            raise self.refused(value, "is not positive")
        if self.sign == "non-negative" and number < 0:
            raise self.refused(value, "is negative")
        if not self.low <= number <= self.high:
            raise self.refused(value, "is out of range")
        return number

    def refused(self, value, why):
        """The error for a value of this kind."""
        return refused(value, why, self.expected)

    def _from_number(self, value):
        if isinstance(value, bool) or not isinstance(value, Real):
            raise self.refused(value, "is not " + ("a number" if self.unit == "" else "a quantity"))
        try:
            return float(value)
        except OverflowError:
            raise self.refused(value, "is not finite") from None

    def _from_text(self, text):
        if re.fullmatch(r"\s*[+-]?(nan|inf|infinity)\b.*", text, re.I | re.S):
            raise self.refused(text, "is not finite")
        match = _NUMBER.match(text)
        if match is None:
            raise self.refused(text, "cannot be read")
        number, unit = float(match[1]), match[2]
        if unit == "" and self.unit != "":
            raise self.refused(text, "has no unit")
        return _convert(number, unit, self, text) if unit else number


def refused(value, why, expected):
    """A pydantic error that carries what was found and what is expected; scene errors are made from it."""
    return PydanticCustomError(
        "refused", "{got} {why}; expected {expected}", {"got": shown(value), "why": why, "expected": expected}
    )


def shown(value):
    """The value as the user wrote it, cut to a readable length, on one line."""
    text = ("true" if value else "false") if isinstance(value, bool) else repr(value)
    text = " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."


@cache
def _registry():
    import pint

    return pint.UnitRegistry()


def _convert(number, unit, kind, text):
    import pint

    registry = _registry()
    try:
        if _UNIT.match(unit) is None:  # pint would evaluate towers of powers
            raise ValueError(unit)
        parsed = registry.parse_units(unit)
        root = registry.Quantity(1, parsed).to_root_units() if kind.name != "temperature" else None
    except Exception:  # pint raises tokenizer, syntax, attribute and definition errors on odd text
        raise kind.refused(text, f"has an unknown unit '{' '.join(unit.split())}'") from None
    if root is not None and ("radian" in root.units._units) != kind.angular:
        # to pint an angle is a pure number: 40 Hz would pass as 40 rad/s, and 40 rpm as a strain rate
        raise kind.refused(text, "has the wrong dimension")
    for target in (kind.unit, *kind.also):
        try:
            inside = registry.Quantity(number, parsed).to(target or "dimensionless").magnitude
            return float(f"{inside:.15g}")  # 7833 kg/m^3 is 7.833e-09 t/mm^3, without round-off from the factors
        except (pint.DimensionalityError, pint.OffsetUnitCalculusError):
            continue
    raise kind.refused(text, "has the wrong dimension")


def _type_of(kind):
    schema = {"type": "number"} if kind.unit == "" else {"anyOf": [{"type": "number"}, {"type": "string"}]}
    unit = f", in {kind.unit}" if kind.unit else ""
    schema |= {"description": f"{kind.expected}; a bare number is taken as it is{unit}"}
    return Annotated[float, BeforeValidator(kind.parse), WithJsonSchema(schema), kind]


def kind_of(annotation):
    """The `Kind` inside an annotation such as `Length | None` or a tuple of lengths; None if there is none."""
    if isinstance(annotation, Kind):
        return annotation
    for part in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        found = kind_of(part)
        if found is not None:
            return found
    return None


def Positive(quantity):
    """The same quantity, greater than zero."""
    return _type_of(replace(kind_of(quantity), sign="positive"))


def NonNegative(quantity):
    """The same quantity, zero or greater."""
    return _type_of(replace(kind_of(quantity), sign="non-negative"))


def Within(quantity, low, high):
    """The same quantity between two bounds, both included, in internal units."""
    return _type_of(replace(kind_of(quantity), low=low, high=high))


def Vector(quantity, *sizes):
    """A tuple of two or three (or as many as `sizes` says) components of a quantity."""
    kind, sizes = kind_of(quantity), sizes or (2, 3)
    names = {2: "two", 3: "three"}
    count = " or ".join(names[size] for size in sizes)

    def parse(value):
        expected = f"{count} components, each {kind.expected}"
        if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__len__"):
            raise refused(value, "is not a list", expected)
        if len(value) not in sizes:
            raise refused(list(value), f"has {len(value)} component{'s' * (len(value) != 1)}", expected)
        return tuple(kind.parse(component) for component in value)

    item = {"type": "number"} if kind.unit == "" else {"anyOf": [{"type": "number"}, {"type": "string"}]}
    schema = {"type": "array", "items": item, "minItems": min(sizes), "maxItems": max(sizes)}
    return Annotated[tuple[float, ...], BeforeValidator(parse), WithJsonSchema(schema), kind]


def List(quantity, *, at_least=1):
    """A tuple of any number of values of a quantity, at least `at_least`."""
    kind = kind_of(quantity)

    def parse(value):
        expected = f"a list of at least {at_least}, each {kind.expected}"
        if isinstance(value, (str, bytes, dict)) or not hasattr(value, "__len__"):
            raise refused(value, "is not a list", expected)
        if len(value) < at_least:
            raise refused(list(value), "is too short", expected)
        return tuple(kind.parse(item) for item in value)

    item = {"type": "number"} if kind.unit == "" else {"anyOf": [{"type": "number"}, {"type": "string"}]}
    schema = {"type": "array", "items": item, "minItems": at_least}
    return Annotated[tuple[float, ...], BeforeValidator(parse), WithJsonSchema(schema), kind]


def _whole(value):
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 0:
        raise refused(value, "is not a count", "a whole number such as 10")
    return int(value)


def _flag(value):
    if not isinstance(value, bool):
        raise refused(value, "is not a yes or no", "true or false")
    return value


def format_quantity(value, unit=""):
    """`format_quantity(1.5, "mm")` → "1.5 mm"; tuples print as "(0, -1) mm/s"; six figures."""
    if isinstance(value, (tuple, list)):
        text = "(" + ", ".join(format_quantity(component) for component in value) + ")"
    else:
        text = f"{value + 0.0:.6g}"
    return f"{text} {unit}".strip()


Number = _type_of(Kind("number", "", "0.3"))
Length = _type_of(Kind("length", "mm", "'1 mm'"))
Area = _type_of(Kind("area", "mm^2", "'100 mm^2'"))
Time = _type_of(Kind("time", "s", "'0.1 s'"))
Speed = _type_of(Kind("speed", "mm/s", "'-1 mm/s'"))
Rate = _type_of(Kind("strain rate", "1/s", "'1 1/s'"))
Angle = _type_of(Kind("angle", "rad", "'30 deg'", angular=True))
AngularSpeed = _type_of(Kind("angular speed", "rad/s", "'40 rpm'", angular=True))
Mass = _type_of(Kind("mass", "t", "'100 kg'"))
Density = _type_of(Kind("density", "t/mm^3", "'7833 kg/m^3'"))
Force = _type_of(Kind("force", "N", "'30 kN'"))
ForceOrLineForce = _type_of(Kind("force", "N", "'30 kN' ('300 N/mm' in plane strain)", also=("N/mm",)))
Stiffness = _type_of(Kind("stiffness", "N/mm", "'200 kN/mm' ('200 kN/mm^2' in plane strain)", also=("N/mm^2",)))
Torque = _type_of(Kind("torque", "N*mm", "'2 N*m'", also=("N",)))
Bedding = _type_of(Kind("stiffness of a bed", "N/mm^3", "'1e5 N/mm^3'"))
Stress = _type_of(Kind("stress", "MPa", "'100 MPa'"))
ReciprocalStress = _type_of(Kind("reciprocal stress", "1/MPa", "'0.04 1/MPa'"))
Energy = _type_of(Kind("energy", "mJ", "'400 J'"))
MolarEnergy = _type_of(Kind("energy per amount", "J/mol", "'150 kJ/mol'"))
Temperature = _type_of(Kind("temperature", "degC", "'20 degC'", low=-273.15))
Conductivity = _type_of(Kind("heat conductivity", "mJ/s/mm/K", "'28 W/m/K'"))
SpecificHeat = _type_of(Kind("specific heat", "mJ/t/K", "'650 J/kg/K'"))
HeatTransferCoefficient = _type_of(Kind("heat transfer coefficient", "mJ/s/mm^2/K", "'10000 W/m^2/K'"))
Expansion = _type_of(Kind("thermal expansion", "1/K", "'1.2e-5 1/K'"))

Count = Annotated[int, BeforeValidator(_whole), WithJsonSchema({"type": "integer", "minimum": 0})]
Flag = Annotated[bool, BeforeValidator(_flag)]


def CountFrom(least):
    """A whole number from `least` on."""
    def enough(value):
        if value < least:
            raise refused(value, "is too small", f"a whole number from {least} on")
        return value

    return Annotated[Count, AfterValidator(enough)]
