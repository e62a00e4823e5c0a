"""Workpieces between dies that deform: REFERENCES.md 10.4, equal and opposite forces, limits, other kinds of tools."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming.physics.tool_body import NodalForces
from fenics_forming.process.tools.elastic import ElasticTool
from fenics_forming.results.files import ResultsError
from fenics_forming.simulation.run import Simulation

from .test_coupling_columns import Heard

STRIP = """
geometry = "plane_strain"
[materials.strip]
flow_stress = { law = "constant", value = "200 MPa" }
[materials.die_steel]
young = "210 GPa"
poisson = 0.3
[workpieces.strip]
shape = { kind = "rectangle", from = [0, 0], to = [18.85, 1.1] }
symmetry = ["x", "y"]
material = "strip"
mesh_size = "0.4 mm"
[tools.upper]
shape = { kind = "rectangle", from = [0, 1.1], to = [250, 251.1] }
symmetry = ["x"]
material = "die_steel"
mesh_size = { contact = "0.7 mm", far = "40 mm" }
held = { y_high = ["x", "y"] }
drive = { kind = "speed", velocity = [0, "-1 mm/s"] }
friction = { law = "siebel", factor = 0.2 }
[steps]
stroke = "0.01 mm"
[stop]
stroke = "0.24 mm"
"""


def slab(width: float, edge: float, factor: float, *, points: int = 400) -> tuple[float, float]:
    """Thickness at the centre minus that at the edge, mm, and force, N/mm, of REFERENCES.md 10.4: the slab equation
    dp/dx = -2mk/h with p = 2k at the edge, between half-planes under that pressure (Flamant)."""
    k, x = 200 / np.sqrt(3), np.linspace(0, width / 2, points + 1)
    step = x[1]

    def influence(from_, to):
        antiderivative = lambda t: t * np.log(np.abs(t) + 1e-300) - t  # noqa: E731
        return antiderivative(x[:, None] - from_) - antiderivative(x[:, None] - to)

    rise = -2 * (1 - 0.3**2) / (np.pi * 210e3) * (influence(x[:-1], x[1:]) + influence(-x[1:], -x[:-1]))
    h = np.full(points + 1, edge)
    for _ in range(60):
        slope = 2 * factor * k / h
        pressure = 2 * k + np.append(np.cumsum((0.5 * (slope[1:] + slope[:-1]) * step)[::-1])[::-1], 0.0)
        mean = 0.5 * (pressure[1:] + pressure[:-1])
        u = rise @ mean
        h = 0.5 * h + 0.5 * (edge + 2 * (u - u[-1]))
    return h[0] - edge, 2 * mean.sum() * step


def forming(folder, *changes, text=STRIP, resume=None, out=None):
    """A run with these changes, and what it said."""
    path = folder / "scene.toml"
    path.write_text(text)
    run, heard = Simulation(ff.read_scene(path, set=changes), resume=resume), Heard()
    run.run(out, observer=heard)
    return run, heard


def thickness(run) -> tuple[float, float, float]:
    """Of the strip at its centre and at the edge of contact, and the width of contact, mm."""
    contact, x = run.body.contact, run.body.nodes.x
    nodes = np.unique(contact.facets.facet_nodes)
    edge = contact.points[contact.tools[0].state.active, 0].max()
    on = nodes[(x[nodes, 0] <= edge) & (x[nodes, 1] > 0.5)]
    first, last = on[np.argmin(x[on, 0])], on[np.argmax(x[on, 0])]
    return 2 * x[first, 1], 2 * x[last, 1], 2 * x[last, 0]


def test_slab_between_half_planes_is_that_of_the_references():
    for width, edge, factor, crown, force in ((40, 2, 0.2, 0.10400, 18263.0), (40, 2, 0.1, 0.06995, 13779.7)):
        found = slab(width, edge, factor)
        assert found[0] == pytest.approx(crown, rel=1e-3) and found[1] == pytest.approx(force, rel=1e-3)


def crown_and_slab(run) -> tuple[float, float, float]:
    """Crown over that of the slab with this width and edge, and the same of the force."""
    centre, edge, width = thickness(run)
    crown, force = slab(width, edge, 0.2)
    return centre - edge, (centre - edge) / crown, 2 * abs(run.body.contact.force(run.body.tools[0])[1]) / force


def test_thin_strip_gets_the_crown_of_its_elastic_dies(tmp_path, verified):
    """10.4: within 5 % of the slab between half-planes in 24 steps, its force within 3 %, no volume made; one
    factorisation of the die, 4 iterations a step (two solves) once the strip flows."""
    run, heard = forming(tmp_path, text=STRIP, out=tmp_path / "out")
    crown, crowned, force = crown_and_slab(run)
    verified("10.4", "crown over that of the slab at its own width, iterated", crowned, 1.0, within=0.05)
    verified("10.4", "force over that of the slab at its own width, iterated", force, 1.0, within=0.03)
    assert abs(heard.rows[-1]["volume_error_strip"]) < 2e-4
    flowing = [row["newton_iterations"] for row in heard.rows[-5:]]
    assert np.median(flowing) == 4 and max(flowing) <= 5
    die = run._recorder.summary["deformation"]["upper"]
    assert die["factorisations"] == 1 and die["mode"] == "iterated"
    assert (tmp_path / "out" / "tool_upper.pvd").is_file()
    forces_on_the_die_are_those_on_the_strip(run)
    guarded, said = forming(tmp_path, "process.tool_deformation=coupled")       # it is guarded through all of the loading
    assert crown_and_slab(guarded)[0] == pytest.approx(crown, rel=0.03)         # of u, a lag of half a step
    assert 0 < said.rows[-1]["stability_upper"] < 100


def forces_on_the_die_are_those_on_the_strip(run):
    """Forces at the nodes of the die add up to minus the force on the strip, to rounding: shapes add up to one."""
    die, contact = run.deforming[0], run.body.contact
    # of all nodes, those whose displacement is held included
    tool = die.known
    every = die.motions.deformed.interpolation(tool.motion, contact.points, tool.state.gap, tool.state.normal,
                                               np.ones(len(contact.points), bool))
    nodal = -(every.T @ (contact.weights[:, None] * tool.traction).ravel()).reshape(-1, 2)
    assert np.abs(nodal.sum(axis=0) + contact.force(tool)).max() < 1e-12 * np.abs(nodal).sum()
    unknown = -die.motions.on_surface(contact.along_motions(tool))
    assert unknown[:, 1].sum() == pytest.approx(-contact.force(tool)[1], rel=1e-12)


@pytest.mark.long
def test_stress_only_leaves_the_strip_flat_and_separate_makes_volume(tmp_path):
    """10.4 and notes/coupling.md 1: no crown at all, 18 % more strip than there was; both are warned about."""
    flat, heard = forming(tmp_path, "process.tool_deformation=stress_only", "steps.stroke=0.02")
    assert abs(crown_and_slab(flat)[0]) < 1e-4 and any("stress_only" in note for note in heard.notes)
    assert heard.rows[-1]["deflection_upper_mm"] > 0.1
    more, heard = forming(tmp_path, "process.tool_deformation=separate", "steps.stroke=0.02")
    assert 0.15 < heard.rows[-1]["volume_error_strip"] < 0.20
    assert any("makes volume" in note for note in heard.notes) and any("volume has drifted" in n for n in heard.notes)
    assert crown_and_slab(more)[1] == pytest.approx(1.0, abs=0.1)      # of its own, wrong, width, in 12 coarse steps


@pytest.mark.parametrize("mode", ["stress_only", "separate", "coupled", "iterated"])
def test_a_die_much_stiffer_than_the_strip_is_rigid_in_all_modes(mode, tmp_path):
    """To 1e-4: steel a million times as stiff yields by 2e-7 mm."""
    changes = ("materials.die_steel.young='2.1e8 GPa'", "stop.stroke=0.05", "workpieces.strip.mesh_size='0.55 mm'")
    rigid, _ = forming(tmp_path, *changes, "process.tool_deformation=rigid")
    run, heard = forming(tmp_path, *changes, f"process.tool_deformation={mode}")
    force = [abs(r.body.contact.force(r.body.tools[0])[1]) for r in (rigid, run)]
    assert force[1] == pytest.approx(force[0], rel=1e-4)
    assert np.abs(run.body.nodes.extents() - rigid.body.nodes.extents()).max() < 1e-4 * 1.1


@pytest.mark.long
def test_a_press_frame_in_series_adds_its_own_yield(tmp_path):
    """The deflection is F/K of the frame and that of the die without one under the same forces of contact; the quarter
    model has half of the force of the drive. What is left is the extrapolation to the end of the last step."""
    stop = ("steps.stroke=0.02", "stop.stroke=0.28", "workpieces.strip.mesh_size='0.55 mm'")
    run, _ = forming(tmp_path, *stop, "tools.upper.drive.stiffness='200 kN/mm^2'")
    die, contact = run.deforming[0], run.body.contact
    force = run._recorder.history.column("force_upper_N_per_mm")[-1]
    forces = -die.motions.on_surface(contact.along_motions(die.known))
    second = ElasticTool(run.scene, "upper", run.comm).solve(forces)
    alone = float((forces * second).sum()) / np.linalg.norm(contact.force(die.known))
    assert alone > 0.1 and force / 200e3 > 0.08
    assert die.deflection == pytest.approx(alone + force / 200e3, rel=3e-3)


def test_a_die_that_yields_is_where_its_own_solver_has_it_under_the_same_forces(tmp_path):
    """Displacements in the velocity solve against a second tool that goes straight to the forces found at the end: within
    the growth of these in half a step of twelve, where the die hardens little, and the effect of the way. The crown is
    that of an elastic die and more."""
    changes = ("materials.die_steel.yield_stress=250", "materials.die_steel.hardening=2000",
               "workpieces.strip.mesh_size='0.55 mm'", "steps.stroke=0.02")
    run, heard = forming(tmp_path, *changes)
    crown, crowned, force = crown_and_slab(run)
    assert crowned > 1.5 and force == pytest.approx(1.0, abs=0.04)
    die, contact = run.deforming[0], run.body.contact
    assert die.tool.solver.plastic.effective.max() > 1e-3
    forces = -die.motions.on_surface(contact.along_motions(die.known))
    second = ElasticTool(run.scene, "upper", run.comm)
    second.solver.solve([NodalForces(second.surface.on_mesh(forces, second.body))], steps=10)
    difference = np.abs(second.displacement().ravel() - die.motions.deformed.u.ravel())[die.motions.unknown]
    assert difference.max() < 0.04 * np.abs(die.motions.displacement).max()


ASSEMBLED = """
geometry = "axisymmetric"
[materials.metal]
flow_stress = { law = "constant", value = "300 MPa" }
[materials.steel]
young = "210 GPa"
poisson = 0.3
[workpieces.billet]
shape = { kind = "rectangle", from = [0, 0], to = [8, 5] }
symmetry = ["z"]
material = "metal"
mesh_size = "1.5 mm"
[tools.upper]
shape = { kind = "rectangle", from = [0, 5], to = [40, 35] }
held = { z_high = "z" }
drive = { kind = "speed", velocity = [0, "-1 mm/s"] }
friction = { law = "siebel", factor = 0.2 }
[tools.upper.parts.insert]
shape = { kind = "rectangle", from = [0, 5], to = [20, 35] }
material = "steel"
mesh_size = { contact = "1.5 mm", far = "6 mm" }
[tools.upper.parts.ring]
shape = { kind = "rectangle", from = [20, 5], to = [40, 35] }
material = "steel"
mesh_size = "5 mm"
[[contacts]]
between = ["insert", "ring"]
interference = "0.02 mm"
[steps]
stroke = "0.05 mm"
[stop]
stroke = "0.3 mm"
"""


RUBBING = ASSEMBLED.replace('interference = "0.02 mm"',
                            'interference = "0.02 mm"\nfriction = { law = "coulomb", coefficient = 0.1 }')


def test_an_assembled_die_yields_about_as_one_in_one_piece(tmp_path):
    """A ring shrunk on holds the insert nearly as the same steel in one piece does: 5 % of the deflection under the billet,
    whose force is the same."""
    assembled, heard = forming(tmp_path, text=ASSEMBLED)
    whole = ASSEMBLED.split("[tools.upper.parts.insert]")[0] + ASSEMBLED[ASSEMBLED.index("[steps]"):]
    whole = whole.replace("[tools.upper]", "[tools.upper]\nmaterial = 'steel'\nmesh_size = { contact = 1.5, far = 6 }")
    one, said = forming(tmp_path, text=whole)
    assert heard.rows[-1]["force_upper_N"] == pytest.approx(said.rows[-1]["force_upper_N"], rel=2e-3)
    assert heard.rows[-1]["deflection_upper_mm"] == pytest.approx(said.rows[-1]["deflection_upper_mm"], rel=0.05)


def test_a_plate_of_two_parts_that_stick_presses_over_their_joint_as_one_in_one_piece():
    """Without a shape of the tool the workpiece meets the outline around the parts, which it flows across their joint.
    Resolution of the meshes: 0.2 % of the force once the material flows, 1 % of the deflection."""
    law = {"young": "40 GPa", "poisson": 0.3}
    billet = {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 6]}, "material": "metal", "mesh_size": 1.5,
              "symmetry": ["z"]}

    def plate(low, high, size):
        return {"shape": {"kind": "rectangle", "from": [low, 6], "to": [high, 20]}, "material": "tool", "mesh_size": size,
                "held": {"z_high": "z"}}

    found = []
    for body, contacts in ((plate(0, 25, 2.4), []), (
            {"parts": {"middle": plate(0, 8, 2), "rim": plate(8, 25, 2.4)}},
            [{"between": ["middle", "rim"], "friction": {"law": "sticking"}}])):
        driven = {"drive": {"kind": "speed", "velocity": [0, -1]}, "friction": {"law": "siebel", "factor": 0.3}}
        found.append(ff.simulate(ff.Scene.read({
            "geometry": "axisymmetric", "workpieces": {"billet": billet}, "tools": {"die": body | driven},
            "materials": {"metal": {"flow_stress": {"law": "constant", "value": 400}}, "tool": law}, "contacts": contacts,
            "steps": {"stroke": 0.15}, "stop": {"stroke": 0.6}})).history.rows[-1])
    one, two = found
    assert two["force_die_N"] == pytest.approx(one["force_die_N"], rel=2e-3)
    assert two["deflection_die_mm"] == pytest.approx(one["deflection_die_mm"], rel=1e-2)


CUBE = """
geometry = "3d"
[materials.metal]
flow_stress = { law = "constant", value = "200 MPa" }
[materials.steel]
young = "210 GPa"
poisson = 0.3
[workpieces.block]
shape = { kind = "box", from = [0, 0, 0], to = [10, 8, 4] }
symmetry = ["x", "y", "z"]
material = "metal"
mesh_size = "4 mm"
[tools.upper]
shape = { kind = "box", from = [0, 0, 4], to = [30, 30, 24] }
symmetry = ["x", "y"]
material = "steel"
mesh_size = { contact = "4 mm", far = "15 mm" }
held = { z_high = ["x", "y", "z"] }
drive = { kind = "speed", velocity = [0, 0, "-1 mm/s"] }
friction = { law = "siebel", factor = 0.2 }
[steps]
stroke = "0.02 mm"
[stop]
stroke = "0.08 mm"
"""


def test_two_elastic_dies_press_a_whole_strip_as_one_does_its_half(tmp_path):
    """Both dies at once, against the upper half with a mirror plane: force and deflection of each, to the difference of
    the meshes, 1e-3; both forces are equal to rounding. A lower die a third as stiff takes three times the deflection."""
    half, heard = forming(tmp_path, "workpieces.strip.mesh_size='0.55 mm'", "steps.stroke=0.02")
    lower = STRIP[STRIP.index("[tools.upper]"):STRIP.index("[steps]")].replace("upper", "lower").replace("y_high", "y_low")
    lower = lower.replace("from = [0, 1.1], to = [250, 251.1]", "from = [0, -251.1], to = [250, -1.1]")
    lower = "\n".join(line for line in lower.splitlines() if not line.startswith("drive")) + "\n"
    two = STRIP.replace('from = [0, 0], to = [18.85, 1.1]', 'from = [0, -1.1], to = [18.85, 1.1]')
    two = two.replace('symmetry = ["x", "y"]', 'symmetry = ["x"]').replace("[steps]", lower + "[steps]")
    changes = ("workpieces.strip.mesh_size='0.55 mm'", "steps.stroke=0.04", "stop.stroke=0.48")
    whole, said = forming(tmp_path, *changes, text=two)
    one, both = heard.rows[-1], said.rows[-1]
    for name in ("upper", "lower"):
        assert both[f"force_{name}_N_per_mm"] == pytest.approx(one["force_upper_N_per_mm"], rel=2e-3)
        assert both[f"deflection_{name}_mm"] == pytest.approx(one["deflection_upper_mm"], rel=2e-3)
    assert both["force_lower_N_per_mm"] == pytest.approx(both["force_upper_N_per_mm"], rel=1e-4)
    soft = "[materials.soft]\nyoung = '70 GPa'\npoisson = 0.3\n[workpieces.strip]"
    text = two.replace("[workpieces.strip]", soft)
    at = text.index("[tools.lower]")
    text = text[:at] + text[at:].replace("die_steel", "soft")
    row = forming(tmp_path, *changes, text=text)[1].rows[-1]
    assert row["deflection_lower_mm"] == pytest.approx(3 * row["deflection_upper_mm"], rel=0.05)


def test_a_die_in_space_yields_by_the_pressure_over_its_depth(tmp_path):
    """A block of 10 x 8 mm on a die 20 mm deep: the deflection lies between that of a column of its own section,
    F l / (E A), and that of one as wide as the die."""
    run, heard = forming(tmp_path, text=CUBE)
    row = heard.rows[-1]
    quarter = row["force_upper_N"] / 4
    assert quarter * 20 / (210e3 * 30 * 30) < row["deflection_upper_mm"] < quarter * 20 / (210e3 * 80)
    assert abs(row["power_imbalance"]) < 1e-3
    assert run._recorder.summary["deformation"]["upper"]["factorisations"] == 1


def test_a_run_with_an_elastic_die_goes_on_as_if_it_had_not_been_interrupted(tmp_path):
    changes = ("workpieces.strip.mesh_size='0.55 mm'", "output.checkpoint_every=3")
    whole, _ = forming(tmp_path, *changes, "stop.stroke=0.06")
    forming(tmp_path, *changes, "stop.stroke=0.03", out=tmp_path / "out")
    resumed, _ = forming(tmp_path, *changes, "stop.stroke=0.06", resume=tmp_path / "out" / "checkpoint.npz",
                         out=tmp_path / "out")
    for name in ("force_upper_N_per_mm", "deflection_upper_mm", "volume_error_strip"):
        a, b = (r._recorder.history.column(name) for r in (whole, resumed))
        assert len(a) == len(b) and np.abs(a - b).max() <= 1e-10 * max(1.0, np.abs(a).max()), name


@pytest.mark.parametrize("mode", [pytest.param("stress_only", marks=pytest.mark.long), "separate",
                                  pytest.param("coupled", marks=pytest.mark.long), "iterated"])
@pytest.mark.parametrize("kind", ["yields", "has parts"])
def test_a_run_with_a_die_that_has_an_inner_state_goes_on_as_if_it_had_not_been_interrupted(kind, mode, tmp_path):
    """A die that yields, and one of two parts that rub on each other: stresses, strains, the state between the parts and
    the tangent of the last step are in the checkpoint. To 1e-10 in every column."""
    changes = [f"process.tool_deformation={mode}", "output.checkpoint_every=2"]
    if kind == "yields":
        changes += ["workpieces.strip.mesh_size='1.1 mm'", "tools.upper.mesh_size.contact=2", "steps.stroke=0.04",
                    "materials.die_steel.yield_stress=250", "materials.die_steel.hardening=2000"]
        text, half, end = STRIP, 0.12, 0.24
    else:
        changes += ["workpieces.billet.mesh_size=3", "tools.upper.parts.insert.mesh_size.contact=3"]
        text, half, end = RUBBING, 0.2, 0.4
    whole, _ = forming(tmp_path, *changes, f"stop.stroke={end}", text=text)
    if kind == "yields":
        assert whole.deforming[0].tool.solver.plastic.effective.max() > 1e-4
    forming(tmp_path, *changes, f"stop.stroke={half}", text=text, out=tmp_path / "out")
    resumed, _ = forming(tmp_path, *changes, f"stop.stroke={end}", text=text, resume=tmp_path / "out" / "checkpoint.npz",
                         out=tmp_path / "out")
    expected, found = (run._recorder.history for run in (whole, resumed))
    assert len(expected) == len(found)
    for name in expected.columns:
        if name not in ("wall_s", "power_imbalance"):
            a, b = expected.column(name), found.column(name)
            assert np.abs(a - b).max() <= 1e-10 * max(1.0, np.abs(a).max()), name


def test_states_of_tools_and_of_the_workpiece_must_be_of_one_step(tmp_path):
    changes = ("workpieces.strip.mesh_size='1.1 mm'", "tools.upper.mesh_size.contact=2", "output.checkpoint_every=1",
               "materials.die_steel.yield_stress=250")
    forming(tmp_path, *changes, "stop.stroke=0.01", out=tmp_path / "out")
    kept = (tmp_path / "out" / "checkpoint_upper.npz").read_bytes()
    forming(tmp_path, *changes, "stop.stroke=0.02", out=tmp_path / "out")
    (tmp_path / "out" / "checkpoint_upper.npz").write_bytes(kept)
    with pytest.raises(ResultsError, match="of the tool 'upper' is of step 1, that of the workpiece of step 2"):
        forming(tmp_path, *changes, "stop.stroke=0.03", resume=tmp_path / "out" / "checkpoint.npz")


@pytest.mark.mpi
def test_two_ranks_find_the_same_deflection(tmp_path):
    """The condensed block is on all ranks, its unknowns on the last; to rounding, over steps in which the die takes all
    of the travel."""
    changes = ("workpieces.strip.mesh_size='0.55 mm'", "stop.stroke=0.03", "output.fields_every=0")
    one, _ = forming(tmp_path, *changes)
    command = ["mpirun", "-n", "2", sys.executable, "-m", "fenics_forming", "run", str(tmp_path / "scene.toml"), "--out",
               str(tmp_path / "two"), "--quiet", *(f"--set={change}" for change in changes)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, env=os.environ)
    assert done.returncode == 0, done.stderr[-2000:]
    two = ff.Results.read(tmp_path / "two").history
    for name in ("force_upper_N_per_mm", "deflection_upper_mm", "newton_iterations"):
        a, b = one._recorder.history.column(name), two.column(name)
        assert np.abs(a - b).max() <= 1e-8 * max(1.0, np.abs(a).max()), name
