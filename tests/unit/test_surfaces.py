"""Laws of the closest point on a tool surface."""

import os
import subprocess
import sys

import numpy as np
import pytest

from fenics_forming.errors import SceneError
from fenics_forming.physics.contact.polyline import Polyline, solid_polygon
from fenics_forming.physics.contact.surfaces import Circle, Cylinder, Plane, Sphere
from fenics_forming.physics.contact.triangulated import Triangulated, read_stl

ROUND_OFF = 1e-14       # coordinates are of order one


def points(n, dimension, reach=2.0, seed=0):
    return np.random.default_rng(seed).uniform(-reach, reach, (n, dimension))


def prism(outline, height=2.0):
    """Convex prism over a counter-clockwise polygon."""
    n, first = len(outline), np.arange(len(outline))
    last, fan = np.roll(first, -1), np.arange(1, n - 1)
    vertices = np.concatenate([np.c_[outline, np.full(n, z)] for z in (-height / 2, height / 2)])
    return vertices, np.concatenate([
        np.c_[first, last, last + n], np.c_[first, last + n, first + n],
        np.c_[0 * fan, fan + 1, fan], n + np.c_[0 * fan, fan, fan + 1]])


def cube():
    return Triangulated(*prism([[-1, -1], [1, -1], [1, 1], [-1, 1]]))


def faceted_sphere(n):
    """Unit sphere in n x 2n cells of latitude and longitude."""
    tilt, turn = np.linspace(0, np.pi, n + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * n + 1)
    x, y, z = np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt) + 0 * turn
    first = (np.arange(n)[:, None] * (2 * n + 1) + np.arange(2 * n)).ravel()
    below = first + 2 * n + 1
    triangles = np.r_[np.c_[first, below, below + 1], np.c_[first, below + 1, first + 1]]
    return np.c_[x.ravel(), y.ravel(), z.ravel()], triangles


def gap_to_box(x, half):
    """Exact signed distance to the box |x_k| < half_k."""
    q = np.abs(x) - half
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(1), 0)


