"""Homogeneous compression between frictionless tools: velocity and force of one solve are exact (REFERENCES 1.1, 1.2).

The linear velocity field lies in the space of every mesh, so nothing but rounding (velocity) and the regularisation
(force: its square, 1e-12) may remain.  The body at height h is built with its exact shape and strain.
"""

from typing import NamedTuple

import numpy as np
import pytest

from fenics_forming import FixedVelocity, NewtonSettings, laws, meshing, solve_flow

from .shapes import side

H0, SETTINGS = 20.0, NewtonSettings(velocity_tolerance=1e-12, regularisation=1e-6)
HEIGHTS = (15.0, 10.0, 6.0)
LAWS = {
    "perfect": laws.Constant(value=100),
    "Swift": laws.Swift(K=100 * 5**0.3, prestrain=0.2, n=0.3),  # 100 (1 + 5 strain)^0.3
    "linear": laws.Linear(initial=100, hardening=50),
    "power": laws.Power(K=200, n=0.2, m=0.1),
    "Norton": laws.NortonHoff(K=150, m=0.15),
}
CYLINDER_FORCE = {  # 1.1: N at the three heights, R0 = 10 mm, 1 mm/s
    "perfect": (41887.90, 62831.85, 104719.76),
    "Swift": (54729.40, 98434.60, 187900.19),
    "linear": (47913.10, 84607.71, 167759.62),
    "power": (49807.19, 92763.04, 181704.98),
    "Norton": (41856.82, 66722.32, 120059.68),
}
PLANE_FORCE = {  # 1.2: N per mm of depth, w0 = 20 mm
    "perfect": (3079.201, 4618.802, 7698.004),
    "Swift": (4129.983, 7486.340, 14338.606),
    "linear": (3590.636, 6467.195, 13048.994),
    "power": (3822.807, 7119.758, 13946.240),
    "Norton": (3144.026, 5011.769, 9018.142),
}
PLANE = 2 / np.sqrt(3)  # effective strain over height strain in plane strain


class Body(NamedTuple):
    """A body at height h: its mesh, its conditions, which part of the full tool face it has, and the exact answer."""

    mesh: object
    fixed: list
    part: float
    spread: tuple  # velocity components over their coordinates and the rate 1/h of height
    strain_factor: float
    force: dict


def planes(mesh, normals):
    """Symmetry planes through the origin, normal to the given axes."""
    return [FixedVelocity(side(mesh, i, 0.0), i) for i in normals]


def cylinder(h):
    radius = 10 * np.sqrt(H0 / h)
    mesh = meshing.polygon([(0, 0), (radius, 0), (radius, h), (0, h)], h / 3)
    fixed = [*planes(mesh, (0, 1)), FixedVelocity(side(mesh, 1, h), 1, -1.0)]
    return Body(mesh, fixed, 1.0, (0.5, -1.0), 1.0, CYLINDER_FORCE)


def plane_block(h):
    half = 10 * H0 / h
    mesh = meshing.polygon([(0, 0), (half, 0), (half, h), (0, h)], h / 3)
    fixed = [*planes(mesh, (0, 1)), FixedVelocity(side(mesh, 1, h), 1, -1.0)]
    return Body(mesh, fixed, 0.5, (1.0, -1.0), PLANE, PLANE_FORCE)


def walled_block(h):
    """Between two frictionless lateral walls 6 mm apart: plane strain."""
    half, depth = 10 * H0 / h, 6.0
    mesh = meshing.box((0, 0, 0), (half, depth, h), (2, 1, 2))
    fixed = [*planes(mesh, (0, 1, 2)), FixedVelocity(side(mesh, 1, depth), 1),
             FixedVelocity(side(mesh, 2, h), 2, -1.0)]
    return Body(mesh, fixed, 0.5 * depth, (1.0, 0.0, -1.0), PLANE, PLANE_FORCE)


def free_block(h):
    """Four free sides: the cylinder's stress on another area."""
    edge = 10 * np.sqrt(H0 / h)
    mesh = meshing.box((0, 0, 0), (edge, edge, h), (2, 2, 2))
    fixed = [*planes(mesh, (0, 1, 2)), FixedVelocity(side(mesh, 2, h), 2, -1.0)]
    return Body(mesh, fixed, 1 / np.pi, (0.5, 0.5, -1.0), 1.0, CYLINDER_FORCE)


BODIES = {"axisymmetric": [cylinder], "plane_strain": [plane_block], "3d": [walled_block, free_block]}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kind", "build"), [(kind, build) for kind, builds in BODIES.items() for build in builds])
def test_frictionless_compression_is_homogeneous_and_takes_the_closed_form_force(kind, build, law):
    """REFERENCES 1.1 and 1.2: linear velocities, uniform rate and stress, force = flow stress times area."""
    for at, h in enumerate(HEIGHTS):
        body = build(h)
        strain = np.full(len(body.mesh.geometry.x), body.strain_factor * np.log(H0 / h))
        flow = solve_flow(body.mesh, kinematics=kind, flow_stress=LAWS[law], fixed=body.fixed,
                          characteristic_rate=1 / h, strain=strain, settings=SETTINGS)
        exact = np.array(body.spread) * flow.x / h
        # the linear solver's rounding: the tools move at 1 mm/s
        assert flow.velocity == pytest.approx(exact, abs=1e-10)
        assert flow.effective_strain_rate == pytest.approx(body.strain_factor / h, rel=1e-9)
        # the tables have seven digits; tool speed is 1 mm/s, so the force is the power
        assert flow.plastic_power == pytest.approx(body.force[law][at] * body.part, rel=1e-6)
        sigma = LAWS[law](strain[0], body.strain_factor / h, None)
        mean = -sigma / 3 if body.strain_factor == 1.0 else -sigma / np.sqrt(3)
        # a multiplier: rounding of the velocities over their spacing, times the viscosity
        assert flow.mean_stress == pytest.approx(mean, rel=1e-8)


@pytest.mark.parametrize("kind", ["axisymmetric", "plane_strain", "3d"])
def test_tension_is_compression_with_the_sign_changed(kind):
    """REFERENCES 1.1: a perfectly plastic body pulled instead of pressed."""
    body = BODIES[kind][-1](H0)
    pulled = [FixedVelocity(c.facets, c.component, -c.value) for c in body.fixed]
    press, pull = (solve_flow(body.mesh, kinematics=kind, flow_stress=LAWS["perfect"], fixed=fixed,
                              characteristic_rate=1 / H0, settings=SETTINGS) for fixed in (body.fixed, pulled))
    # the same arithmetic up to signs
    assert pull.velocity == pytest.approx(-press.velocity, abs=1e-10)
    assert pull.mean_stress == pytest.approx(-press.mean_stress, rel=1e-8)
    assert pull.plastic_power == pytest.approx(press.plastic_power, rel=1e-10)
