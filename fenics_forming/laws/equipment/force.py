"""A tool that presses with a given force."""

import math
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from ...units import ForceOrLineForce, List, Number, Positive, Speed, Time, Vector
from ..described import at_key
from .drive import Directed, Translation, check_direction, check_spin, listed

Forces = Annotated[List(Positive(ForceOrLineForce)), BeforeValidator(listed)]
STEEP = 1e-3     # share of the force over which the speed falls from the given one to nothing


class ForceDrive(Directed, Translation):
    """Presses with a given force, no faster than a given speed: as fast as the body gives way to the force.

    Where the body resists less than the force, the tool moves with the speed; where it resists more, it stands still.
    What is said of time here is the motion that nothing resists.

    Parameters
    ----------
    force : N (N/mm in plane strain), of the whole tool; with `times` a list, linear between them. times : s, rising from 0.
    speed : mm/s, the greatest. direction : any length. rotation : optional `Spin`, or a table of its keys.
    """

    kind: Literal["force"] = "force"
    force: Forces
    times: List(Time, at_least=2) | None = None
    speed: Positive(Speed)
    given_direction: Vector(Number) = Field(alias="direction")

    @model_validator(mode="after")
    def _has_a_direction(self):
        check_spin(self.rotation, len(self.given_direction))
        check_direction(self.given_direction)
        times = self.times or (0.0,)
        if times[0] != 0 or any(late <= early for early, late in pairwise(times)):
            raise at_key("times", "are not rising from 0", list(times), "rising times, the first 0")
        if len(self.force) != len(times):
            sentence = f"has {len(self.force)} values for {len(times)} times; expected one for each"
            raise at_key("force", sentence if self.times else "is a list; expected 'times' with it", self.force)
        return self

    @property
    def force_limit(self):
        return max(self.force)

    def force_at(self, time):
        return float(np.interp(time, self.times or (0.0,), self.force))

    @property
    def last_change(self):
        return self.times[-1] if self.times else 0.0

    @property
    def yields_from(self):
        """Share of the force limit from which on the tool is slower than given."""
        return 1.0 - STEEP

    def velocity(self, time):
        return self.speed * self.direction

    def displacement(self, time):
        return self.travel(time) * self.direction

    def travel(self, time):
        return self.speed * time

    def time_of_travel(self, travel, start=0.0):
        return max(start, travel / self.speed) if math.isfinite(travel) else math.inf
