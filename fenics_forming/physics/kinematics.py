"""The three geometry kinds: how a velocity field becomes strain rates, and how volumes are weighed.

The kind is chosen once, here; no form of the package branches on it.  Symmetric tensors are Mandel vectors
(shear components times the square root of two), so that ``dot(a, b)`` is the double contraction in every kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
import ufl

SQRT2 = sqrt(2.0)


@dataclass(frozen=True)
class Kinematics:
    """A geometry kind.

    Attributes
    ----------
    name : "plane_strain", "axisymmetric" or "3d"
    dim : number of space dimensions of the mesh
    components : number of Mandel components of a symmetric tensor
    axes : the letters of the coordinates
    """

    name: str
    dim: int
    components: int
    axes: str

    def strain_rate(self, v):
        r"""Strain rate :math:`D = \mathrm{sym}\,\nabla v` as a Mandel vector, 1/s (in axisymmetry not on the axis)."""
        g = ufl.grad(v)
        if self.name == "plane_strain":
            return ufl.as_vector([g[0, 0], g[1, 1], (g[0, 1] + g[1, 0]) / SQRT2])
        if self.name == "axisymmetric":
            hoop = v[0] / ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(v))[0]
            return ufl.as_vector([g[0, 0], g[1, 1], hoop, (g[0, 1] + g[1, 0]) / SQRT2])
        return ufl.as_vector([g[0, 0], g[1, 1], g[2, 2], (g[1, 2] + g[2, 1]) / SQRT2,
                              (g[0, 2] + g[2, 0]) / SQRT2, (g[0, 1] + g[1, 0]) / SQRT2])

    def strain_rate_at(self, gradient, velocity, points):
        """The same as :meth:`strain_rate` for arrays: (n, dim, dim) 1/s, (n, dim) mm/s, (n, dim) mm to (n, components).

        On the axis the hoop rate is the radial one.
        """
        sym = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
        diagonal = [sym[:, i, i] for i in range(self.dim)]
        if self.name == "axisymmetric":
            r = points[:, 0]
            off = np.abs(r) > 1e-9 * np.abs(r).max(initial=0.0)
            diagonal.append(np.where(off, velocity[:, 0] / np.where(off, r, 1.0), sym[:, 0, 0]))
        pairs = [(0, 1)] if self.dim == 2 else [(1, 2), (0, 2), (0, 1)]
        return np.stack(diagonal + [SQRT2 * sym[:, i, j] for i, j in pairs], axis=1)

    def largest_principal(self, stress):
        """Largest principal value of deviatoric Mandel vectors (..., components), which in plane strain have no
        component out of the plane: (...)."""
        if self.dim == 3:
            a, b, c, bc, ac, ab = np.moveaxis(stress, -1, 0)
            rows = [[a, ab / SQRT2, ac / SQRT2], [ab / SQRT2, b, bc / SQRT2], [ac / SQRT2, bc / SQRT2, c]]
            return np.linalg.eigvalsh(np.moveaxis(np.array(rows), (0, 1), (-2, -1)))[..., -1]
        half, shear = 0.5 * (stress[..., 0] - stress[..., 1]), stress[..., -1] / SQRT2
        in_plane = 0.5 * (stress[..., 0] + stress[..., 1]) + np.hypot(half, shear)
        return np.maximum(in_plane, stress[..., 2] if self.name == "axisymmetric" else 0.0)

    def divergence(self, v):
        r"""Volumetric strain rate :math:`\nabla\cdot v`, 1/s."""
        d = self.strain_rate(v)
        return d[0] + d[1] + (d[2] if self.components > 3 else 0)

    def weight(self, x):
        """What turns an integral over the mesh into one over the body: 2 pi r in axisymmetry, else 1."""
        return 2 * pi * x[0] if self.name == "axisymmetric" else 1

    def weight_at(self, points):
        """The same as :meth:`weight` for an array of points (n, dim)."""
        return 2 * pi * points[:, 0] if self.name == "axisymmetric" else 1.0


PLANE_STRAIN = Kinematics("plane_strain", 2, 3, "xy")
AXISYMMETRIC = Kinematics("axisymmetric", 2, 4, "rz")
THREE_DIMENSIONAL = Kinematics("3d", 3, 6, "xyz")
KINDS = {k.name: k for k in (PLANE_STRAIN, AXISYMMETRIC, THREE_DIMENSIONAL)}
