"""A body that slides over a sharp corner of a tool gets a vertex of its boundary there, and nothing else changes."""

from types import SimpleNamespace

import numpy as np
import pytest

from fenics_forming.physics import meshing
from fenics_forming.physics.contact.polyline import Polyline
from fenics_forming.physics.contact.rigid import KnownTool, ToolMotion
from fenics_forming.physics.contact.surfaces import Plane
from fenics_forming.physics.kinematics import PLANE_STRAIN
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.remeshing import BodyArrays, remesh
from fenics_forming.process.meshes.renewing import side_labels
from fenics_forming.process.meshes.tool_corners import drawn_to_corners, feet, hold_corners, left_corner, protruding_corners
from fenics_forming.process.shifting import put_on_tools
from fenics_forming.process.volume import FreeSurface
from fenics_forming.scene.outline import nearest

CORNER = np.array([0.0, 1.0])


def size_of(h):
    return lambda points: np.full(len(points), h)


def die(shift=(0.0, 0.0)):
    """Container y = 2, die face x = 0, exit at (0, 1), and a relieved land behind it."""
    points = [(-9, 2), (0, 2), (0, 1), (9, 2)]
    return KnownTool("die", Polyline(points[::-1]), motion=ToolMotion(np.array(shift, float), np.zeros(2)))


def body(h=0.5, exit_at=(0.0, 1.0), above=1.5):
    """Half a billet in its container with a stub 2 mm long; ``exit_at``: the vertex that was at the corner of the die,
    ``above``: the height of the next one, on its face."""
    points = [(-4, 0), (2, 0), (2, exit_at[1]), exit_at, (0, above), (0, 2), (-4, 2)]
    nodes = Nodes(meshing.polygon(points, h))
    made = BodyArrays(nodes.x.copy(), nodes.cells.copy())
    put_on_tools(made.x, [die()], np.unique(made.sides), {}, 0.0)       # as every step leaves it
    return made


def area(body):
    a, b, m = (body.x[body.sides[:, k]] for k in range(3))
    cross = lambda p, q: p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]  # noqa: E731
    return ((4 * cross(a, m) + 4 * cross(m, b) - cross(a, b)) / 6).sum()


def vertices_at(body, place):
    return np.isclose(body.x[np.unique(body.sides[:, :2])], place, atol=1e-14).all(axis=1).sum()


def is_one_loop(body):
    starts, ends = np.sort(body.sides[:, 0]), np.sort(body.sides[:, 1])
    return np.array_equal(starts, np.unique(starts)) and np.array_equal(starts, ends)


def test_only_the_exit_of_a_die_protrudes_and_not_the_corner_of_its_container():
    assert protruding_corners(die()) == pytest.approx(CORNER[None])
    assert protruding_corners(die(shift=(3, 0))) == pytest.approx(CORNER[None] + [3, 0])


def test_a_plane_has_no_corner():
    plane = KnownTool("ram", Plane((0.0, 0.0), (1.0, 0.0)), motion=ToolMotion(np.zeros(2), np.zeros(2)))
    assert len(protruding_corners(plane)) == 0


def test_the_foot_on_a_parabola_is_its_nearest_point():
    p = np.array([[[0.0, 0.0], [2.0, 0.0], [1.0, 0.3]]])
    s, distance = feet(p, np.array([0.7, 1.0]))
    t = np.linspace(0, 1, 20001)
    curve = np.stack([2 * t, 4 * t * (1 - t) * 0.3], axis=1)
    away = np.linalg.norm(curve - [0.7, 1.0], axis=1)
    assert distance[0] == pytest.approx(away.min(), abs=1e-7)
    assert s[0] == pytest.approx(t[np.argmin(away)], abs=1e-4)


@pytest.mark.parametrize("exit_at", [(0.08, 0.98), (0.0, 0.95), (0.15, 0.9)])
def test_the_vertex_that_has_left_the_corner_comes_back_to_it(exit_at):
    """The triangles of the boundary at the corner change by no more than its way times a side."""
    old = body(exit_at=exit_at)
    new = drawn_to_corners(old, size_of(0.5), [die()], {1: 0.0})
    assert vertices_at(old, CORNER) == 0 and vertices_at(new, CORNER) == 1
    assert is_one_loop(new)
    assert abs(area(new) - area(old)) <= np.linalg.norm(np.subtract(exit_at, CORNER)) * 0.6
    assert left_corner(new.sides, new.x, [die()]) == {"die": 0.0}
    assert left_corner(old.sides, old.x, [die()])["die"] > 0.1


