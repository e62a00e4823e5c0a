"""Tools that turn about a fixed centre, and the roll that does so at a given speed."""

from typing import Literal

import numpy as np
from pydantic import model_validator

from ...units import AngularSpeed, Length, Number, Vector
from .drive import UP, Drive, check_axis, unit


class Turning(Drive):
    """Rotation about a fixed centre (and an axis in 3d).

    Parameters
    ----------
    centre : mm. axis : a direction, in 3d only.
    """

    centre: Vector(Length)
    axis: Vector(Number, 3) | None = None

    @model_validator(mode="after")
    def _axis_fits(self):
        check_axis(self.centre, self.axis)
        return self

    @property
    def dimension(self):
        return len(self.centre)

    @property
    def rotation_centre(self):
        return np.array(self.centre)

    @property
    def rotation_axis(self):
        return unit(self.axis or UP)


class RotationDrive(Turning):
    """Rotation about a fixed centre (and an axis in 3d): a roll.

    Parameters
    ----------
    speed : rad/s, or "40 rpm"; positive counter-clockwise (about `axis`). centre : mm. axis : a direction, in 3d only.
    """

    kind: Literal["rotation"] = "rotation"
    speed: AngularSpeed

    def angular_velocity(self, time):
        return self.speed
