r"""When a tool that is solved now and then, and goes on with its last velocity in between, is stable.

With a force that grows with the m-th power of the speed and a deflection :math:`\delta`, the lagged scheme obeys
:math:`z^2+\lambda z-\lambda=0`, :math:`\lambda=m\delta/s`, s the travel of the die in a tool step: stable for
:math:`s>2m\delta`.  With the position tracked too and the tool solved in every step it is :math:`z^3+\lambda(2z-1)(z-1)=0`,
:math:`s>6m\delta`.  Whatever m is, a jump :math:`\Delta\delta` must not open the contact: :math:`s>2|\Delta\delta|`
(FORMULATION.md 5; both were found in the one-dimensional model and in columns of finite elements).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SAFE = 1.5      # times the limits; a choice
LARGEST = 1e6   # what is written for a number without bound


@dataclass(frozen=True)
class Stability:
    """Where a lagged tool stands: each number is stable above 1.

    number : travel over 2 m deflection, which is reported · lag : over the limit of this tool step · opening : over twice
    the change of the deflection in a tool step
    """

    number: float
    lag: float
    opening: float

    @classmethod
    def of(cls, *, travel: float, sensitivity: float, deflection: float, change: float, every: int) -> Stability:
        """travel, deflection, change : mm, in a tool step of ``every`` steps · sensitivity : m"""
        yields = 2 * sensitivity * abs(deflection)
        return cls(_over(travel, yields), _over(travel, (3 if every == 1 else 1) * yields), _over(travel, 2 * abs(change)))

    @property
    def is_safe(self) -> bool:
        return min(self.lag, self.opening) >= SAFE


def _over(travel: float, limit: float) -> float:
    return LARGEST if travel >= LARGEST * limit else travel / limit


def rate_sensitivity(workpiece) -> float:
    """d log(flow stress) / d log(strain rate) of the present flow, the mean by plastic power: that of the law, of what ties
    a solve to the one before, and 1 where the rate is below the regularisation. Collective."""
    from ...physics.parallel import total

    rate = workpiece.point_rate()
    strain_rate = np.sqrt(np.maximum(rate**2 - float(workpiece.rate0.value) ** 2, 0.0))
    size = np.repeat(workpiece.nodes.cell_sizes(), len(rate) // max(len(workpiece.nodes.cells), 1))
    power = workpiece.sigma * strain_rate * size
    local = 1.0 - workpiece.softening * (strain_rate / rate) ** 2
    sums = total(workpiece.nodes.comm, np.array([power @ local, power.sum()]))
    return float(sums[0] / sums[1]) if sums[1] > 0 else 1.0
