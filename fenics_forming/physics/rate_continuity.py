"""The tie of the strain rates of a solve to those of the solve before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .point_kernels import tie

MOST_TIED = 0.05     # of the flow stress, by which the tie to the rates of the solve before may change it


@dataclass(frozen=True)
class RateContinuity:
    r"""Ties the strain rate of a material point to that of the solve before, as an implicit step would.

    The velocities of rigid-plastic flow are not unique (a smooth block in plane strain may flow in any bands), and in
    compression it is the change of shape and the hardening *during the step* that decide. Both enter to first order as
    :math:`\bar\sigma\,[1+\Delta t(\dot{\bar\varepsilon}-\dot{\bar\varepsilon}_{ref})]`: nothing where the rate goes on
    as before, an increment of the size of the strain increment where it jumps, 5 % at most: a small push decides, and a
    die that is just full sends the whole flow elsewhere (in steps of a tenth of its flash, 25 % too much force uncapped).

    rate : (points,) 1/s, the rates of the solve before, scaled by the change of the characteristic rate · step : s
    """

    rate: np.ndarray
    step: float

    def tie(self, flow_stress: np.ndarray, softening: np.ndarray, rate: np.ndarray) -> None:
        """Multiply the flow stress at the regularised rates, and follow with the softening; all (points,), changed in
        place."""
        tie(flow_stress, softening, rate, self.rate, self.step, MOST_TIED)
