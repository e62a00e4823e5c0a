"""A plane body meshed anew: the same boundary, the same labels, the wanted sizes, good cells, the same mesh twice."""

import ast
from pathlib import Path

import numpy as np
import pytest

import fenics_forming
from fenics_forming.errors import MeshError
from fenics_forming.physics import meshing
from fenics_forming.physics.nodes import Nodes
from fenics_forming.physics.remeshing import BodyArrays, Remeshed, filling, mmg, plane, remesh
from fenics_forming.physics.remeshing.corner_cells import turned
from fenics_forming.physics.remeshing.curve import Curve
from fenics_forming.physics.remeshing.outline import Chain
from fenics_forming.physics.remeshing.quality import Quality, neighbour_ratio, scaled_jacobian

ENGINES = [pytest.param("mmg", marks=pytest.mark.skipif(not mmg.installed(), reason="mmgpy is not installed")), "gmsh"]
engines = pytest.mark.parametrize("engine", ENGINES)


def size_of(h):
    return lambda points: np.full(len(points), h)


# ---------------------------------------------------------------------- bodies
def rectangle(divisions):
    """2 x 1 with mirror planes x = 0 and y = 0 and a tool on y = 1."""
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), divisions))
    body = BodyArrays(nodes.x.copy(), nodes.cells.copy())
    return body, where(body)


def where(body):
    x, y = body.x[body.sides[:, 2]].T
    return np.select([abs(x) < 1e-12, abs(y) < 1e-12, abs(y - 1) < 1e-12], [-1, -2, 1], 0)


def outlined(*loops, h):
    """Straight-sided loops, meshed by gmsh."""
    def build(gmsh):
        curves = []
        for loop in loops:
            tags = [gmsh.model.geo.addPoint(x, y, 0.0, h) for x, y in loop]
            curves.append(gmsh.model.geo.addCurveLoop([gmsh.model.geo.addLine(a, b)
                                                       for a, b in zip(tags, tags[1:] + tags[:1], strict=True)]))
        gmsh.model.geo.addPlaneSurface(curves)
        gmsh.model.geo.synchronize()

    nodes = Nodes(meshing.generate(build, 2, h))
    return BodyArrays(nodes.x.copy(), nodes.cells.copy())


def circle(radius, count, centre=(0.0, 0.0)):
    angle = 2 * np.pi * np.arange(count) / count
    return [(centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a)) for a in angle]


def ring(count):
    """Radii 1 and 2, mid-nodes of the boundary on the circles; no feature anywhere."""
    body = outlined(circle(2, 2 * count), circle(1, count), h=2 * np.pi / count)
    x, middle = body.x.copy(), body.sides[:, 2]
    radius = np.linalg.norm(x[middle], axis=1)
    x[middle] *= (np.round(radius) / radius)[:, None]
    return BodyArrays(x, body.cells), np.zeros(len(middle), int)


def barrel(divisions):
    """A cylinder R = 1, H = 2 upset by 60 % in the isochoric field of a barrel (notes/remeshing.md), its side folded.

    v_z = -(z + b h / 2π sin(2π z / h)) / h, v_r = -r/2 dv_z/dz, b = 0.5, by 200 steps of the classical Runge-Kutta
    scheme: exact to rounding for the purposes here. Tools 1 above and 2 below, axis -1.
    """
    nodes = Nodes(meshing.rectangle((0, 0), (1, 2), (divisions, 2 * divisions)))
    body = BodyArrays(nodes.x.copy(), nodes.cells.copy())
    r, z = body.x[body.sides[:, 2]].T
    labels = np.select([abs(r) < 1e-12, abs(z - 2) < 1e-12, abs(z) < 1e-12], [-1, 1, 2], 0)

    def velocity(x, h):
        phase = 2 * np.pi * x[:, 1] / h
        return np.stack([x[:, 0] * (1 + 0.5 * np.cos(phase)) / (2 * h),
                         -(x[:, 1] + 0.5 * h / (2 * np.pi) * np.sin(phase)) / h], axis=1)

    x, h, dt = body.x, 2.0, 1.2 / 200
    for _ in range(200):
        a = velocity(x, h)
        b = velocity(x + dt / 2 * a, h - dt / 2)
        c = velocity(x + dt / 2 * b, h - dt / 2)
        d = velocity(x + dt * c, h - dt)
        x, h = x + dt / 6 * (a + 2 * b + 2 * c + d), h - dt
    return BodyArrays(x, body.cells), labels


