"""What is written and when, and the numerical parameters."""

from typing import Literal

from ..laws.described import Described
from ..units import Count, CountFrom, Flag, Length, List, Number, Positive


class Output(Described):
    """What is written, and when.

    Parameters
    ----------
    fields_every : steps between two frames; 0 for the start and the end only. strokes : mm, strokes that are hit
    exactly and written. checkpoint_every : steps between two checkpoints; 0 for none.
    """

    fields_every: Count = 10
    strokes: List(Positive(Length), at_least=0) = ()
    checkpoint_every: Count = 10


class Solver(Described):
    """Numerical parameters; none of them is a property of the material.

    Parameters
    ----------
    regularisation : of the strain rate, relative to tool speed / body size. slip_regularisation : of the slip velocity,
    relative to the tool speed. velocity_tolerance, force_tolerance : relative changes at which Newton stops.
    max_iterations : of Newton in a solve. penalty_factor : contact penalty relative to the stiffness of the surface.
    augmented : augmented-Lagrange update of the contact pressure. linear : how the equations of an iteration are solved,
    "direct", "iterative" (in space), or "auto".

    References
    ----------
    Defaults and the errors that they cost: FORMULATION.md 1 and 3.
    """

    regularisation: Positive(Number) = 1.5e-3
    slip_regularisation: Positive(Number) = 1e-3
    velocity_tolerance: Positive(Number) = 1e-2
    force_tolerance: Positive(Number) = 2e-3
    max_iterations: CountFrom(1) = 40
    penalty_factor: Positive(Number) = 10.0
    augmented: Flag = True
    linear: Literal["auto", "direct", "iterative"] = "auto"
