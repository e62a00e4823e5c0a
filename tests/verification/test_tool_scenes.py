"""Scenes of tools alone against closed solutions (REFERENCES.md 6), and what they leave behind."""

import json
from pathlib import Path

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming import cli
from fenics_forming.errors import ConvergenceError
from fenics_forming.results.recording.fields import read_frames
from fenics_forming.scene import Scene, read_scene

SCENE = str(Path(__file__).parents[2] / "demos" / "scenes" / "shrink_fit.toml")
STEEL = {"young": "210 GPa", "poisson": 0.3}


def run(geometry, tools, *, points=None, material=STEEL, contacts=(), out=None, **more):
    scene = Scene.read({"geometry": geometry, "materials": {"steel": material}, "tools": tools, "points": points or {},
                        "contacts": list(contacts)} | more)
    return ff.simulate(scene, out)


def last(results, *columns):
    return [results.history.rows[-1][column] for column in columns]


def cylinder(inner, outer, pressure, size, ends=("z_low", "z_high"), height=10):
    return {"cylinder": {"shape": {"kind": "rectangle", "from": [inner, 0], "to": [outer, height]}, "material": "steel",
                         "mesh_size": size, "held": dict.fromkeys(ends, "z"), "loads": {"r_low": {"pressure": pressure}}}}


def test_thick_cylinder_carries_an_inner_pressure_as_lame_says():
    """REFERENCES.md 6.1 within 0.5 %: displacements and hoop stresses; the energy is half the work of the pressure."""
    points = {"bore": {"body": "cylinder", "at": [20, 5]}, "outside": {"body": "cylinder", "at": [50, 5]}}
    results = run("axisymmetric", cylinder(20, 50, 300, 2.5), points=points)
    found = last(results, *(f"{place}_{column}" for column in ("displacement_r_mm", "stress_tt_MPa")
                            for place in ("bore", "outside")))
    assert found == pytest.approx([0.0470476, 0.0247619, 414.285714, 114.285714], rel=5e-3)
    energy = results.summary["ledger"]["energy"]["cylinder"]
    assert energy["elastic_energy_mJ"] == pytest.approx(0.5 * 300 * 2 * np.pi * 20 * 10 * found[0], rel=1e-3)
    assert energy["external_work_mJ"] == pytest.approx(energy["elastic_energy_mJ"], rel=1e-9)
    assert results.summary["factorisations"] == {"cylinder": 1}


def rings(**more):
    parts = {name: {"shape": {"kind": "rectangle", "from": [inner, 0], "to": [outer, 10]}, "material": "steel",
                    "mesh_size": size} for name, inner, outer, size in (("insert", 20, 40, 4), ("ring", 40, 80, 5))}
    return {"die": {"parts": parts, "held": {"z_low": "z", "z_high": "z"}, **more}}


FIT = {"between": ["insert", "ring"], "interference": "0.04 mm"}
BORE = {"bore": {"body": "insert", "at": [20, 5]}}


@pytest.mark.parametrize("held, pressure", [({"z_low": "z", "z_high": "z"}, 69.2308), ({"z_low": "z"}, 63.000)])
def test_shrink_fit_presses_the_rings_together_in_both_stress_states(held, pressure):
    """REFERENCES.md 6.2: ends held, plane strain; free without friction, plane stress. The bore goes in by 0.016 mm."""
    results = run("axisymmetric", rings(held=held), points=BORE, contacts=[FIT])
    found, bore = last(results, "contact_pressure_insert_ring_MPa", "bore_displacement_r_mm")
    assert found == pytest.approx(pressure, rel=2e-3) and bore == pytest.approx(-0.016, rel=2e-3)


