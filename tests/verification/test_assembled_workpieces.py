"""Assembled workpieces: several bodies of different laws in one velocity solve, with contact between them."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fenics_forming import laws, scene
from fenics_forming.results.history import History
from fenics_forming.simulation import Simulation, simulate

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
STRESS = 100.0
SHEAR = STRESS / np.sqrt(3)


def rectangle(low, high, size, symmetry=("z",), material="m"):
    return scene.Workpiece(shape=scene.Rectangle(from_=low, to=high), material=material, symmetry=list(symmetry),
                           mesh_size=size)


def box(low, high, size, symmetry):
    return scene.Workpiece(shape=scene.Box(from_=low, to=high), material="m", symmetry=list(symmetry), mesh_size=size)


def platen(height, velocity=(0, -1), friction=laws.NoFriction(), dim=2):
    up = np.eye(dim)[dim - 1]
    return scene.Tool(shape=scene.Plane(point=tuple(height * up), normal=tuple(-up)),
                      drive=laws.SpeedDrive(velocity=velocity), friction=friction)


def between(a, b, friction=laws.NoFriction(), **more):
    return scene.Contact(between=(a, b), friction=friction, **more)


def upsetting(bodies, contacts=(), *, tools, travel, step, geometry="axisymmetric", law=None, **more):
    law = law or laws.Constant(value=STRESS)
    return scene.Scene(geometry=geometry, materials={"m": scene.Material(flow_stress=law)}, workpieces=bodies,
                       contacts=list(contacts), tools=tools, steps=scene.Steps(stroke=step),
                       stop=scene.Stop(stroke=travel), **more)


def force(results, tool="upper"):
    return results.history.column(next(c for c in results.history.columns if c.startswith(f"force_{tool}_N")))


# ---------------------------------------------------------------------- as one body
SOLID = {"billet": rectangle((0, 0), (10, 10), 1.0)}
CUTS = {"stack": {"a": rectangle((0, 0), (10, 5), 0.8), "b": rectangle((0, 5), (10, 10), 1.0, ())},
        "sleeve": {"a": rectangle((0, 0), (5, 10), 0.8), "b": rectangle((5, 0), (10, 10), 1.0)}}
SWIFT = laws.Swift(K=200, prestrain=0.05, n=0.2)


@pytest.fixture(scope="module")
def whole():
    return force(simulate(upsetting(SOLID, tools={"upper": platen(10, friction=laws.Siebel(factor=0.2))}, travel=2,
                                    step=0.25, law=SWIFT)))


@pytest.mark.parametrize("element, cut, allowed", [
    ("integration_point", "stack", 0.002), ("integration_point", "sleeve", 0.005),
    ("node", "stack", 0.005), ("node", "sleeve", 0.005)])
def test_sticking_bodies_behave_as_one(whole, element, cut, allowed):
    """Two thirds of the flow stress limit sticking, so the surfaces part nowhere: what is left is the regularised slip, and
    of nodal contact its quadrature (4 % locally in the patch test, a few tenths of it in the force)."""
    parts = upsetting(CUTS[cut], [between("a", "b", laws.Sticking(), element=element)], travel=2, step=0.25, law=SWIFT,
                      tools={"upper": platen(10, friction=laws.Siebel(factor=0.2))})
    results = simulate(parts)
    np.testing.assert_allclose(force(results), whole, rtol=allowed)
    assert np.abs(results.history.column("power_imbalance")).max() < 1e-3
    assert max(abs(results.history.column(f"volume_error_{name}")[-1]) for name in "ab") < 5e-4


@pytest.mark.parametrize("cut", ["stack", "sleeve"])
def test_exchanging_slave_and_master_changes_the_force_little(cut):
    """The finer side holds the points: either body may be that one. Both cases have the same total of elements."""
    found = []
    for sizes in ((0.8, 1.0), (1.0, 0.8)):
        bodies = {name: CUTS[cut][name].replaced(mesh_size=size) for name, size in zip("ab", sizes, strict=True)}
        run = Simulation(upsetting(bodies, [between("a", "b", laws.Siebel(factor=0.3))], travel=1.5, step=0.25, law=SWIFT,
                                   tools={"upper": platen(10, friction=laws.Siebel(factor=0.2))}))
        assert run.body.interfaces.slaves == {"a-b": "a" if sizes[0] < sizes[1] else "b"}
        found.append(force(run.run()))
    np.testing.assert_allclose(found[0], found[1], rtol=5e-3)


def test_two_blocks_in_space_behave_as_one():
    def run(bodies, contacts=()):
        tools = {"upper": platen(4, (0, 0, -1), laws.Siebel(factor=0.3), dim=3)}
        return force(simulate(upsetting(bodies, contacts, tools=tools, travel=0.2, step=0.2, geometry="3d")))

    every, lateral = ("x", "y", "z"), ("x", "y")
    one = run({"a": box((0, 0, 0), (4, 4, 4), 1.4, every)})
    two = run({"a": box((0, 0, 0), (4, 4, 2), 1.4, every), "b": box((0, 0, 2), (4, 4, 4), 1.2, lateral)},
              [between("a", "b", laws.Sticking())])
    np.testing.assert_allclose(two, one, rtol=2e-3)


# ---------------------------------------------------------------------- sliding
@pytest.mark.parametrize("element", ["integration_point", "node"])
@pytest.mark.parametrize("friction, per_length, coefficient", [
    (laws.Siebel(factor=0.3), 0.3 * SHEAR, None), (laws.Coulomb(coefficient=0.15), None, 0.15)], ids=["siebel", "coulomb"])
def test_friction_between_sliding_blocks(element, friction, per_length, coefficient):
    """REFERENCES 7: m k = 17.3205 MPa on the whole surface, or the coefficient times the normal force; the slip is a
    thousand times the regularisation, which so costs less than 1e-6."""
    along, pressed, _ = slid(friction, element)
    allowed = 2e-3 if element == "integration_point" else 0.015     # an end node stands for a sixth of the last side
    assert along == pytest.approx(20 * per_length if coefficient is None else coefficient * pressed, rel=allowed)


def test_friction_of_levanov_between_sliding_blocks():
    """m k (1 - exp(-1.25 p / stress)) summed over the surface; what of it is over nothing has no strength to ask the law
    with, and no warning comes of it."""
    along, pressed, contact = slid(laws.Levanov(factor=0.3), "integration_point", row=-1)
    expected = 0.3 * SHEAR * (1 - np.exp(-1.25 * contact.state.pressure / STRESS)) @ contact.weights
    assert along == pytest.approx(expected, rel=2e-3) and (contact.weights == 0).any()
    assert along < 20 * 0.3 * SHEAR * (1 - np.exp(-1.25 * pressed / 20 / STRESS))     # which is concave in the pressure


def slid(friction, element, row=0):
    """Forces along and across the surface of two blocks of 20 mm that slide on one another, N/mm, and their contact."""
    lower = scene.Tool(shape=scene.Plane(point=(0, 0), normal=(0, 1)), friction=laws.Sticking())
    blocks = {"a": rectangle((0, 0), (20, 5), 1.6, ()), "b": rectangle((0, 5), (20, 10), 1.3, ())}
    run = Simulation(upsetting(blocks, [between("a", "b", friction, element=element)], geometry="plane_strain",
                               tools={"upper": platen(10, (1, -0.02), laws.Sticking()), "lower": lower}, travel=0.1,
                               step=0.1))
    history = run.run().history
    cosine = 1 / np.hypot(1, 0.02)
    pressed = history.column("force_lower_N_per_mm")[row]
    assert all(np.isfinite(history.column(name)).all() for name in history.columns)
    along = history.column("force_upper_N_per_mm")[row] / cosine - 0.02 * pressed
    return along, pressed, run.body.interfaces.contacts[0]


# ---------------------------------------------------------------------- opening and closing
def test_sleeve_that_widens_leaves_its_core_alone():
    """Without friction a ring grows on its inside too; the lower core touches no tool any more and stays as it is."""
    bodies = {"core": rectangle((0, 0), (6, 8), 1.5), "ring": rectangle((6, 0), (10, 12), 1.2)}
    results = simulate(upsetting(bodies, [between("core", "ring", laws.Siebel(factor=0.2))],
                                 tools={"upper": platen(12)}, travel=1, step=0.25))
    shortened = 12 / 11
    exact = STRESS * np.pi * (10**2 - 6**2) * shortened
    assert force(results)[-1] == pytest.approx(exact, rel=2e-3)
    assert results.history.column("contact_force_core_ring_N")[-1] == 0.0
    assert results.history.column("max_effective_strain_core")[-1] < 1e-9
    extents = results.summary["extents_mm"]
    assert extents["core"] == {"r": [0.0, 6.0], "z": [0.0, 8.0]}
    assert extents["ring"]["r"] == pytest.approx([6 * np.sqrt(shortened), 10 * np.sqrt(shortened)], rel=1e-4)


def test_gap_between_core_and_sleeve_closes_and_presses():
    """A cylinder of height h has the radius 6 sqrt(12/h): it meets a bore of 6.2 at h = 11.239, and then needs the sleeve
    to yield, too, which no tool touches."""
    bodies = {"core": rectangle((0, 0), (6, 12), 1.5), "sleeve": rectangle((6.2, 0), (9, 6), 1.2)}
    points = {"inner": scene.TrackedPoint(body="core", at=(6, 0)), "outer": scene.TrackedPoint(body="sleeve", at=(6.2, 0))}
    results = simulate(upsetting(bodies, [between("core", "sleeve")], tools={"upper": platen(12)}, travel=1.5, step=0.125,
                                 points=points))
    stroke, pressed = (results.history.column(c) for c in ("stroke_upper_mm", "contact_force_core_sleeve_N"))
    touches = 12 * (1 - (6 / 6.2) ** 2)
    assert pressed[stroke < touches - 0.125].max() == 0.0
    assert pressed[stroke > touches + 0.125].min() > 0.0
    inner, outer = (results.history.column(f"{name}_r_mm")[-1] for name in points)
    assert inner == pytest.approx(outer, abs=1e-3)      # nodes of unlike meshes: a chord of one lies in a side of the other


@pytest.mark.parametrize("radius", [20.0, 20.05], ids=["declared", "drawn"])
def test_interference_widens_a_thin_ring_by_itself(radius):
    """0.05 mm between a hard core and a perfectly plastic ring of 20 to 21 mm, no tool near: the ring yields all around
    under p = s ln(b/a) (free ends, thin: within 2 %), and stops at the core, drawn that wide or not."""
    bodies = {"core": rectangle((0, 0), (radius, 12), 3.0, material="hard"), "ring": rectangle((20, 0), (21, 10), 0.7)}
    found = upsetting(bodies, [between("core", "ring", interference=0.05)], travel=0.2, step=0.1,
                      tools={"upper": platen(13)}, points={"bore": scene.TrackedPoint(body="ring", at=(20, 3))})
    hard = scene.Material(flow_stress=laws.Constant(value=20 * STRESS))
    history = simulate(found.replaced(materials={**found.materials, "hard": hard})).history
    pressed = history.column("contact_force_core_ring_N")
    assert pressed[0] == pytest.approx(100 * np.log(21 / 20) * 2 * np.pi * 20 * 20, rel=0.02)
    assert pressed[-1] == 0.0
    assert history.column("bore_r_mm")[-1] == pytest.approx(20.05, abs=5e-5)
    assert history.column("bore_effective_strain")[-1] == pytest.approx(0.05 / 20, rel=0.01)
    assert (history.column("force_upper_N") == 0.0).all()


def test_body_that_nothing_holds_is_carried_and_lands():
    """The upper of two blocks with a gap between flies with its platen, without force, until it meets the lower one."""
    bodies = {"low": rectangle((0, 0), (10, 5), 1.6), "high": rectangle((0, 5.2), (10, 10), 1.4, ())}
    results = simulate(upsetting(bodies, [between("low", "high")], tools={"upper": platen(10)}, travel=0.6, step=0.1))
    stroke, found = results.history.column("stroke_upper_mm"), force(results)
    assert found[stroke < 0.15].max() < 1e-5 * STRESS * np.pi * 100
    assert results.history.column("max_effective_strain_high")[stroke < 0.15].max() < 1e-6
    assert found[-1] == pytest.approx(STRESS * np.pi * 100 * 9.8 / 9.4, rel=2e-3)


# ---------------------------------------------------------------------- penalty
@pytest.mark.parametrize("augmented", [True, False])
def test_penalty_factor_changes_little_and_nothing_fails(augmented):
    """From a tenth to ten thousand times the default. Without multipliers a soft penalty lets the surfaces sink into one
    another; a hard one is cut between bodies, where unlike meshes would lock."""
    found = []
    for factor in (1.0, 10.0, 1e2, 1e3, 1e5):
        case = upsetting(CUTS["sleeve"], [between("a", "b", laws.Siebel(factor=0.2))], travel=1, step=0.25, law=SWIFT,
                         tools={"upper": platen(10, friction=laws.Siebel(factor=0.2))},
                         solver=scene.Solver(penalty_factor=factor, augmented=augmented))
        results = simulate(case)
        found.append(force(results))
        assert results.summary["newton_iterations_per_solve"] < 8
    np.testing.assert_allclose(found, np.broadcast_to(found[1], np.shape(found)), rtol=3e-3 if augmented else 1e-2)


# ---------------------------------------------------------------------- runs
def test_bimetal_scene_runs_to_its_stop():
    """Coarse; as it stands it does so as well (see demos). The sleeve of the harder metal holds the core back."""
    sizes = ["workpieces.core.mesh_size=1.5", "workpieces.sleeve.mesh_size=1.3", "steps.stroke=0.2"]
    results = simulate(scene.read_scene(SCENES / "bimetal_upsetting.toml", set=sizes))
    history = results.history
    assert results.summary["stopped"] == "stroke 4 mm reached"
    assert np.abs(history.column("power_imbalance")).max() < 2e-3
    assert max(abs(history.column(f"volume_error_{name}")[-1]) for name in ("core", "sleeve")) < 5e-4
    assert {"contact core-sleeve: siebel", "term drag"} <= set(results.summary["parts_built"])
    lowest = history.column("force_upper_N")
    assert (np.diff(lowest) > 0).all(), "copper hardens, and the area grows"


def test_bodies_without_contact_build_no_gap_operator_and_the_user_is_told():
    found = scene.read_scene(SCENES / "bimetal_upsetting.toml").replaced(contacts=[])
    assert any("no [[contacts]]" in warning for warning in scene.check(found))
    assert Simulation(found).body.interfaces is None


def test_single_body_imports_nothing_of_assemblies():
    code = ("import sys; from fenics_forming.scene import read_scene; from fenics_forming.simulation import simulate; "
            f"simulate(read_scene({str(SCENES / 'billet_upsetting.toml')!r}, set=['stop.stroke=0.2', 'steps.stroke=0.2', "
            "'workpieces.billet.mesh_size=4'])); print([m for m in sys.modules if m.endswith(('physics.assembly', "
            "'physics.parts', 'contact.interfaces', 'contact.bodies', 'process.assembling'))])")
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip().endswith("[]")


COARSE = ["workpieces.core.mesh_size=2.5", "workpieces.sleeve.mesh_size=2.2", "steps.stroke=0.25",
          "output.checkpoint_every=2", "output.fields_every=2",
          "points.side={ body = 'sleeve', at = [6, 5] }", "points.middle={ body = 'core', at = [6, 5] }"]


def command(folder, *more, ranks=1, scene_file=SCENES / "bimetal_upsetting.toml"):
    words = ["mpirun", "-n", str(ranks)] * (ranks > 1) + [sys.executable, "-m", "fenics_forming", "run", str(scene_file),
                                                          "--out", str(folder), *more]
    subprocess.run(words, check=True, capture_output=True, text=True)
    return History.read(folder / "history.csv")


def settings(*changes):
    return [word for change in (*COARSE, *changes) for word in ("--set", change)]


def differing(one, other, *, skip=("wall_s",)):
    """Largest relative difference of the columns of two histories."""
    columns = [c for c in one.columns if c not in skip and not c.startswith("power_imbalance")]
    assert one.columns == other.columns
    a, b = (np.array([h.column(c) for c in columns]) for h in (one, other))
    size = np.maximum(np.abs(a).max(axis=1, keepdims=True), 1e-3)
    return float((np.abs(a - b) / size).max())


def test_resumed_run_goes_on_as_if_it_had_not_stopped(tmp_path):
    whole = command(tmp_path / "whole", *settings("stop.stroke=1.5"))
    command(tmp_path / "cut", *settings("stop.stroke=0.5"))
    again = command(tmp_path / "cut", *settings("stop.stroke=1.5"), "--resume")
    assert differing(whole, again) < 1e-9
    at = [whole.column(f"{point}_r_mm")[-1] for point in ("middle", "side")]
    assert at[0] == pytest.approx(at[1], abs=2e-3), "points on both sides of the surface stay with their bodies"
    assert whole.column("side_effective_strain")[-1] != whole.column("middle_effective_strain")[-1]


def test_frames_tell_the_bodies_apart(tmp_path):
    import meshio

    command(tmp_path, *settings("stop.stroke=0.5"))
    mesh = meshio.read(tmp_path / "fields_000002.vtu")
    bodies = mesh.cell_data["body"][0]
    assert set(bodies) == {0, 1}
    # at the vertices of the surface, and by half at the mid-nodes behind it; next to the die its own pressure follows
    pressure, r = mesh.point_data["contact_pressure_MPa"], mesh.points[:, 0]
    inner = (np.abs(r - 6.1) < 0.2) & (mesh.points[:, 1] < 11)
    assert 5 < pressure[inner].max() < 200 and pressure[(r > 8) & (mesh.points[:, 1] < 11)].max() == 0.0
    middle = mesh.points[mesh.cells[0].data[:, :3]].mean(axis=1)[:, 0]
    assert middle[bodies == 0].max() < 6.5 and middle[bodies == 1].min() > 5.9
    assert set(json.loads((tmp_path / "summary.json").read_text())["extents_mm"]) == {"core", "sleeve"}


@pytest.mark.mpi
def test_number_of_ranks_does_not_matter(tmp_path):
    found = [command(tmp_path / str(ranks), *settings("stop.stroke=0.75"), ranks=ranks) for ranks in (1, 2)]
    assert differing(*found) < 1e-8
