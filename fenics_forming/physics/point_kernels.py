"""What happens at the integration points of a flowing body in an iteration, compiled: each point at a time."""

from __future__ import annotations

from math import sqrt

import numpy as np

from .machine_code import compiled


@compiled
def regularised(strain_rate, rate0):
    """Effective strain rate with its regularisation, sqrt(2/3 D:D + rate0²), (points,), of D (points, components)."""
    out = np.empty(len(strain_rate))
    for p in range(len(out)):
        square = 0.0
        for i in range(strain_rate.shape[1]):
            square += strain_rate[p, i] * strain_rate[p, i]
        out[p] = sqrt(2.0 / 3.0 * square + rate0 * rate0)
    return out


@compiled
def tie(flow_stress, softening, rate, before, step, most):
    """Multiply the flow stress by 1 + step (rate - before), at most 1 ± ``most``, and follow with the softening, kept
    between 0 and 1; all (points,), changed in place."""
    for p in range(len(rate)):
        factor = min(max(1.0 + step * (rate[p] - before[p]), 1.0 - most), 1.0 + most)
        flow_stress[p] *= factor
        softening[p] = min(max(softening[p] - step * rate[p] / factor, 0.0), 1.0)


@compiled
def cut(stress, flow_stress):
    """Shorten deviators (points, components), in place, to the flow stress (points,)."""
    for p in range(len(stress)):
        square = 0.0
        for i in range(stress.shape[1]):
            square += stress[p, i] * stress[p, i]
        length = sqrt(1.5 * square)
        if length > flow_stress[p]:
            for i in range(stress.shape[1]):
                stress[p, i] *= flow_stress[p] / length


@compiled
def advance(strain_rate, increment, stress, flow_stress, softening, rate):
    """Strain rates and stresses (points, components) after the increment of the rates, in place: the stress-velocity
    update, with flow stress, softening and regularised rate (points,) of before."""
    for p in range(len(rate)):
        over = 1.0 / rate[p]
        change = 0.0
        for i in range(strain_rate.shape[1]):
            change += strain_rate[p, i] * increment[p, i]
        change *= 2.0 / 3.0 * over * over * softening[p]
        viscosity = 2.0 / 3.0 * flow_stress[p] * over
        for i in range(strain_rate.shape[1]):
            strain_rate[p, i] += increment[p, i]
            stress[p, i] = viscosity * strain_rate[p, i] - change * stress[p, i]
