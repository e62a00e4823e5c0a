"""How a body gives heat to its tools and to the air (FORMULATION.md 9); temperatures in degC, kelvin inside radiation."""

from math import sqrt
from typing import Literal

from pydantic import ConfigDict, Field, model_validator

from ..units import CountFrom, HeatTransferCoefficient, NonNegative, Number, Positive, Temperature, Within
from .described import Described, at_key, one_of

ZERO_CELSIUS = 273.15                 # K
STEFAN_BOLTZMANN = 5.670374419e-11    # mW/mm²/K⁴


def effusivity(material):
    """sqrt(conductivity · density · specific heat) of a material, mJ/(mm² K s^½): how much heat a surface takes up."""
    return sqrt(material.conductivity * material.density * material.specific_heat)


class HeatExchange(Described):
    """Base of what a tool does with heat: `acts`, and `coefficient` where it does; `warms` where it becomes hotter."""

    model_config = ConfigDict(ignored_types=(bool,))

    acts, warms = True, False


class NoExchange(HeatExchange):
    """The tool takes no heat: its surface insulates, and all friction heat stays in the workpiece."""

    kind: Literal["none"] = "none"
    acts = False


class ConstantExchange(HeatExchange):
    """q = coefficient · (T - temperature): the tool keeps its temperature, whatever it is given.

    Parameters
    ----------
    temperature : of the tool, degC. coefficient : mJ/s/mm^2/K.
    """

    kind: Literal["constant"] = "constant"
    temperature: Temperature
    coefficient: Positive(HeatTransferCoefficient)


class ColumnExchange(HeatExchange):
    """Below every point of its surface lies a column of the tool, infinitely deep and insulated from its neighbours.

    Parameters
    ----------
    material : of the tool, the name of a material; that of the tool if not given. temperature : at the start, degC.
    coefficient : mJ/s/mm^2/K.
    """

    warms = True
    kind: Literal["column"] = "column"
    material: str | None = Field(None, description="the name of a material")
    temperature: Temperature
    coefficient: Positive(HeatTransferCoefficient)


class CoupledExchange(HeatExchange):
    """The temperature of the tool is a field on a mesh of its own; what the workpiece gives, the tool takes.

    Parameters
    ----------
    material : of the tool, the name of a material; that of the tool if not given. temperature : at the start, degC.
    coefficient : mJ/s/mm^2/K. every : steps of the workpiece in a step of the tool's conduction.
    """

    warms = True
    kind: Literal["coupled"] = "coupled"
    material: str | None = Field(None, description="the name of a material")
    temperature: Temperature
    coefficient: Positive(HeatTransferCoefficient)
    every: CountFrom(1) = 1


HeatExchangeLaw = one_of("kind", NoExchange, ConstantExchange, ColumnExchange, CoupledExchange, base=HeatExchange)


class Air(Described):
    """What surrounds the free surface: q = coefficient · (T - temperature) + emissivity · sigma · (T^4 - temperature^4).

    Parameters
    ----------
    temperature : degC. coefficient : of convection, mJ/s/mm^2/K. emissivity : 0 to 1; no radiation if not given.
    """

    temperature: Temperature = 20.0
    coefficient: NonNegative(HeatTransferCoefficient) | None = None
    emissivity: Within(Number, 0, 1) | None = None

    @property
    def ways(self):
        """How it takes heat, as words."""
        return ["air"] * bool(self.coefficient) + ["radiation"] * bool(self.emissivity)

    @model_validator(mode="after")
    def _takes_heat(self):
        if not self.coefficient and not self.emissivity:
            raise at_key("coefficient", "is missing; the air takes heat by 'coefficient', 'emissivity' or both")
        return self
