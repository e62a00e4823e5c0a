"""Edges of tools that lie on the surface of a body at the start are edges of its first mesh."""

import numpy as np
import pytest
from mpi4py import MPI

from fenics_forming import Scene, simulate
from fenics_forming.physics.bodies import body_mesh
from fenics_forming.physics.contact.triangulated import Triangulated
from fenics_forming.physics.imprint import split_at
from fenics_forming.physics.remeshing import BodyArrays
from fenics_forming.physics.tools import known_tools
from fenics_forming.scene.outline import Arc, Line

BLOCK = {"shape": {"kind": "box", "from": [0, 0, -2], "to": [3, 3, 0]}, "material": "m", "mesh_size": 0.9}
TOOLS = {
    "round punch": {"kind": "cylinder", "base": [0, 0, 0], "radius": 1.1, "height": 1},
    "round punch upside down": {"kind": "cylinder", "base": [0, 0, 1], "axis": [0, 0, -1], "radius": 1.1, "height": 1},
    "flat die": {"kind": "box", "from": [-1, -5, 0], "to": [1.3, 5, 2]},
    "corner of a die": {"kind": "box", "from": [-5, -5, 0], "to": [1.3, 1.7, 2]}}
INSIDE = {"round punch": lambda x: np.hypot(x[:, 0], x[:, 1]) - 1.1, "flat die": lambda x: x[:, 0] - 1.3,
          "corner of a die": lambda x: np.maximum(x[:, 0] - 1.3, x[:, 1] - 1.7)}


def body_under(shape, workpiece=BLOCK, geometry="3d"):
    scene = Scene.read({"geometry": geometry, "materials": {"m": {"flow_stress": {"law": "constant", "value": 100}}},
                        "workpieces": {"b": workpiece}, "tools": {"t": {"shape": shape}}, "steps": {"time": 1},
                        "stop": {"time": 1}})
    mesh, _ = body_mesh(scene, known_tools(scene), MPI.COMM_SELF)
    dim = scene.dimension
    return BodyArrays(mesh.geometry.x[:, :dim].copy(), mesh.geometry.dofmap.astype(np.int64))


@pytest.mark.parametrize("name", TOOLS)
def test_no_side_of_an_element_straddles_the_edge_of_a_punch(name):
    """On the flat face every side lies under the tool or beside it, to the chord of a curved side, 1e-3."""
    body = body_under(TOOLS[name])
    top = body.sides[(np.abs(body.x[body.sides, 2]) < 1e-9).all(axis=1)]
    beyond = INSIDE[name.removesuffix(" upside down")](body.x)[top]
    assert ((beyond < 1e-3).all(axis=1) | (beyond > -1e-3).all(axis=1)).all()
    assert (beyond < 1e-3).all(axis=1).any()


def test_a_tool_whose_edges_lie_elsewhere_leaves_the_mesh_as_it_is():
    plane = body_under({"kind": "plane", "point": [0, 0, 0], "normal": [0, 0, -1]})
    platen = body_under({"kind": "box", "from": [-20, -20, 0], "to": [20, 20, 5]})
    assert platen.x == pytest.approx(plane.x, abs=0) and (platen.cells == plane.cells).all()


def test_the_corner_of_a_punch_on_a_side_in_the_plane_is_a_vertex():
    body = body_under({"kind": "rectangle", "from": [0, 0], "to": [1.234, 2]}, geometry="plane_strain",
                      workpiece={"shape": {"kind": "rectangle", "from": [0, -2], "to": [3, 0]}, "material": "m"})
    vertices = body.x[np.unique(body.cells[:, :3])]
    assert np.linalg.norm(vertices - [1.234, 0.0], axis=1).min() < 1e-12


def test_lines_of_an_outline_are_cut_at_points_on_them_and_nowhere_else():
    line, arc = Line((0.0, 0.0), (10.0, 0.0)), Arc((10.0, 0.0), (0.0, 0.0), (5.0, 0.0), 5.0, np.pi)
    pieces = split_at([line, arc], np.array([[4.0, 0.0], [7.0, 0.0], [5.0, 1.0], [10.0, 0.0], [5.0, 5.0]]), 1.0)
    assert [piece.start for piece in pieces] == [(0.0, 0.0), (4.0, 0.0), (7.0, 0.0), (10.0, 0.0)]
    assert pieces[-1] is arc


def test_edges_that_protrude_are_told_from_grooves_and_facets():
    """An L turned into a prism: 17 sharp edges around less tool than space, one in its groove; diagonals are none."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)
    low, high = np.pad(outline, ((0, 0), (0, 1))), np.pad(outline, ((0, 0), (0, 1)), constant_values=1.0)
    k, after = np.arange(6), np.roll(np.arange(6), -1)
    mantle = [np.stack([k, after, 6 + after], axis=1), np.stack([k, 6 + after, 6 + k], axis=1)]
    face = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    found = Triangulated(np.vstack([low, high]), np.vstack([*mantle, face[:, ::-1], 6 + face])).edges()
    assert len(found) == 17
    assert not (np.abs(found[:, :, :2] - 1).max(axis=(1, 2)) < 1e-12).any()


def test_a_flat_die_bites_into_a_bar_by_a_quarter_of_its_height_on_one_coarse_mesh(tmp_path):
    """Cogging, four elements along the bite. Without the edge in the mesh the force jumps by 2 % up and down as nodes pass
    below the die; smaller cells at the edge turn over at half of the stroke."""
    results = simulate(Scene.read({
        "geometry": "3d", "materials": {"steel": {"flow_stress": {"law": "norton_hoff", "K": "90 MPa", "m": 0.12}}},
        "workpieces": {"bar": {"shape": {"kind": "box", "from": [0, 0, 0], "to": [100, 50, 50]}, "mesh_size": 14,
                               "material": "steel", "symmetry": ["x", "y", "z"]}},
        "tools": {"die": {"shape": {"kind": "box", "from": [-30, -80, 50], "to": [30, 80, 90]},
                          "drive": {"kind": "speed", "velocity": [0, 0, "-50 mm/s"]},
                          "friction": {"law": "siebel", "factor": 0.7}}},
        "steps": {"stroke": 1}, "stop": {"stroke": 12}}), tmp_path)
    assert results.summary["stopped"] == "stroke 12 mm reached"
    assert results.history.rows[-1]["step"] == 12, "no step was cut"
    force = results.force()
    assert (np.diff(force) > -0.015 * force[:-1]).all()
    # at the start: a rate of the order of 2 x 50 mm/s over 100 mm, pressed between that of a free bar and 1.5 times it
    assert 90 * 6000 < force[0] < 1.5 * 90 * 6000
