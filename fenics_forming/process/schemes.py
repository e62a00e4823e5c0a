"""The time schemes by name, and the one that a scene chooses."""

from __future__ import annotations

from .integration import Etd2, Explicit, Midpoint, Rotation, Scheme, Trapezoid
from .substeps import Substeps

SCHEMES = {scheme.name: scheme for scheme in (Explicit, Rotation, Etd2, Midpoint, Trapezoid, Substeps)}
SCHEMES["implicit"] = Midpoint


def scheme_of(choice) -> Scheme:
    """A fresh scheme.

    Parameters
    ----------
    choice : ``scheme.Shifting``: scheme, substeps, rule, rotation
    """
    return SCHEMES[choice.scheme].of(choice)
