"""Inertia and weight: free fall, fast upsetting, spinning rings, Taylor's rods, balances (REFERENCES.md 8)."""

import numpy as np
import pytest
import ufl
from scipy.integrate import solve_ivp

from fenics_forming import Simulation, laws, meshing, read_scene, simulate
from fenics_forming.physics.conditions import FixedVelocity
from fenics_forming.physics.gravity import GRAVITY
from fenics_forming.physics.kinematics import KINDS
from fenics_forming.physics.mass import MassProperties
from fenics_forming.physics.newton import FlowSolver
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.workpiece import Workpiece
from fenics_forming.process.body import FlowingBody
from fenics_forming.process.integration import Midpoint

from .motion import ALUMINIUM, COPPER, falling, fast_upsetting, length_and_foot, rod

DROP = 49.03325     # mm in 0.1 s
ROUNDING = 1e-12
NO_INERTIA = {"process": {}, "workpieces": {"block": {
    "shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 20]}, "material": "steel", "mesh_size": 5,
    "symmetry": ["z"]}}}


# ---------------------------------------------------------------------- free fall, 8.2
@pytest.mark.parametrize(("scheme", "law"), [("implicit", 0), ("trapezoid", 0), ("etd2", 0), ("explicit", -1),
                                             ("rotation", -1), ("substeps", -1)])
def test_a_free_body_falls_by_the_law_of_its_scheme(scheme, law, verified):
    """Backward Euler is exact for a constant acceleration; of the ways, those by the velocity of the start lag by 1/N."""
    run = Simulation(falling(scheme, 10))
    results = run.run()
    np.testing.assert_allclose(run.body.inertia.velocity, np.broadcast_to([0, -980.665], run.nodes.x.shape),
                               rtol=ROUNDING, atol=980.665 * ROUNDING)
    fallen = 10 - results.history.column("middle_z_mm")[-1]
    verified("8.2", f"way of a free fall, {scheme}, 10 steps", fallen, DROP * (1 + law / 10), within=ROUNDING, unit="mm")


@pytest.mark.parametrize("geometry", ["plane_strain", "3d"])
def test_a_free_body_falls_along_the_negative_last_axis_and_keeps_its_shape(geometry):
    run = Simulation(falling("implicit", 3, geometry))
    before = run.nodes.x.copy()
    run.run()
    down = np.zeros(run.nodes.dim)
    down[-1] = -DROP
    np.testing.assert_allclose(run.nodes.x - before, np.broadcast_to(down, before.shape), atol=DROP * ROUNDING * 10)


def test_a_way_by_the_velocity_of_the_end_goes_ahead_by_one_over_n(verified):
    """The lower layer, as the founding text writes it: x += v dt with the velocity just solved (REFERENCES 8.2)."""
    nodes = Nodes(meshing.polygon([(0, 0), (10, 0), (10, 20), (0, 20)], 10))
    body = Workpiece(nodes, kinematics=KINDS["axisymmetric"], flow_stress=laws.Constant(value=100),
                     fixed=[FixedVelocity(meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(x[0], 0)), 0)],
                     mass=MassProperties(7.85e-9, inertia=True, weight=True))
    solver, velocity, start = FlowSolver(body), np.zeros_like(nodes.x), nodes.x.copy()
    for _ in range(10):
        body.mass.start_from(velocity, 0.01)
        solver.solve(strain=np.zeros(nodes.count), characteristic_rate=5.0)
        velocity = body.velocity
        nodes.x[:] += 0.01 * velocity
    fallen = (start - nodes.x)[:, 1]
    assert np.ptp(fallen) < 100 * ROUNDING
    verified("8.2", "way of a free fall by the velocity of the end, 10 steps", fallen.mean(), 53.936575, within=ROUNDING,
             unit="mm")


# ---------------------------------------------------------------------- fast upsetting, 8.1
def pressure_of_fast_upsetting(geometry, speed, height):
    """Mean die pressure, MPa: of the flow alone, and with inertia."""
    rate, density = speed / height, 7.85e-9
    if geometry == "axisymmetric":
        radius = 10 * np.sqrt(20 / height)
        return 100.0, 100 + 3 / 16 * density * rate**2 * radius**2
    width = 2 * 10 * 20 / height
    return 200 / np.sqrt(3), 200 / np.sqrt(3) + density * rate**2 * width**2 / 6


