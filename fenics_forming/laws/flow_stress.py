"""Flow-stress laws: the flow stress in MPa from effective strain, effective strain rate (1/s) and temperature (degC).

Every law is a frozen description with its parameters and is itself the function: `law(strain, rate, temperature)`
takes floats, numpy arrays or UFL expressions. Formulas: FORMULATION.md 2. Floors that keep every value finite:
strain at least 0 where a power of it is a mere summand, `STRAIN_FLOOR` where it is a factor or a divisor, rate at
least `RATE_FLOOR`; none of them is a material constant.
"""

import math
from typing import Literal

from pydantic import Field, field_validator, model_validator

from ..errors import FormingError
from ..units import NonNegative, Number, Positive, Rate, Stress, Temperature, Within, refused
from .described import Described, at_key
from .functions import exp, is_ufl, log, maximum, minimum, power, where_greater, zeros_like

SHEAR = 1 / math.sqrt(3)
"""Shear yield stress over flow stress after von Mises."""

STRAIN_FLOOR = 1e-3
"""Least effective strain in laws that would vanish or blow up at zero strain (below what a test resolves)."""

DIVIDED_STRAIN_FLOOR = 1e-2
"""Least effective strain in laws that divide by it: e^(m4/strain) spans nine decades between this and 1e-3."""

RATE_FLOOR = 1e-12
"""Least effective strain rate in 1/s in laws with a power or logarithm of the rate."""

Exponent = Within(NonNegative(Number), 0, 1)


