r"""The terms of the virtual power of a flowing body, each a function named after its physics; mW (mJ/s).

``D_v``, ``D_dv``, ``D_w`` are strain rates as Mandel vectors (``Kinematics.strain_rate``) of the velocity, its increment
and the test velocity; ``weight`` is what turns an integral over the mesh into one over the body.
"""

from __future__ import annotations

import ufl


def plastic(D_v, D_w, flow_stress, rate, weight, dx):
    r"""Plastic virtual power :math:`\int \frac{2\bar\sigma}{3\dot{\bar\varepsilon}} D(v):D(w)\,dV`, mW."""
    return 2 * flow_stress / (3 * rate) * ufl.dot(D_v, D_w) * weight * dx


def plastic_tangent(D_v, D_dv, D_w, flow_stress, rate, stress, softening, weight, dx):
    r"""Stress-velocity tangent of :func:`plastic`:
    :math:`\int\frac{2}{3\dot{\bar\varepsilon}}\big[\bar\sigma D(dv):D(w)-\frac{c}{2\dot{\bar\varepsilon}}
    (\hat\tau:D(dv)\,D(v):D(w)+D(v):D(dv)\,\hat\tau:D(w))\big]dV`.

    ``softening`` is :math:`c=1-\dot{\bar\varepsilon}\,\partial_{\dot{\bar\varepsilon}}\bar\sigma/\bar\sigma`: 1 for
    perfect plasticity, 0 for a Newtonian fluid, which makes the tangent linear there, as it must be.
    """
    cross = ufl.dot(stress, D_dv) * ufl.dot(D_v, D_w) + ufl.dot(D_v, D_dv) * ufl.dot(stress, D_w)
    return 2 / (3 * rate) * (flow_stress * ufl.dot(D_dv, D_w) - softening / (2 * rate) * cross) * weight * dx


def incompressibility(v, p, w, q, divergence, weight, dx):
    r"""Power of the mean stress and its constraint: :math:`-\int p\,\nabla\!\cdot w-\int q\,\nabla\!\cdot v`."""
    return -(p * divergence(w) + q * divergence(v)) * weight * dx


def body_force_power(f, w, weight, dx):
    r"""Power of a force per volume, :math:`-\int f\cdot w\,dV`."""
    return -ufl.inner(f, w) * weight * dx


def drag(v, w, coefficient, weight, dx):
    r"""Power of a drag that keeps bodies at rest that nothing holds, :math:`\int c\,v\cdot w\,dV`."""
    return coefficient * ufl.inner(v, w) * weight * dx


def inertia(change, w, density, per_step, weight, dx):
    r"""Power of the inertia, :math:`\int\rho\,\frac{v-v_{before}}{\Delta t}\cdot w\,dV`.

    ``change`` is the change of velocity that a material point has seen, ``per_step`` one over the time between.
    """
    return density * per_step * ufl.inner(change, w) * weight * dx


def weight_power(gravity, w, density, weight, dx):
    r"""Power of the weight, :math:`-\int\rho\,g\cdot w\,dV`."""
    return -density * ufl.inner(gravity, w) * weight * dx
