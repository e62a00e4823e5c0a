r"""Elastic-plastic response at points: von Mises, isotropic hardening, backward Euler, all points at once.

Stresses and strains are Mandel vectors with the three normal components first (shear times the square root of two),
four components in the plane and in axisymmetry, six in space, so that products of rows are double contractions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ON_YIELD_SURFACE = 1e-8     # a point that was left on it and comes back does not flow by what Newton's iteration left over
PLANE_STRESS_ITERATIONS = 30
PLANE_STRESS_TOLERANCE = 1e-13     # of the stress across the plane, relative to Young's modulus: near rounding


@dataclass(frozen=True)
class Response:
    """What an increment leads to, point by point.

    stress (p, c) MPa · plastic_strain (p, c) · effective (p,) effective plastic strain · tangent (p, c, c) MPa, the
    derivative of the stress by the strain · yielding (p,) whether the point flows in the increment
    """

    stress: np.ndarray
    plastic_strain: np.ndarray
    effective: np.ndarray
    tangent: np.ndarray
    yielding: np.ndarray


def deviatoric(components: int) -> np.ndarray:
    """The matrix that takes the mean of the normal components away from a Mandel vector, (c, c)."""
    unit = _unit(components)
    return np.eye(components) - np.outer(unit, unit) / 3


def elastic_tangent(law, components: int) -> np.ndarray:
    """Hooke's law K 1 x 1 + 2 G dev, (c, c), MPa."""
    unit = _unit(components)
    return law.bulk_modulus * np.outer(unit, unit) + 2 * law.shear_modulus * deviatoric(components)


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress of Mandel vectors (p, c): sqrt(3/2 s : s), (p,), MPa."""
    s = stress @ deviatoric(stress.shape[1])
    return np.sqrt(1.5 * np.einsum("pi,pi->p", s, s))


def return_map(law, strain: np.ndarray, plastic_strain: np.ndarray, effective: np.ndarray) -> Response:
    r"""Stress and consistent tangent for a total strain (p, c), from the plastic strain (p, c) and the effective plastic
    strain (p,) of before.

    The trial stress :math:`C(\varepsilon-\varepsilon_p)` is scaled back radially to the yield stress:
    :math:`s=(1-3G\Delta p/q)\,s_{trial}`, with :math:`\Delta p` in closed form (``laws.Elasticity``). Tangent:
    :math:`K\,1\otimes1+2G(1-3G\Delta p/q)\,\mathrm{dev}+6G^2\big(\Delta p/q-\tfrac1{3G+H}\big)N\otimes N`.

    References
    ----------
    Simo and Hughes, Computational Inelasticity, 3.3 (the radial return and its tangent).
    """
    components = strain.shape[1]
    elastic = elastic_tangent(law, components)
    stress = (strain - plastic_strain) @ elastic
    trial = von_mises(stress)
    yielding = trial > law.yield_stress_at(effective) * (1 + ON_YIELD_SURFACE)
    tangent = np.broadcast_to(elastic, (len(strain), components, components))
    if not yielding.any():
        return Response(stress, plastic_strain, effective, tangent, yielding)
    tangent, plastic, grown = tangent.copy(), plastic_strain.copy(), effective.copy()
    q, dev, unit = trial[yielding], deviatoric(components), _unit(components)
    s = stress[yielding] @ dev
    direction = s * (np.sqrt(1.5) / q)[:, None]           # N = s / |s|, |s| = sqrt(2/3) q
    after = law.plastic_strain_of(q, effective[yielding])
    step = after - effective[yielding]
    grown[yielding] = after
    plastic[yielding] += np.sqrt(1.5) * step[:, None] * direction
    stress[yielding] -= (2 * law.shear_modulus * np.sqrt(1.5) * step)[:, None] * direction
    G, slope = law.shear_modulus, law.hardening_at(after)
    along = 6 * G**2 * (step / q - 1 / (3 * G + slope))
    tangent[yielding] = (law.bulk_modulus * np.outer(unit, unit) + (2 * G * (1 - 3 * G * step / q))[:, None, None] * dev
                         + along[:, None, None] * direction[:, :, None] * direction[:, None, :])
    return Response(stress, plastic, grown, tangent, yielding)


def plane_stress_return_map(law, strain: np.ndarray, plastic_strain: np.ndarray, effective: np.ndarray) -> Response:
    r"""The same with no stress across the plane (third component): the strain across, strain[:, 2], is found by Newton
    and written into ``strain``; the tangent is condensed, :math:`C_{ij}-C_{i3}C_{3j}/C_{33}`."""
    unsettled = np.arange(len(strain))
    for _ in range(PLANE_STRESS_ITERATIONS):
        part = return_map(law, strain[unsettled], plastic_strain[unsettled], effective[unsettled])
        across = part.stress[:, 2]
        off = np.abs(across) > PLANE_STRESS_TOLERANCE * law.young
        if not off.any():
            break
        unsettled = unsettled[off]
        strain[unsettled, 2] -= across[off] / part.tangent[off, 2, 2]
    found = return_map(law, strain, plastic_strain, effective)
    column = found.tangent[:, :, 2]
    condensed = found.tangent - column[:, :, None] * column[:, None, :] / column[:, 2, None, None]
    return Response(found.stress, found.plastic_strain, found.effective, condensed, found.yielding)


def _unit(components: int) -> np.ndarray:
    return (np.arange(components) < 3).astype(float)
