"""How far tools and body reach into one another between the nodes: exact depths at constructed places."""

import numpy as np
import pytest

from fenics_forming import kinematics, meshing
from fenics_forming.physics.contact.polyline import solid_polygon
from fenics_forming.physics.contact.rigid import KnownTool, ToolMotion
from fenics_forming.physics.contact.surfaces import Circle, Plane, Sphere
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.surface import Surface
from fenics_forming.process.penetration import corner_undercut, side_penetration


def body(dim, divisions=4):
    """A 4 x 2 rectangle, or a 4 x 2 x 2 box: sides of 1 mm length on the top in the plane."""
    if dim == 2:
        nodes = Nodes(meshing.rectangle((0, 0), (4, 2), (divisions, 2)))
    else:
        nodes = Nodes(meshing.box((0, 0, 0), (4, 2, 2), (divisions, 2, 2)))
    return nodes, Surface.of(nodes, kinematics.PLANE_STRAIN if dim == 2 else kinematics.THREE_DIMENSIONAL)


def tool(surface, displacement=None, angle=0.0, centre=None):
    shift = np.zeros(surface.dimension) if displacement is None else np.asarray(displacement, float)
    return KnownTool("tool", surface, motion=ToolMotion(shift, 0 * shift, angle, centre=centre))


@pytest.mark.parametrize("dim", [2, 3])
def test_side_that_lies_on_a_tool_does_not_sink_into_it(dim):
    nodes, surface = body(dim)
    up = np.eye(dim)[-1]
    found = side_penetration(surface, nodes.x, [tool(Plane(tuple(2 * up), tuple(-up)))])["tool"]
    assert found.worst < 1e-15 and len(found.depth) == len(surface.sides)


def test_straight_side_over_a_round_tool_sinks_by_the_height_of_its_arc():
    """A punch of radius R pressed in, the vertices of the top on it and the mid-nodes half-way between them: a side of
    chord c sinks in by R - sqrt(R² - c²/4), and most in its middle."""
    nodes, surface = body(2)
    top, radius, centre = np.isclose(nodes.x[:, 1], 2), 5.0, np.array([2.0, 7.0])
    nodes.x[top, 1] = 7 - np.sqrt(radius**2 - (nodes.x[top, 0] - 2) ** 2)
    nodes.with_mids(nodes.x)
    ends = nodes.x[surface.sides[:, :2]]
    chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    bent = np.isclose(np.linalg.norm(ends - centre, axis=2), radius).all(axis=1)
    assert bent.sum() == 4
    found = side_penetration(surface, nodes.x, [tool(Circle(tuple(centre), radius))])["tool"]
    assert found.depth[bent] == pytest.approx(radius - np.sqrt(radius**2 - chord[bent] ** 2 / 4), rel=1e-12)
    assert found.depth[~bent] == pytest.approx(0, abs=1e-15)
    assert found.worst == pytest.approx((found.depth / chord).max(), rel=1e-12)


def test_side_sizes_are_lengths_and_those_of_equal_triangles():
    nodes, surface = body(2)
    assert surface.lengths(nodes.x) == pytest.approx(np.ones(12), rel=1e-14)
    nodes, surface = body(3)
    assert surface.lengths(nodes.x) == pytest.approx(np.sqrt(0.5 * 4 / np.sqrt(3)) * np.ones(len(surface.sides)))


@pytest.mark.parametrize("x", [1.5, 1.3, 2.0])
def test_sharp_corner_of_a_punch_is_as_deep_as_it_went(x):
    """A wedge sinks with its tip between, or on, the nodes of the top."""
    nodes, surface = body(2)
    wedge = solid_polygon([(x, 1.93), (x + 1, 4), (x - 1, 4)])
    found = corner_undercut(surface, nodes.x, [tool(wedge)])["tool"]
    assert sorted(found.depth) == pytest.approx([0, 0, 0.07], abs=1e-13)
    assert found.worst == pytest.approx(0.07)      # sides of 1 mm
    assert found.at[np.argmax(found.depth)] == pytest.approx((x, 1.93))


def test_corners_go_along_with_the_tool_and_turn():
    """The same wedge, described upside down at another place, turned by half a turn and moved back."""
    nodes, surface = body(2)
    wedge = solid_polygon([(11.5, 6.07), (12.5, 4), (10.5, 4)])
    moved = tool(wedge, displacement=(-10, -2), angle=np.pi, centre=np.array([11.5, 5.0]))
    found = corner_undercut(surface, nodes.x, [moved])["tool"]
    assert found.at[np.argmax(found.depth)] == pytest.approx((1.5, 1.93))
    assert found.depth.max() == pytest.approx(0.07, rel=1e-12)
    back = moved.motion.to_tool(moved.motion.to_space(wedge.points))
    assert back == pytest.approx(wedge.points, abs=1e-13)


def test_corner_under_a_curved_side_is_measured_from_the_curve():
    """The middle of a side pulled up by 0.2: a corner at the height of its chord is 0.2 below the curve."""
    nodes, surface = body(2)
    mid = np.flatnonzero(np.all(np.isclose(nodes.x, (1.5, 2)), axis=1))
    nodes.x[mid, 1] = 2.2
    wedge = solid_polygon([(1.5, 2.0), (2.5, 4), (0.5, 4)])
    found = corner_undercut(surface, nodes.x, [tool(wedge)])["tool"]
    assert found.depth.max() == pytest.approx(0.2, rel=1e-12)


def test_corner_outside_is_no_undercut_past_a_corner_of_the_body_either():
    """Nearest to a vertex between two sides, out of which only their mean normal tells in from out."""
    nodes, surface = body(2)
    wedge = solid_polygon([(4.1, 2.1), (6, 3), (5, 5)])
    found = corner_undercut(surface, nodes.x, [tool(wedge)])["tool"]
    assert (found.depth == 0).all() and found.worst == 0


def test_smooth_tools_have_no_corners():
    nodes, surface = body(3)
    found = corner_undercut(surface, nodes.x, [tool(Sphere((2, 1, 4), 2.1))])["tool"]
    assert found.depth.shape == (0,) and found.worst == 0
