"""Stresses of tools from forming runs: nothing of the contact forces is lost on the way to another mesh."""

import numpy as np
import pytest

import fenics_forming as ff
from fenics_forming import cli, meshing
from fenics_forming.errors import SceneError
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.parallel import total
from fenics_forming.physics.tool_body.carrying import ContactForces, carried, moments
from fenics_forming.results.files import ResultsError
from fenics_forming.results.recording.contact_forces import read_contact_forces
from fenics_forming.scene import Scene

SHAPES = {2: lambda: meshing.rectangle((0, 0), (20, 10), (13, 6)),
          3: lambda: meshing.box((0, 0, 0), (20, 20, 10), (7, 7, 3))}


@pytest.mark.parametrize("dim", [2, 3])
def test_force_moment_and_work_are_the_same_on_the_tool_to_rounding(dim):
    """Random forces at points that lie up to 0.05 mm off the face and beyond its rim: sums to 1e-12 of the largest; on
    displacements that are linear in the face they do the same work as at their feet."""
    nodes = Nodes(SHAPES[dim]())
    low = meshing.boundary_facets(nodes.mesh, lambda x: np.isclose(x[dim - 1], 0))
    rng = np.random.default_rng(1)
    points = rng.uniform(-0.05, 20.05, (400, dim))
    points[:, -1] = rng.uniform(-0.05, 0.05, 400)
    acting = ContactForces(points, rng.normal(size=(400, dim)))
    forces = carried(acting, nodes, low)
    own = np.arange(nodes.count) < nodes.mesh.geometry.index_map().size_local
    assert total(nodes.comm, forces[own].sum(axis=0)) == pytest.approx(acting.total(), abs=1e-11)
    moment = total(nodes.comm, moments(nodes.x[own], forces[own]).sum(axis=0))
    assert moment == pytest.approx(acting.moment(), abs=1e-9)
    above = ContactForces(np.clip(points, 0.01, 19.99), acting.forces)
    straight = carried(above, nodes, low, with_couples=False)
    slope, feet = rng.normal(size=(dim, dim)), above.points * (np.arange(dim) < dim - 1)
    assert (straight * (nodes.x @ slope)).sum() == pytest.approx((above.forces * (feet @ slope)).sum(), rel=1e-10)


COLUMN = {"shape": {"kind": "rectangle", "from": [0, 15], "to": [10, 55]}, "material": "steel", "held": {"z_high": "z"},
          "mesh_size": {"contact": 1.5, "far": 8}, "drive": {"kind": "speed", "velocity": [0, -1]}}


def upsetting(tool=COLUMN, steel=None, **more):
    return Scene.read({
        "geometry": "axisymmetric",
        "materials": {"lead": {"flow_stress": {"law": "constant", "value": 100}},
                      "steel": {"young": "210 GPa", "poisson": 0.3} | (steel or {})},
        "workpieces": {"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [10, 15]}, "symmetry": ["z"],
                                  "material": "lead", "mesh_size": 2}},
        "tools": {"upper": tool}, "points": {"face": {"body": "upper", "at": [0, 15]}},
        "process": {"tool_deformation": "rigid"},
        "steps": {"stroke": 0.1}, "stop": {"stroke": 0.2}, "output": {"fields_every": 1}} | more)


def test_column_above_a_billet_shortens_by_its_pressure(tmp_path):
    """Frictionless, the billet presses with its flow stress: u = p h / E on the column of the same section, uniaxial,
    1 % for the regularised rate and the penalty; the force is that of the history to rounding, in every frame."""
    run = ff.simulate(upsetting(), tmp_path)
    for frame, row in enumerate(run.history.rows):
        _, _, points, forces = read_contact_forces(tmp_path, "upper", frame)
        assert forces.sum(axis=0)[1] == pytest.approx(row["force_upper_N"], rel=1e-12)
    stressed = ff.tool_stresses(run, "upper", frame=0)
    last = stressed.history.rows[-1]
    assert last["face_displacement_z_mm"] == pytest.approx(100 * 40 / 210e3, rel=1e-2)
    assert last["face_stress_zz_MPa"] == pytest.approx(-100, rel=3e-2)
    assert last["reaction_upper_z_high_z_N"] == pytest.approx(-run.history.rows[0]["force_upper_N"], rel=1e-9)


def test_forces_are_kept_only_where_a_tool_has_a_body(tmp_path):
    plate = {"shape": {"kind": "plane", "point": [0, 15], "normal": [0, -1]}, "drive": COLUMN["drive"]}
    run = ff.simulate(upsetting(plate, points={}), tmp_path)
    assert not list(tmp_path.glob("contact_*.npz"))
    with pytest.raises(ResultsError, match="kept none"):
        ff.tool_stresses(run, "upper", scene=upsetting())


def test_stresses_are_a_command_with_its_own_results(tmp_path):
    """A weak column yields: its plastic zone is in the frame. Another mesh may be asked for afterwards."""
    ff.simulate(upsetting(steel={"yield_stress": 80, "hardening": 2000}), tmp_path)
    words = ["stresses", str(tmp_path), "upper", "--frame", "1", "--set", "tools.upper.mesh_size=4", "--quiet"]
    assert cli.main(words) == 0
    results = ff.Results.read(tmp_path / "upper")
    assert results.history.rows[-1]["face_effective_strain"] == pytest.approx(20 / 2000, rel=0.2)
    assert results.summary["tools"]["upper"]["upper"]["share_that_flowed"] > 0.9
    assert results.summary["stopped"] == "full loads reached"
    assert cli.main(["stresses", str(tmp_path), "lower"]) == 2