# ---------------------------------------------------------------------- integrals over the boundary
def boundary_integral(body, of):
    """∮ f dy over the parabolas of the sides; exact for polynomials of degree 4 in the coordinates."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    a, b, m = (body.x[body.sides[:, k]] for k in range(3))
    total = 0.0
    for t, w in zip((nodes + 1) / 2, weights / 2, strict=True):
        p = (1 - t) * (1 - 2 * t) * a + t * (2 * t - 1) * b + 4 * t * (1 - t) * m
        slope = (4 * t - 3) * a + (4 * t - 1) * b + (4 - 8 * t) * m
        total += w * (of(p) * slope[:, 1]).sum()
    return float(total)


def area(body):
    return boundary_integral(body, lambda p: p[:, 0])


def volume(body):
    """Of the body of revolution."""
    return boundary_integral(body, lambda p: np.pi * p[:, 0] ** 2)


# ---------------------------------------------------------------------- the boundary stays
@engines
def test_rectangle_keeps_its_sides_labels_and_mirror_planes(engine):
    body, labels = rectangle((20, 10))
    new = remesh(body, labels, size_of(0.1), engine=engine)
    assert area(new) == pytest.approx(2.0, rel=1e-14)
    assert np.array_equal(new.labels, where(new)) and len(new.sides) == 60, "two labels on no side"
    for axis in range(2):
        assert (new.x[new.sides[new.labels == -1 - axis], axis] == 0.0).all(), "not only to rounding"
    assert abs(new.x[new.sides[new.labels == 1], 1] - 1.0).max() < 1e-15, "straight runs stay straight"
    assert new.engine == engine


@engines
def test_upset_barrel_keeps_its_volume_through_twenty_remeshings(engine):
    body, labels = barrel(12)
    assert volume(body) == pytest.approx(2 * np.pi, rel=1e-6)
    h = 0.07
    for k in range(20):
        body = remesh(body, labels, size_of(h * (1 if k % 2 else 0.93)), engine=engine)
        labels = body.labels
        if k == 0:
            # the spline's error is of fourth order; straight sides lose 6e-4 (notes/remeshing.md 1)
            assert volume(body) == pytest.approx(2 * np.pi, rel=1e-5)
        quality = Quality.of(body.x, body.cells)
        # the fold leaves a corner of 60°, whose triangle has to be cut: near 0.43
        assert quality.smallest > 0.4 and quality.mean > 0.93 and scaled_jacobian(body.x, body.cells).min() > 0.5
    assert volume(body) == pytest.approx(2 * np.pi, rel=3e-5), "no run-away"
    assert set(labels) == {-1, 0, 1, 2}
    assert np.ptp(body.x[body.sides[labels == 1], 1]) < 1e-15 and (body.x[body.sides[labels == -1], 0] == 0.0).all()


def test_area_of_a_remeshed_ring_is_of_fourth_order_in_the_size():
    errors = []
    for count in (12, 24, 48):
        body, labels = ring(count)
        new = remesh(body, labels, size_of(0.87 * 2 * np.pi / count), engine="gmsh")
        errors.append(abs(area(new) / (3 * np.pi) - 1))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 3.3).all(), (errors, orders)      # numbers of sides are whole: the ratio of sizes is not quite 2


def test_noise_of_the_boundary_does_not_grow():
    """A zigzag of the mid-nodes, the roughest that the mesh carries, and 15 remeshings."""
    body, labels = ring(30)
    x, shift = body.x.copy(), np.random.default_rng(1).uniform(0.997, 1.003, len(body.sides))
    x[body.sides[:, 2]] *= shift[:, None]
    body = BodyArrays(x, body.cells)

    def roughness(body):
        radius = np.linalg.norm(body.x[np.unique(body.sides)], axis=1)
        return np.std(radius / np.round(radius))

    before = roughness(body)
    for k in range(15):
        body = remesh(body, labels, size_of(0.2 * (1 if k % 2 else 0.93)), engine="gmsh")
        labels = body.labels
    assert roughness(body) < before


@engines
def test_corners_and_ends_of_contact_stay_to_the_bit(engine):
    corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    body = outlined(corners, h=0.2)
    x, y = body.x[body.sides[:, 2]].T
    vertex = np.unique(body.x[body.sides[:, :2][(abs(x - 2) < 1e-12)].ravel()], axis=0)
    contact = (abs(x - 2) < 1e-12) & (y < vertex[len(vertex) // 2, 1])
    new = remesh(body, contact.astype(int), size_of(0.13), engine=engine)
    kept = {tuple(p) for p in new.x}
    for corner in corners:
        assert tuple(body.x[np.linalg.norm(body.x - corner, axis=1).argmin()]) in kept
    assert tuple(vertex[len(vertex) // 2]) in kept, "where the tool ends"
    length = np.linalg.norm(np.diff(new.x[new.sides[:, :2]], axis=1)[:, 0], axis=1)
    assert length[new.labels == 1].sum() == pytest.approx(vertex[len(vertex) // 2, 1], rel=1e-13)
    assert area(new) == pytest.approx(3.0, rel=1e-14)


@engines
def test_holes_stay_holes(engine):
    body = outlined([(0, 0), (4, 0), (4, 2), (0, 2)], circle(0.5, 24, (1, 1)), circle(0.3, 16, (3, 1)), h=0.2)
    new = remesh(body, np.zeros(len(body.sides), int), size_of(0.2), engine=engine)
    for centre, radius in (((1, 1), 0.5), ((3, 1), 0.3)):
        assert np.linalg.norm(new.x - centre, axis=1).min() > 0.97 * radius
    # the spline rounds the corners of the polygons that the holes were
    assert area(new) == pytest.approx(area(body), rel=1e-3)
    assert Quality.of(new.x, new.cells).smallest > 0.4
    assert np.array_equal(np.unique(new.cells), np.arange(len(new.x))), "no node without a cell"


@engines
def test_free_surface_that_all_but_touches_itself_is_kept_apart(engine):
    """A slit 0.02 wide, sides of 0.1: the round end has the radius 0.01."""
    w = 0.02
    end = [(1 + w / 2 * np.cos(t), 0.5 + w / 2 * np.sin(t)) for t in -np.pi * np.arange(13) / 12]
    body = outlined([(0, 0), (2, 0), (2, 1), (1 + w / 2, 1), *end, (1 - w / 2, 1), (0, 1)], h=0.1)
    new = remesh(body, np.zeros(len(body.sides), int), size_of(0.1), engine=engine)
    assert area(new) == pytest.approx(area(body), rel=1e-4)
    assert scaled_jacobian(new.x, new.cells).min() > 0.2 and Quality.of(new.x, new.cells).smallest > 0.4


# ---------------------------------------------------------------------- sizes
@engines
def test_count_of_cells_follows_the_size(engine):
    body, labels = rectangle((20, 10))
    for h in (0.1, 0.05):
        new = remesh(body, labels, size_of(h), engine=engine)
        assert len(new.cells) == pytest.approx(2.0 / (np.sqrt(3) / 4 * h**2), rel=0.1)   # equilateral triangles


@engines
def test_sizes_that_differ_thirty_times_are_met(engine):
    """Small about an inner point that no old node marks, growing by 0.2 per distance."""
    body, labels = rectangle((20, 10))

    def sizes(points):
        return np.minimum(0.3, 0.01 + 0.2 * np.linalg.norm(points - (0.71, 0.43), axis=1))

    new = remesh(body, labels, sizes, engine=engine)
    p = new.x[new.cells[:, :3]]
    cell_area = 0.5 * np.linalg.det(p[:, 1:] - p[:, :1])
    met = np.sqrt(4 / np.sqrt(3) * cell_area) / sizes(p.mean(axis=1))
    # an engine takes edges between 1/√2 and √2 of the wanted one as right
    assert 0.8 < np.median(met) < 1.2 and met.min() > 0.4 and met.max() < 2.0
    quality = Quality.of(new.x, new.cells)
    assert quality.smallest > 0.4 and quality.mean > 0.92 and neighbour_ratio(new.x, new.cells) < 2.0


@engines
def test_sizes_that_jump_are_graded(engine):
    body, labels = rectangle((20, 10))
    new = remesh(body, labels, lambda p: np.where((abs(p - (0.7, 0.3)) < 0.1).all(axis=1), 0.01, 0.3), engine=engine)
    assert Quality.of(new.x, new.cells).smallest > 0.35 and neighbour_ratio(new.x, new.cells) < 2.5


@engines
@pytest.mark.parametrize("h", [0.05, 0.3])
def test_thin_flash_gets_cells_that_fit_its_thickness(engine, h):
    """0.1 thick: with h = 0.05 two cells across as asked, with h = 0.3 cells of its thickness rather than flat ones."""
    body = outlined([(0, 0), (3, 0), (3, 0.1), (1, 0.1), (1, 1), (0, 1)], h=0.05)
    new = remesh(body, np.zeros(len(body.sides), int), size_of(h), engine=engine)
    assert area(new) == pytest.approx(1.2, rel=1e-13)
    assert Quality.of(new.x, new.cells).smallest > 0.4
    flash = new.x[new.cells[:, :3]].mean(axis=1)[:, 0] > 1.2
    equilateral = 0.18 / (np.sqrt(3) / 4 * min(h, 0.1) ** 2)
    # one row of cells between two walls: mmg puts a vertex here and there between them
    assert 0.8 * equilateral < flash.sum() < 1.8 * equilateral


@pytest.mark.parametrize("chord", [0.01, 0.001])
def test_straight_sides_stay_within_the_chord_distance(chord):
    body, labels = ring(30)
    new = remesh(body, labels, size_of(1.0), chord=chord, engine="gmsh")
    a, b, m = (new.x[new.sides[:, k]] for k in range(3))
    sagitta = np.linalg.norm(m - 0.5 * (a + b), axis=1)
    # δ = h²/8R; whole numbers of sides and the spread of the curvature over a side: some per cent
    assert 0.6 * chord < sagitta.max() < 1.1 * chord


# ---------------------------------------------------------------------- cells
@engines
@pytest.mark.parametrize("h", [0.1, 0.3, 1.0])
def test_cells_behind_strongly_curved_sides_do_not_fold_over(engine, h):
    nodes = Nodes(meshing.rectangle((0, 0), (2, 1), (20, 10)))
    x = nodes.x.copy()
    x[:, 1] += 0.2 * np.sin(6 * x[:, 0]) * x[:, 1] ** 2
    body = BodyArrays(x, nodes.cells.copy())
    new = remesh(body, np.zeros(len(body.sides), int), size_of(h), engine=engine)
    assert scaled_jacobian(new.x, new.cells).min() > 0.25
    assert area(new) == pytest.approx(area(body), rel=1e-3)


def test_side_that_folds_its_cell_over_in_every_attempt_is_straight():
    x = np.array([[0.0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0.4]])      # the middle of the first side sags
    made = Remeshed(x=x, cells=np.arange(6)[None], labels=np.zeros(3, np.int64), engine="mmg")
    assert scaled_jacobian(made.x, made.cells).min() < 0
    straight = plane._straightened(made)
    assert scaled_jacobian(straight.x, straight.cells).min() == pytest.approx(1.0)
    assert (straight.x[:5] == x[:5]).all() and (straight.sides == made.sides).all()


@engines
def test_no_cell_has_two_sides_on_the_boundary(engine):
    body, labels = rectangle((8, 4))
    new = remesh(body, labels, size_of(0.25), engine=engine)
    on_boundary = np.isin(new.cells[:, 3:], new.sides[:, 2]).sum(axis=1)
    assert on_boundary.max() == 1
    # the triangle of a right corner, cut at its centre, would leave a ratio of 0.2
    assert Quality.of(new.x, new.cells).smallest > 0.4


def test_diagonal_behind_a_right_corner_is_turned_and_behind_a_sharp_one_is_not():
    sides = np.array([[0, 1], [3, 0]])      # 0 is the corner, 1 and 3 its neighbours, 2 lies opposite
    cells = np.array([[0, 1, 3], [1, 2, 3]])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    assert {frozenset(c) for c in turned(square, cells, sides).tolist()} == {frozenset({0, 1, 2}), frozenset({0, 2, 3})}
    dart = np.array([[0, 0], [1, -1], [0.2, 0], [1, 1]], float)     # the other diagonal would leave the body
    assert np.array_equal(turned(dart, np.array([[0, 1, 3], [1, 3, 2]])[:, [0, 1, 2]], sides)[0], cells[0])


# ---------------------------------------------------------------------- sameness, rescue, refusal
@engines
def test_same_body_gives_the_same_mesh_to_the_bit(engine):
    body, labels = barrel(8)
    first, second = (remesh(BodyArrays(body.x.copy(), body.cells.copy()), labels.copy(),
                            lambda p: 0.05 + 0.1 * p[:, 0], engine=engine) for _ in range(2))
    for name in ("x", "cells", "sides", "labels"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name


@engines
def test_rounding_of_the_body_or_of_the_sizes_changes_no_cell(engine):
    """A rectangle of equal squares leaves an engine many choices that only the last digit decides."""
    body, labels = rectangle((8, 4))
    noise = 1e-14 * np.random.default_rng(3).uniform(-1, 1, body.x.shape)
    first = remesh(body, labels, size_of(0.3), engine=engine)
    second = remesh(BodyArrays(body.x + noise, body.cells), labels, size_of(0.3 * (1 + 1e-14)), engine=engine)
    assert np.array_equal(first.cells, second.cells)
    np.testing.assert_allclose(first.x, second.x, atol=1e-13)


def test_gmsh_comes_to_the_rescue_where_mmg_fails_or_is_not_installed(monkeypatch):
    body, labels = rectangle((8, 4))

    def fails(*_):
        raise RuntimeError("Remeshing failed in MMG2D_mmg2dmesh")

    monkeypatch.setattr(mmg, "installed", lambda: True)
    monkeypatch.setattr(mmg, "plane", fails)
    assert remesh(body, labels, size_of(0.2)).engine == "gmsh"
    with pytest.raises(MeshError, match="could not be meshed anew: mmg: Remeshing failed"):
        remesh(body, labels, size_of(0.2), engine="mmg")
    monkeypatch.setattr(mmg, "installed", lambda: False)
    assert remesh(body, labels, size_of(0.2)).engine == "gmsh"
    with pytest.raises(MeshError, match="mmgpy is not installed"):
        remesh(body, labels, size_of(0.2), engine="mmg")


def test_engine_that_leaves_a_part_empty_is_not_believed(monkeypatch):
    body, labels = rectangle((8, 4))
    honest = filling.gmsh_plane

    def cheats(*arguments):
        x, triangles, sides = honest(*arguments)
        return x, triangles[1:], sides

    monkeypatch.setattr(filling, "gmsh_plane", cheats)
    with pytest.raises(MeshError, match="do not fill the boundary"):
        remesh(body, labels, size_of(0.2), engine="gmsh")


def test_pinched_body_is_refused_in_one_sentence():
    """Two squares with one common corner."""
    square = Nodes(meshing.rectangle((0, 0), (1, 1), (2, 2)))
    n = len(square.x)
    far, near = square.x.sum(axis=1).argmax(), square.x.sum(axis=1).argmin()
    other = np.arange(n) + n
    other[near] = far
    body = BodyArrays(np.concatenate([square.x, square.x + 1]), np.concatenate([square.cells, other[square.cells]]))
    with pytest.raises(MeshError, match=r"^the body is pinched: .* touch at \(1, 1\) mm$"):
        remesh(body, np.zeros(len(body.sides), int), size_of(0.3))


@engines
def test_boundary_that_crosses_itself_is_refused_in_one_sentence(engine):
    """A band wound once and a bit around: an engine that got it would crash or never return."""
    nodes = Nodes(meshing.rectangle((0, 0), (4, 1), (40, 10)))
    angle, radius = 1.75 * nodes.x[:, 0], 1.2 - nodes.x[:, 1]
    body = BodyArrays(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), nodes.cells.copy())
    with pytest.raises(MeshError, match=r"^the body could not be meshed anew: its boundary crosses itself at \(.*\) mm$"):
        remesh(body, np.zeros(len(body.sides), int), size_of(0.1), engine=engine)


def test_collinear_sides_do_not_cross_and_touching_ones_do():
    points = np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [0, 1]], float)
    number = np.arange(6)
    sides = np.stack([number, np.roll(number, -1)], axis=1)
    assert not plane.crossing(points, sides).any()
    points[5] = (1.5, 0.0)      # on the side from 1 to 2
    assert plane.crossing(points, sides)[1]


# ---------------------------------------------------------------------- absent, not zero
def test_mmg_has_one_door_and_it_opens_late():
    package = Path(fenics_forming.__file__).parent
    for path in package.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names if "mmgpy" in a.name}
        assert not names or path.relative_to(package).as_posix() == "physics/remeshing/mmg.py"
        assert not any(isinstance(n, ast.Import) and n.names[0].name == "mmgpy" for n in tree.body)


@pytest.mark.parametrize("count", [9.5, 4.5])
def test_round_off_does_not_decide_how_many_sides_a_run_gets(count):
    """Round lengths ask for n + 1/2 sides: a cup got 9 or 10 on its rim, and another mesh, by the number of ranks."""
    points = np.stack([np.linspace(0, count, 7), np.zeros(7)], axis=1)
    curve = Curve(Chain(points, np.arange(7), 0, False))
    sides = {len(curve.divide(np.full(len(curve.s), 1.0 + error), 1)) - 1 for error in (-1e-12, 0.0, 1e-12)}
    assert sides == {int(count + 0.5)}