def errors_of_fast_upsetting(geometry, speed, steps, **more):
    """Relative errors of the mean die pressure in every step, and of the inertial part of it at the end."""
    history = simulate(fast_upsetting(speed, steps, geometry, **more)).history
    height = 20 - history.column("stroke_die_mm")[1:]
    if geometry == "axisymmetric":
        pressure = history.column("force_die_N")[1:] / (np.pi * 100 * 20 / height)
    else:
        pressure = history.column("force_die_N_per_mm")[1:] / (2 * 10 * 20 / height)
    flow, exact = pressure_of_fast_upsetting(geometry, speed, height)
    return pressure / exact - 1, (pressure[-1] - flow) / (exact[-1] - flow) - 1


@pytest.mark.parametrize("geometry", ["axisymmetric", "plane_strain"])
def test_a_fast_die_feels_the_inertia_of_the_flow(geometry, verified):
    """100 m/s: in the end the pressure is 30 to 40 % above that of slow upsetting. 1.5 % in every step from the first."""
    errors, _ = errors_of_fast_upsetting(geometry, 1e5, 40)
    assert np.abs(errors).max() < 0.015
    exact = pressure_of_fast_upsetting(geometry, 1e5, np.array([20 - 0.25, 10]))[1]
    verified("8.1", f"mean pressure at 100 m/s, {geometry.replace('_', ' ')}", (1 + errors[[0, -1]]) * exact, exact,
             within=0.015, unit="MPa", at=("first step of 40", "h = 10 mm"))


def test_the_pressure_of_a_fast_die_falls_from_its_middle_to_its_rim():
    """p = 100 + 3/8 rho (v/h)² (R² - r²): 114.7188 MPa in the middle at 50 m/s and h = 10 mm, at every contact point."""
    run = Simulation(fast_upsetting(5e4, 40))
    run.run()
    contact = run.body.contact
    state, r = contact.tools[0].state, contact.points[:, 0]
    exact = 100 + 3 / 8 * 7.85e-9 * 5e3**2 * (200 - r**2)
    assert exact.max() > 114 and state.active.sum() >= 8
    np.testing.assert_allclose(state.pressure[state.active], exact[state.active], rtol=0.005)


def test_slow_upsetting_feels_nothing_of_inertia_and_takes_no_more_iterations():
    """1 mm/s: the inertial pressure is 1e-11 of the flow stress."""
    slow = [simulate(fast_upsetting(1.0, 10).replaced(**change)) for change in ({}, NO_INERTIA)]
    forces = [run.history.column("force_die_N")[1:] for run in slow]
    np.testing.assert_allclose(*forces, rtol=1e-3)
    iterations = [run.summary["newton_iterations_per_solve"] for run in slow]
    assert iterations[0] <= iterations[1] + 1


def test_pressures_of_fast_upsetting_at_lower_speeds(verified):
    """REFERENCES 8.1: 100.2944 and 107.3594 MPa at h = 10 mm; what is off there is of the inertial part."""
    for speed, pressure in ((1e4, 100.2944), (5e4, 107.3594)):
        assert pressure_of_fast_upsetting("axisymmetric", speed, 10)[1] == pytest.approx(pressure, abs=1e-4)
        errors, _ = errors_of_fast_upsetting("axisymmetric", speed, 20)
        assert np.abs(errors).max() < 0.005
        verified("8.1", f"mean pressure at {speed / 1e3:g} m/s, h = 10 mm", (1 + errors[-1]) * pressure, pressure,
                 within=0.005, unit="MPa")


def test_the_inertial_pressure_is_of_first_order_in_the_step():
    errors = [errors_of_fast_upsetting("axisymmetric", 1e5, steps)[1] for steps in (10, 20, 40)]
    for coarse, fine in zip(errors, errors[1:], strict=False):
        assert coarse / fine == pytest.approx(2.0, abs=0.35)


def test_the_explicit_scheme_needs_no_constant_step():
    """The acceleration counts the time that has passed, whatever the step was and will be: steps that strain limits give
    what equal ones do, an error of first order."""
    errors, _ = errors_of_fast_upsetting("axisymmetric", 5e4, 20, scheme="explicit",
                                         adaptive={"max_strain_increment": 0.03})
    assert len(np.unique(np.round(np.diff(errors), 12))) > 3 and np.abs(errors).max() < 0.02


# ---------------------------------------------------------------------- spinning rings, 8.3
@pytest.mark.parametrize(("exponent", "time", "radius"), [(1.0, 1.0, 128.300), (1.0, 2.0, 215.666), (0.5, 1.0, 104.271),
                                                          (0.5, 5.0, 144.444)])
