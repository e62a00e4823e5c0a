"""Motions of tools that the solve finds: springs, masses, given forces and free rotations against closed solutions."""

from __future__ import annotations

from math import log, pi

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.physics.contact.free_motions import RigidMotions
from fenics_forming.physics.newton import FlowSolver
from fenics_forming.simulation.run import Simulation

COLUMN = """
geometry = "axisymmetric"
[materials.metal]
flow_stress = {law}
[workpieces.column]
shape = {{ kind = "rectangle", from = [0, 0], to = [10, 20] }}
material = "metal"
mesh_size = "5 mm"
[tools.upper]
shape = {{ kind = "plane", point = [0, 20], normal = [0, -1] }}
drive = {{ kind = "speed", velocity = [0, "{speed} mm/s"] }}
[tools.lower]
shape = {{ kind = "plane", point = [0, 0], normal = [0, 1] }}
[process]
volume_constancy = "each_step"
[steps]
time = "{step} s"
[stop]
time = "{end} s"
[solver]
penalty_factor = 1000.0
"""
PERFECT = '{ law = "constant", value = "100 MPa" }'
AREA = pi * 10**2


def column(folder, motions, *, law=PERFECT, speed=-1.0, step=0.5, end=1.0) -> Simulation:
    """A smooth column under a platen that has these motions beside its drive."""
    path = folder / "column.toml"
    path.write_text(COLUMN.format(law=law, speed=speed, step=step, end=end))
    simulation = Simulation(ff.read_scene(path))
    next(t for t in simulation.body.tools if t.name == "upper").free = motions
    simulation.body.solver = FlowSolver(simulation.body.workpiece)
    return simulation


@pytest.mark.parametrize("steps, error", [(10, 4e-3), (20, 1e-3)])
def test_a_press_frame_yields_by_the_force_over_its_stiffness(steps, error, tmp_path):
    """REFERENCES.md 10.1: height 10.304865 mm after a travel of 10 mm on a spring of 2e5 N/mm; second order in the step
    (the bounds are 1.5 times what is left), and in every step the spring carries the force of its solve."""
    frame = RigidMotions([[0, 1]], stiffness=2e5)
    run = column(tmp_path, frame, step=10 / steps, end=10.0)
    results = run.run()
    assert abs(run.body.height() - 10.304865) < error
    assert abs(frame.displacement[0] - 0.304865) < error
    assert results.history.column("force_upper_N")[-1] == pytest.approx(AREA * 20 / run.body.height() * 100, rel=2e-3)
    assert np.abs(results.history.column("power_imbalance")).max() < 1e-5
    assert results.history.column("newton_iterations")[1:].max() <= 4      # of two solves


def test_a_given_force_finds_its_speed(tmp_path):
    """A column of Newtonian material: F = K A v / h (K = 100 MPa s), so v = F h / (K A); to the penetration."""
    ram = RigidMotions([[0, -1]], force=3000.0)
    run = column(tmp_path, ram, law='{ law = "norton_hoff", K = "100 MPa", m = 1.0 }', speed=-1e-9, step=0.1, end=0.1)
    ram.rate[:] = 1.0
    body = run.body
    flow = body.solve(0.0, body.new_history(), 0.1)
    expected = 3000.0 * 20 / (100 * AREA)
    assert ram.rate[0] == pytest.approx(expected, rel=1e-3)
    assert -flow.velocity[:, 1].min() == pytest.approx(expected, rel=1e-3)
    assert body.contact.forces()[0, 1] == pytest.approx(-3000.0, rel=1e-9)


def test_a_linear_body_on_a_spring_is_solved_in_one_step_of_newton(tmp_path):
    """The border is the exact tangent: from rest the second increment of a Newtonian column is round-off."""
    run = column(tmp_path, RigidMotions([[0, 1]], stiffness=1e3), law='{ law = "norton_hoff", K = "100 MPa", m = 1.0 }')
    body, changes = run.body, []
    solver, step = body.solver, body.solver._linear_solve

    def watched(**how):
        step(**how)
        changes.append(np.abs(body.workpiece.increment.x.array[body.workpiece.velocity_dofs]).max())

    solver._linear_solve = watched
    body.solve(0.0, body.new_history(), 0.1)
    assert changes[1] < 1e-9 * changes[0]


def test_a_falling_mass_loses_what_the_column_takes(tmp_path):
    """M v²/2 goes into sigma V ln(h0/h) (REFERENCES.md 8.6, its energy balance); the step of a mass keeps energy."""
    mass, start = 0.1, 1000.0
    hammer = RigidMotions([[0, -1]], mass=mass, velocity=start)
    run = column(tmp_path, hammer, speed=-1e-9, step=4e-4, end=2e-3)
    body = run.body
    run.run()
    taken = 100 * AREA * 20 * log(20 / body.height())
    assert 0.5 * mass * (start**2 - hammer.velocity[0]**2) == pytest.approx(taken, rel=3e-3)      # the rest: penalty


ROLL = """
geometry = "plane_strain"
[materials.metal]
flow_stress = { law = "constant", value = "100 MPa" }
[workpieces.block]
shape = { kind = "rectangle", from = [0, 0], to = [20, 8] }
material = "metal"
mesh_size = "2 mm"
[tools.roll]
shape = { kind = "circle", centre = [8, 18], radius = 10 }
drive = { kind = "speed", velocity = ["2 mm/s", "-0.4 mm/s"], rotation = { speed = 0, centre = [8, 18] } }
friction = { law = "siebel", factor = 0.3 }
[tools.table]
shape = { kind = "plane", point = [0, 0], normal = [0, 1] }
friction = { law = "sticking" }
[steps]
time = "0.05 s"
[stop]
time = "0.5 s"
"""


def test_a_free_roll_turns_until_friction_has_no_moment_about_its_axis(tmp_path):
    path = tmp_path / "roll.toml"
    path.write_text(ROLL)
    run = Simulation(ff.read_scene(path))
    body, roll = run.body, next(t for t in run.body.tools if t.name == "roll")
    run.run()
    held = body.contact.torque(roll)
    roll.free = RigidMotions.rotation(2)
    body.solver = FlowSolver(body.workpiece)
    body.solve(0.5, body.new_history(), 0.05)
    assert abs(body.contact.torque(roll)) < 2e-3 * abs(held)      # the tolerance of forces in the Newton
    assert -0.3 < roll.free.rate[0] < -0.1       # it rolls along the top, about 2 mm/s over 10 mm: slower for what sinks in
