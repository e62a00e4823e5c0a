"""A tool that moves in a fixed ratio to another tool."""

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from ...units import Number, Vector
from ..described import at_key
from .drive import Drive, check_direction, unit


class RatioDrive(Drive):
    """Moves along its own direction as far as another tool along its own, times a ratio: v = ratio · v of the other.

    Known together with the drive of the other tool: see `Follower`.

    Parameters
    ----------
    of : name of the other tool. ratio : of the speeds, not 0. direction : any length.
    """

    kind: Literal["ratio"] = "ratio"
    of: str
    ratio: Number
    given_direction: Vector(Number) = Field(alias="direction")

    @model_validator(mode="after")
    def _is_a_ratio(self):
        check_direction(self.given_direction)
        if self.ratio == 0:
            raise at_key("ratio", "0 leaves the tool at rest; leave the drive out instead", 0)
        return self

    @property
    def dimension(self):
        return len(self.given_direction)

    @property
    def direction(self):
        return np.sign(self.ratio) * unit(self.given_direction)


class Follower:
    """The drive of a tool that follows another: answers all that a `Drive` does.

    Parameters
    ----------
    leader : drive of the other tool, with a direction. drive : the `RatioDrive`.
    """

    kind = "ratio"
    rotation_centre = rotation_axis = dead_centre_time = None
    moves, spends_energy, stalls = True, False, False

    def __init__(self, leader, drive):
        self._leader, self._way = leader, np.outer(drive.ratio * unit(drive.given_direction), leader.direction)
        self._ratio, self.direction, self.dimension = abs(drive.ratio), drive.direction, drive.dimension

    @property
    def turning_times(self):
        return self._leader.turning_times

    def velocity(self, time):
        return self._way @ self._leader.velocity(time)

    def displacement(self, time):
        return self._way @ self._leader.displacement(time)

    def travel(self, time):
        return self._ratio * self._leader.travel(time)

    def time_of_travel(self, travel, start=0.0):
        return self._leader.time_of_travel(travel / self._ratio, start)

    def angular_velocity(self, time):
        return 0.0

    def angle(self, time):
        return 0.0
