"""A tool at constant velocity."""

import math
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from ...units import Speed, Vector
from .drive import Translation, check_spin, unit


class SpeedDrive(Translation):
    """Constant velocity: displacement = velocity * t.

    Parameters
    ----------
    velocity : mm/s, two or three components. rotation : optional `Spin`, or a table of its keys.
    """

    kind: Literal["speed"] = "speed"
    given_velocity: Vector(Speed) = Field(alias="velocity")

    @model_validator(mode="after")
    def _vectors_fit(self):
        check_spin(self.rotation, len(self.given_velocity))
        return self

    @property
    def dimension(self):
        return len(self.given_velocity)

    @property
    def direction(self):
        return unit(self.given_velocity) if any(self.given_velocity) else None

    def velocity(self, time):
        return np.array(self.given_velocity)

    def displacement(self, time):
        return np.array(self.given_velocity) * time

    def travel(self, time):
        return math.hypot(*self.given_velocity) * time

    def time_of_travel(self, travel, start=0.0):
        speed = math.hypot(*self.given_velocity)
        if travel <= speed * start:
            return start
        return travel / speed if speed > 0 else math.inf