def test_a_viscous_ring_grows_under_its_centrifugal_force(exponent, time, radius, verified):
    """Thin, R0 = 100 mm at 500 rad/s, K = 100 MPa; the body force of the lower layer, no radial inertia (8.3)."""
    omega, density = 500.0, 7.85e-9
    nodes = Nodes(meshing.polygon([(99.75, 0), (100.25, 0), (100.25, 0.5), (99.75, 0.5)], 0.5))
    bottom = meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(x[1], 0))
    r = ufl.SpatialCoordinate(nodes.mesh)[0]
    body = FlowingBody(Workpiece(nodes, kinematics=KINDS["axisymmetric"], fixed=[FixedVelocity(bottom, 1)],
                                 flow_stress=laws.NortonHoff(K=100, m=exponent),
                                 body_force=ufl.as_vector([density * omega**2 * r, 0 * r])),
                       drives={}, boundary=np.empty(0, np.int32), working_direction=(0, 1))
    body.speed, steps = 1e-2 * body.height(), 40        # slower than the ring grows: the regularisation is far below
    history, flow, dt = body.new_history(), None, time / 40
    for step in range(steps):
        flow = body.solve(step * dt, history, dt)
        history = Midpoint().advance(body, flow, step * dt, history, dt).history
    verified("8.3", f"radius of a spun ring, m = {exponent:g}, {time:g} s",
             np.linalg.norm(nodes.x[:, 0]) / np.sqrt(nodes.count), radius, within=0.01, unit="mm")


@pytest.fixture(scope="module")
def ring_mesh(tmp_path_factory):
    """A ring of 100 mm mean radius, 8 mm thick, as a file."""
    import gmsh
    path = tmp_path_factory.mktemp("ring") / "ring.msh"
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 0)
        disks = [gmsh.model.occ.addDisk(0, 0, 0, r, r) for r in (104, 96)]
        gmsh.model.occ.cut([(2, disks[0])], [(2, disks[1])])
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", 8)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 8)
        gmsh.model.addPhysicalGroup(2, [1])
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def test_a_free_spinning_ring_keeps_its_moment_of_momentum_and_grows_as_its_hoop_yields(ring_mesh):
    """One turn at 500 rad/s in plane strain. Thin ring: 2/sqrt(3) K (2/sqrt(3) R'/R)^m = rho (H²/R² - R R''), H = w R²."""
    omega, density, K = 500.0, 7.85e-9, 4.0
    turn, moment = 2 * np.pi / omega, omega * 100.0**2
    scene = read_ring(ring_mesh, omega, K, turn / 72)
    run = Simulation(scene)
    run.run()
    mass, inertia = run.body.inertia.mass, run.body.inertia
    x, v = mass.at_points(run.nodes.x), mass.at_points(inertia.velocity)
    spin = (mass.of_points * (x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0])).sum()
    assert spin / (mass.total() * omega * (100**2 + 4**2)) == pytest.approx(1, abs=0.015)     # 1.2 % in steps of 5°
    thin = solve_ivp(lambda t, y: [y[1], moment**2 / y[0]**3 - 4 / 3 * K * y[1] / y[0]**2 / density], (0, turn),
                     [100.0, 0.0], method="LSODA", rtol=1e-8)
    radius = np.sqrt((mass.of_points * (x**2).sum(axis=-1)).sum() / mass.total())
    assert radius - 100 == pytest.approx(thin.y[0, -1] - 100, rel=0.03)       # the thickness makes 0.9 % of it
    assert np.abs(inertia.momentum_error()).max() < 1e-10 * mass.total() * omega * 100


def read_ring(path, omega, K, step):
    from fenics_forming import Scene
    return Scene(geometry="plane_strain", tools={}, process={"inertia": True},
                 materials={"m": {"flow_stress": {"law": "norton_hoff", "K": K, "m": 1.0}, "density": 7.85e-9}},
                 workpieces={"ring": {"shape": {"kind": "file", "path": str(path)}, "material": "m", "initial_velocity":
                                      {"kind": "rotation", "speed": omega, "centre": [0, 0]}}},
                 steps={"time": step}, stop={"time": 72 * step})


# ---------------------------------------------------------------------- Taylor's rods, 8.4 and 8.5
@pytest.fixture(scope="module")
def copper():
    return simulate(rod(COPPER, 80, 1.0, remesh=True))


def test_the_copper_rod_ends_with_the_length_and_the_foot_of_the_reference(copper, verified):
    """21.466 mm and 7.341 mm on the finer of two explicit meshes, elastic-plastic: 1 and 3 % for a rigid-plastic rod."""
    assert copper.summary["remeshings"] > 1
    check_rod(verified, "8.4", "copper, remeshed", copper, 21.466, 7.341, 0.01)


def check_rod(verified, entry, what, results, length, foot, within):
    """Length within the given share of the reference, radius of the foot within 3 %."""
    ours = length_and_foot(results)
    verified(entry, f"final length, {what}", ours[0], length, within=within, unit="mm")
    verified(entry, f"radius of the foot, {what}", ours[1], foot, within=0.03, unit="mm")


