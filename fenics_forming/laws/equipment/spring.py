"""A tool on springs: a cushion, a spring-supported counter-punch."""

from typing import Literal

from pydantic import Field, model_validator

from ...units import Number, Positive, Stiffness, Vector
from .drive import Directed, Drive, check_direction


class SpringDrive(Directed, Drive):
    """Rests on a spring: the force on the body is the stiffness times the way by which it has been pushed back.

    Parameters
    ----------
    stiffness : N/mm (N/mm per mm of width in plane strain). direction : in which the spring pushes, any length.
    """

    kind: Literal["spring"] = "spring"
    stiffness: Positive(Stiffness)
    given_direction: Vector(Number) = Field(alias="direction")

    @model_validator(mode="after")
    def _has_a_direction(self):
        check_direction(self.given_direction)
        return self

    @property
    def moves(self):
        return False
