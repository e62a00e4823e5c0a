"""Flow-stress laws: the flow stress in MPa from effective strain, effective strain rate (1/s) and temperature (degC).

Every law is a frozen description with its parameters and is itself the function: `law(strain, rate, temperature)`
takes floats, numpy arrays or UFL expressions. Formulas: FORMULATION.md 2. Floors that keep every value finite:
strain at least 0 where a power of it is a mere summand, `STRAIN_FLOOR` where it is a factor or a divisor, rate at
least `RATE_FLOOR`; none of them is a material constant.
"""

import math
from typing import Literal

from pydantic import ConfigDict

from ..errors import FormingError
from ..units import NonNegative, Number, Positive, Stress, Within
from .described import Described
from .functions import exp, is_ufl, maximum, power, zeros_like

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

    model_config = ConfigDict(ignored_types=(bool,))

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
