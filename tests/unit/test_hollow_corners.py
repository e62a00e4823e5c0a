"""A hollow corner of a tool that a body fills stays filled while material flows around it: a vertex of the body stays."""

from types import SimpleNamespace

import numpy as np
import pytest

from fenics_forming.physics import meshing
from fenics_forming.physics.contact.polyline import Polyline
from fenics_forming.physics.contact.rigid import KnownTool, ToolMotion
from fenics_forming.physics.kinematics import PLANE_STRAIN
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.remeshing import BodyArrays, remesh
from fenics_forming.process.meshes.hollow_corners import filled_corners, hold_hollow_corners, in_hollow_corners
from fenics_forming.process.meshes.renewing import side_labels
from fenics_forming.process.volume import FreeSurface

ENTRY = np.array([0.0, 2.0])      # container y = 2 to the left of it, a cone of 35 degrees to the right
EXIT = np.array([2.0, 2.0 - 2.0 * np.tan(np.radians(35))])


def die(shift=0.0):
    points = [(-9, 2), ENTRY, EXIT, (9, 3)]
    return KnownTool("die", Polyline(points[::-1]), motion=ToolMotion(np.array([0.0, shift]), np.zeros(2)))


def billet(entry=ENTRY):
    return Nodes(meshing.polygon([(-4, 0), (2, 0), EXIT, entry, (-4, 2)], 0.5))


def running(entry=ENTRY, pressed=lambda middle: np.full(len(middle), True)):
    """As much of a body in a run as the corners ask for; ``pressed``: which sides are, by their middles."""
    nodes, tool = billet(entry), die()
    surface = FreeSurface.of_mesh(nodes, PLANE_STRAIN, {1: 0.0})
    sides = surface.surface.sides
    tool.state = SimpleNamespace(pressure=np.repeat(np.where(pressed(nodes.x[sides[:, 2]]), 5.0, 0.0), 3))
    facets = SimpleNamespace(facet_nodes=sides, points_per_facet=3)
    body = SimpleNamespace(nodes=nodes, x=nodes.x, tools=[tool], skins=lambda: [(surface, nodes.cells)], size=6.0,
                           boundary=np.flatnonzero(surface.nodes), contact=SimpleNamespace(facets=facets))
    return body, {"strain": nodes.with_mids(3 + nodes.x @ [1.0, 2.0])}


def on_die(middle):
    return np.abs(die().gap(middle)[0]) < 1e-6


def test_a_corner_is_filled_where_both_of_its_walls_press():
    filled = filled_corners(running(pressed=on_die)[0])
    assert [(tool.name, die().surface.corners()[k] == pytest.approx(ENTRY)) for tool, k in filled] == [("die", True)]


@pytest.mark.parametrize("pressed", [lambda middle: on_die(middle) & (middle[:, 0] < 0),
                                     lambda middle: np.full(len(middle), False)])
def test_a_corner_is_not_held_where_a_wall_is_left(pressed):
    assert filled_corners(running(pressed=pressed)[0]) == []


def test_the_vertex_that_has_left_a_filled_corner_comes_back_with_the_history_that_is_there():
    """Of a linear field that is the field at the corner, up to the distance of the corner from the side over it."""
    body, history = running(entry=ENTRY + 0.1 * (EXIT - ENTRY) / np.linalg.norm(EXIT - ENTRY))
    before = body.x.copy()
    found = hold_hollow_corners(body, [(body.tools[0], _entry())], history)["strain"]
    moved = np.flatnonzero((body.x != before).any(axis=1))
    vertex = moved[body.nodes.is_vertex[moved]]
    assert len(vertex) == 1 and body.x[vertex[0]] == pytest.approx(ENTRY, abs=1e-15)
    assert found[vertex[0]] == pytest.approx(3 + ENTRY @ [1.0, 2.0], abs=0.1 * np.sin(np.radians(35)) * np.sqrt(5))


def test_a_corner_that_was_not_filled_is_left_alone():
    body, history = running(entry=ENTRY + [0.1, -0.1])
    before = body.x.copy()
    assert hold_hollow_corners(body, [], history) is history
    assert np.array_equal(body.x, before)


def test_a_new_mesh_keeps_its_vertex_in_a_blunt_corner():
    """35 degrees are less than what a new mesh takes for a corner by itself."""
    nodes = billet()
    body = BodyArrays(nodes.x.copy(), nodes.cells.copy())
    corners = in_hollow_corners(body, [die()])
    assert corners == pytest.approx(ENTRY[None])
    labels = side_labels(body, [die()], {1: 0.0}, 1e-6)
    made = remesh(body, labels, lambda points: np.full(len(points), 0.37), corners=corners)
    vertices = made.x[np.unique(made.sides[:, :2])]
    assert np.linalg.norm(vertices - ENTRY, axis=1).min() < 1e-12


def test_a_hollow_corner_without_a_vertex_asks_for_none():
    nodes = billet()
    assert in_hollow_corners(BodyArrays(nodes.x, nodes.cells), [die(shift=0.5)]).shape == (0, 2)


def _entry():
    return int(np.argmin(np.linalg.norm(die().surface.corners() - ENTRY, axis=1)))