def winding_number(x, corners):
    """Solid angle of the triangles over 4 pi: 1 inside, 0 outside (van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(corners[None] - x[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(r, axis=2) for r in (a, b, c))
    dot = [np.einsum("nmk,nmk->nm", *pair) for pair in ((a, b), (b, c), (c, a))]
    volume = np.einsum("nmk,nmk->nm", a, np.cross(b, c))
    return np.arctan2(volume, la * lb * lc + dot[0] * lc + dot[1] * la + dot[2] * lb).sum(1) / (2 * np.pi)


STAR = [[1.5, 0.0], [0.5, 0.4], [0.0, 1.5], [-0.5, 0.3], [-1.5, 0.0], [-0.4, -0.4], [0.0, -1.5], [0.4, -0.5]]
WAVE = [[s, 0.2 * np.sin(7 * s)] for s in np.linspace(-2, 2, 400)]
ALL = {
    "line": Plane((0.1, 0.2), (1.0, 2.0)),
    "plane": Plane((0.1, 0.2, 0.3), (1.0, 2.0, -1.0)),
    "circle": Circle((0.1, 0.2), 1.2),
    "round hole": Circle((0.1, 0.2), 1.2, hollow=True),
    "sphere": Sphere((0.1, 0.2, 0.0), 1.2),
    "roll": Cylinder((0.1, 0.2, 0.0), (1.0, 2.0, -1.0), 0.8),
    "bore": Cylinder((0.1, 0.2, 0.0), (1.0, 2.0, -1.0), 1.8, hollow=True),
    "profile": Polyline([[-2.0, 0.5], [-0.5, 0.0], [0.0, -1.0], [0.3, 0.2], [2.0, 0.0]]),
    "filleted profile": Polyline([[-2.0, 0.5], [-0.5, 0.0], [0.0, -1.0], [0.8, 0.2], [2.0, 0.0]], fillet=0.2),
    "star": solid_polygon(STAR),
    "filleted star": solid_polygon(STAR, fillet=0.1),
    "wave": Polyline(WAVE),
    "cube": cube(),
    "faceted sphere": Triangulated(*faceted_sphere(12)),
}
every_surface = pytest.mark.parametrize("surface", ALL.values(), ids=ALL.keys())


@every_surface
def test_the_closest_point_lies_on_the_surface(surface):
    x = points(2000, surface.dimension)
    gap, normal = surface.closest(x)
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < ROUND_OFF
    again, _ = surface.closest(x - gap[:, None] * normal)
    assert np.abs(again).max() < ROUND_OFF


@every_surface
def test_no_points_have_no_gaps(surface):
    """A rank may own no contact facet."""
    gap, normal = surface.closest(np.empty((0, surface.dimension)))
    assert gap.shape == (0,) and normal.shape == (0, surface.dimension)


@every_surface
def test_no_point_moves_nearer_to_the_surface_than_it_was_moved(surface):
    """The distance is 1-Lipschitz: a wrong (too far) closest point breaks this somewhere."""
    x = points(2000, surface.dimension)
    step = 0.1 * points(2000, surface.dimension, 1.0, seed=1)
    change = np.abs(surface.closest(x + step)[0]) - np.abs(surface.closest(x)[0])
    assert (np.abs(change) <= np.linalg.norm(step, axis=1) + ROUND_OFF).all()


@every_surface
def test_the_outline_lies_on_the_surface_and_in_the_box(surface):
    low, high = np.full(surface.dimension, -0.9), np.full(surface.dimension, 1.6)
    vertices, cells = surface.outline(low, high)
    assert cells.shape[1] == surface.dimension and cells.max() < len(vertices)
    assert (vertices > low - ROUND_OFF).all() and (vertices < high + ROUND_OFF).all()
    # chords rise by 2e-4 of the diagonal (4.4), and quadrilaterals of a sphere in two directions
    assert np.abs(surface.closest(vertices[np.unique(cells)])[0]).max() < 4 * 2e-4 * 4.4
    box = surface.bounds()
    assert (vertices >= box[0] - ROUND_OFF).all() and (vertices <= box[1] + ROUND_OFF).all()


def test_drawn_triangles_look_out_of_the_tool():
    for name in ("plane", "sphere", "roll", "bore", "cube"):
        vertices, cells = ALL[name].outline([-0.9] * 3, [1.6] * 3)
        corners = vertices[cells]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("mk,mk->m", area, ALL[name].closest(corners.mean(1))[1]) > -ROUND_OFF).all(), name


@pytest.mark.parametrize("name", ["circle", "sphere", "roll", "convex polygon", "filleted polygon", "cube",
                                  "faceted sphere"])
def test_outside_a_convex_tool_the_gradient_of_the_gap_is_the_normal(name):
    """Outside a convex body the distance is continuously differentiable, past edges and corners too."""
    pentagon = [[0, 1], [-1, 0.3], [-0.6, -1], [0.6, -1], [1, 0.3]]
    fillet = {"convex polygon": 0.0, "filleted polygon": 0.3}.get(name)
    surface = ALL[name] if fillet is None else solid_polygon(pentagon, fillet=fillet)
    x = points(2000, surface.dimension)
    x = x[surface.closest(x)[0] > 0.05]
    h = 1e-5
    gradient = np.stack([(surface.closest(x + h * e)[0] - surface.closest(x - h * e)[0]) / (2 * h)
                         for e in np.eye(surface.dimension)], axis=1)
    # curvature 1/gap < 20 jumps where the closest feature changes: error up to 20 h
    assert np.abs(gradient - surface.closest(x)[1]).max() < 20 * h


def test_the_gap_does_not_see_rigid_motions():
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    c, s = np.cos(0.7), np.sin(0.7)
    plane_turn, shift = np.array([[c, -s], [s, c]]), np.array([3.0, -2.0, 1.0])
    wave, ball = np.array(WAVE), faceted_sphere(12)
    pairs = [
        (ALL["line"], lambda m: Plane(m((0.1, 0.2)), plane_turn @ [1.0, 2.0])),
        (ALL["circle"], lambda m: Circle(m((0.1, 0.2)), 1.2)),
        (ALL["filleted star"], lambda m: solid_polygon(m(STAR), fillet=0.1)),
        (ALL["wave"], lambda m: Polyline(m(wave))),
        (ALL["plane"], lambda m: Plane(m((0.1, 0.2, 0.3)), turn @ [1.0, 2.0, -1.0])),
        (ALL["roll"], lambda m: Cylinder(m((0.1, 0.2, 0.0)), turn @ [1.0, 2.0, -1.0], 0.8)),
        (ALL["faceted sphere"], lambda m: Triangulated(m(ball[0]), ball[1])),
    ]
    for surface, moved in pairs:
        rotation = plane_turn if surface.dimension == 2 else turn
        move = lambda x, r=rotation: np.asarray(x) @ r.T + shift[:len(r)]     # noqa: E731
        x = points(2000, surface.dimension)
        gap, normal = surface.closest(x)
        moved_gap, moved_normal = moved(move).closest(move(x))
        assert np.abs(moved_gap - gap).max() < 2 * ROUND_OFF, surface
        # where two closest points are equally near, round-off decides between their normals
        assert np.mean(np.abs(moved_normal - normal @ rotation.T).max(1) < 1e-9) > 0.99, surface


@pytest.mark.parametrize("solid, hollow", [
    (Circle((0.1, 0.2), 1.2), Circle((0.1, 0.2), 1.2, hollow=True)),
    (Sphere((0.1, 0.2, 0), 1.2), Sphere((0.1, 0.2, 0), 1.2, hollow=True)),
    (Cylinder((0, 0, 0), (1, 2, 0), 1.2), Cylinder((0, 0, 0), (1, 2, 0), 1.2, hollow=True)),
    (solid_polygon(STAR, fillet=0.1), Polyline(STAR, fillet=0.1, closed=True))])
def test_a_hollow_tool_is_minus_the_solid_one(solid, hollow):
    x = points(2000, solid.dimension)
    for a, b in zip(solid.closest(x), hollow.closest(x), strict=True):
        assert np.abs(a + b).max() < ROUND_OFF


def test_the_distance_to_a_cube_is_exact():
    x = np.concatenate([points(20000, 3), points(2000, 3, 1.0)])
    assert np.abs(cube().closest(x)[0] - gap_to_box(x, 1.0)).max() < ROUND_OFF


def test_the_distance_to_a_filleted_rectangle_is_exact():
    x, radius, half = points(20000, 2), 0.3, np.array([1.2, 0.8])
    surface = solid_polygon(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half, fillet=radius)
    assert np.abs(surface.closest(x)[0] - (gap_to_box(x, half - radius) - radius)).max() < ROUND_OFF


@pytest.mark.parametrize("down", [1, -1], ids=["concave", "convex"])
def test_a_fillet_is_the_arc_that_touches_both_sides(down):
    """V of 90 degrees with fillet R: its centre lies R sqrt(2) from the tip."""
    radius, a = 0.5, np.linspace(1.26, 1.74, 50) * np.pi
    surface = Polyline([[-2, 2 * down], [0, 0], [2, 2 * down]], fillet=radius)
    centre = np.array([0, down * radius * np.sqrt(2)])
    ray = np.stack([np.cos(a), down * np.sin(a)], axis=1)
    for r in (0.1, 0.5, 0.9):
        gap, normal = surface.closest(centre + r * ray)
        assert np.abs(gap - down * (radius - r)).max() < ROUND_OFF
        assert np.abs(normal + down * ray).max() < 10 * ROUND_OFF


@pytest.mark.parametrize("surface", [solid_polygon(STAR, fillet=0.1), Polyline(STAR[:5], fillet=0.1)],
                         ids=["closed", "open"])
def test_a_filleted_profile_has_a_continuous_tangent(surface):
    vertices, cells = surface.outline([-5, -5], [5, 5])
    walk = np.concatenate([np.linspace(*vertices[c], 40) for c in cells])
    normal, step = surface.closest(walk)[1], np.linalg.norm(np.diff(walk, axis=0), axis=1)
    # along an arc the normal turns by way / radius; the chords drawn are shorter by far less than 1 %
    assert (np.linalg.norm(np.diff(normal, axis=0), axis=1) <= 1.01 * step / 0.1 + 1e-12).all()


@pytest.mark.parametrize("angle", [5, 40, 140])
def test_past_the_edge_of_a_wedge_no_sign_is_wrong(angle):
    half = np.deg2rad(angle) / 2
    width = min(1, 1 / np.tan(half))
    wedge = width * np.array([[0, 0], [-1, np.tan(half)], [-1, -np.tan(half)]])
    x = np.concatenate([points(20000, 3), points(20000, 3, 0.05)])
    flat = np.max([x[:, :2] @ [np.sin(half), np.cos(half)], x[:, :2] @ [np.sin(half), -np.cos(half)],
                   -width - x[:, 0]], axis=0)
    assert ((solid_polygon(wedge).closest(x[:, :2])[0] > 0) == (flat > 0)).all()
    solid = np.maximum(flat, np.abs(x[:, 2]) - 1)
    assert ((Triangulated(*prism(wedge)).closest(x)[0] > 0) == (solid > 0)).all()


def test_the_sign_is_that_of_the_winding_number():
    """A star-shaped prism has concave and convex edges of less than 60 degrees."""
    n = len(STAR)
    first, last = np.arange(n), np.roll(np.arange(n), -1)
    low, high = np.c_[STAR, np.full(n, -1.0)], np.c_[STAR, np.full(n, 1.0)]
    vertices = np.r_[low, high, [[0, 0, -1], [0, 0, 1]]]
    middle = np.full(n, 2 * n)
    triangles = np.r_[np.c_[first, last, last + n], np.c_[first, last + n, first + n],
                      np.c_[last, first, middle], np.c_[first + n, last + n, middle + 1]]
    surface, x = Triangulated(vertices, triangles), points(20000, 3)
    inside = winding_number(x, surface.vertices[surface.triangles])
    assert np.abs(inside - np.round(inside)).max() < 1e-9
    assert ((surface.closest(x)[0] < 0) == (inside > 0.5)).all()


def test_the_facet_error_of_a_sphere_falls_with_the_square_of_the_facet():
    x = points(20000, 3, seed=1)
    x *= 1.01 / np.linalg.norm(x, axis=1)[:, None]
    error = [np.abs(Triangulated(*faceted_sphere(n)).closest(x)[0] - 0.01).max() for n in (16, 32, 64)]
    order = np.log2(np.divide(error[:-1], error[1:]))
    assert np.abs(order - 2).max() < 0.1, order
    # half the square of the circumradius of the largest (right-angled, legs pi/64) facet
    assert error[-1] < 1.02 * (np.pi / 64) ** 2 / 4


@pytest.mark.parametrize("fillet", [0.0, 0.01])
def test_a_profile_of_many_pieces_has_the_same_gap_by_tree_and_by_looking_at_all(fillet):
    surface, x = Polyline(WAVE, fillet=fillet), points(5000, 2)
    pieces = surface._pieces
    gap, normal = pieces.take(pieces.nearest(x)).gap(x)
    assert np.abs(surface.closest(x)[0] - gap).max() < ROUND_OFF
    # points equally near to two pieces may get either normal
    assert np.mean(np.abs(surface.closest(x)[1] - normal).max(1) < 1e-9) > 0.999


def test_slender_triangles_have_the_same_gap_by_tree_and_by_looking_at_all():
    """Aspect ratio up to 1e5; the oracle is the nearest of three segments and, over the face, the plane."""
    random = np.random.default_rng(0)
    corners = random.uniform(-1, 1, (500, 3, 3))
    corners[:, 2] = corners[:, 0] + random.uniform(0, 1, (500, 1)) * (corners[:, 1] - corners[:, 0]) \
        + 10 ** random.uniform(-5, -1, (500, 1)) * random.normal(size=(500, 3))
    x = points(2000, 3, 1.0)
    gap, _ = Triangulated(corners.reshape(-1, 3), np.arange(1500).reshape(-1, 3)).closest(x)

    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    nearest, over = np.full((2000, 500), np.inf), np.ones((2000, 500), bool)
    for k in range(3):
        a, edge = corners[:, k], corners[:, (k + 1) % 3] - corners[:, k]
        away = x[:, None] - a
        share = np.clip(np.einsum("nmk,mk->nm", away, edge) / np.einsum("mk,mk->m", edge, edge), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(away - share[..., None] * edge, axis=2))
        over &= np.einsum("nmk,mk->nm", away, np.cross(normal, edge)) > 0
    plane = np.abs(np.einsum("nmk,mk->nm", x[:, None] - corners[:, 0], normal))
    expected = np.where(over, plane, nearest).min(1)
    assert np.abs(np.abs(gap) - expected).max() < 100 * ROUND_OFF


def test_a_closed_surface_wound_inside_out_is_turned():
    vertices, triangles = faceted_sphere(12)
    gap, _ = Triangulated(vertices, triangles[:, ::-1]).closest([[0, 0, 0.0], [0, 0, 2.0]])
    assert gap[0] < 0 < gap[1]


def test_beyond_the_end_of_an_open_profile_the_end_point_is_closest():
    gap, normal = Polyline([[0, 0], [1, 0]]).closest([[4.0, 4.0], [4.0, -4.0], [0.5, 2.0]])
    assert np.allclose(gap, [5, -5, 2], atol=ROUND_OFF)
    assert np.allclose(normal, [[0.6, 0.8], [-0.6, 0.8], [0, 1]], atol=ROUND_OFF)


def test_what_slides_past_the_end_of_an_open_profile_is_free():
    """A land ends: metal that was pressed 1e-3 mm into it is out of it an element further on, at both ends."""
    land = Polyline([[0, 0], [1, 0]])
    gap, normal = land.closest([[1.5, -1e-3], [-0.5, -1e-3], [0.999, -1e-3]])
    assert np.allclose(gap, [0.5, 0.5, -1e-3], atol=1e-5) and np.allclose(normal[:2], [[1, 0], [-1, 0]], atol=3e-3)
    # a node of the axis lies on the end of a profile that begins there, to round-off either way
    gap, normal = land.closest([[-1e-16, -1e-6], [0, -1e-6], [0, 0]])
    assert np.allclose(gap, [-1e-6, -1e-6, 0], atol=1e-12) and np.allclose(normal, [[0, 1]] * 3, atol=1e-6)


def test_corners_are_the_sharp_vertices():
    assert len(solid_polygon(STAR).corners()) == len(STAR)
    assert Polyline([[0, 0], [1, 0], [2, 0.1], [2, 1]]).corners().tolist() == [[2, 0.1]]
    for name in ("filleted star", "wave", "cube", "roll", "plane", "circle"):
        assert ALL[name].corners().shape == (0, ALL[name].dimension)


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_an_stl_file_gives_the_surface_it_was_written_from(form, tmp_path):
    """Corners are written once per triangle, one of them 1e-10 off: the surface must still be closed."""
    vertices, triangles = prism([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = np.concatenate([vertices[triangles], vertices[[[0, 0, 1]]]])
    path = tmp_path / "cube.stl"
    if form == "binary":
        record = np.zeros(len(corners), [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
        record["c"] = corners
        head = b"solid in name only".ljust(80)
        path.write_bytes(head + np.uint32(len(corners)).tobytes() + record.tobytes())
    else:
        corners[0, 0] += 1e-10
        facet = "facet normal 0 0 0\nouter loop\n" + 3 * "vertex {} {} {}\n" + "endloop\nendfacet\n"
        facets = [facet.format(*corner.ravel().tolist()) for corner in corners]
        path.write_text("solid cube\n" + "".join(facets) + "endsolid cube\n")
    surface, x = read_stl(path, scale=25.4), 25.4 * points(2000, 3)
    assert repr(surface) == "Triangulated(12 triangles, 8 vertices, 50.8 x 50.8 x 50.8 mm, closed)"
    assert np.abs(surface.closest(x)[0] - gap_to_box(x, 25.4)).max() < 1e-8


def test_an_open_surface_says_so():
    vertices, triangles = prism([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    assert repr(Triangulated(vertices, triangles[:-1])).endswith("open: 3 free edges)")


@pytest.mark.parametrize("build, key", [
    (lambda: Plane((0, 0), (0, 0)), "normal"),
    (lambda: Plane((0, 0), (0, 0, 1)), "normal"),
    (lambda: Circle((0, 0), -1), "radius"),
    (lambda: Circle((0, 0, 0), 1), "centre"),
    (lambda: Polyline([[0, 0]]), "points"),
    (lambda: Polyline([[0, 0], [0, 0], [1, 0]]), "points"),
    (lambda: Polyline([[0, 0], [1, 0], [0.5, 0]]), "points"),
    (lambda: Polyline([[0, 0], [1, 0], [1, 1]], fillet=-1), "fillet"),
    (lambda: Polyline([[0, 0], [1, 0], [1, 1]], fillet=1.1), "at most 1 mm"),
    (lambda: Triangulated(np.zeros((3, 3)), [[0, 1, 2]]), "triangles"),
    (lambda: Triangulated(np.vstack([np.zeros(3), np.eye(3)]), [[0, 1, 2], [0, 1, 3]]), "opposite senses"),
])
def test_an_impossible_surface_is_refused_by_name(build, key):
    with pytest.raises(SceneError, match=key):
        build()


def run(code, **environment):
    return subprocess.run([sys.executable, "-c", code], env=os.environ | environment, text=True, check=True,
                          capture_output=True).stdout


def test_tools_that_need_no_search_do_not_load_the_compiler():
    assert run("""
import sys
from fenics_forming.physics.contact.surfaces import Circle
from fenics_forming.physics.contact.triangulated import Triangulated
from fenics_forming.physics.contact.polyline import solid_polygon
Circle((0, 0), 1.0).closest([[1, 1]]); solid_polygon([[0, 0], [1, 0], [1, 1]], fillet=0.1).closest([[1, 1]])
print("numba" in sys.modules, "dolfinx" in sys.modules)""").split() == ["False", "False"]