def test_the_copper_rod_shortens_as_the_reference_does(copper):
    """The elastic rod lags by the time that its wave takes, 9 µs: 0.2 mm at most at this speed of the tail."""
    times = copper.history.column("time_s")
    reference = [30.14, 28.08, 26.22, 24.60, 23.27, 22.27, 21.64]
    ours = np.interp(np.arange(1, 8) * 1e-5, times, copper.history.column("tail_z_mm"))
    assert np.abs(ours - reference).max() < 0.3


def test_energy_and_momentum_of_the_rod_are_accounted_for(copper):
    """All of the kinetic energy is found again; what only the time step takes is below 1 %, also with new meshes."""
    ledger = copper.summary["ledger"]
    energy = ledger["energy"]["mJ"]
    assert ledger["energy"]["worst_relative_imbalance"] < 1e-4
    assert abs(energy["stepping"] + energy["remeshing"]) < 0.01 * energy["start"]
    assert energy["kinetic"] < 1e-4 * energy["start"] == pytest.approx(1e-4 * 239810, rel=1e-3)
    assert abs(ledger["momentum_Ns"]["z"]["relative_error"]) < 2e-3         # the force tolerance of the solves
    impulse = copper.history.column("momentum_z_Ns")
    assert impulse[0] == pytest.approx(-239810 * 2 / 227e3, rel=0.04)          # what the blow of the start has left
    assert np.abs(copper.history.column("power_imbalance")).max() < 1e-3


@pytest.mark.long
def test_the_copper_rod_without_a_new_mesh(verified):
    check_rod(verified, "8.4", "copper, one mesh", simulate(rod(COPPER, 200, 0.6)), 21.466, 7.341, 0.01)


@pytest.mark.long
def test_the_aluminium_rod_ends_with_the_length_and_the_foot_of_the_reference(verified):
    """The shortest length, before the elastic rod rebounds: 16.52 mm; foot 8.24 and 8.30 mm on two meshes."""
    check_rod(verified, "8.5", "aluminium", simulate(rod(ALUMINIUM, 80, 0.8)), 16.52, 8.30, 0.03)


# ---------------------------------------------------------------------- coming to rest
DROPPED = """
geometry = "axisymmetric"
process = { inertia = true, weight = true }
contacts = [ { between = ["lower", "upper"] } ]
[materials.steel]
flow_stress = { law = "constant", value = "100 MPa" }
density = "7850 kg/m^3"
[workpieces.lower]
shape = { kind = "rectangle", from = [0, 3], to = [10, 13] }
material = "steel"
mesh_size = 5
[workpieces.upper]
shape = { kind = "rectangle", from = [0, 15], to = [10, 25] }
material = "steel"
mesh_size = 4
[tools.die]
shape = { kind = "plane", point = [0, 0], normal = [0, 1] }
[steps]
time = "2 ms"
[stop]
time = "60 ms"
"""


def test_bodies_that_are_dropped_come_to_rest_on_one_another(tmp_path):
    """They touch nothing, fall, land without rebound, and press by their weight."""
    (tmp_path / "dropped.toml").write_text(DROPPED, encoding="utf-8")
    results = simulate(read_scene(tmp_path / "dropped.toml"))
    end, weight = results.history.rows[-1], 7.85e-9 * np.pi * 1000 * GRAVITY
    assert end["force_die_N"] == pytest.approx(2 * weight, rel=1e-5)
    assert end["contact_force_lower_upper_N"] == pytest.approx(weight, rel=1e-5)
    assert end["kinetic_energy_mJ"] < 1e-12 * results.history.column("kinetic_energy_mJ").max()
    assert end["max_effective_strain"] < 1e-5
    assert np.abs(results.history.column("energy_imbalance")).max() < 1e-6
    assert results.summary["extents_mm"]["upper"]["z"] == pytest.approx([10, 20], abs=1e-4)


def test_weight_without_inertia_presses_what_rests_and_does_not_let_fall(tmp_path):
    from fenics_forming import ConvergenceError

    text = DROPPED.replace("inertia = true, ", "").replace("60 ms", "4 ms")
    path = tmp_path / "resting.toml"
    path.write_text(text.replace("from = [0, 3], to = [10, 13]", "from = [0, 0], to = [10, 10]")
                    .replace("from = [0, 15], to = [10, 25]", "from = [0, 10], to = [10, 20]"), encoding="utf-8")
    end = simulate(read_scene(path)).history.rows[-1]
    assert end["force_die_N"] == pytest.approx(2 * 7.85e-9 * np.pi * 1000 * GRAVITY, rel=1e-4)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConvergenceError, match="process.inertia = true lets it fall"):
        simulate(read_scene(path))
