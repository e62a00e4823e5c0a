"""Plane-strain limit loads against slip-line fields (REFERENCES 4): one velocity solve each, on three meshes.

The velocity solution is kinematically admissible, so its plastic power is an upper bound of tool force times tool
speed and must fall to the exact load as the mesh is refined.  The exact velocities jump across slip lines, which a
continuous field smears over one element: the error is of first order in the element size, whatever the polynomial
degree.  So every law is checked for its value (2 %, the accuracy that REFERENCES 4 asks for), for the side of the
error, and for that order.
"""

import numpy as np
import pytest

from fenics_forming import NewtonSettings, Scene, laws, meshing, simulate, solve_flow

from .shapes import held, observed_orders, side

SIGMA0 = 100.0
K = SIGMA0 / np.sqrt(3.0)
# elements at the singular corners (in units of the tool), and their growth per unit of distance
COARSE, MEDIUM, FINE, FINEST = (0.08, 0.5), (0.04, 0.25), (0.02, 0.125), (0.01, 0.0625)
# no contact here, so no contact set that could cycle: full Newton steps throughout
SETTINGS = NewtonSettings(velocity_tolerance=1e-3)


def tool_pressure(mesh, fixed, tool_width, rate):
    """Plastic power over tool speed (1 mm/s everywhere here) and tool width, MPa."""
    flow = solve_flow(mesh, kinematics="plane_strain", flow_stress=laws.Constant(value=SIGMA0), fixed=fixed,
                      characteristic_rate=rate, settings=SETTINGS)
    return flow.plastic_power / tool_width


def assert_falls_to(exact, pressures, levels, verified, entry, what):
    errors = np.array(pressures) / exact - 1.0
    sizes = [corner_size for corner_size, _ in levels]
    shown = ", ".join(f"{e:+.2%}" for e in errors)
    verified(entry, what, pressures[-1], exact, within=0.02, unit="MPa")
    # an upper bound, up to the regularisation, which takes about 1e-4 of the power
    assert (errors > -1e-3).all(), f"below the exact load: {shown}"
    assert (np.diff(errors) < 0).all(), f"refinement must lower an upper bound: {shown}"
    # first order (see above); 0.86 to 1.24 measured, scattered by where the free meshes meet the slip lines
    order = observed_orders(np.array(sizes)[[0, -1]], errors[[0, -1]])[0]
    assert 0.75 < order < 1.4, f"order {order:.2f}: {shown}"


def punch(level, rough):
    corner, growth = level
    mesh = meshing.polygon([(0, -3), (5, -3), (5, 0), (1, 0), (0, 0)], 1.0, corners=[(1, 0)], corner_size=corner,
                           growth=growth)
    fixed = (held(side(mesh, 1, -3), (0, 0)) + held(side(mesh, 0, 5), (0, None)) + held(side(mesh, 0, 0), (0, None))
             + held(side(mesh, 1, 0, (0, 1)), (0 if rough else None, -1)))
    return tool_pressure(mesh, fixed, 1.0, 1.0)


def round_punch(level, rough):
    """Pressure of a punch of radius 1 on a block of radius 3 and height 2; boxes from 3 x 2 to 8 x 5 differ by 5e-4."""
    corner, growth = level
    mesh = meshing.polygon([(0, -2), (3, -2), (3, 0), (1, 0), (0, 0)], 1.0, corners=[(1, 0)], corner_size=corner,
                           growth=growth)
    fixed = (held(side(mesh, 1, -2), (None, 0)) + held(side(mesh, 0, 3), (0, None)) + held(side(mesh, 0, 0), (0, None))
             + held(side(mesh, 1, 0, (0, 1)), (0 if rough else None, -1)))
    flow = solve_flow(mesh, kinematics="axisymmetric", flow_stress=laws.Constant(value=SIGMA0), fixed=fixed,
                      characteristic_rate=1.0, settings=SETTINGS)
    return flow.plastic_power / np.pi