def test_shared_scene_of_the_shrink_fit_runs_as_it_stands(tmp_path):
    assert cli.main(["check", SCENE]) == 0
    assert cli.main(["run", SCENE, "--out", str(tmp_path), "--quiet"]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["parts_built"] == ["tool die: elastic, axisymmetric", "contact insert-ring: coulomb"]
    assert summary["extents_mm"]["insert"]["r"][0] == pytest.approx(19.984, abs=2e-5)
    results = ff.Results.read(tmp_path)
    assert results.history.rows[-1]["contact_pressure_insert_ring_MPa"] == pytest.approx(69.2308, rel=0.01)
    assert results.history.rows[-1]["bore_r_mm"] == pytest.approx(19.984, abs=2e-5)
    import meshio
    frame = meshio.read(read_frames(tmp_path)[-1][1])
    assert {"displacement_mm", "von_mises_MPa", "mean_stress_MPa", "stress_tt_MPa", "contact_pressure_MPa"} <= \
        set(frame.point_data)
    assert read_scene(tmp_path / "scene.toml") == read_scene(SCENE)
    assert cli.main(["plot", str(tmp_path)]) == 0 and (tmp_path / "von_mises.png").exists()


PLASTIC = STEEL | {"yield_stress": 240}
PRESSURES = {120: (0.111108, 0.070420), 140: (0.139815, 0.087288), 160: (0.183435, 0.111645), 190: (0.362383, 0.205405)}


def test_thick_cylinder_yields_from_the_bore_outwards():
    """REFERENCES.md 6.6 at its four pressures within 0.5 %, which a list of load factors goes through."""
    points = {"bore": {"body": "cylinder", "at": [100, 5]}, "outside": {"body": "cylinder", "at": [200, 5]}}
    factors = [p / 190 for p in (*PRESSURES, )]
    factors = [100 / 190, *factors[:3], 170 / 190, 180 / 190, 185 / 190, 1.0]
    results = run("axisymmetric", cylinder(100, 200, 190, 10, height=20), points=points, material=PLASTIC,
                  steps={"loads": factors})
    rows = {round(row["load_factor"] * 190): row for row in results.history.rows}
    for pressure, expected in PRESSURES.items():
        row = rows[pressure]
        assert [row["bore_displacement_r_mm"], row["outside_displacement_r_mm"]] == pytest.approx(expected, rel=5e-3)
    assert rows[100]["max_effective_strain_cylinder"] == 0 and rows[120]["max_effective_strain_cylinder"] > 0
    # plastic work and what is stored are what the pressure has done, to the trapezoidal rule of eight steps
    energy = results.summary["ledger"]["energy"]["cylinder"]
    assert energy["elastic_energy_mJ"] + energy["plastic_work_mJ"] == pytest.approx(energy["external_work_mJ"], rel=5e-3)


def test_collapse_is_found_by_cutting_load_steps_back(tmp_path):
    """REFERENCES.md 6.6: 192.0906 MPa. Steps are halved down to a thousandth of one, and what is reached is on disk."""
    with pytest.raises(ConvergenceError, match="carries"):
        run("axisymmetric", cylinder(100, 200, 200, 12, height=20), material=PLASTIC, out=tmp_path, steps={"loads": 10})
    results = ff.Results.read(tmp_path)
    assert 200 * results.history.rows[-1]["load_factor"] == pytest.approx(192.0906, rel=3e-3)
    assert results.summary["stopped"].startswith("failed") and results.summary["cut_backs"] > 3


def test_unloaded_cylinder_keeps_the_stress_of_its_elastic_relief():
    """Autofrettage to 160 MPa and back: the displacement that is left is the plastic one less the elastic return,
    u(160) - 160/100 u(100); it does not yield again on the way."""
    points = {"bore": {"body": "cylinder", "at": [100, 5]}}
    results = run("axisymmetric", cylinder(100, 200, 160, 10, height=20), points=points, material=PLASTIC,
                  steps={"loads": [0.625, 0.8, 1.0, 0.0]})
    u = results.history.column("bore_displacement_r_mm")
    assert u[-1] == pytest.approx(u[3] - u[1] * 1.6, rel=1e-6)
    assert results.history.rows[-1]["bore_stress_tt_MPa"] < -50
    strain = results.history.column("max_effective_strain_cylinder")
    assert strain[-1] == strain[3]


def test_table_of_hardening_is_followed_beyond_the_yield_stress():
    """A bar that is drawn: strain = s / E + the plastic strain of the table at s."""
    bar = {"bar": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 40]}, "material": "steel", "mesh_size": 5,
                   "symmetry": ["z"], "loads": {"z_high": {"pressure": -350}}}}
    hardening = [[0, 200], [0.01, 300], [0.05, 400]]
    results = run("axisymmetric", bar, points={"end": {"body": "bar", "at": [0, 40]}},
                  material=STEEL | {"hardening": hardening})
    assert last(results, "end_displacement_z_mm")[0] == pytest.approx(40 * (350 / 210e3 + 0.03), rel=1e-6)
    assert last(results, "end_effective_strain")[0] == pytest.approx(0.03, rel=1e-6)


