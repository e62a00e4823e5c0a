"""Manufactured solutions: the orders of convergence of velocity and mean stress (REFERENCES 5.4).

A velocity without divergence and a pressure are chosen; the body force that makes them the solution is differentiated
symbolically from sigma = 2 eta D - p I with eta = K/3 (rate² + e0²)^((m-1)/2).  That is what the package makes of the
Norton law: 2 sigma(r) / (3 r) = 2 eta with r² = rate² + e0² gives sigma = K r^m, where e0 = regularisation times
characteristic rate.  e0 is a quarter of the largest rate and stays, so that the viscosity is a smooth function that
the meshes resolve (with 0.1/s its layers are 0.002 wide, far thinner than an element, and every order is erratic).
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem

from fenics_forming import FixedVelocity, NewtonSettings, kinematics, laws, meshing, solve_flow

from .shapes import observed_orders, side

K, E0 = 100.0, 5.0


def plane_velocity(lib, x, y):
    """u = dpsi/dy, v = -dpsi/dx of psi = sin²(pi x) sin²(pi y): nothing moves on the boundary."""
    pi = np.pi
    return pi * lib.sin(pi * x) ** 2 * lib.sin(2 * pi * y), -pi * lib.sin(2 * pi * x) * lib.sin(pi * y) ** 2


def ring_velocity(lib, r, z):
    """v_r = -dPsi/dz / r, v_z = dPsi/dr / r of the Stokes stream function Psi = r²(1-r)² sin²(pi z)."""
    pi = np.pi
    return -pi * r * (1 - r) ** 2 * lib.sin(2 * pi * z), (2 - 6 * r + 4 * r**2) * lib.sin(pi * z) ** 2


def hoop_rate(r, z):
    """v_r / r of :func:`ring_velocity`, without the division."""
    return -np.pi * (1 - r) ** 2 * ufl.sin(2 * np.pi * z)


VELOCITY = {"plane_strain": plane_velocity, "axisymmetric": ring_velocity}


def exact_fields(kind, m, x):
    """Velocity, pressure and the body force that holds them, in UFL."""
    v = ufl.as_vector(VELOCITY[kind](ufl, x[0], x[1]))
    p = K * ufl.cos(np.pi * x[0]) * ufl.cos(np.pi * x[1])
    hoop = hoop_rate(x[0], x[1]) if kind == "axisymmetric" else 0
    D = ufl.sym(ufl.grad(v))
    eta = K / 3 * (2 / 3 * (ufl.inner(D, D) + hoop**2) + E0**2) ** ((m - 1) / 2)
    sigma = 2 * eta * D - p * ufl.Identity(2)
    force = -ufl.div(sigma)
    if kind == "axisymmetric":
        sigma_hoop = 2 * eta * hoop - p
        force -= ufl.as_vector([sigma[0, 0] - sigma_hoop, sigma[0, 1]]) / x[0]
    return v, p, force


def relative_errors(kind, m, n):
    """L2 errors of velocity and pressure (up to its constant) with n x n squares."""
    mesh = meshing.rectangle((0.0, 0.0), (1.0, 1.0), (n, n))
    x = ufl.SpatialCoordinate(mesh)
    v, p, force = exact_fields(kind, m, x)
    walls = np.concatenate([side(mesh, 0, 1.0), side(mesh, 1, 0.0), side(mesh, 1, 1.0)])
    near = side(mesh, 0, 0.0)
    given = [lambda at, i=i: VELOCITY[kind](np, *at.T)[i] for i in (0, 1)]
    fixed = [FixedVelocity(walls, i, given[i]) for i in (0, 1)]
    # the axis of the ring is a plane of symmetry, not a wall: what moves along it is found
    fixed += [FixedVelocity(near, i, given[i]) for i in ((0, 1) if kind == "plane_strain" else (0,))]
    flow = solve_flow(mesh, kinematics=kind, flow_stress=laws.NortonHoff(K=K, m=m), fixed=fixed,
                      characteristic_rate=1.0, body_force=force, pressure_datum=True,
                      settings=NewtonSettings(regularisation=E0, velocity_tolerance=1e-9))
    weight = kinematics.KINDS[kind].weight(x)
    found_v, found_p = ufl.split(flow.workpiece.solution)

    def integral(expression):
        return fem.assemble_scalar(fem.form(expression * weight * ufl.dx(domain=mesh, degree=6)))

    off = integral(found_p - p) / integral(fem.Constant(mesh, 1.0))
    dv, dp = found_v - v, found_p - p - off
    return (np.sqrt(integral(ufl.inner(dv, dv)) / integral(ufl.inner(v, v))),
            np.sqrt(integral(dp**2) / integral(p**2)))


@pytest.mark.parametrize("m", [1.0, 0.3], ids=["Newtonian", "power law 0.3"])
@pytest.mark.parametrize("kind", ["plane_strain", "axisymmetric"])
def test_velocity_converges_with_order_3_and_pressure_with_order_2(kind, m, verified):
    """REFERENCES 5.4: the orders of quadratic velocities with linear pressures in the L2 norm."""
    divisions = (8, 16, 32)
    errors = np.array([relative_errors(kind, m, n) for n in divisions])
    sizes = 1 / np.array(divisions)
    # velocity 3.02 to 3.11, pressure 2.01 to 3.2 measured
    what = f"order of the velocity, {kind.replace('_', ' ')}, m = {m:g}"
    verified("5.4", what, observed_orders(sizes, errors[:, 0])[-1], 3.0, within=0.2, absolute=True)
    assert (observed_orders(sizes, errors[:, 0]) > 2.8).all(), errors
    assert (observed_orders(sizes, errors[:, 1]) > 1.8).all(), errors
    # and the constants: what 32 squares a side gave when this was written, with a margin of two
    assert (errors[-1] < (2e-4, 2e-3)).all(), errors
