"""What every drive answers, and what drives share: rotation, directions, checks."""

import math

import numpy as np
from pydantic import model_validator

from ...units import AngularSpeed, Length, Number, Positive, Stiffness, Vector
from ..described import Described, at_key

UP = (0.0, 0.0, 1.0)


class Spin(Described):
    """A steady rotation about a centre (and an axis in 3d).

    Parameters
    ----------
    speed : rad/s, positive counter-clockwise (about `axis`). centre : mm, at t = 0; it moves with the drive.
    axis : a direction, in 3d only; any length.
    """

    speed: AngularSpeed
    centre: Vector(Length)
    axis: Vector(Number, 3) | None = None

    @model_validator(mode="after")
    def _axis_fits(self):
        check_axis(self.centre, self.axis)
        return self


class Drive(Described):
    """Base of the drives: at rest, unless a subclass says otherwise."""

    @property
    def dimension(self):
        """2 or 3, from the vectors of the drive."""
        raise NotImplementedError(f"{type(self).__name__} has no dimension")

    def velocity(self, time):
        """Velocity of the tool (of its centre of rotation, if it rotates) at a time, mm/s, shape (dimension,)."""
        return np.zeros(self.dimension)

    def displacement(self, time):
        """Displacement since t = 0 (without the rotation), mm, shape (dimension,)."""
        return np.zeros(self.dimension)

    def travel(self, time):
        """The stroke: length of the path since t = 0, mm."""
        return 0.0

    def time_of_travel(self, travel, start=0.0):
        """Earliest time, not before `start`, at which the stroke reaches `travel`, s; inf if it never does."""
        return start if travel <= self.travel(start) else math.inf

    def angular_velocity(self, time):
        """rad/s about `rotation_axis` (z in 2-D), positive counter-clockwise."""
        return 0.0

    def angle(self, time):
        """Angle turned since t = 0, rad."""
        return self.angular_velocity(0.0) * time

    @property
    def rotation_centre(self):
        """Centre of rotation at t = 0, mm, shape (dimension,); it moves by `displacement`. None without rotation."""
        return None

    @property
    def rotation_axis(self):
        """Unit vector of the axis of rotation, shape (3,), z in 2-D; None without rotation."""
        return None

    @property
    def direction(self):
        """Unit vector of the translation (its first, if it turns back), shape (dimension,); None if there is none."""
        return None

    @property
    def turning_times(self):
        """Times after t = 0 at which the tool starts, stops or turns back, s: no step should run across one."""
        return ()

    @property
    def dead_centre_time(self):
        """Time of the bottom dead centre, s; None of a drive that has none."""
        return None

    @property
    def force_limit(self):
        """Greatest force of the tool, N; None of a drive without a limit."""
        return None

    def force_at(self, time):
        """The force limit at a time, N."""
        return self.force_limit

    @property
    def last_change(self):
        """Time from which on the force limit stays, s."""
        return 0.0

    @property
    def stalls(self):
        """Whether its force limit holds the tool back altogether, in a run."""
        return False

    @property
    def spends_energy(self):
        """Whether the drive brings an energy and ends where it is spent."""
        return False

    @property
    def frame_stiffness(self):
        """Stiffness of the press frame along `direction`, N/mm (per mm of width in plane strain), or None."""
        return None

    @property
    def moves(self):
        """Whether the tool ever moves."""
        return self.direction is not None or self.angular_velocity(0.0) != 0


class Directed:
    """For drives along a direction that the user gives, of any length, as ``given_direction``."""

    @property
    def dimension(self):
        """2 or 3, the number of components of the direction."""
        return len(self.given_direction)

    @property
    def direction(self):
        """Unit vector, shape (dimension,)."""
        return unit(self.given_direction)


class Translation(Drive):
    """A drive that translates the tool and may turn it too; ``stiffness`` is that of the press frame, N/mm (in plane strain
    per mm of thickness), by which the tool yields along the direction of the drive."""

    rotation: Spin | None = None
    stiffness: Positive(Stiffness) | None = None

    @property
    def frame_stiffness(self):
        return self.stiffness

    def angular_velocity(self, time):
        return self.rotation.speed if self.rotation else 0.0

    @property
    def rotation_centre(self):
        return np.array(self.rotation.centre) if self.rotation else None

    @property
    def rotation_axis(self):
        return unit(self.rotation.axis or UP) if self.rotation else None


def unit(vector):
    return np.array(vector, dtype=float) / math.hypot(*vector)


def check_axis(centre, axis):
    if len(centre) == 3 and (axis is None or not any(axis)):
        raise at_key("axis", "is missing or has the length zero; expected a direction such as [0, 0, 1]", axis)
    if len(centre) == 2 and axis is not None:
        raise at_key("axis", "has no meaning in two dimensions, where the axis is the normal of the plane", axis)


def check_spin(spin, dimension):
    if spin is not None and len(spin.centre) != dimension:
        raise at_key("rotation.centre", f"has {len(spin.centre)} components, the drive has {dimension}", spin.centre)


def check_direction(direction):
    """Refuse a direction of the length zero."""
    if not any(direction):
        raise at_key("direction", "has the length zero; expected a direction such as [0, -1]", direction)


def listed(value):
    """A single value as a list of one."""
    is_list = hasattr(value, "__len__") and not isinstance(value, (str, dict))
    return value if is_list else [value]