def extrusion(level, reduction, rough=False):
    corner, growth = level
    exit_height = 1.0 - reduction
    mesh = meshing.polygon([(-1.5, 0), (0.5, 0), (0.5, exit_height), (0, exit_height), (0, 1), (-1.5, 1)], 0.5,
                           corners=[(0, exit_height)], corner_size=corner, growth=growth)
    fixed = (held(side(mesh, 0, -1.5), (1, None)) + held(side(mesh, 1, 1), (None, 0))
             + held(side(mesh, 1, 0), (None, 0))
             + held(side(mesh, 0, 0, (exit_height, 1)), (0, 0 if rough else None)))
    return tool_pressure(mesh, fixed, 1.0, 1.0)


def rough_platens(level, width_over_height):
    """Quarter of a flush block of height 1."""
    corner, growth = level
    half = width_over_height / 2
    mesh = meshing.polygon([(0, 0), (half, 0), (half, 0.5), (0, 0.5)], 0.3, corners=[(half, 0.5)],
                           corner_size=corner, growth=growth)
    fixed = (held(side(mesh, 0, 0), (0, None)) + held(side(mesh, 1, 0), (None, 0))
             + held(side(mesh, 1, 0.5), (0, -1)))
    return tool_pressure(mesh, fixed, half, 2.0)


def opposed_punches(level, height_over_width):
    """Quarter of a strip under smooth punches of width 1; its free ends are 2 heights away."""
    corner, growth = level
    half_height, length = height_over_width / 2, 0.5 + 2 * height_over_width
    mesh = meshing.polygon([(0, 0), (length, 0), (length, half_height), (0.5, half_height), (0, half_height)],
                           half_height / 2, corners=[(0.5, half_height)], corner_size=corner, growth=growth)
    fixed = (held(side(mesh, 0, 0), (0, None)) + held(side(mesh, 1, 0), (None, 0))
             + held(side(mesh, 1, half_height, (0, 0.5)), (None, -1)))
    return tool_pressure(mesh, fixed, 0.5, 1 / half_height)


def notched_strip(level):
    """Quarter of a strip with two razor notches: half ligament 1, half width 10, beyond Hill's 8.7."""
    corner, growth = level
    mesh = meshing.polygon([(0, 0), (1, 0), (10, 0), (10, 5), (0, 5)], 2.0, corners=[(1, 0)], corner_size=corner,
                           growth=growth)
    fixed = (held(side(mesh, 0, 0), (0, None)) + held(side(mesh, 1, 0, (0, 1)), (None, 0))
             + held(side(mesh, 1, 5), (0, 1)))
    return tool_pressure(mesh, fixed, 1.0, 1.0)


@pytest.mark.parametrize("rough", [False, True], ids=["smooth", "rough"])
def test_flat_punch_sinks_in_at_2_plus_pi_k(rough, verified):
    """REFERENCES 4.1 (Prandtl), the same smooth and rough; half width 1, box 5 x 3, base and far side held."""
    levels = COARSE, MEDIUM, FINE
    assert_falls_to((2 + np.pi) * K, [punch(level, rough) for level in levels], levels, verified,
                    "4.1", "rough punch" if rough else "smooth punch")


@pytest.mark.parametrize(("rough", "pressure", "tresca"), [(False, 5.22, 5.69), (True, 5.52, 6.05)],
                         ids=["smooth", "rough"])
def test_circular_punch_sinks_in_between_the_bounds_that_tresca_sets_for_von_mises(rough, pressure, tresca, verified):
    """REFERENCES 4.6: the hexagon around the circle of von Mises (same k) carries more, the one inside it less."""
    levels = COARSE, MEDIUM, FINE
    pressures = [round_punch(level, rough) for level in levels]
    assert_falls_to(pressure * K, pressures, levels, verified, "4.6", "rough punch" if rough else "smooth punch")
    assert np.sqrt(3) / 2 * tresca * K < pressures[-1] < tresca * K


