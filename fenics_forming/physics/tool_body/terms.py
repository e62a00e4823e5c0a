r"""The terms of the virtual work of a tool, each a function named after its physics; mJ (mJ/mm in the plane).

``D_u``, ``D_w`` are strains as Mandel vectors (``Kinematics.strain_rate`` of a displacement) of the displacement, or its
increment, and of the test displacement; ``weight`` is what turns an integral over the mesh into one over the body.
"""

from __future__ import annotations

import ufl


def elastic(u, w, strain, divergence, lame, shear_modulus, weight, dx):
    r"""Elastic virtual work :math:`\int\lambda\,\nabla\!\cdot u\,\nabla\!\cdot w+2G\,D(u):D(w)\,dV`, mJ."""
    return (lame * divergence(u) * divergence(w) + 2 * shear_modulus * ufl.dot(strain(u), strain(w))) * weight * dx


def internal(stress, D_w, weight, dx):
    r"""Virtual work of a stress that is known at the points, :math:`\int\sigma:D(w)\,dV`, mJ."""
    return ufl.dot(stress, D_w) * weight * dx


def tangent(packed, D_du, D_w, weight, dx):
    r"""Its derivative :math:`\int D(w):C\,D(du)\,dV` with the symmetric tangent C as the rows of its upper half."""
    size = D_du.ufl_shape[0]
    place = {}
    for i in range(size):
        for j in range(i, size):
            place[i, j] = place[j, i] = len(set(place.values()))
    product = sum(packed[place[i, j]] * D_du[j] * D_w[i] for i in range(size) for j in range(size))
    return product * weight * dx


def spring(u, w, direction, stiffness, weight, ds):
    r"""Virtual work of springs on a surface that push back along one direction,
    :math:`\int k\,(u\cdot d)(w\cdot d)\,d\Gamma`, mJ; k in N/mm³."""
    return stiffness * ufl.dot(u, direction) * ufl.dot(w, direction) * weight * ds


def body_force(force, w, weight, dx):
    r"""Virtual work of a force per volume, :math:`\int f\cdot w\,dV`, mJ."""
    return ufl.inner(force, w) * weight * dx
