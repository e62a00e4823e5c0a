"""Flow-stress laws of temperature: Johnson-Cook, Hensel-Spittel, and the hyperbolic sine of hot working."""

import math
from typing import Literal

from pydantic import Field, field_validator, model_validator

from ..units import (
    MolarEnergy,
    NonNegative,
    Number,
    Positive,
    Rate,
    ReciprocalStress,
    Stress,
    Temperature,
    Within,
    refused,
)
from .described import at_key
from .flow_stress import DIVIDED_STRAIN_FLOOR, RATE_FLOOR, STRAIN_FLOOR, Exponent, FlowStress
from .functions import exp, log, maximum, minimum, power, where_greater, zeros_like

GAS_CONSTANT = 8.314462618
"""R in J/(mol K), CODATA 2018."""

ABSOLUTE_ZERO = -273.15
"""In degC."""


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
        stress = self._without_rate(strain, temperature) * self._rate_factor(rate)
        return stress + zeros_like(strain, rate, temperature)

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
    """sigma = A e^(m1 T) T^m9 eps^m2 e^(m4/eps) (1+eps)^(m5 T) e^(m7 eps) rate^m3 rate^(m8 T), eps the strain, T degC.

    The nine-parameter variant (m6 does not occur). The strain is at least `STRAIN_FLOOR`, or `DIVIDED_STRAIN_FLOOR`
    where m4 is not 0; T is at least 1 degC in T^m9. The exponent of the rate, m3 + m8 T, is at least 0: where the
    negative m3 of a measured set would make it less (below some 600 degC for steels), the set no longer holds.
    A factor whose parameter is 0 is left out.

    Parameters
    ----------
    A : MPa. m1 … m9 : numbers, 0 where not given. m3 : from -1 to 1, negative only beside m8 > 0.

    References
    ----------
    Hensel and Spittel, Kraft- und Arbeitsbedarf bildsamer Formgebungsverfahren (1978); FORMULATION.md 2.
    """

    law: Literal["hensel_spittel"] = "hensel_spittel"
    A: Positive(Stress)
    m1: Number = 0.0
    m2: Number = 0.0
    m3: Within(Number, -1, 1) = 0.0
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

    @model_validator(mode="after")
    def _stress_grows_with_the_rate(self):
        if self.m3 < 0 and not self.m8 > 0:
            raise at_key("m3", "is negative, and no m8 > 0 makes up for it: the stress grows with the rate", self.m3,
                         "a number from 0 to 1, or a negative one beside m8 > 0")
        return self

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
        return maximum(self.m3 + self.m8 * temperature, 0.0) if self.m8 else self.m3


class Sinh(FlowStress):
    """sigma = arsinh((Z / A)^(1/n)) / alpha, Z = rate * exp(activation_energy / (R T)), T in K: steady hot flow.

    The law of Sellars and Tegart, for metals that recover or recrystallise as fast as they harden: strain does not
    matter. Z is the Zener-Hollomon parameter. A runs over many powers of ten and is therefore printed as `ln_A` in
    most papers; give one of the two.

    Parameters
    ----------
    alpha : 1/MPa. n : number. activation_energy : J/mol. A : 1/s. ln_A : its natural logarithm, A in 1/s.

    References
    ----------
    Sellars and Tegart, Int. Metall. Rev. 17 (1972) 1; Sheppard, Extrusion of Aluminium Alloys (1999), ch. 4.
    """

    law: Literal["sinh"] = "sinh"
    alpha: Positive(ReciprocalStress)
    n: Within(Positive(Number), 0.1, 100)
    activation_energy: Within(Positive(MolarEnergy), 1e3, 2e6)
    A: Positive(Rate) | None = None
    ln_A: Within(Number, -50, 500) | None = None
    depends_on_rate = True
    depends_on_temperature = True

    @model_validator(mode="after")
    def _one_of_two(self):
        if (self.A is None) == (self.ln_A is None):
            why = "is missing; 'A' or its logarithm 'ln_A' is needed"
            raise at_key("ln_A", why if self.A is None else "is given together with 'A'; one of them is enough")
        return self

    def __call__(self, strain, rate, temperature=None):
        raised, positive = self._argument(rate, temperature)
        # arsinh(e^x) without overflow: with p = max(x, 0) it is p + ln(e^(x-p) + sqrt(e^(2(x-p)) + e^(-2p)))
        e = exp(raised - positive)
        stress = positive + log(e + power(e * e + exp(-2.0 * positive), 0.5))
        return stress / self.alpha + zeros_like(strain, rate, temperature)

    def rate_derivative(self, strain, rate, temperature=None):
        """1 / (alpha n rate) * u / sqrt(1 + u^2), u = (Z/A)^(1/n), MPa s."""
        raised, positive = self._argument(rate, temperature)
        e = exp(raised - positive)
        slope = e / power(e * e + exp(-2.0 * positive), 0.5)
        return slope / (self.alpha * self.n * maximum(rate, RATE_FLOOR)) + zeros_like(strain, rate, temperature)

    def _argument(self, rate, temperature):
        """x = ln(Z / A) / n and max(x, 0)."""
        kelvin = maximum(self._needed(temperature) - ABSOLUTE_ZERO, 1.0)
        ln_a = self.ln_A if self.A is None else math.log(self.A)
        z = log(maximum(rate, RATE_FLOOR)) + self.activation_energy / (GAS_CONSTANT * kelvin)
        x = (z - ln_a) / self.n
        return x, maximum(x, 0.0)
