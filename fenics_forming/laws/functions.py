"""exp, log, power and max for floats, numpy arrays and UFL expressions alike, so that a law is written once."""

import numpy as np


def is_ufl(value):
    """True for a UFL expression (asked without importing ufl)."""
    return hasattr(value, "ufl_shape")


def exp(x):
    """e^x."""
    if is_ufl(x):
        import ufl

        return ufl.exp(x)
    return np.exp(x)


def log(x):
    """Natural logarithm."""
    if is_ufl(x):
        import ufl

        return ufl.ln(x)
    return np.log(x)


def power(base, exponent):
    """base^exponent; either may be a float, an array or a UFL expression."""
    if is_ufl(base) or is_ufl(exponent):
        return base**exponent
    return np.power(np.asarray(base, dtype=float), exponent)[()]


def maximum(a, b):
    """The larger of two."""
    if is_ufl(a) or is_ufl(b):
        import ufl

        return ufl.max_value(a, b)
    return np.maximum(a, b)


def minimum(a, b):
    """The smaller of two."""
    if is_ufl(a) or is_ufl(b):
        import ufl

        return ufl.min_value(a, b)
    return np.minimum(a, b)


def where_greater(a, b, then, otherwise):
    """`then` where a > b, elsewhere `otherwise`."""
    if any(map(is_ufl, (a, b, then, otherwise))):
        import ufl

        return ufl.conditional(ufl.gt(a, b), then, otherwise)
    return np.where(np.greater(a, b), then, otherwise)[()]


def zeros_like(*values):
    """Zero in the common shape of the values; 0.0 for UFL expressions."""
    if any(map(is_ufl, values)):
        return 0.0
    shapes = {np.shape(v) for v in values if v is not None}
    return np.zeros(shapes.pop() if len(shapes) == 1 else np.broadcast_shapes(*shapes))[()]
