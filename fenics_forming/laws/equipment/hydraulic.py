"""The ram of a hydraulic press."""

import math
from typing import Literal

from pydantic import Field, model_validator

from ...units import ForceOrLineForce, Length, Number, Positive, Speed, Vector, Within
from ..described import Described, at_key
from .drive import Directed, Translation, check_direction, check_spin


class SlowDown(Described):
    """A lower speed from a given stroke on.

    Parameters
    ----------
    stroke : mm. speed : mm/s, lower than that of the approach.
    """

    stroke: Positive(Length)
    speed: Positive(Speed)


class HydraulicDrive(Directed, Translation):
    r"""A ram at constant speed, from a given stroke on at a lower one, that slows down before it reaches its force limit.

    Below the share s of the limit :math:`F_0` the speed is the given one, w; above, :math:`w\,(1-F/F_0)/(1-s)`.
    What is said of time here is the motion without the limit.

    Parameters
    ----------
    speed : mm/s. direction : of any length. slow_down : optional, a table of the keys of `SlowDown`. force : the limit, N
    (N/mm in plane strain), of the whole tool. slows_from : s. rotation : optional `Spin`, or a table of its keys.
    """

    kind: Literal["hydraulic"] = "hydraulic"
    speed: Positive(Speed)
    given_direction: Vector(Number) = Field(alias="direction")
    slow_down: SlowDown | None = None
    force: Positive(ForceOrLineForce) | None = None
    slows_from: Within(Positive(Number), 0, 0.999) = 0.95

    @model_validator(mode="after")
    def _is_a_press(self):
        check_spin(self.rotation, len(self.given_direction))
        check_direction(self.given_direction)
        if self.slow_down is not None and self.slow_down.speed >= self.speed:
            sentence = f"{self.slow_down.speed:g} mm/s is not lower than the speed {self.speed:g} mm/s before"
            raise at_key("slow_down.speed", sentence, self.slow_down.speed, f"less than {self.speed:g}")
        if self.says("slows_from") and self.force is None:
            raise at_key("slows_from", "has no meaning without 'force', the limit of the press", self.slows_from)
        return self

    @property
    def force_limit(self):
        return self.force

    @property
    def yields_from(self):
        """Share of the force limit from which on the tool is slower than given."""
        return self.slows_from

    @property
    def turning_times(self):
        return () if self.slow_down is None else (self.slow_down.stroke / self.speed,)

    def velocity(self, time):
        late = self.slow_down is not None and time >= self.turning_times[0]
        return (self.slow_down.speed if late else self.speed) * self.direction

    def displacement(self, time):
        return self.travel(time) * self.direction

    def travel(self, time):
        fast = self.turning_times[0] if self.slow_down is not None else math.inf
        return self.speed * min(time, fast) + (self.slow_down.speed * (time - fast) if time > fast else 0.0)

    def time_of_travel(self, travel, start=0.0):
        if travel <= self.travel(start):
            return start
        if self.slow_down is None or travel <= self.slow_down.stroke:
            return travel / self.speed
        return self.turning_times[0] + (travel - self.slow_down.stroke) / self.slow_down.speed
