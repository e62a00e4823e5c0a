r"""Bounds of the force of forming, of metals with a yield stress, from below and above (k = flow stress / √3).

A body in equilibrium is in itself a bound from below, a flow one from above; see REFERENCES.md 3.1, 4.1 and 4.4.
"""

from __future__ import annotations

import numpy as np

from fenics_forming.scene import Scene

FACTORS = {"none": lambda friction: 0.0, "siebel": lambda friction: friction.factor}     # of others at most 1


def yield_stress(scene: Scene) -> float | None:
    """Of the metal of the body before it has hardened, MPa; None where it has none, or flows at a rate."""
    law = scene.materials["m"].flow_stress
    values = {"constant": "value", "linear": "initial", "ludwik": "initial", "voce": "initial"}
    if law.law == "table":
        return float(np.asarray(law.stress).ravel()[0])
    return getattr(law, values[law.law]) if law.law in values else None


def factor(tool) -> float:
    """Most that friction can be on a tool, in k."""
    return FACTORS.get(tool.friction.law, lambda friction: 1.0)(tool.friction)


def of_upsetting(scene: Scene, width: float, height: float, factors: float) -> tuple[float, float]:
    r"""Between parallel plates: :math:`\sigma A`, :math:`2/\sqrt3` times that in plane strain, and the power of uniform
    flow with the friction factors of both plates together (3.1); N, per mm in plane strain. ``width`` from the middle."""
    stress = yield_stress(scene)
    if scene.geometry == "plane_strain":
        least = 2 / np.sqrt(3) * stress * 2 * width
        return least, least * (1 + factors * width / (4 * height))
    if scene.geometry == "axisymmetric":
        least = stress * np.pi * width**2
        return least, least * (1 + factors * width / (3 * np.sqrt(3) * height))
    # points of a square of side 1 are in the mean 0.3826 away from its middle
    return stress * 4 * width**2, stress * 4 * width**2 * (1 + factors * 0.3826 * width / (np.sqrt(3) * height))


def of_stamping(scene: Scene, flat: float) -> float:
    """A flat stamp on a block that rests on a plate, ``flat`` from its middle to its fillet: from below, the column under
    it; coarse meshes do not see the other bound (4.1)."""
    return of_upsetting(scene, flat, 1.0, 0.0)[0]


def of_rolling(scene: Scene, arc: float, height: float) -> tuple[float, float]:
    """Of a roll, N/mm: strips without tension yield under 2 k at least, and at most as a strip between punches as long as
    the arc (4.4, where it is long against the height, and short)."""
    least = 2 / np.sqrt(3) * yield_stress(scene) * arc
    return least, least * (1 + np.pi / 2 + arc / (4 * height))
