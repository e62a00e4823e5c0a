"""A drop or power hammer."""

from typing import Literal

from ...units import Mass, Positive
from .energy import EnergyDrive


class HammerDrive(EnergyDrive):
    r"""A ram that falls on the body with a given energy, once or several times.

    The speed of impact is :math:`\sqrt{2E/M}`. On a free anvil of the mass :math:`M_a` the share
    :math:`1/(1+M/M_a)` of the energy forms, the rest moves ram and anvil on together.

    Parameters
    ----------
    mass : of the ram, t or "100 kg". energy : of a blow, mJ or "400 J"; a list for blows of different energy.
    direction : of the blow, any length. anvil_mass : of an anvil that is not held, t. efficiency : share of what is left
    that forms. blows : their number. pause : between the end of a blow and the next, s. lift : of the ram above the body at
    the end of a blow, mm; it rests on the body if not given. rotation : optional `Spin`. In plane strain mass and energy
    are those of one mm of width.

    References
    ----------
    REFERENCES.md 8.6 and 11.
    """

    kind: Literal["hammer"] = "hammer"
    mass: Positive(Mass)
    anvil_mass: Positive(Mass) | None = None

    @property
    def moving_mass(self):
        return self.mass

    @property
    def forming_share(self):
        return self.efficiency / (1 + (self.mass / self.anvil_mass if self.anvil_mass is not None else 0.0))