def test_sphere_from_rounded_corners_holds_an_inner_pressure():
    """REFERENCES.md 6.7 at 160 MPa, before and after yielding (140 MPa): u(b) = p a³ (1 - nu) 3 / (2 E (b³ - a³)) b while
    elastic; plastic to c = 120 mm at 212.9543 MPa, u(b) = 0.034560 mm."""
    shell = {"kind": "polygon", "points": [[100, 0], [200, 0], [200, 200], [0, 200], [0, 100], [100, 100]],
             "fillet": [0, 0, 200, 0, 0, 100]}
    tool = {"ball": {"shape": shell, "material": "steel", "mesh_size": 20, "symmetry": ["z"],
                     "loads": {"fillet_6": {"pressure": 212.9543}}}}
    results = run("axisymmetric", tool, material=PLASTIC, points={"outside": {"body": "ball", "at": [200, 0]}},
                  steps={"loads": [120 / 212.9543, 0.7, 0.8, 0.9, 1.0]})
    u = results.history.column("outside_displacement_r_mm")
    assert u[1] == pytest.approx(120 * 1e6 * 0.7 * 3 / (2 * 210e3 * 7e6) * 200, rel=5e-3)
    assert u[-1] == pytest.approx(0.034560, rel=5e-3)


@pytest.mark.parametrize("state, bending", [("plane_stress", 2.380952), ("plane_strain", 2.166667)])
def test_cantilever_bends_under_a_shear_at_its_end(state, bending):
    """REFERENCES.md 6.9 within 1 %; the root is clamped, a little stiffer than a beam's."""
    beam = {"beam": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [100, 20]}, "material": "steel", "mesh_size": 5,
                     "stress_state": state, "held": {"x_low": ["x", "y"]}, "loads": {"x_high": {"traction": [0, 50]}}}}
    results = run("plane_strain", beam, points={"end": {"body": "beam", "at": [100, 10]}})
    (found,) = last(results, "end_displacement_y_mm")
    assert found == pytest.approx(bending + 0.074286, rel=1e-2)
    assert last(results, "reaction_beam_x_low_y_N_per_mm")[0] == pytest.approx(-1000, rel=1e-6)


def test_block_on_springs_sinks_by_the_load_over_their_stiffness():
    """25 MPa on a bed of 1e4 N/mm³, 2.5e-3 mm, and the block itself p h / E on top; a spring takes half the work."""
    block = {"block": {"shape": {"kind": "box", "from": [0, 0, 0], "to": [10, 10, 20]}, "material": "steel", "mesh_size": 8,
                       "symmetry": ["x", "y"], "springs": {"z_low": {"stiffness": "1e4 N/mm^3", "axis": "z"}},
                       "loads": {"z_high": {"pressure": 25}}}}
    results = run("3d", block, points={"top": {"body": "block", "at": [5, 5, 20]}})
    assert last(results, "top_displacement_z_mm")[0] == pytest.approx(-(2.5e-3 + 25 * 20 / 210e3), rel=1e-6)
    energy = results.summary["ledger"]["energy"]["block"]
    assert energy["spring_energy_mJ"] == pytest.approx(0.5 * 25 * 100 * 2.5e-3, rel=1e-6)
    assert "springs block" in results.summary["parts_built"]


def test_clamped_parts_carry_the_load_of_their_clamp():
    """Two plates in a clamp that is closed by 0.02 mm: sigma = E 0.02 / 20 in both before any load."""
    parts = {name: {"shape": {"kind": "rectangle", "from": [0, low], "to": [10, low + 10]}, "material": "steel",
                    "mesh_size": 5} for name, low in (("lower", 0), ("upper", 10))}
    tool = {"pack": {"parts": parts, "stress_state": "plane_stress", "symmetry": ["x"],
                     "held": {"y_low": "y", "y_high": {"y": "-0.02 mm"}}, "loads": {"x_high": {"pressure": 20}}}}
    results = run("plane_strain", tool, contacts=[{"between": ["lower", "upper"]}], steps={"loads": 2})
    clamped, loaded = (results.history.rows[k]["contact_pressure_lower_upper_MPa"] for k in (1, -1))
    assert clamped == pytest.approx(210e3 * 0.02 / 20, rel=1e-3)
    assert loaded == pytest.approx(210 + 0.3 * 20, rel=1e-3)        # held along y, it presses more by nu times the load
    assert results.history.rows[1]["load_factor"] == 0 and len(results.history) == 4
    assert results.history.rows[1]["reaction_pack_y_high_y_N_per_mm"] == pytest.approx(-2 * 10 * 210, rel=1e-3)


def test_tool_that_nothing_holds_is_news_and_not_a_crash(tmp_path):
    loose = cylinder(20, 50, 300, 5, ends=())
    with pytest.raises(ConvergenceError, match="free to move"):
        run("axisymmetric", loose, out=tmp_path)
    assert "free to move" in json.loads((tmp_path / "summary.json").read_text())["stopped"]


