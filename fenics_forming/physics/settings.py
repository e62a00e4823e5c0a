"""Numerical parameters of one velocity solve."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NewtonSettings:
    """What the stress-velocity Newton needs to know (defaults measured, FORMULATION.md 1).

    Attributes
    ----------
    regularisation : the rate below which the body is taken as viscous, relative to the characteristic rate; 1.5e-3
        costs about 1e-4 of the force
    slip_regularisation : the same for the slip, relative to the speed of the tools
    velocity_tolerance, force_tolerance : stop when the relative change of the velocities *and* of the contact forces
        falls below these; by iterations, whose contact is settled, also when less than half of it is left to come
    power_tolerance : and when the power that does not balance is less than this part of the plastic power
    max_iterations : a solve that needs more has failed
    linear : "direct", "iterative" (in space only), or "auto": iterative in space where that is faster
    damping_from : from this iteration on every second increment is halved (ends cycles of the contact set)
    """

    regularisation: float = 1.5e-3
    slip_regularisation: float = 1e-3
    velocity_tolerance: float = 1e-2
    force_tolerance: float = 2e-3
    power_tolerance: float = 5e-4
    max_iterations: int = 40
    damping_from: int = 8
    penalty_factor: float = 10.0
    augmented: bool = True
    linear: str = "auto"
