"""Wanted element sizes: what the scene, the tools and the state of a body ask for, as one field over space."""

from .field import Around, AtNodes, AtPoints, Remembered, Sizes, graded
from .wanted import body_sizes, mirror_planes, nodal_sizes

__all__ = ["Around", "AtNodes", "AtPoints", "Remembered", "Sizes", "body_sizes", "graded", "mirror_planes", "nodal_sizes"]
