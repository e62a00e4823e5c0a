"""A roll: driven at a given speed, or turned by the body."""

from typing import Literal

from pydantic import model_validator

from ...units import AngularSpeed, Torque
from ..described import at_key
from .rotation import Turning


class RollDrive(Turning):
    """Rotation about a fixed centre (and an axis in 3d): at a given speed, or free, with the torque on it in balance.

    Parameters
    ----------
    centre : mm. axis : a direction, in 3d only. speed : rad/s, or "40 rpm", positive counter-clockwise (about `axis`); free
    if not given. torque : on a free roll by what else acts on it, such as a motor or (negative against its turn) a
    bearing, N mm (N in plane strain), positive as the speed; zero if not given.
    """

    kind: Literal["roll"] = "roll"
    speed: AngularSpeed | None = None
    torque: Torque | None = None

    @model_validator(mode="after")
    def _takes_or_gives_torque(self):
        if self.speed is not None and self.torque is not None:
            raise at_key("torque", "is given together with the speed; a driven roll takes what it needs", self.torque)
        return self

    @property
    def is_free(self):
        """Whether the body turns it."""
        return self.speed is None

    def angular_velocity(self, time):
        return self.speed or 0.0
