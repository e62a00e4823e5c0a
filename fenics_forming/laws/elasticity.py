r"""Elastic, and elastic-plastic, behaviour of tools: isotropic, small strains, von Mises with isotropic hardening.

The yield stress is a piecewise linear function of the effective plastic strain, whether it comes from one slope or from
a table; so the return to it has a closed form, which is why it is a formula of the law and not a loop of the solver.
"""

from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, WithJsonSchema, model_validator

from ..units import Expansion, NonNegative, Number, Positive, Stress, Within, kind_of, refused
from .described import Described, at_key

_SLOPE, _STRAIN, _STRESS = kind_of(NonNegative(Stress)), kind_of(NonNegative(Number)), kind_of(Positive(Stress))
_PAIRS = "a slope such as '2 GPa', or a list of pairs (plastic strain, stress) such as [[0, 1200], [0.01, 1300]]"


def _slope_or_pairs(value):
    if not isinstance(value, (list, tuple, np.ndarray)):
        return _SLOPE.parse(value)
    if len(value) == 0 or any(isinstance(pair, str) or not hasattr(pair, "__len__") or len(pair) != 2 for pair in value):
        raise refused(value, "is no hardening", _PAIRS)
    return tuple((_STRAIN.parse(strain), _STRESS.parse(stress)) for strain, stress in value)


_SCHEMA = {"anyOf": [{"type": "number"}, {"type": "string"}, {"type": "array"}]}
Hardening = Annotated[Any, BeforeValidator(_slope_or_pairs), WithJsonSchema(_SCHEMA), _SLOPE]


class Elasticity(Described):
    """Elastic constants of a tool and, where it may yield, its yield stress over the effective plastic strain.

    Without `yield_stress` and `hardening` the material is elastic whatever the load. With a yield stress alone it is
    perfectly plastic; beyond the last point of a table the last stress holds.

    Parameters
    ----------
    young, yield_stress : MPa. poisson : 0 to 0.4999. expansion : 1/K.
    hardening : slope of the yield stress over the effective plastic strain, MPa, or pairs (plastic strain, stress MPa)
        that begin at the strain 0 and rise in strain and do not fall in stress; the first one is the yield stress.
    """

    young: Positive(Stress)
    poisson: Within(Number, 0, 0.4999)
    yield_stress: Positive(Stress) | None = None
    hardening: Hardening | None = None
    expansion: NonNegative(Expansion) | None = None

    @model_validator(mode="after")
    def _hardens_from_its_yield_stress(self):
        if not isinstance(self.hardening, tuple):
            if self.hardening is not None and self.yield_stress is None:
                raise at_key("yield_stress", "is missing: the hardening is a slope, which begins at a yield stress")
            return self
        strain, stress = np.array(self.hardening).T
        if strain[0] != 0:
            raise at_key("hardening", f"begins at the plastic strain {strain[0]:g}; the first pair is that of the strain 0")
        if (np.diff(strain) <= 0).any() or (np.diff(stress) < 0).any():
            raise at_key("hardening", "is not rising: strains have to rise, and stresses must not fall", self.hardening)
        if self.yield_stress not in (None, stress[0]):
            raise at_key("yield_stress", f"is {self.yield_stress:g} MPa, but the table of the hardening begins with "
                         f"{stress[0]:g} MPa; leave one out", self.yield_stress)
        return self

    @property
    def yields(self) -> bool:
        """Whether the material can become plastic at all."""
        return self.yield_stress is not None or self.hardening is not None

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)), MPa."""
        return self.young / (2 * (1 + self.poisson))

    @property
    def bulk_modulus(self) -> float:
        """K = E / (3 (1 - 2 nu)), MPa."""
        return self.young / (3 * (1 - 2 * self.poisson))

    @property
    def lame(self) -> float:
        """Lamé's first constant K - 2 G / 3, MPa."""
        return self.bulk_modulus - 2 * self.shear_modulus / 3

    @cached_property
    def _knots(self):
        """Plastic strains and stresses at the corners of the yield curve, and its slope beyond each of them."""
        if isinstance(self.hardening, tuple):
            strain, stress = np.array(self.hardening).T
            return strain, stress, np.append(np.diff(stress) / np.diff(strain), 0.0)
        initial = np.inf if self.yield_stress is None else self.yield_stress
        return np.zeros(1), np.array([initial]), np.array([self.hardening or 0.0])

    def yield_stress_at(self, plastic_strain):
        """Yield stress, MPa, after an effective plastic strain (number or array); infinite where it does not yield."""
        strain, stress, slope = self._knots
        part = self._part(strain, plastic_strain)
        return stress[part] + slope[part] * (plastic_strain - strain[part])

    def hardening_at(self, plastic_strain):
        """Slope of the yield stress over the effective plastic strain, MPa; at a corner of a table the one beyond it."""
        strain, _, slope = self._knots
        return slope[self._part(strain, plastic_strain)]

    def plastic_strain_of(self, trial_stress, plastic_strain):
        r"""Effective plastic strain p that brings an elastic trial stress back to the yield stress:
        :math:`q_{trial}-3G\,(p-p_0)=\sigma_y(p)`.

        Parameters
        ----------
        trial_stress : von Mises stress beyond the yield stress, MPa. plastic_strain : p_0, that of before. Arrays.
        """
        strain, stress, slope = self._knots
        three_shear = 3 * self.shear_modulus
        wanted, reached = trial_stress + three_shear * plastic_strain, stress + three_shear * strain
        part = self._part(reached, wanted)
        return strain[part] + (wanted - reached[part]) / (three_shear + slope[part])

    @staticmethod
    def _part(corners, value):
        return np.clip(np.searchsorted(corners, value, side="right") - 1, 0, len(corners) - 1)
