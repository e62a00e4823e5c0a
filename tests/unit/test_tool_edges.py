"""The surface of a solid gets edges on the sharp edges of tools that it slides over, and keeps them there."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from fenics_forming.physics import meshing
from fenics_forming.physics.contact.blocks import box_surface, cylinder_surface
from fenics_forming.physics.contact.rigid import KnownTool, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.kinematics import THREE_DIMENSIONAL
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.remeshing import BodyArrays, remesh
from fenics_forming.physics.remeshing.straight import volumes
from fenics_forming.process.meshes.drawn_edges import drawn_to_edges
from fenics_forming.process.meshes.held_edges import hold_edges
from fenics_forming.process.meshes.renewing import side_labels
from fenics_forming.process.meshes.tool_corners import with_edges
from fenics_forming.process.meshes.tool_edges import ToolEdges, edges_of
from fenics_forming.process.volume import FreeSurface

MIRRORS = {0: 0.0, 1: 0.0}
HEIGHT = 6.0


def still(surface, name="punch"):
    return KnownTool(name, surface, motion=ToolMotion(np.zeros(3), np.zeros(3)))


def square_punch(half=5.3, at=HEIGHT):
    return still(box_surface(np.array([-half, -half, at]), np.array([half, half, at + 10])))


def round_punch(radius=5.3):
    return still(cylinder_surface(np.array([0, 0, HEIGHT]), np.array([0.0, 0, 1]), radius, 10.0))


@pytest.fixture(scope="module")
def block():
    """A quarter of a block whose mesh knows nothing of the punch on it."""
    nodes = Nodes(meshing.box((0, 0, 0), (10, 10, HEIGHT), (4, 4, 3)))
    return BodyArrays(nodes.x.copy(), nodes.cells.copy())


def pressed_area(body, tool):
    chosen = body.sides[side_labels(body, [tool], MIRRORS, 1e-9) == 1][:, :3]
    p = body.x[chosen]
    return 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()


def volume(body):
    return np.abs(volumes(body.x, body.cells)).sum()


def test_the_contact_ends_at_the_edges_of_a_square_punch_and_at_its_corner(block):
    """A quarter of its face is covered to rounding; the cells still fill the block, and none is flat."""
    tool = square_punch()
    drawn, _ = drawn_to_edges(block, [tool], MIRRORS)
    assert pressed_area(block, tool) < 0.9 * 5.3**2
    assert pressed_area(drawn, tool) == pytest.approx(5.3**2, rel=1e-12)
    assert np.isclose(drawn.x[np.unique(drawn.sides[:, :3])], [5.3, 5.3, HEIGHT], atol=1e-12).all(axis=1).sum() == 1
    assert volume(drawn) == pytest.approx(600, rel=1e-12)
    assert np.abs(volumes(drawn.x, drawn.cells)).min() > 1e-3 * np.abs(volumes(block.x, block.cells)).mean()


def test_the_contact_ends_on_the_rim_of_a_round_punch(block):
    """Its vertices and mid-nodes lie on the rim, in 72 pieces a turn; straight triangles leave segments of it out."""
    tool = round_punch()
    drawn, _ = drawn_to_edges(block, [tool], MIRRORS)
    sides = drawn.sides[side_labels(drawn, [tool], MIRRORS, 1e-9) == 1]
    radius = np.hypot(*drawn.x[np.unique(sides), :2].T)
    assert radius.max() == pytest.approx(5.3, rel=1e-3)
    assert np.sum(radius > 5.3 * np.cos(np.pi / 72) - 1e-9) >= 7
    assert pressed_area(drawn, tool) == pytest.approx(np.pi / 4 * 5.3**2, rel=0.04)


def test_a_new_mesh_keeps_the_edge(block):
    tool = square_punch()
    drawn, corners = drawn_to_edges(block, [tool], MIRRORS)
    labels = side_labels(drawn, [tool], MIRRORS, 1e-9)
    made = remesh(drawn, labels, lambda points: np.full(len(points), 2.0), corners=corners)
    assert pressed_area(made, tool) == pytest.approx(5.3**2, rel=1e-6)


def test_a_body_that_no_edge_touches_stays_as_it_is(block):
    assert drawn_to_edges(block, [square_punch(at=HEIGHT + 4)], MIRRORS)[0] is block
    assert drawn_to_edges(block, [square_punch(half=30.0)], MIRRORS)[0] is block


def test_only_tools_with_edges_that_protrude_are_asked():
    plane = still(Plane((0, 0, 0), (0, 0, 1)), "floor")
    punch = square_punch()
    assert with_edges([plane, punch]) == [punch]
    edges = ToolEdges(punch, np.zeros(3), np.array([10.0, 10, 6]), 2.0)
    assert len(edges.corners()) >= 1 and np.isclose(edges.corners(), [5.3, 5.3, 6]).all(axis=1).any()


@pytest.mark.parametrize("punch", [square_punch, round_punch])
def test_vertices_that_have_left_an_edge_come_back_and_find_the_history_there(block, punch):
    """All nodes have moved outwards by 2 %. A history linear in the place stays so within how far the places lie off the
    edges of the surface, here a tenth of a millimetre."""
    tool = punch()
    drawn, _ = drawn_to_edges(block, [tool], MIRRORS)
    nodes = Nodes(meshing.from_arrays(drawn.x, drawn.cells, MPI.COMM_SELF))
    surface = FreeSurface.of_mesh(nodes, THREE_DIMENSIONAL, MIRRORS)
    body = SimpleNamespace(nodes=nodes, x=nodes.x, tools=[tool], skins=lambda: [(surface, nodes.cells)], size=10.0,
                           boundary=np.flatnonzero(surface.nodes))
    edges = ToolEdges(tool, np.zeros(3), np.array([10.0, 10, 6]), 2.0)

    def on_edges():
        vertices = np.unique(edges_of(surface.surface.sides[surface.sides]))
        return np.sum(edges.nearest(body.x[vertices])[1] < 1e-9)

    before = on_edges()
    assert before >= 4
    body.x[:, :2] *= 1.02
    assert on_edges() == 0
    linear = lambda: 3 + body.x @ [1.0, 2.0, 0.5]  # noqa: E731
    history = hold_edges(body, {"strain": nodes.with_mids(linear())})
    assert on_edges() == before
    vertices = nodes.is_vertex
    assert history["strain"][vertices] == pytest.approx(linear()[vertices], abs=0.1 * np.linalg.norm([1, 2, 0.5]))
    assert np.abs(volumes(nodes.x, nodes.vertices)).sum() == pytest.approx(600 * 1.02**2, rel=1e-3)
