"""Rigid tools from CAD files: the surface is that of the body in the file, its normals out of it."""

import numpy as np
import pytest

from fenics_forming import Scene, Simulation, check, simulate
from fenics_forming.errors import SceneError
from fenics_forming.physics.contact.triangulated import Triangulated
from fenics_forming.physics.gmsh_arrays import gmsh_model
from fenics_forming.physics.tools import known_tools


def write(path, build):
    with gmsh_model() as gmsh:
        gmsh.option.setNumber("General.Verbosity", 0)
        build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    return str(path)


def die_with_a_bowl(occ):
    """A plate of 40 x 40 x 10 mm, from whose lower face at z = 0 half a ball of 8 mm is taken out, with a hole of 3 mm."""
    plate, ball = occ.addBox(-20, -20, 0, 40, 40, 10), occ.addSphere(0, 0, 0, 8)
    occ.cut([(3, plate)], [(3, ball), (3, occ.addCylinder(14, 14, -1, 0, 0, 12, 3))])


def scene(path, scale=1.0, symmetry=(), **tool):
    die = {"shape": {"kind": "file", "path": path, "scale": scale}, "symmetry": list(symmetry),
           "drive": {"kind": "speed", "velocity": [0, 0, -1]}} | tool
    return Scene.read({"geometry": "3d", "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}}},
                       "workpieces": {"b": {"shape": {"kind": "box", "from": [0, 0, -5], "to": [5, 5, 0]}, "material": "m",
                                            "symmetry": ["x", "y", "z"], "mesh_size": 2.5}},
                       "tools": {"die": die}, "steps": {"stroke": 0.5}, "stop": {"stroke": 1}})


def test_the_surface_is_that_of_the_body_with_its_bowl_and_hole(tmp_path):
    """Facets of height h lie h²/6R off, 0.13 % of the radius as asked; gmsh makes some larger: 0.4 % of 8 mm."""
    surface = known_tools(scene(write(tmp_path / "die.step", die_with_a_bowl)))[0].surface
    assert isinstance(surface, Triangulated) and surface.open_edges == 0
    points = [[0, 0, -3], [0, 0, 3], [2, 1, 2], [-15, -15, -2], [-15, -15, 2], [14, 14, 5], [0, 0, 12], [25, 0, 5]]
    exact = np.array([np.hypot(3, 8), 5, 5, 2, -2, 3, 2, 5])
    assert surface.closest(np.array(points, float))[0] == pytest.approx(exact, abs=0.032)
    assert len(surface.triangles) < 10_000


def test_the_unit_of_a_file_is_a_factor(tmp_path):
    surface = known_tools(scene(write(tmp_path / "die.brep", die_with_a_bowl), scale=0.5))[0].surface
    assert np.array(surface.bounds()) == pytest.approx(np.array([[-10, -10, 0], [10, 10, 5]]))


def test_the_low_faces_of_a_tool_cut_in_half_are_no_surface(tmp_path):
    half = scene(write(tmp_path / "half.step", lambda occ: occ.addBox(0, -20, 0, 20, 40, 10)), symmetry=["x"])
    gap, normal = known_tools(half)[0].surface.closest([[0.01, 0, 4.0]])
    assert gap == pytest.approx([-4.0]) and normal[0] == pytest.approx([0, 0, -1])


def test_a_flat_die_from_a_file_presses_like_a_plane(tmp_path):
    """The same contact points, gaps and normals: the same forces to the tolerance of Newton's iterations."""
    path = write(tmp_path / "flat.step", lambda occ: occ.addBox(-10, -10, 0, 20, 20, 5))
    forces = [simulate(described, tmp_path / "out").force() for described in (
        scene(path), scene(path, shape={"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, -1]}))]
    assert forces[0] == pytest.approx(forces[1], rel=1e-6)


def test_a_die_that_stands_in_the_body_is_refused_in_words(tmp_path):
    """Its nodes would be put onto the surface of the die, and cells turned inside out."""
    path = write(tmp_path / "deep.step", lambda occ: occ.addBox(-10, -10, -3, 20, 20, 5))
    with pytest.raises(SceneError, match="tools.die.shape: overlaps the workpiece at the start, .* mm deep at"):
        simulate(scene(path))
    grazing = write(tmp_path / "grazing.step", lambda occ: occ.addBox(-10, -10, -0.2, 20, 20, 5))
    assert [w for w in Simulation(scene(grazing)).warnings if "0.2 mm deep" in w and "put onto its surface" in w]


def test_a_file_without_a_body_is_refused_in_words(tmp_path):
    sheet = write(tmp_path / "sheet.step", lambda occ: occ.addRectangle(0, 0, 0, 10, 10))
    with pytest.raises(SceneError, match="tools.die.shape.path: .*holds no body of dimension 3"):
        known_tools(scene(sheet))
    broken = tmp_path / "broken.step"
    broken.write_text("this is no STEP file")
    with pytest.raises(SceneError, match="tools.die.shape.path: .*(cannot be read|holds no body)"):
        known_tools(scene(str(broken)))


def test_a_rigid_tool_from_a_file_has_no_mesh_size(tmp_path):
    described = scene(write(tmp_path / "die.step", die_with_a_bowl), mesh_size=2.0)
    with pytest.raises(SceneError, match="tools.die.mesh_size: belongs to a tool that deforms"):
        check(described)


def test_a_rigid_tool_in_the_plane_from_a_file(tmp_path):
    path = write(tmp_path / "punch.step", lambda occ: occ.addRectangle(0, 0, 0, 3, 2))
    described = Scene.read({
        "geometry": "plane_strain", "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}}},
        "workpieces": {"b": {"shape": {"kind": "rectangle", "from": [0, -5], "to": [5, 0]}, "material": "m"}},
        "tools": {"punch": {"shape": {"kind": "file", "path": path}}}, "steps": {"time": 1}, "stop": {"time": 1}})
    surface = known_tools(described)[0].surface
    assert surface.closest(np.array([[1.0, -1.0], [1.0, 0.5], [4.0, 1.0]]))[0] == pytest.approx([1.0, -0.5, 1.0])
