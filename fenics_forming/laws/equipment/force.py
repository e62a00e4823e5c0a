"""A tool that presses with a given force."""

import math
from typing import Literal

from pydantic import Field, model_validator

from ...units import ForceOrLineForce, Number, Positive, Speed, Vector
from .drive import Translation, check_direction, check_spin, unit

STEEP = 1e-3     # share of the force over which the speed falls from the given one to nothing


class ForceDrive(Translation):
    """Presses with a given force, no faster than a given speed: as fast as the body gives way to the force.

    Where the body resists less than the force, the tool moves with the speed; where it resists more, it stands still.
    What is said of time here is the motion that nothing resists.

    Parameters
    ----------
    force : N (N/mm in plane strain), of the whole tool. speed : mm/s, the greatest. direction : any length.
    rotation : optional `Spin`, or a table of its keys.
    """

    kind: Literal["force"] = "force"
    force: Positive(ForceOrLineForce)
    speed: Positive(Speed)
    given_direction: Vector(Number) = Field(alias="direction")

    @model_validator(mode="after")
    def _has_a_direction(self):
        check_spin(self.rotation, len(self.given_direction))
        check_direction(self.given_direction)
        return self

    @property
    def force_limit(self):
        return self.force

    @property
    def yields_from(self):
        """Share of the force limit from which on the tool is slower than given."""
        return 1.0 - STEEP

    @property
    def dimension(self):
        return len(self.given_direction)

    @property
    def direction(self):
        return unit(self.given_direction)

    def velocity(self, time):
        return self.speed * self.direction

    def displacement(self, time):
        return self.travel(time) * self.direction

    def travel(self, time):
        return self.speed * time

    def time_of_travel(self, travel, start=0.0):
        return max(start, travel / self.speed) if math.isfinite(travel) else math.inf
