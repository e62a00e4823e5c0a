"""The ram of a crank press: exact slider-crank kinematics."""

import math
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from ...units import AngularSpeed, Length, Number, Positive, Vector
from ..described import at_key
from .drive import Directed, Translation, check_direction, check_spin


class CrankPressDrive(Directed, Translation):
    r"""One stroke of a crank press: down to the dead centre, up again to the top, where it stays.

    With the angle :math:`\varphi` before the bottom dead centre, :math:`\dot\varphi=-\omega`, the ram is at the height

    .. math:: h(\varphi) = r(1-\cos\varphi) + l\,(1-\sqrt{1-(r/l)^2\sin^2\varphi})

    above it. Exact; the connecting rod and the frame are rigid.

    Parameters
    ----------
    radius : of the crank, mm. rod : length of the connecting rod, mm, longer than the radius. speed : rad/s or "60 rpm".
    direction : in which the ram goes down, any length. dead_centre : height of the tool above its bottom dead centre at
    t = 0, mm, at most 2 radius; from the top if not given. rotation : optional `Spin`, or a table of its keys.
    """

    kind: Literal["crank_press"] = "crank_press"
    radius: Positive(Length)
    rod: Positive(Length)
    speed: Positive(AngularSpeed)
    given_direction: Vector(Number) = Field(alias="direction")
    dead_centre: Positive(Length) | None = None

    @model_validator(mode="after")
    def _is_a_crank(self):
        check_spin(self.rotation, len(self.given_direction))
        check_direction(self.given_direction)
        if self.rod <= self.radius:
            sentence = f"{self.rod:g} mm is not longer than the crank radius {self.radius:g} mm: the crank could not turn"
            raise at_key("rod", sentence, self.rod, f"more than {self.radius:g}")
        if self.dead_centre is not None and self.dead_centre > 2 * self.radius:
            sentence = f"{self.dead_centre:g} mm above the dead centre is more than the stroke {2 * self.radius:g} mm"
            raise at_key("dead_centre", sentence, self.dead_centre, f"at most {2 * self.radius:g}")
        return self

    @property
    def start_height(self):
        """Height above the bottom dead centre at t = 0, mm."""
        return 2 * self.radius if self.dead_centre is None else self.dead_centre

    @property
    def dead_centre_time(self):
        """Time of the bottom dead centre, s."""
        return self.angle_at(self.start_height) / self.speed

    @property
    def turning_times(self):
        return (self.dead_centre_time, self.dead_centre_time + math.pi / self.speed)

    def height_at(self, angle):
        """Height above the bottom dead centre, mm, at an angle before or behind it, rad."""
        sine = math.sin(angle)
        sagitta = self.radius**2 * sine**2 / (self.rod + math.sqrt(self.rod**2 - self.radius**2 * sine**2))
        return 2 * self.radius * math.sin(angle / 2) ** 2 + sagitta

    def angle_at(self, height):
        """Angle before the bottom dead centre, rad in 0…π, at a height above it, mm: the inverse of `height_at`."""
        share = height * (2 * self.rod - height) / (4 * self.radius * (self.radius + self.rod - height))
        return 2 * math.asin(math.sqrt(min(max(share, 0.0), 1.0)))

    def velocity(self, time):
        angle = self._angle_before(time)
        if angle <= -math.pi:
            return np.zeros(self.dimension)
        sine, cosine = math.sin(angle), math.cos(angle)
        lean = self.radius * cosine / math.sqrt(self.rod**2 - self.radius**2 * sine**2)
        return self.speed * self.radius * sine * (1 + lean) * self.direction

    def displacement(self, time):
        return (self.start_height - self.height_at(self._angle_before(time))) * self.direction

    def travel(self, time):
        angle = self._angle_before(time)
        height = self.height_at(angle)
        return self.start_height - height if angle >= 0 else self.start_height + height

    def time_of_travel(self, travel, start=0.0):
        if travel <= self.travel(start):
            return start
        behind = travel - self.start_height
        if behind <= 0:
            return self.dead_centre_time - self.angle_at(-behind) / self.speed
        return self.dead_centre_time + self.angle_at(behind) / self.speed if behind <= 2 * self.radius else math.inf

    def _angle_before(self, time):
        return max(self.speed * (self.dead_centre_time - time), -math.pi)