def test_resumed_run_of_tools_is_the_uninterrupted_one(tmp_path):
    """A shrink fit with friction whose rings yield, and a second tool, on, off and on again: 1e-10 of every number."""
    tools = rings(held={}, loads={"r_low": {"pressure": 200}})
    for part in tools["die"]["parts"].values():
        part["held"] = {"z_low": "z"}
    tools["other"] = cylinder(20, 40, 150, 5, ends=("z_low",))["cylinder"]
    fit = FIT | {"interference": 0.06, "friction": {"law": "coulomb", "coefficient": 0.1}}

    def scene(loads):
        steel = STEEL | {"yield_stress": 200, "hardening": 2000}
        return Scene.read({"geometry": "axisymmetric", "materials": {"steel": steel}, "tools": tools,
                           "points": BORE, "contacts": [fit], "steps": {"loads": loads}})

    whole = ff.simulate(scene([0.3, 0.6, 1.0, 0.5, 1.0]), tmp_path / "whole")
    ff.simulate(scene([0.3, 0.6]), tmp_path / "parts")
    ff.write_scene(scene([0.3, 0.6, 1.0, 0.5, 1.0]), tmp_path / "scene.toml")
    words = ["run", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "parts"), "--resume", "--quiet"]
    assert cli.main(words) == 0
    resumed = ff.Results.read(tmp_path / "parts")
    assert resumed.history.columns == whole.history.columns and len(resumed.history) == 7
    assert whole.history.rows[-1]["max_effective_strain_die"] > 1e-4
    for name in set(whole.history.columns) - {"wall_s"}:
        expected = whole.history.column(name)
        slack = 1e-10 * max(1.0, np.abs(expected).max())
        assert resumed.history.column(name) == pytest.approx(expected, rel=1e-10, abs=slack)
    works = [run.summary["ledger"]["energy"]["die"]["friction_work_mJ"] for run in (whole, resumed)]
    assert works[1] == pytest.approx(works[0], rel=1e-9) and works[0] > 0


def test_shrink_fit_holds_until_the_push_is_the_friction_of_its_pressure(tmp_path):
    """The insert is pushed out of its ring at F = mu N, 0.1 %, found by cutting load steps back. The mesh has two sides on
    the joint, whose points slip one after the other, some of them the other way at first."""
    parts = rings()["die"]["parts"]
    parts["insert"] |= {"loads": {"z_high": {"pressure": 100}}, "mesh_size": 5}
    parts["ring"] |= {"held": {"z_low": "z"}, "mesh_size": 7}
    tool = {"die": {"parts": parts}}
    fit = FIT | {"friction": {"law": "coulomb", "coefficient": 0.3}}
    with pytest.raises(ConvergenceError, match="its parts slide"):
        run("axisymmetric", tool, contacts=[fit], out=tmp_path, steps={"loads": [0.05, 0.1, 0.15]})
    results = ff.Results.read(tmp_path)
    row = results.history.rows[-1]
    push = row["load_factor"] * 100 * np.pi * (40**2 - 20**2)
    assert push == pytest.approx(0.3 * row["contact_force_insert_ring_N"], rel=1e-3)
    assert row["resultant_insert_ring_z_N"] == pytest.approx(push, rel=1e-6)
    energy = results.summary["ledger"]["energy"]["die"]
    assert energy["elastic_energy_mJ"] + energy["friction_work_mJ"] == pytest.approx(
        energy["external_work_mJ"] + energy["interference_work_mJ"], rel=1e-3)
    assert "max_effective_strain_die" not in row


def test_corners_that_supports_move_press_as_the_face_between_them_does():
    """A stiff punch is moved down by its top, or by its top and both sides, whose lowest nodes lie on the contact surface:
    the same force. It is a thousand times stiffer than what it presses on, and bends by about as little."""
    pressed = []
    for faces in (["y_high"], ["y_high", "x_low", "x_high"]):
        moved = dict.fromkeys(faces, {"x": 0.0, "y": -0.01})
        parts = {"low": {"shape": {"kind": "rectangle", "from": [-5, 0], "to": [25, 10]}, "material": "steel",
                         "mesh_size": 2.4, "held": {"y_low": ["x", "y"]}},
                 "high": {"shape": {"kind": "rectangle", "from": [0, 10], "to": [20, 20]}, "material": "hard",
                          "mesh_size": 2, "held": moved}}
        materials = {"steel": STEEL, "hard": {"young": 210e6, "poisson": 0.3}}
        scene = Scene.read({"geometry": "plane_strain", "materials": materials, "tools": {"press": {"parts": parts}},
                            "contacts": [{"between": ["high", "low"]}]})
        pressed += last(ff.simulate(scene), "contact_force_high_low_N_per_mm")
    assert pressed[1] == pytest.approx(pressed[0], rel=2e-3)
