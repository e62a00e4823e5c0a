"""The four stress states of a tool: its kinematics, and the full strain and stress vectors at its points.

The forms work with the Mandel components that the kinematics has; the points of a plane body carry the component across
the plane as well, since the material yields by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kinematics import AXISYMMETRIC, PLANE_STRAIN, THREE_DIMENSIONAL, Kinematics
from ..plasticity import plane_stress_return_map, return_map


@dataclass(frozen=True)
class StressState:
    """A stress state.

    Attributes
    ----------
    name : "plane_strain", "plane_stress", "axisymmetric" or "3d"
    kinematics : the geometry kind that strains are made by
    components : Mandel components at a point, the three normal ones first
    held : those of them that the forms work with
    """

    name: str
    kinematics: Kinematics
    components: int
    held: tuple[int, ...]

    @property
    def is_plane_stress(self) -> bool:
        return self.name == "plane_stress"

    @property
    def return_map(self):
        """The function of ``plasticity`` that gives the response of a point."""
        return plane_stress_return_map if self.is_plane_stress else return_map

    def lame(self, law) -> float:
        """What multiplies the divergence of the form in the elastic stress, MPa: in plane stress the strain across the
        plane is eliminated from it."""
        lame, G = law.lame, law.shear_modulus
        return 2 * lame * G / (lame + 2 * G) if self.is_plane_stress else lame

    def widened(self, strain: np.ndarray) -> np.ndarray:
        """Strains of the form (p, k) with all components (p, c), zero where the form has none."""
        if strain.shape[1] == self.components:
            return strain
        full = np.zeros((len(strain), self.components))
        full[:, self.held] = strain
        return full

    def narrowed(self, stress: np.ndarray) -> np.ndarray:
        """The components of the form, (p, k), of stresses (p, c)."""
        return stress[:, self.held]

    def narrowed_tangent(self, tangent: np.ndarray) -> np.ndarray:
        """The components of the form, (p, k, k), of tangents (p, c, c)."""
        return tangent[:, self.held][:, :, self.held] if self.components != len(self.held) else tangent


STATES = {s.name: s for s in (
    StressState("plane_strain", PLANE_STRAIN, 4, (0, 1, 3)),
    StressState("plane_stress", PLANE_STRAIN, 4, (0, 1, 3)),
    StressState("axisymmetric", AXISYMMETRIC, 4, (0, 1, 2, 3)),
    StressState("3d", THREE_DIMENSIONAL, 6, (0, 1, 2, 3, 4, 5)),
)}
