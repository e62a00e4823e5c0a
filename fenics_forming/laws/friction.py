"""Friction laws: the largest friction stress in MPa from contact pressure and flow stress (FORMULATION.md 3)."""

from typing import Literal

import numpy as np
from pydantic import ConfigDict

from ..units import NonNegative, Number, Within
from .described import Described, one_of
from .flow_stress import SHEAR
from .functions import exp, maximum, minimum, zeros_like

Factor = Within(Number, 0, 1)


class Friction(Described):
    """Base of the friction laws: `limit(pressure, flow_stress)`, its `rise` with the pressure,
    `depends_on_pressure`, `sticks`, `acts`."""

    model_config = ConfigDict(ignored_types=(bool,))

    depends_on_pressure = False
    sticks = False
    acts = True

    def limit(self, pressure, flow_stress):
        """Largest friction stress, MPa; the friction stress points against the slip velocity.

        Parameters
        ----------
        pressure : contact pressure, MPa, positive in compression. flow_stress : MPa.
            Floats, arrays of one broadcast shape, or UFL scalars.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say what its friction stress is")

    def rise(self, pressure, flow_stress):
        """Derivative of the limit by the pressure; arguments as of `limit`, numbers or arrays."""
        return zeros_like(pressure, flow_stress)


class NoFriction(Friction):
    """tau = 0: the surface slips freely and no friction term is built (`acts` is False)."""

    law: Literal["none"] = "none"
    acts = False

    def limit(self, pressure, flow_stress):
        return zeros_like(pressure, flow_stress)


class Siebel(Friction):
    """tau = factor * k, k = flow stress / sqrt(3).

    Parameters
    ----------
    factor : 0 to 1.
    """

    law: Literal["siebel"] = "siebel"
    factor: Factor

    def limit(self, pressure, flow_stress):
        return self.factor * SHEAR * flow_stress + zeros_like(pressure, flow_stress)


class Coulomb(Friction):
    """tau = min(coefficient * pressure, k); no friction where the pressure is negative.

    Parameters
    ----------
    coefficient : 0 or greater.
    """

    law: Literal["coulomb"] = "coulomb"
    coefficient: NonNegative(Number)
    depends_on_pressure = True

    def limit(self, pressure, flow_stress):
        return minimum(self.coefficient * maximum(pressure, 0.0), SHEAR * flow_stress)

    def rise(self, pressure, flow_stress):
        return np.where((pressure > 0) & (self.coefficient * pressure < SHEAR * flow_stress), self.coefficient, 0.0)


class Levanov(Friction):
    """tau = factor * k * (1 - exp(-1.25 pressure / flow_stress)); Siebel at high, Coulomb at low pressure.

    Parameters
    ----------
    factor : 0 to 1.
    """

    law: Literal["levanov"] = "levanov"
    factor: Factor
    depends_on_pressure = True

    def limit(self, pressure, flow_stress):
        return self.factor * SHEAR * flow_stress * (1.0 - exp(-1.25 * maximum(pressure, 0.0) / flow_stress))

    def rise(self, pressure, flow_stress):
        return np.where(pressure > 0, 1.25 * self.factor * SHEAR * exp(-1.25 * maximum(pressure, 0.0) / flow_stress), 0.0)


class Sticking(Friction):
    """No slip: what touches the tool moves with it (`sticks` is True), whatever stress that takes."""

    law: Literal["sticking"] = "sticking"
    sticks = True

    def limit(self, pressure, flow_stress):
        return np.inf + zeros_like(pressure, flow_stress)


FrictionLaw = one_of("law", NoFriction, Siebel, Coulomb, Levanov, Sticking, base=Friction)
