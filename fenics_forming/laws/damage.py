"""Damage laws: how much of its ductility the material uses up while it is strained."""

from typing import Literal

from ..units import Number, Positive
from .described import Described, one_of
from .functions import maximum


class Damage(Described):
    """Base of the damage laws: `rate(principal_stress, flow_stress)` and `critical`, or None."""

    critical: Positive(Number) | None = None

    def rate(self, principal_stress, flow_stress):
        """Damage per unit of effective strain.

        Parameters
        ----------
        principal_stress : the largest one, MPa, positive in tension. flow_stress : MPa.
            Floats, arrays of one broadcast shape, or UFL scalars.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say how damage grows")


class CockcroftLatham(Damage):
    """D = integral of max(sigma_1, 0) / flow stress over the effective strain (normalised).

    Parameters
    ----------
    critical : the value at which a crack is expected; only reported, the material does not soften.

    References
    ----------
    Cockcroft and Latham, J. Inst. Metals 96 (1968) 33-39, in the form divided by the flow stress.
    """

    law: Literal["cockcroft_latham"] = "cockcroft_latham"

    def rate(self, principal_stress, flow_stress):
        return maximum(principal_stress, 0.0) / flow_stress


DamageLaw = one_of("law", CockcroftLatham, base=Damage)