class FlowStress(Described):
    """Base of the laws; subclass it for a law of your own.

    A law of your own needs a `law` name, its parameters and `__call__`; say `depends_on_rate` and give
    `rate_derivative` if the rate matters (the base differentiates numerically, for numbers and arrays):

        class Zerilli(FlowStress):
            law: Literal["zerilli"] = "zerilli"
            C0: Stress
            K: Stress
            n: Number
            depends_on_strain = True

            def __call__(self, strain, rate, temperature=None):
                return self.C0 + self.K * power(maximum(strain, 0.0), self.n)
    """

    model_config = {"ignored_types": (bool,)}

    depends_on_strain = False
    depends_on_rate = False
    depends_on_temperature = False

    def __call__(self, strain, rate, temperature=None):
        """The flow stress.

        Parameters
        ----------
        strain : effective strain; rate : effective strain rate, 1/s; temperature : degC, where the law needs it.
            Floats, arrays of one broadcast shape, or UFL scalars.

        Returns
        -------
        Flow stress, MPa; a float where nothing that the law depends on is a UFL expression or an array.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say what its flow stress is")

    def rate_derivative(self, strain, rate, temperature=None):
        """d(flow stress)/d(effective strain rate), MPa s; 0 for a law that does not depend on the rate."""
        if not self.depends_on_rate:
            return zeros_like(strain, rate, temperature)
        if is_ufl(rate):
            raise FormingError(f"{type(self).__name__} has no rate_derivative for UFL expressions")
        rate = maximum(rate, RATE_FLOOR)
        above, below = self(strain, 1.0001 * rate, temperature), self(strain, 0.9999 * rate, temperature)
        return (above - below) / (2e-4 * rate)

    def shear_yield_stress(self, strain, rate, temperature=None):
        """k = flow stress / sqrt(3), MPa (von Mises)."""
        return SHEAR * self(strain, rate, temperature)

    def _needed(self, temperature):
        if temperature is None:
            raise FormingError(f"the flow-stress law '{self.law}' depends on temperature; give the body one")
        return temperature


class Constant(FlowStress):
    """sigma = value: perfect plasticity.

    Parameters
    ----------
    value : flow stress, MPa.
    """

    law: Literal["constant"] = "constant"
    value: Positive(Stress)

    def __call__(self, strain, rate, temperature=None):
        return self.value + zeros_like(strain, rate, temperature)


class Linear(FlowStress):
    """sigma = initial + hardening * strain.

    Parameters
    ----------
    initial, hardening : MPa.
    """

    law: Literal["linear"] = "linear"
    initial: Positive(Stress)
    hardening: NonNegative(Stress)
    depends_on_strain = True

    def __call__(self, strain, rate, temperature=None):
        return self.initial + self.hardening * maximum(strain, 0.0) + zeros_like(strain, rate, temperature)


class Ludwik(FlowStress):
    """sigma = initial + K * strain^n.

    Parameters
    ----------
    initial, K : MPa. n : 0 to 1.
    """

    law: Literal["ludwik"] = "ludwik"
    initial: Positive(Stress)
    K: NonNegative(Stress)
    n: Exponent
    depends_on_strain = True

    def __call__(self, strain, rate, temperature=None):
        hardening = self.K * power(maximum(strain, 0.0), self.n)
        return self.initial + hardening + zeros_like(strain, rate, temperature)


class Hollomon(FlowStress):
    """sigma = K * strain^n, the strain at least `STRAIN_FLOOR`.

    Parameters
    ----------
    K : MPa. n : 0 to 1.
    """

    law: Literal["hollomon"] = "hollomon"
    K: Positive(Stress)
    n: Exponent
    depends_on_strain = True

    def __call__(self, strain, rate, temperature=None):
        return self.K * power(maximum(strain, STRAIN_FLOOR), self.n) + zeros_like(strain, rate, temperature)


class Swift(FlowStress):
    """sigma = K * (prestrain + strain)^n.

    100 (1 + 5 strain)^0.3 (REFERENCES.md 1.1) is K = 100 * 5^0.3 MPa, prestrain = 0.2, n = 0.3.

    Parameters
    ----------
    K : MPa. prestrain : positive. n : 0 to 1.
    """

    law: Literal["swift"] = "swift"
    K: Positive(Stress)
    prestrain: Positive(Number)
    n: Exponent
    depends_on_strain = True

    def __call__(self, strain, rate, temperature=None):
        return self.K * power(self.prestrain + maximum(strain, 0.0), self.n) + zeros_like(strain, rate, temperature)


class Voce(FlowStress):
    """sigma = saturation - (saturation - initial) * exp(-rate * strain).

    Parameters
    ----------
    initial, saturation : MPa. rate : how fast the strain saturates the law (a number, no strain rate).
    """

    law: Literal["voce"] = "voce"
    initial: Positive(Stress)
    saturation: Positive(Stress)
    rate: NonNegative(Number)
    depends_on_strain = True

    def __call__(self, strain, rate, temperature=None):
        missing = (self.saturation - self.initial) * exp(-self.rate * maximum(strain, 0.0))
        return self.saturation - missing + zeros_like(strain, rate, temperature)


class NortonHoff(FlowStress):
    """sigma = K * rate^m: a viscous material.

    Parameters
    ----------
    K : MPa, the flow stress at a rate of 1/s. m : 0 to 1.
    """

    law: Literal["norton_hoff"] = "norton_hoff"
    K: Positive(Stress)
    m: Exponent
    depends_on_rate = True

    def __call__(self, strain, rate, temperature=None):
        return self.K * power(maximum(rate, RATE_FLOOR), self.m) + zeros_like(strain, rate, temperature)

    def rate_derivative(self, strain, rate, temperature=None):
        return self.m * self(strain, rate, temperature) / maximum(rate, RATE_FLOOR)


class Power(FlowStress):
    """sigma = K * strain^n * rate^m, the strain at least `STRAIN_FLOOR`.

    Parameters
    ----------
    K : MPa, the flow stress at a strain of 1 and a rate of 1/s. n, m : 0 to 1.
    """

    law: Literal["power"] = "power"
    K: Positive(Stress)
    n: Exponent
    m: Exponent
    depends_on_strain = True
    depends_on_rate = True

    def __call__(self, strain, rate, temperature=None):
        by_strain = power(maximum(strain, STRAIN_FLOOR), self.n)
        by_rate = power(maximum(rate, RATE_FLOOR), self.m)
        return self.K * by_strain * by_rate + zeros_like(strain, rate, temperature)

    def rate_derivative(self, strain, rate, temperature=None):
        return self.m * self(strain, rate, temperature) / maximum(rate, RATE_FLOOR)


class JohnsonCook(FlowStress):
    """sigma = (A + B strain^n) (1 + C ln(rate / reference_rate)) (1 - T*^m), T* = (T - T_ref) / (T_melt - T_ref).

    Below the reference rate the rate factor is 1 (the logarithm would turn it negative); T* is kept between 0 and 1
    and the temperature factor at or above 1e-3. Without `m` and `melting_temperature` temperature does not matter.

    Parameters
    ----------
    A, B : MPa. n, C, m : numbers. reference_rate : 1/s. reference_temperature, melting_temperature : degC.

    References
    ----------
    Johnson and Cook, 7th Int. Symp. on Ballistics (1983) 541.
    """

    law: Literal["johnson_cook"] = "johnson_cook"
    A: Positive(Stress)
    B: NonNegative(Stress)
    n: Exponent
    C: NonNegative(Number) = 0.0
    m: Positive(Number) | None = None
    reference_rate: Positive(Rate) = 1.0
    reference_temperature: Temperature = 20.0
    melting_temperature: Temperature | None = None
    depends_on_strain = True

    @property
    def depends_on_rate(self):
        return self.C != 0

    @property
    def depends_on_temperature(self):
        return self.m is not None

    @model_validator(mode="after")
    def _temperatures_fit(self):
        if (self.m is None) != (self.melting_temperature is None):
            key = "m" if self.m is None else "melting_temperature"
            raise at_key(key, "is missing; 'm' and 'melting_temperature' are given together or not at all")
        if self.m is not None and self.melting_temperature <= self.reference_temperature:
            raise at_key("melting_temperature", "is not above the reference temperature", self.melting_temperature)
        return self

    def __call__(self, strain, rate, temperature=None):
        return self._without_rate(strain, temperature) * self._rate_factor(rate) + zeros_like(strain, rate, temperature)

    def rate_derivative(self, strain, rate, temperature=None):
        slope = where_greater(rate, self.reference_rate, self.C / maximum(rate, self.reference_rate), 0.0)
        return self._without_rate(strain, temperature) * slope + zeros_like(strain, rate, temperature)

    def _rate_factor(self, rate):
        return 1.0 + self.C * log(maximum(rate, self.reference_rate) / self.reference_rate) if self.C else 1.0

    def _without_rate(self, strain, temperature):
        stress = self.A + self.B * power(maximum(strain, 0.0), self.n)
        if not self.depends_on_temperature:
            return stress
        span = self.melting_temperature - self.reference_temperature
        homologous = (self._needed(temperature) - self.reference_temperature) / span
        softening = 1.0 - power(minimum(maximum(homologous, 0.0), 1.0), self.m)
        return stress * maximum(softening, 1e-3)


class HenselSpittel(FlowStress):
    """sigma = A e^(m1 T) T^m9 strain^m2 e^(m4/strain) (1+strain)^(m5 T) e^(m7 strain) rate^m3 rate^(m8 T), T in degC.

    The nine-parameter variant (m6 does not occur). The strain is at least `STRAIN_FLOOR`, or
    `DIVIDED_STRAIN_FLOOR` where m4 is not 0; T is at least 1 degC in T^m9. Factors whose parameter is 0 are not computed.

    Parameters
    ----------
    A : MPa. m1 … m9 : numbers, 0 where not given.

    References
    ----------
    Hensel and Spittel, Kraft- und Arbeitsbedarf bildsamer Formgebungsverfahren (1978); FORMULATION.md 2.
    """

    law: Literal["hensel_spittel"] = "hensel_spittel"
    A: Positive(Stress)
    m1: Number = 0.0
    m2: Number = 0.0
    m3: Exponent = 0.0
    m4: Within(Number, -5, 5) = 0.0
    m5: Number = 0.0
    m6: Number = Field(0.0, description="0: m6 does not occur in this variant")
    m7: Number = 0.0
    m8: Number = 0.0
    m9: Number = 0.0

    @field_validator("m6")
    @classmethod
    def _m6_is_absent(cls, value):
        if value != 0:
            raise refused(value, "would be ignored", "0, because m6 does not occur in this variant of the law")
        return value

    @property
    def depends_on_strain(self):
        return any((self.m2, self.m4, self.m5, self.m7))

    @property
    def depends_on_rate(self):
        return any((self.m3, self.m8))

    @property
    def depends_on_temperature(self):
        return any((self.m1, self.m5, self.m8, self.m9))

    def __call__(self, strain, rate, temperature=None):
        zero = zeros_like(strain, rate, temperature)
        if self.depends_on_temperature:
            self._needed(temperature)
        floor = DIVIDED_STRAIN_FLOOR if self.m4 else STRAIN_FLOOR
        strain, rate = maximum(strain, floor), maximum(rate, RATE_FLOOR)
        stress = self.A
        if self.m2:
            stress = stress * power(strain, self.m2)
        if self.m9:
            stress = stress * power(maximum(temperature, 1.0), self.m9)
        if self.m5:
            stress = stress * power(1.0 + strain, self.m5 * temperature)
        exponent = self._exponent(strain, temperature)
        if exponent is not None:
            stress = stress * exp(exponent)
        if self.depends_on_rate:
            stress = stress * power(rate, self._rate_exponent(temperature))
        return stress + zero

    def rate_derivative(self, strain, rate, temperature=None):
        exponent = self._rate_exponent(temperature) if self.depends_on_rate else 0.0
        return exponent * self(strain, rate, temperature) / maximum(rate, RATE_FLOOR)

    def _exponent(self, strain, temperature):
        parts = []
        if self.m1:
            parts.append(self.m1 * temperature)
        if self.m4:
            parts.append(self.m4 / strain)
        if self.m7:
            parts.append(self.m7 * strain)
        return sum(parts[1:], parts[0]) if parts else None

    def _rate_exponent(self, temperature):
        return self.m3 + self.m8 * temperature if self.m8 else self.m3
