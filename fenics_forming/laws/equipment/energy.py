"""Drives that bring an energy and end where it is spent: what hammer and screw press share."""

import math
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ...units import Count, Energy, Length, List, NonNegative, Number, Positive, Time, Vector, Within
from ..described import at_key
from .drive import Directed, Translation, check_direction, check_spin, listed

Energies = Annotated[List(Positive(Energy)), BeforeValidator(listed)]


class EnergyDrive(Directed, Translation):
    r"""A ram whose energy the body takes, blow by blow; its motion is known only together with the force it meets.

    With the force F on the tool, the moving mass M and the share :math:`\eta` of the energy that forms,

    .. math:: \tfrac12 M w^2 = E - W/\eta ,\qquad W=\int F\,ds ,\qquad M\,\dot w = -F/\eta ;

    a blow ends at :math:`W=\eta E`, the rest of the energy goes elsewhere. Before the ram meets a body its speed is
    constant: the weight of the ram is part of the energy. What is said of time here is that free flight.
    """

    given_direction: Vector(Number) = Field(alias="direction")
    energy: Energies
    efficiency: Within(Positive(Number), 0, 1) = 1.0
    blows: Count | None = None
    pause: NonNegative(Time) = 0.0
    lift: NonNegative(Length) = 0.0

    @model_validator(mode="after")
    def _blows_fit(self):
        check_spin(self.rotation, len(self.given_direction))
        check_direction(self.given_direction)
        if self.blows == 0:
            raise at_key("blows", "0 is too small; expected a whole number from 1 on", 0, "a whole number from 1 on")
        if self.blows is not None and len(self.energy) not in (1, self.blows):
            sentence = f"has {len(self.energy)} values for {self.blows} blows; expected one for all, or one for each"
            raise at_key("energy", sentence, self.energy, "one value, or one for each blow")
        return self

    @property
    def energies(self):
        """Energy of every blow, mJ."""
        return self.energy * (self.blows or 1) if len(self.energy) == 1 else self.energy

    @property
    def moving_mass(self):
        """Mass that stands for all that moves, t."""
        raise NotImplementedError(f"{type(self).__name__} has no moving mass")

    @property
    def forming_share(self):
        """Share of the energy that forms."""
        return self.efficiency

    def impact_speed(self, energy):
        """Speed of the ram with an energy, mm/s."""
        return math.sqrt(2 * energy / self.moving_mass)

    @property
    def spends_energy(self):
        return True

    def velocity(self, time):
        return self.impact_speed(self.energies[0]) * self.direction

    def displacement(self, time):
        return np.asarray(self.velocity(time) * time)

    def travel(self, time):
        return self.impact_speed(self.energies[0]) * time

    def time_of_travel(self, travel, start=0.0):
        return max(start, travel / self.impact_speed(self.energies[0]))