def test_a_long_side_over_the_corner_is_cut_there():
    """Sides of 1.2 mm, of which one goes from the die face over the corner."""
    old = body(h=1.2, exit_at=(0.3, 0.4))
    new = drawn_to_corners(old, size_of(0.6), [die()], {1: 0.0})
    assert vertices_at(new, CORNER) == 1
    assert is_one_loop(new)
    assert len(new.x) == len(old.x) + 3 and len(new.cells) == len(old.cells) + 1


def test_small_sides_at_the_corner_are_left_out():
    old = body(h=0.1, exit_at=(0.02, 0.99), above=1.1)
    new = drawn_to_corners(old, size_of(0.5), [die()], {1: 0.0})
    others = np.unique(new.sides[:, :2])
    others = others[~np.isclose(new.x[others], CORNER).all(axis=1)]
    assert np.linalg.norm(new.x[others] - CORNER, axis=1).min() >= 0.25
    assert is_one_loop(new) and vertices_at(new, CORNER) == 1


def test_a_new_mesh_has_its_vertex_on_the_corner_and_sides_on_the_die_up_to_there():
    old = body(exit_at=(0.1, 0.97))
    drawn = drawn_to_corners(old, size_of(0.3), [die()], {1: 0.0})
    made = remesh(drawn, side_labels(drawn, [die()], {1: 0.0}, 1e-6), size_of(0.3))
    assert vertices_at(made, CORNER) == 1
    face = made.sides[(np.abs(made.x[made.sides[:, 2], 0]) < 1e-12) & (made.x[made.sides[:, 2], 1] > 1)]
    assert made.x[face[:, :2], 1].min() == pytest.approx(1.0, abs=1e-14)
    assert np.allclose(made.x[face, 0], 0.0, atol=1e-12)


def test_a_body_that_does_not_reach_the_corner_stays_as_it_is():
    old = body()
    assert drawn_to_corners(old, size_of(0.5), [die(shift=(5.0, 0.0))], {1: 0.0}) is old
    assert left_corner(old.sides, old.x, [die(shift=(5.0, 0.0))]) == {"die": 0.0}


def running(exit_at):
    """As much of a body in a run as the corners ask for, with a history that is linear in the place."""
    nodes = Nodes(meshing.polygon([(-4, 0), (2, 0), (2, exit_at[1]), exit_at, (0, 1.5), (0, 2), (-4, 2)], 0.6))
    surface = FreeSurface.of_mesh(nodes, PLANE_STRAIN, {1: 0.0})
    body = SimpleNamespace(nodes=nodes, x=nodes.x, tools=[die()], skins=lambda: [(surface, nodes.cells)], size=6.0,
                           boundary=np.flatnonzero(surface.nodes))
    return body, {"strain": nodes.with_mids(3 + nodes.x @ [1.0, 2.0])}


def test_between_remeshings_the_vertex_is_drawn_back_and_finds_the_history_that_is_there():
    """Of a linear field that is the field at the corner, up to the distance of the corner from the side over it."""
    body, history = running(exit_at=(0.0, 0.9))
    before, given = body.x.copy(), history["strain"].copy()
    found = hold_corners(body, history)["strain"]
    moved = np.flatnonzero((body.x != before).any(axis=1))
    vertices = moved[body.nodes.is_vertex[moved]]
    assert len(vertices) == 1 and body.x[vertices[0]] == pytest.approx(CORNER, abs=1e-15)
    assert found[vertices[0]] == pytest.approx(3 + CORNER @ [1.0, 2.0], abs=1e-12)
    others = body.nodes.is_vertex.copy()
    others[vertices] = False
    assert np.array_equal(found[others], given[others]) and np.array_equal(history["strain"], given)
    assert found == pytest.approx(body.nodes.with_mids(found.copy()), abs=1e-15)
    assert np.abs(body.x[moved] - before[moved]).max() <= 0.1 + 1e-12


def test_a_vertex_on_the_corner_stays_with_its_history():
    body, history = running(exit_at=tuple(CORNER))
    before = body.x.copy()
    assert hold_corners(body, history) is history
    assert np.array_equal(body.x, before)


def test_fillets_that_take_all_of_a_side_leave_a_distance():
    """Round by half of its width a stamp has a side of no length; its nearest point was divided by it."""
    outline = np.array([[0, 0], [2, 0], [2, 0], [2, 3]], float)
    with np.errstate(all="raise"):
        distance, left = nearest([[1, 1], [3, 1]], outline, closed=False)
    np.testing.assert_allclose(distance, [1, 1])
    assert left.tolist() == [True, False]
