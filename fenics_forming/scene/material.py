"""A material, as the scene describes it."""

from ..laws import FlowStressLaw
from ..laws.damage import DamageLaw
from ..laws.elasticity import Elasticity, Hardening
from ..units import Conductivity, Density, Expansion, NonNegative, Number, Positive, SpecificHeat, Stress, Within
from .library import FromLibrary

Fraction = Within(Number, 0, 1)


class Material(FromLibrary):
    """What a body is made of.

    Parameters
    ----------
    from_ (key `from`) : name of a material of the library (`forming materials`); its keys hold where no other is given.
    flow_stress : a flow-stress law. damage : a damage law, followed only if given. young, yield_stress : MPa.
    hardening : slope of the yield stress over the plastic strain, MPa, or pairs (plastic strain, stress in MPa).
    expansion : 1/K. density : t/mm^3.
    conductivity : mJ/s/mm/K. specific_heat : mJ/t/K. poisson, plastic_heat_fraction : numbers.
    """

    flow_stress: FlowStressLaw | None = None
    damage: DamageLaw | None = None
    density: Positive(Density) | None = None
    conductivity: Positive(Conductivity) | None = None
    specific_heat: Positive(SpecificHeat) | None = None
    plastic_heat_fraction: Fraction | None = None
    young: Positive(Stress) | None = None
    poisson: Within(Number, 0, 0.4999) | None = None
    yield_stress: Positive(Stress) | None = None
    hardening: Hardening | None = None
    expansion: NonNegative(Expansion) | None = None

    @property
    def elasticity(self):
        """The law of a body that deforms elastically; None without elastic constants."""
        if self.young is None or self.poisson is None:
            return None
        keys = ("young", "poisson", "yield_stress", "hardening", "expansion")
        return Elasticity(**{key: value for key in keys if (value := getattr(self, key)) is not None})