def test_tool_that_yields_may_go_through_all_frames(tmp_path):
    """Forces that rise and fall again: the plastic strain is that of the highest, of which the last frame knows nothing."""
    scene = upsetting(steel={"yield_stress": 95, "hardening": 5000})
    run = ff.simulate(scene, tmp_path)
    files = sorted(tmp_path.glob("contact_*.npz"))
    for path, share in zip(files, (1.0, 1.2, 0.5), strict=True):
        with np.load(path) as kept:
            arrays = dict(kept)
        arrays["upper"][:, 2:] *= share
        np.savez(path, **arrays)
    whole, alone = (ff.tool_stresses(run, "upper", path=path).history for path in (True, False))
    assert whole.column("time_s") == pytest.approx([0, 0, 0.1, 0.2])
    assert alone.rows[-1]["face_effective_strain"] == 0
    strain = whole.column("face_effective_strain")
    assert strain[-1] == strain[-2] == pytest.approx((120 - 95) / 5000, rel=0.25) and 0 < strain[1] < strain[2]


def test_tool_that_deforms_with_the_workpiece_leaves_frames_and_points_of_its_own(tmp_path):
    """The column yields within the solve: its face has moved by p h / E, and by the drive."""
    scene = upsetting(process={"tool_deformation": "iterated"})
    run = ff.simulate(scene, tmp_path)
    last = run.history.rows[-1]
    pressure = last["force_upper_N"] / (np.pi * 10**2)
    assert last["face_displacement_z_mm"] == pytest.approx(pressure * 40 / 210e3, rel=2e-2)
    assert last["face_z_mm"] == pytest.approx(15 - 0.2 + last["face_displacement_z_mm"], abs=1e-9)
    assert len(run.tool_frames("upper")) == len(run.frames) == 3
    numbers = run.summary["tools"]["upper"]["upper"]
    assert numbers["largest_von_mises_MPa"] == pytest.approx(100, rel=0.2) and "share_that_flowed" not in numbers
    assert cli.main(["plot", str(tmp_path), "--field", "stress_zz", "--tool", "upper"]) == 0
    assert (tmp_path / "stress_zz_upper.png").exists()
    # a later run without such a tool takes them away
    ff.simulate(upsetting(points={}), tmp_path)
    assert not list(tmp_path.glob("tool_*"))


def test_assembled_tool_is_pre_stressed_before_the_forming_forces_come(tmp_path):
    """A die of insert and ring around a billet that flows against its bore: workpieces meet one outline, the forces go to
    the parts behind it. The bore is pressed in by the fit (0.016 mm) and comes out under the radial pressure."""
    parts = {name: {"shape": {"kind": "rectangle", "from": [inner, 0], "to": [outer, 15]}, "material": "steel",
                    "mesh_size": size} for name, inner, outer, size in (("insert", 20, 40, 4), ("ring", 40, 80, 6))}
    die = {"shape": {"kind": "polyline", "points": [[20, 0], [20, 15]], "side": "left"}, "parts": parts,
           "symmetry": ["z"], "held": {"z_high": "z"}}
    punch = {"shape": {"kind": "plane", "point": [0, 10], "normal": [0, -1]}, "drive": COLUMN["drive"]}
    scene = Scene.read({
        "geometry": "axisymmetric",
        "materials": {"lead": {"flow_stress": {"law": "constant", "value": 100}},
                      "steel": {"young": "210 GPa", "poisson": 0.3}},
        "workpieces": {"billet": {"shape": {"kind": "rectangle", "from": [0, 0], "to": [19.9, 10]}, "symmetry": ["z"],
                                  "material": "lead", "mesh_size": 3}},
        "tools": {"die": die, "punch": punch}, "points": {"bore": {"body": "insert", "at": [20, 5]}},
        "contacts": [{"between": ["insert", "ring"], "interference": 0.04}], "process": {"tool_deformation": "rigid"},
        "steps": {"stroke": 0.05}, "stop": {"force": "250 kN"}})      # the die is full: it stands 100 MPa above yield
    run = ff.simulate(scene, tmp_path)
    whole = scene.replaced(tools=scene.tools | {"die": scene.tools["die"].replaced(symmetry=())})
    with pytest.raises(SceneError, match="must be cut there too"):       # the forces are those of the upper half
        ff.tool_stresses(run, "die", scene=whole)
    rows = ff.tool_stresses(run, "die").history.rows
    assert [row["load_factor"] for row in rows] == [0, 0, 1]
    assert rows[1]["bore_displacement_r_mm"] == pytest.approx(-0.016, rel=1e-2)
    assert rows[2]["bore_displacement_r_mm"] > rows[1]["bore_displacement_r_mm"] + 1e-3
    assert rows[2]["contact_pressure_insert_ring_MPa"] > rows[1]["contact_pressure_insert_ring_MPa"]