@pytest.mark.parametrize(("friction", "pressure"), [("none", 5.22), ("sticking", 5.52)], ids=["smooth", "rough"])
def test_circular_punch_in_space_presses_like_one_about_its_axis(friction, pressure, verified, tmp_path):
    """REFERENCES 4.6, a quarter of a block under a cylinder, solved by iterations; 6 %, from above as elements are coarse.

    The mesh has an edge where the punch ends, and elements of 0.15 mm there: with neither it was 20 % too much.
    """
    walls = {"x": ([3, 0, 0], [-1, 0, 0]), "y": ([0, 3, 0], [0, -1, 0]), "z": ([0, 0, -2], [0, 0, 1])}
    walls = {axis: {"shape": {"kind": "plane", "point": at, "normal": normal}} for axis, (at, normal) in walls.items()}
    punch = {"shape": {"kind": "cylinder", "base": [0, 0, 0], "radius": 1, "height": 1}, "friction": {"law": friction},
             "drive": {"kind": "speed", "velocity": [0, 0, -1]}}
    near = {"kind": "cylinder", "base": [0, 0, -0.1], "radius": 1.1, "height": 0.1, "size": 0.15}
    block = {"shape": {"kind": "box", "from": [0, 0, -2], "to": [3, 3, 0]}, "symmetry": ["x", "y"], "material": "metal",
             "mesh_size": 1.0, "refine": [near]}
    results = simulate(Scene.read({
        "geometry": "3d", "materials": {"metal": {"flow_stress": {"law": "constant", "value": SIGMA0}}},
        "workpieces": {"block": block}, "tools": {"punch": punch, **walls}, "solver": {"linear": "iterative"},
        "steps": {"stroke": 0.002}, "stop": {"stroke": 0.002}}), tmp_path)
    force = results.history.rows[0]["force_punch_N"]
    verified("4.6", f"in space, {friction}", force / np.pi, pressure * K, within=0.06, unit="MPa")
    assert force / np.pi > pressure * K


@pytest.mark.parametrize("rough", [False, True], ids=["smooth die", "rough die"])
def test_extrusion_to_a_half_takes_a_ram_pressure_of_1_plus_half_pi_k(rough, verified):
    """REFERENCES 4.2: p/2k = (2+pi)/4, square die, frictionless container, whatever the die (dead metal)."""
    levels = COARSE, MEDIUM, FINE
    assert_falls_to(2 * K * (2 + np.pi) / 4, [extrusion(level, 0.5, rough) for level in levels], levels, verified,
                    "4.2", f"reduction 50 %, {'rough' if rough else 'smooth'} die")


@pytest.mark.parametrize(("reduction", "pressure"), [(0.3, 0.824), (2 / 3, 1.710)])
def test_extrusion_pressure_follows_the_limit_analysis_at_other_reductions(reduction, pressure, verified):
    """REFERENCES 4.2: p/2k, smooth container and smooth die (known to 0.4 %)."""
    levels = COARSE, MEDIUM, FINE
    assert_falls_to(2 * K * pressure, [extrusion(level, reduction) for level in levels], levels, verified,
                    "4.2", f"reduction {reduction:.1%}, smooth die")


@pytest.mark.parametrize(("width_over_height", "pressure"), [(1, 1.0), (2, 1.2138), (4, 1.7562), (6, 2.2662)])
def test_block_between_rough_platens_follows_prandtl_and_hill(width_over_height, pressure, verified):
    """REFERENCES 4.3: mean p/2k of a flush block."""
    levels = MEDIUM, FINE, FINEST
    assert_falls_to(2 * K * pressure, [rough_platens(level, width_over_height) for level in levels], levels, verified,
                    "4.3", f"w/h = {width_over_height}")


@pytest.mark.parametrize(("height_over_width", "pressure"), [(2, 1.2138), (5, 1.9713)])
def test_opposed_punches_follow_the_slip_line_net(height_over_width, pressure, verified):
    """REFERENCES 4.4: p/2k of the plane-strain compression test."""
    levels = COARSE, MEDIUM, FINE
    assert_falls_to(2 * K * pressure, [opposed_punches(level, height_over_width) for level in levels], levels, verified,
                    "4.4", f"h/w = {height_over_width}")


def test_deeply_notched_strip_tears_at_2_plus_pi_k_on_the_ligament(verified):
    """REFERENCES 4.5: net stress; an element that locks in incompressible flow finds no limit here."""
    levels = COARSE, MEDIUM, FINE
    assert_falls_to((2 + np.pi) * K, [notched_strip(level) for level in levels], levels, verified, "4.5", "deep notches")
